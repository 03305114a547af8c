"""Tests of icons: theme colours, device pixel ratio, and completeness of the shipped set."""

from __future__ import annotations

import gc
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import QByteArray, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QImage, QPainter
from PySide6.QtSvg import QSvgRenderer

from app import resources
from app.blocks.model.program import Problem
from app.blocks.toolbox.catalogue import Catalogue
from app.core.projects.problems import ProblemLine
from app.ui.panels.build.problems import ProblemRow
from app.ui.theme import icons
from app.ui.theme import tokens as theme_tokens
from app.ui.theme.theme import Theme
from tests.blocks.samples import robot
from tests.ui.shell_parts import COMMANDS

pytest_plugins = ["tests.ui.shell_fixtures"]


def inks(image: QImage) -> set[str]:
    """Return the colours of all opaque pixels."""
    colours = set()
    for y in range(image.height()):
        for x in range(image.width()):
            pixel = image.pixelColor(x, y)
            if pixel.alpha() == 255:
                colours.add(pixel.name())
    return colours


def test_every_icon_of_the_theme_and_commands_is_shipped() -> None:
    tokens = theme_tokens.load()
    wanted = {*tokens.icons.values(), *tokens.block_icons.values()}
    wanted |= {status.icon for status in tokens.status.values() if status.icon != "dot"}
    wanted |= {row.icon for row in COMMANDS if row.icon is not None}
    assert wanted <= icons.names()


def test_licences_of_icons_and_fonts_are_shipped() -> None:
    assert "ISC License" in resources.path("icons", "LICENSE.txt").read_text("utf-8")
    for name in ("Inter", "JetBrainsMono", "MPLUS1p"):
        text = resources.path("fonts", f"LICENSE-{name}.txt").read_text("utf-8")
        assert "SIL Open Font License, Version 1.1" in text


def test_icon_has_the_colour_of_its_role_and_follows_the_theme(theme: Theme) -> None:
    icon = theme.icon("square", "accent")
    assert inks(icon.pixmap(QSize(48, 48), 1.0).toImage()) == {theme.colour("accent").name()}
    theme.set_mode("dark")
    assert inks(icon.pixmap(QSize(48, 48), 1.0).toImage()) == {theme.colour("accent").name()}


def test_disabled_icon_is_grey(theme: Theme) -> None:
    image = theme.icon("square", "accent").pixmap(QSize(48, 48), 1.0, QIcon.Mode.Disabled).toImage()
    assert inks(image) == {theme.colour("textDisabled").name()}


@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.0])
def test_icon_is_rendered_at_the_device_pixel_ratio(theme: Theme, ratio: float) -> None:
    pixmap = theme.icon("play").pixmap(QSize(20, 20), ratio)
    assert pixmap.width() == round(20 * ratio)
    assert pixmap.devicePixelRatio() == ratio


@pytest.mark.parametrize("name", ["plya", "", "../LICENSE", "a\tb", "<svg/>", "x" * 100_000])
def test_unknown_icon_is_logged_and_replaced_by_a_fallback(qapp, caplog, name: str) -> None:
    engine = icons.IconEngine(name, lambda _mode, _state: QColor("#102030"))
    assert inks(engine.scaledPixmap(QSize(24, 24), QIcon.Mode.Normal, QIcon.State.Off, 2.0).toImage())
    assert caplog.records[0].getMessage().startswith(f"unknown icon '{name[:80]}'")
    assert ("did you mean 'play'?" in caplog.text) == (name == "plya")


def test_every_icon_used_in_the_code_is_shipped() -> None:
    """Icon names are found by a regular expression over the source."""
    before = r'(?:paint_icon(?:_again)?\([^"\n]*|\bicon\(|icon=|Button\(theme, "[^"]*", )'
    given = re.compile(before + r'"([a-z0-9-]+)"')
    root = Path(icons.__file__).parents[2]
    named = {name for path in root.rglob("*.py") for name in given.findall(path.read_text("utf-8"))}
    assert len(named) > 50
    assert named - {"dot", "error", "behaviour"} <= icons.names()  # not icons: a disc, a colour, a layout


def test_every_icon_svg_paints_visible_pixels(qapp) -> None:
    blank = []
    for name in sorted(icons.names()):
        image = QImage(24, 24, QImage.Format.Format_ARGB32_Premultiplied)
        image.fill(Qt.GlobalColor.transparent)
        painter = QPainter(image)
        QSvgRenderer(QByteArray(icons._source(name).encode())).render(painter)
        painter.end()
        if not any(bytes(image.constBits())):
            blank.append(name)
    assert len(icons.names()) > 2000
    assert not blank


def test_problem_row_is_painted_for_every_block_type(qtbot, theme: Theme, caplog) -> None:
    for block in Catalogue([robot()]).blocks.values():
        problem = Problem("error", "a", block.style, "it", "Something is wrong with it.", icon=block.icon)
        row = ProblemRow(theme, ProblemLine(problem, ()), is_large=True)
        qtbot.addWidget(row)
        row.resize(400, 60)
        assert not row.grab().isNull(), block.type
    assert not caplog.records


def test_icon_is_painted_into_its_rectangle(qapp: object) -> None:
    image = QImage(40, 40, QImage.Format.Format_ARGB32)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    icons.paint_icon(painter, QRectF(20, 20, 16, 16), "square", QColor("#ff0000"), is_filled=True)
    painter.end()
    assert image.pixelColor(28, 28).name() == "#ff0000"
    assert image.pixelColor(10, 10).alpha() == 0


def test_copies_of_an_icon_outlive_the_original(theme: Theme) -> None:
    copies = []
    for _ in range(50):
        icon = QIcon(icons.IconEngine("play", lambda _mode, _state: QColor("#123456")))
        copies.append(QIcon(icon))
        del icon
    gc.collect()
    assert all(not copy.pixmap(QSize(16, 16), 1.0).isNull() for copy in copies)


def test_cached_icon_is_rendered_once_and_looks_like_a_directly_painted_icon(qapp) -> None:
    def painted(paint: Callable[[QPainter], None]) -> QImage:
        image = QImage(40, 40, QImage.Format.Format_RGB32)
        image.setDevicePixelRatio(2.0)
        image.fill(QColor("white"))
        painter = QPainter(image)
        paint(painter)
        painter.end()
        return image

    place, colour = QRectF(3, 3, 14, 14), QColor("#204080")
    direct = painted(lambda painter: icons.paint_icon(painter, place, "braces", colour))
    icons._cached_pixmap.cache_clear()
    again = [painted(lambda p: icons.paint_cached_icon(p, place, "braces", colour)) for _ in range(3)]
    assert icons._cached_pixmap.cache_info().misses == 1
    for image in again:
        far = max(
            abs(image.pixelColor(x, y).red() - direct.pixelColor(x, y).red())
            for x in range(40)
            for y in range(40)
        )
        assert far <= 2
    other = painted(lambda p: icons.paint_cached_icon(p, place, "braces", QColor("#802020")))
    assert other != again[0]
