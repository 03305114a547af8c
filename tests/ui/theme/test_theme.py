"""Tests of the theme: values from the design tokens and an immediate repaint when the mode changes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QColor, QFont, QFontDatabase, QFontInfo, QPalette
from PySide6.QtWidgets import QApplication, QLabel

from app.ui.theme import fonts
from app.ui.theme.theme import Theme, qt_colour
from app.ui.widgets import label
from tests.ui.theme.test_tokens import RAW, contrast

pytest_plugins = ["tests.ui.shell_fixtures"]
UI = Path(__file__).parents[3] / "app" / "ui"


class Hints(QObject):
    """Fake style hints with a settable colour scheme."""

    colorSchemeChanged = Signal()  # noqa: N815

    def __init__(self) -> None:
        super().__init__()
        self.scheme = Qt.ColorScheme.Light

    def colorScheme(self) -> Qt.ColorScheme:
        return self.scheme

    def become(self, scheme: Qt.ColorScheme) -> None:
        self.scheme = scheme
        self.colorSchemeChanged.emit()


def test_colour_roles_depend_on_the_theme_mode(theme: Theme) -> None:
    assert theme.colour("accent").name() == "#2f4fd0"
    theme.set_mode("dark")
    assert theme.colour("accent").name() == "#4c66e6"
    assert theme.is_dark


def test_unknown_colour_role_raises(theme: Theme) -> None:
    with pytest.raises(KeyError, match="sparkle"):
        theme.colour("sparkle")


def test_last_component_of_a_colour_token_is_alpha() -> None:
    assert qt_colour("#1C1B1966") == QColor(0x1C, 0x1B, 0x19, 0x66)


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_qt_palette_uses_the_design_tokens(qapp: QApplication, mode: str) -> None:
    theme = Theme("dark" if mode == "dark" else "light")
    palette = theme.palette()
    assert palette.color(QPalette.ColorRole.Window) == theme.colour("window")
    assert palette.color(QPalette.ColorRole.Highlight) == theme.colour("selected")
    assert palette.color(QPalette.ColorRole.PlaceholderText) == theme.colour("textTertiary")
    disabled = palette.color(QPalette.ColorGroup.Disabled, QPalette.ColorRole.Text)
    assert disabled == theme.colour("textDisabled")


def test_system_colour_scheme_is_followed_only_in_system_mode(qapp: QApplication) -> None:
    hints = Hints()
    theme = Theme("system", hints=hints)  # type: ignore[arg-type]
    told: list[bool] = []
    theme.changed.connect(lambda: told.append(theme.is_dark))
    assert not theme.is_dark
    hints.become(Qt.ColorScheme.Dark)
    assert theme.is_dark
    assert told == [True]
    theme.set_mode("light")
    hints.become(Qt.ColorScheme.Dark)
    assert not theme.is_dark


def test_mode_change_repaints_a_label_immediately(qtbot, theme: Theme) -> None:
    theme.apply()
    shown = label("words", role="accentText")
    qtbot.addWidget(shown)
    shown.show()
    before = shown.palette().color(QPalette.ColorRole.WindowText)
    theme.set_mode("dark")
    assert before == QColor("#2743B8")
    assert shown.palette().color(QPalette.ColorRole.WindowText) == theme.colour("accentText")


def test_text_size_grows_with_the_percentage(theme: Theme) -> None:
    assert theme.font("body").pixelSize() == 13
    theme.set_text_percent(200)
    assert theme.font("body").pixelSize() == 26
    theme.set_text_percent(900)
    assert theme.text_percent == 200


def test_labels_use_font_and_size_of_their_kind(qtbot, theme: Theme) -> None:
    theme.apply()
    made = {kind: label("Stop", kind) for kind in ("small", "heading", "code")}
    for shown in made.values():
        qtbot.addWidget(shown)
        shown.show()
    assert {kind: QFontInfo(shown.font()).pixelSize() for kind, shown in made.items()} == {
        "small": 12,
        "heading": 18,
        "code": 12,
    }
    assert QFontInfo(made["code"].font()).family() == "JetBrains Mono"
    assert QFontInfo(made["heading"].font()).family() == "Inter"


def test_bundled_fonts_load_in_all_four_weights(qapp: QApplication) -> None:
    assert fonts.load() == ()
    for family in ("Inter", "JetBrains Mono"):
        assert family in QFontDatabase.families()
        for weight in (400, 500, 600, 700):
            font = fonts.make_font([family], 14, weight)
            assert (QFontInfo(font).family(), QFontInfo(font).weight()) == (family, weight)


def test_digits_have_equal_width(qapp: QApplication, theme: Theme) -> None:
    font = theme.font("body")
    assert font.isFeatureSet(QFont.Tag("tnum"))
    shown = QLabel("1")
    shown.setFont(font)
    assert shown.fontMetrics().horizontalAdvance("1111") == shown.fontMetrics().horizontalAdvance("8888")


def test_reduced_motion_sets_animations_to_zero_and_keeps_toast_durations(theme: Theme) -> None:
    assert theme.duration("changedFade") == 800
    theme.is_motion_reduced = True
    assert theme.duration("changedFade") == 0
    assert theme.duration("toastShown") == 6000


def test_high_contrast_has_strong_edges_and_no_tints(theme: Theme) -> None:
    theme.is_high_contrast = True
    assert theme.colour("border") == theme.colour("controlBorder")
    assert theme.colour("okTint") == theme.colour("panel")


def test_block_editor_tokens_have_the_colours_of_the_theme_mode(theme: Theme) -> None:
    theme.set_mode("dark")
    tokens = theme.blockly_tokens()
    assert tokens["dark"] is True
    assert tokens["colour"]["workspace"] == "#16181C"
    assert tokens["block"]["events"]["tertiary"] == "#A9986B"


def test_style_sheet_has_no_object_names_and_no_unfilled_placeholders(theme: Theme) -> None:
    sheet = theme.style_sheet()
    assert "{" in sheet
    assert not re.search(r"[{}]{2}|\{[a-zA-Z]+\}", sheet)
    assert not re.search(r"#[a-z][A-Za-z_]+\s*\{", sheet)


def test_colours_are_defined_only_in_the_tokens() -> None:
    # Colours of a robot's drawing, lamps and detection boxes are independent of the theme.
    independent = ("robot_drawing", "pictures/boxes.py", "panels/robots/robots/controls/colour.py")
    written = [
        f"{path.relative_to(UI)}: {found}"
        for path in UI.rglob("*.py")
        for found in re.findall(r"[\"']#[0-9a-fA-F]{6}\b", path.read_text("utf-8"))
        if not path.relative_to(UI).as_posix().startswith(independent)
    ]
    assert written == []


def test_every_colour_pair_and_edge_is_visible_in_high_contrast(theme: Theme) -> None:
    pairs = RAW["contrast"]["pairs"]
    for mode in ("light", "dark"):
        theme.set_mode(mode)
        theme.set_contrast("on")
        for ink, ground, least in pairs:
            assert contrast(theme.hex(ink), theme.hex(ground)) >= least, (mode, ink, ground)
        for edge in ("border", "borderStrong", "controlBorder", "errorBorder", "warnBorder", "okBorder"):
            for ground in ("panel", "window"):
                assert contrast(theme.hex(edge), theme.hex(ground)) >= 3, (mode, edge, ground)
        page = theme.blockly_tokens()["colour"]
        assert page["border"] == theme.hex("controlBorder")
        theme.set_contrast("off")
        assert theme.hex("border") != theme.hex("controlBorder")


def test_contrast_and_motion_follow_the_system_only_in_system_mode() -> None:
    class Asked(QObject):
        contrastPreferenceChanged = Signal()  # noqa: N815  Qt's name
        wish = Qt.ContrastPreference.NoPreference

        def contrastPreference(self) -> Qt.ContrastPreference:
            return self.wish

    class WithContrast(Hints):
        def __init__(self) -> None:
            super().__init__()
            self.asked = Asked()

        def accessibility(self) -> Asked:
            return self.asked

    hints = WithContrast()
    theme = Theme("light", hints=hints)  # type: ignore[arg-type]
    theme.set_contrast("system")
    assert not theme.is_high_contrast
    hints.asked.wish = Qt.ContrastPreference.HighContrast
    hints.asked.contrastPreferenceChanged.emit()
    assert theme.is_high_contrast
    theme.set_contrast("off")
    hints.asked.contrastPreferenceChanged.emit()
    assert not theme.is_high_contrast
