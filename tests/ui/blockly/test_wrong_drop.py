"""Tests of the message after an invalid drop, and of the snap distance."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint

from app.blocks.toolbox.definitions import editor_definitions
from tests.blocks.samples import number, robot
from tests.ui.blockly_person import START, WAIT_MS, Person, editor, workspace

pytestmark = pytest.mark.web

SAID = "document.querySelector('.nepWhy').textContent"
TURN = {
    "type": "robot_pepper_do_turn",
    "id": "turn",
    "x": 56,
    "y": 196,
    "inputs": {"ANGLE": {"shadow": number(90) | {"id": "angle"}}},
}
EVER = {"type": "control_forever", "id": "ever", "x": 56, "y": 392}
FACE = {"type": "robot_pepper_get_sees_face", "id": "face", "x": 560, "y": 56}
BATTERY = {"type": "robot_pepper_get_battery", "id": "battery", "x": 560, "y": 336}
IF = {"type": "control_if", "id": "if", "x": 56, "y": 616}
NEAR = 24


@pytest.fixture
def view(qtbot):
    return editor(qtbot, editor_definitions([robot()]), 1031, 640)


@pytest.fixture
def them(person) -> Person:
    return person(state=workspace(START, TURN, EVER, FACE, BATTERY, IF))


def drop(them: Person, id: str, target: QPoint) -> None:
    """Drag a block and drop it with its top left corner at `target`."""
    box = them.box(f"[data-id={id}] > .blocklyPath")
    start = them.hold(f"[data-id={id}] > .blocklyPath")
    end = target + start - QPoint(round(box["left"]), round(box["top"]))
    them.move(start, end)
    them.drop(end)


def corner(them: Person, selector: str, side: str = "top") -> QPoint:
    box = them.box(selector)
    return QPoint(round(box["left"]), round(box[side]))


@pytest.mark.parametrize(
    ("id", "selector", "side", "words"),
    [
        ("face", "[data-id=angle] > .blocklyPath", "top", "“turn … by” needs a number here"),
        ("battery", "[data-id=if] > .blocklyOutlinePath", "top", "“if” needs yes or no here"),
        (
            "ever",
            "[data-id=angle] > .blocklyPath",
            "top",
            "“repeat forever” doesn't return a value, so it doesn't fit into a value slot.",
        ),
        ("turn", "[data-id=ever] > .blocklyPath", "bottom", "“repeat forever” can't have blocks below it"),
        ("battery", "[data-id=start] > .blocklyPath", "bottom", "“battery” is a value. Drag it into a slot"),
        ("start", "[data-id=turn] > .blocklyPath", "bottom", "“when started” starts a script"),
    ],
)
def test_invalid_drop_shows_the_reason_and_moves_the_block_off_the_target(
    qtbot, them, id, selector, side, words
):
    before = them.newest()
    place = corner(them, selector, side)
    drop(them, id, place)
    them.wait_for(f"{SAID}.startsWith({words!r})")
    assert them.ask("document.querySelector('.nepWhy').getAttribute('role')") == "status"
    mine = them.box(f"[data-id={id}] > .blocklyPath")
    assert mine["left"] > place.x() + 20 or mine["top"] > place.y() + 20
    bubble = them.box(".nepWhy")
    assert abs(bubble["left"] - place.x()) < 80
    assert abs(bubble["top"] - place.y()) < 90
    them.render()  # an edit becomes an undo step in a later frame
    them.view.undo()
    qtbot.waitUntil(lambda: them.newest() == before, timeout=WAIT_MS)


def test_block_moved_off_the_target_of_an_invalid_drop_covers_no_other_script(qtbot, view, them):
    """The first free direction, to the right of the target, leads to another script."""
    state = workspace(START, TURN, EVER, {**FACE, "y": 476}, {**BATTERY, "x": 300, "y": 196})
    view.load(state)
    them.wait_for("!!document.querySelector('[data-id=battery]') && !document.querySelector('[data-id=if]')")
    drop(them, "face", corner(them, "[data-id=angle] > .blocklyPath"))
    them.wait_for(f"{SAID} !== ''")
    mine, other, turn = (them.box(f"[data-id={each}] > .blocklyPath") for each in ("face", "battery", "turn"))
    for each in (other, turn):
        apart = mine["left"] >= each["right"] or mine["right"] <= each["left"]
        assert apart or mine["top"] >= each["bottom"] or mine["bottom"] <= each["top"]


def test_invalid_drop_message_disappears_on_the_next_click(them):
    drop(them, "face", corner(them, "[data-id=angle] > .blocklyPath"))
    them.wait_for(f"{SAID} !== ''")
    them.click("[data-id=ever] > .blocklyPath")
    them.wait_for(SAID, "")


def test_drop_on_empty_canvas_shows_no_message(qtbot, them):
    drop(them, "face", QPoint(700, 560))
    qtbot.waitUntil(lambda: them.ask("document.querySelector('.blocklyDragging')") is None, timeout=WAIT_MS)
    assert them.ask(SAID) == ""


@pytest.mark.parametrize("zooms", [-4, 0, 3])
def test_block_snaps_from_the_same_screen_distance_at_every_zoom(qtbot, view, them, zooms):
    width = "document.querySelector('[data-id=start] > .blocklyPath').getBoundingClientRect().width"
    for _ in range(abs(zooms)):  # the page receives each step separately
        before = them.ask(width)
        (view.zoom_in if zooms > 0 else view.zoom_out)()
        them.wait_for(f"{width} !== {before}")
    view.show_block("turn")
    them.wait_for("document.activeElement.closest('[data-id]')?.dataset.id", "turn")
    end = corner(them, "[data-id=start] > .blocklyPath", "bottom")
    drop(them, "turn", end + QPoint(NEAR, 0))
    qtbot.waitUntil(lambda: nested(them, "start") == "robot_pepper_do_turn", timeout=WAIT_MS)


def nested(them: Person, id: str) -> str | None:
    top = next(each for each in them.tops() if each["id"] == id)
    return top.get("next", {}).get("block", {}).get("type")
