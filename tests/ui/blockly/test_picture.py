"""Tests of exported images of all blocks, including those outside the viewport."""

from __future__ import annotations

import pytest
from PySide6.QtGui import QImage

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import number, robot, started, workspace
from tests.ui.blockly_person import TOKENS, WAIT_MS, Person, editor

pytestmark = pytest.mark.web


def wait_block(id: str) -> dict:
    return {"type": "control_wait", "id": id, "inputs": {"SECONDS": {"shadow": number(1)}}}


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


@pytest.fixture
def them(view, person) -> Person:
    state = workspace(
        started(wait_block("a")) | {"id": "start", "x": 60, "y": 60},
        wait_block("far") | {"x": 60, "y": 4000},
    )
    return person(state=state)


def taken(qtbot, view: BlocklyView, kind: str, white: bool = True) -> bytes:
    got: list[bytes] = []
    view.render_picture(kind, white, got.append)
    qtbot.waitUntil(lambda: bool(got), timeout=WAIT_MS)
    return got[0]


def test_exported_image_shows_all_blocks_at_double_scale_on_white(qtbot, view, them):
    them.wait_for("!!document.querySelector('.nepFar')")  # the distant block isn't rendered
    image = QImage.fromData(taken(qtbot, view, "png"))
    assert image.height() > 2 * 3940
    assert image.pixelColor(2, 2).getRgb() == (255, 255, 255, 255)
    orange = TOKENS["block"]["control"]["light"]["primary"].lower()
    column = [image.pixelColor(80, y).name() for y in range(image.height())]
    assert orange in column[:600]
    assert orange in column[-200:]


def test_exported_image_without_background_is_transparent_around_blocks(qtbot, view, them):
    image = QImage.fromData(taken(qtbot, view, "png", white=False))
    assert image.pixelColor(2, 2).alpha() == 0


def test_exported_image_is_the_same_in_dark_theme_and_theme_is_kept(qtbot, view, them):
    light = taken(qtbot, view, "svg")
    view.set_theme(TOKENS, is_dark=True)
    assert taken(qtbot, view, "svg") == light
    them.wait_for("getComputedStyle(document.documentElement).colorScheme", "dark")


def test_exported_svg_is_self_contained(qtbot, view, them):
    svg = taken(qtbot, view, "svg").decode()
    assert "@font-face" in svg
    assert "var(--" not in svg
    assert "foreignObject" not in svg
    assert "data:font/otf" in svg or "data:application" in svg


def test_exported_image_omits_the_selection_and_the_highlight_of_running_blocks(qtbot, view, them):
    before = taken(qtbot, view, "svg")
    them.click("[data-id=a] > .blocklyPath")
    them.wait_for("document.querySelector('.blocklySelected')?.dataset.id", "a")
    view.highlight(["a"])
    them.wait_for("!!document.querySelector('.nepState')")
    after = taken(qtbot, view, "svg")
    assert sorted(after.split(b"<")) == sorted(
        before.split(b"<")
    )  # the selected block is drawn above others: only the order differs


def test_empty_canvas_exports_no_image(qtbot, view, them):
    view.load(workspace())
    assert taken(qtbot, view, "png") == b""
