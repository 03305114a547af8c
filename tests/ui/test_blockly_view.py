"""The block editor with a live page, a real mouse and real keys."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction, QColor
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QMainWindow

from app import resources
from app.ui.blockly_view import BlocklyView, register_scheme

register_scheme()

pytestmark = pytest.mark.web

DATA = Path(__file__).resolve().parents[1] / "data" / "blockly"
DEFINITIONS = json.loads((DATA / "definitions.json").read_text("utf-8"))
PICTURE = json.loads((DATA / "picture.json").read_text("utf-8"))
TOKENS = json.loads(resources.path("theme", "tokens.json").read_text("utf-8"))
START = {"type": "events_started", "id": "start", "x": 56, "y": 56}
WAIT_MS = 10_000


def workspace(*blocks: dict) -> dict:
    return {"blocks": {"languageVersion": 0, "blocks": list(blocks)}}


def statement(type: str, id: str, **more: object) -> dict:
    return {"type": type, "id": id, **more}


class Person:
    """Looks at the page and uses the mouse and the keyboard in it."""

    def __init__(self, qtbot, view: BlocklyView) -> None:
        self._qtbot = qtbot
        self.view = view

    def ask(self, script: str):
        answers: list = []
        self.view.web.page.runJavaScript(f"JSON.stringify({script})", answers.append)
        self._qtbot.waitUntil(lambda: bool(answers), timeout=WAIT_MS)
        return json.loads(answers[0]) if answers[0] else None

    def wait_for(self, script: str, expected: object = True) -> None:
        self._qtbot.waitUntil(lambda: self.ask(script) == expected, timeout=WAIT_MS)

    def newest(self) -> dict:
        got: list[dict] = []
        self.view.flush(got.append)
        self._qtbot.waitUntil(lambda: bool(got), timeout=WAIT_MS)
        return got[0]

    def tops(self) -> list[dict]:
        return self.newest().get("blocks", {}).get("blocks", [])

    def box(self, selector: str) -> dict:
        """Where an element is on the screen of the page, once it is there and has stopped moving."""
        script = (
            f"(e => e && (r => r.width > 0 && [r.left, r.top, r.right, r.bottom])(e.getBoundingClientRect()))"
            f"(document.querySelector({json.dumps(selector)}))"
        )
        before: list = []

        def still() -> bool:
            now = self.ask(script)
            same = bool(now) and now == (before[-1] if before else None)
            before.append(now)
            return same

        self._qtbot.waitUntil(still, timeout=WAIT_MS)
        left, top, right, bottom = before[-1]
        return {"left": left, "top": top, "right": right, "bottom": bottom}

    @property
    def target(self):
        return self.view.web.keyboard()

    def click(self, selector: str, dx: float = 14, dy: float = 14) -> None:
        box = self.box(selector)
        QTest.mouseClick(
            self.target, Qt.LeftButton, pos=QPoint(round(box["left"] + dx), round(box["top"] + dy))
        )

    def press(self, key: Qt.Key, modifiers=Qt.NoModifier) -> None:
        QTest.keyClick(self.target, key, modifiers)

    def open_category(self, name: str) -> None:
        script = f"[...document.querySelectorAll('.blocklyToolboxCategoryLabel')].findIndex(e => e.textContent == {name!r})"
        number = self.ask(script)
        assert number >= 0
        rows = ".blocklyToolboxCategoryContainer"
        self.ask(f"document.querySelectorAll({rows!r})[{number}].setAttribute('data-test', 'open')")
        self.click("[data-test=open]", dx=60)
        self.box(".blocklyFlyout .blocklyBlock")

    def hold(self, selector: str) -> QPoint:
        box = self.box(selector)
        start = QPoint(round(box["left"] + 12), round(box["top"] + 18))
        QTest.mouseMove(self.target, start)
        QTest.mousePress(self.target, Qt.LeftButton, pos=start)
        return start

    def move(self, start: QPoint, end: QPoint, steps: int = 10) -> None:
        for step in range(1, steps + 1):
            part = step / steps
            QTest.mouseMove(
                self.target, start + QPoint(round((end - start).x() * part), round((end - start).y() * part))
            )

    def drop(self, at: QPoint) -> None:
        QTest.mouseRelease(self.target, Qt.LeftButton, pos=at)

    def drag(self, selector: str, end: QPoint) -> None:
        start = self.hold(selector)
        self.move(start, end)
        self.drop(end)


@pytest.fixture
def view(qtbot) -> Iterator[BlocklyView]:
    made = BlocklyView()
    qtbot.addWidget(made)
    made.resize(1031, 586)
    made.set_definitions(DEFINITIONS)
    yield made


@pytest.fixture
def person(qtbot, view) -> Callable[..., Person]:
    def open_with(*blocks: dict, state: dict | None = None) -> Person:
        view.load(state or workspace(*blocks))
        with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
            view.show()
        return Person(qtbot, view)

    return open_with


# -- files --------------------------------------------------------------------------------------------


def test_what_was_loaded_is_what_is_saved(person):
    assert person(state=PICTURE).newest() == PICTURE


def test_loading_says_nothing_is_changed(qtbot, view, person):
    with qtbot.assertNotEmitted(view.changed, wait=400):
        them = person(state=PICTURE)
        view.load(workspace(START))
        view.set_live_values({"Pepper/battery": "84 %"})
        view.highlight(["start"])
    assert them.newest() == workspace(START)


def test_parts_of_the_file_that_are_not_blocks_are_kept(person):
    state = {**workspace(START), "variables": [{"name": "count", "id": "v1"}], "fromLater": {"a": [1]}}
    assert person(state=state).newest() == state


def test_before_the_page_exists_the_view_knows_its_program(qtbot, view):
    got: list[dict] = []
    view.load(PICTURE)
    view.flush(got.append)
    assert got == [PICTURE]


UNKNOWN = workspace(
    {
        "type": "robot_rover_when_stuck", "id": "u0", "x": 28, "y": 28, "extraState": {"deep": [1, {"x": None}]},
        "next": {"block": {
            "type": "robot_rover_do_wave", "id": "u1", "fields": {"ROBOT": "Rover", "TIMES": 3}, "data": "kept",
            "inputs": {
                "TEXT": {"shadow": {"type": "values_text", "id": "u2", "fields": {"TEXT": "hi"}}},
                "ANGLE": {"block": {"type": "robot_rover_get_angle", "id": "u3", "extraState": "old"}},
                "DO": {"block": {"type": "control_wait", "id": "u4", "next": {"block": {
                    "type": "robot_rover_do_wave", "id": "u5", "collapsed": True}}}},
            },
            "next": {"block": {"type": "control_wait", "id": "u6"}},
        }},
    },
    {
        "type": "control_wait", "id": "u7", "x": 280, "y": 28,
        "inputs": {"SECONDS": {"block": {"type": "robot_rover_get_angle", "id": "u8", "fields": {"A": "b"}}},
                   "FROM_LATER": {"block": {"type": "values_number", "id": "u9", "fields": {"NUMBER": 4}}}},
        "fields": {"GONE": "value"},
    },
    {
        "type": "robot_pepper_do_look", "id": "u10", "x": 280, "y": 112,
        "fields": {"ROBOT": "A robot long gone", "EMOTION": "puzzled"},
        "inputs": {"SECONDS": {"block": {"type": "values_text", "id": "u11", "fields": {"TEXT": "not a number"}}}},
    },
    {"type": "events_started", "id": "u12", "x": 28, "y": 308,
     "next": {"block": {"type": "values_number", "id": "u13", "fields": {"NUMBER": 1}}}},
)  # fmt: skip


def test_blocks_nobody_knows_come_back_as_they_were(person):
    them = person(state=UNKNOWN)
    assert them.newest() == UNKNOWN
    assert them.ask("document.querySelectorAll('.blocklyBlockCanvas .nepAbsent').length") >= 7


def test_a_stack_that_cannot_be_made_is_kept_whole(person):
    shadowed = {"type": "control_wait", "id": "w", "x": 28, "y": 28, "inputs": {"SECONDS": {"shadow": {
        "type": "values_compare", "id": "c", "fields": {"OP": "<"},
        "inputs": {"A": {"block": {"type": "values_number", "id": "n", "fields": {"NUMBER": 1}}}}}}}}  # fmt: skip
    state = workspace(shadowed, START)
    assert person(state=state).newest() == state


def test_unknown_blocks_survive_moving_copying_and_undo(qtbot, view, person):
    rover = {"type": "robot_rover_do_wave", "id": "r", "x": 140, "y": 140, "fields": {"A": 1}}
    them = person(rover)
    them.drag("[data-id=r]", QPoint(640, 400))
    qtbot.waitUntil(lambda: them.tops()[0]["x"] > 300, timeout=WAIT_MS)
    moved = them.tops()[0]
    assert {**moved, "x": 0, "y": 0} == {**rover, "x": 0, "y": 0}
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: them.tops() == [], timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: them.tops() == [moved], timeout=WAIT_MS)


def test_a_definition_that_comes_later_wakes_the_kept_block(qtbot, view, person):
    rover = {"type": "robot_rover_do_wave", "id": "r", "x": 140, "y": 140, "fields": {"TIMES": 2}}
    them = person(rover)
    more = copy.deepcopy(DEFINITIONS)
    more["blocks"].append({"type": "robot_rover_do_wave", "message0": "wave %1 times", "style": "robot",
        "args0": [{"type": "field_number", "name": "TIMES"}], "previousStatement": None, "nextStatement": None})  # fmt: skip
    view.set_definitions(more)
    them.wait_for("document.querySelector('[data-id=r]').classList.contains('robot_rover_do_wave')")
    assert them.ask("document.querySelector('[data-id=r]').classList.contains('nepAbsent')") is False
    assert them.tops() == [rover]


# -- mouse and keys -----------------------------------------------------------------------------------


def test_a_block_dragged_under_the_hat_snaps_there(qtbot, view, person):
    them = person(START)
    hat = them.box("[data-id=start] > .blocklyPath")
    them.open_category("Control")
    with qtbot.waitSignal(view.changed, timeout=WAIT_MS) as changed:
        start = them.hold(".blocklyFlyout .control_wait")
        end = QPoint(round(hat["left"] + 16), round(hat["bottom"] + 22))
        them.move(start, QPoint(700, 300))
        them.move(QPoint(700, 300), end)
        them.drop(end)
    (top,) = changed.args[0]["blocks"]["blocks"]
    assert top["next"]["block"]["type"] == "control_wait"
    assert top["next"]["block"]["inputs"]["SECONDS"]["shadow"]["fields"] == {"NUMBER": 1}
    assert them.newest() == changed.args[0]


def test_undo_redo_and_their_announcement(qtbot, view, person):
    them = person(START)
    history: list[tuple[bool, bool]] = []
    view.history_changed.connect(lambda *each: history.append(each))
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: them.tops() == [] and history[-1:] == [(True, False)], timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: them.tops() == [START] and history[-1] == (False, True), timeout=WAIT_MS)
    view.redo()
    qtbot.waitUntil(lambda: them.tops() == [] and history[-1] == (True, False), timeout=WAIT_MS)
    them.press(Qt.Key_Z, Qt.ControlModifier)
    qtbot.waitUntil(lambda: them.tops() == [START] and history[-1] == (False, True), timeout=WAIT_MS)
    assert history == [(True, False), (False, True), (True, False), (False, True)]


def test_copy_and_paste_by_keys(qtbot, person):
    them = person(START)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_C, Qt.ControlModifier)
    them.press(Qt.Key_V, Qt.ControlModifier)
    qtbot.waitUntil(lambda: [top["type"] for top in them.tops()] == ["events_started"] * 2, timeout=WAIT_MS)


def test_the_selected_block_is_told(qtbot, view, person):
    them = person(START)
    with qtbot.waitSignal(view.block_selected, timeout=WAIT_MS, check_params_cb=lambda id: id == "start"):
        them.click("[data-id=start] > .blocklyPath", dy=30)


def test_typing_in_a_text_changes_the_program(qtbot, view, person):
    say = {"type": "robot_pepper_do_say", "id": "say", "x": 28, "y": 28, "fields": {"ROBOT": "Pepper"},
           "inputs": {"TEXT": {"shadow": {"type": "values_text", "id": "t", "fields": {"TEXT": "x"}}}}}  # fmt: skip
    them = person(say)
    them.click("[data-id=t] .blocklyInputField", dx=8, dy=8)
    them.wait_for("!!document.querySelector('.blocklyHtmlInput')")
    QTest.keyClicks(them.target, "Hello, you")
    them.press(Qt.Key_Return)

    def text() -> str:
        return them.tops()[0]["inputs"]["TEXT"]["shadow"]["fields"]["TEXT"]

    qtbot.waitUntil(lambda: text() == "Hello, you", timeout=WAIT_MS)


def test_f12_reaches_the_window_while_the_page_has_the_keyboard(qtbot, view, person):
    them = person(START)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    with qtbot.waitSignal(view.key_pressed, timeout=WAIT_MS) as pressed:
        them.press(Qt.Key_F12)
    assert pressed.args == ["F12"]


def test_a_shortcut_of_the_window_wins_over_the_page_and_runs_once(qtbot):
    window = QMainWindow()
    qtbot.addWidget(window)
    view = BlocklyView()
    view.set_definitions(DEFINITIONS)
    window.setCentralWidget(view)
    window.resize(1031, 586)
    stops: list[str] = []
    action = QAction("Stop", window)
    action.setShortcut("F12")
    action.setShortcutContext(Qt.ApplicationShortcut)
    action.triggered.connect(lambda: stops.append("action"))
    window.addAction(action)
    view.key_pressed.connect(stops.append)
    view.load(workspace(START))
    with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
        window.show()
    window.activateWindow()
    them = Person(qtbot, view)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_F12)
    qtbot.waitUntil(lambda: bool(stops), timeout=WAIT_MS)
    qtbot.wait(100)
    assert len(stops) == 1


# -- looks --------------------------------------------------------------------------------------------


def test_a_change_of_theme_keeps_program_and_undo(qtbot, view, person):
    them = person(START)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: them.tops() == [], timeout=WAIT_MS)
    view.set_theme(TOKENS, dark=True)
    dark = TOKENS["colour"]["dark"]["workspace"]
    them.wait_for(
        "getComputedStyle(document.querySelector('.blocklyMainBackground').closest('svg')).backgroundColor",
        "rgb({}, {}, {})".format(*QColor(dark).getRgb()[:3]),
    )
    view.undo()
    qtbot.waitUntil(lambda: them.tops() == [START], timeout=WAIT_MS)
    primary = TOKENS["block"]["events"]["dark"]["tertiary"].lower()
    assert (
        them.ask("document.querySelector('[data-id=start] > .blocklyPath').getAttribute('stroke')") == primary
    )


def test_the_flat_tokens_of_the_theme_do_as_well(view, person):
    them = person(START)
    light = TOKENS["colour"]["light"]
    flat = {
        "colour": {name: value for name, value in light.items() if isinstance(value, str)}
        | {"grid": "#123456"},
        "block": {name: {**each["light"], "icon": each["icon"]} for name, each in TOKENS["block"].items()},
        "reducedMotion": True,
    }
    view.set_theme(flat, dark=False)
    them.wait_for("getComputedStyle(document.documentElement).getPropertyValue('--nep-grid')", "#123456")
    them.wait_for("document.documentElement.classList.contains('reduced')")


def outlined(name: str) -> str:
    return f"[...document.querySelectorAll('.nepState-{name}')].map(e => e.parentElement.dataset.id)"


def test_running_blocks_glow_in_the_page(view, person):
    them = person(state=PICTURE)
    view.highlight(["say_touch", "battery"])
    them.wait_for(outlined("running") + ".sort()", ["battery", "say_touch"])
    shape = "document.querySelector('[data-id=say_touch] > {}').getAttribute('d')"
    assert them.ask(shape.format(".nepState .nepOutline")) == them.ask(shape.format(".blocklyPath"))
    animated = "getComputedStyle(document.querySelector('.nepGlow')).animationName"
    assert them.ask(animated) == "nepBreathe"
    view.set_reduced_motion(True)
    them.wait_for(animated, "none")
    view.highlight([])
    view.mark_stopped(["say_touch"])
    them.wait_for(outlined("running"), [])
    them.wait_for(outlined("stopped"), ["say_touch"])


def test_thirty_highlights_a_second_are_cheap(qtbot, view, person):
    them = person(state=PICTURE)
    ids = ["say_touch", "battery", "wave"]
    for number in range(300):
        view.highlight([ids[number % 3]])
    them.wait_for(outlined("running"), ["wave"])
    script = (
        "(() => { const begin = performance.now();"
        "document.body.getBoundingClientRect(); return performance.now() - begin; })()"
    )
    assert them.ask(script) < 100


def test_an_error_has_its_sentence_beside_the_block(view, person):
    them = person(state=PICTURE)
    view.set_errors({"say_touch": "Pepper does not answer."})
    them.wait_for("document.querySelector('.nepBubble')?.textContent", "Pepper does not answer.")
    assert them.ask(outlined("error")) == ["say_touch"]
    block = them.box("[data-id=say_touch] > .blocklyPath")
    bubble = them.box(".nepBubble")
    assert 0 < bubble["left"] - block["right"] < 30
    assert block["top"] - 5 < bubble["top"] < block["bottom"]
    view.set_errors({})
    them.wait_for("document.querySelectorAll('.nepBubble, .nepState').length", 0)


def test_absent_robots_are_grey_with_the_reason(view, person):
    them = person(state=PICTURE)
    view.set_absent(["wave"])
    grey = "[...document.querySelectorAll('.nepAbsent')].map(e => e.dataset.id)"
    them.wait_for(grey, ["wave"])
    assert them.newest() == PICTURE
    view.set_absent([])
    them.wait_for(grey, [])


def test_live_values_are_shown_but_no_edit(qtbot, view, person):
    them = person(state=PICTURE)
    shown = "document.querySelector('[data-id=battery] .nepLive').textContent.replaceAll('\\u00a0', ' ')"
    with qtbot.assertNotEmitted(view.changed, wait=300), qtbot.assertNotEmitted(view.history_changed):
        view.set_live_values({"Pepper/battery": "84 %"})
        them.wait_for(shown, "84 %")
        view.set_live_values({"battery": "83 %"})
        them.wait_for(shown, "83 %")
    assert them.newest() == PICTURE


def test_an_empty_program_is_nothing_but_dots(person):
    them = person()
    assert them.ask("document.querySelectorAll('.blocklyBlockCanvas .blocklyBlock').length") == 0
    assert them.ask("document.querySelectorAll('.blocklyTrash, .blocklyZoom').length") == 0
    assert them.ask("document.querySelectorAll('.nepZoom button').length") == 3
    assert them.view.web.fence.blocked == []


def test_zoom_and_fit(qtbot, view, person):
    them = person(state=PICTURE)
    canvas = "document.querySelector('svg.blocklySvg .blocklyBlockCanvas')"
    scale = f"Math.round(new DOMMatrix(getComputedStyle({canvas}).transform).a * 1000) / 1000"
    them.wait_for(scale, 0.8)
    view.zoom_in()
    them.wait_for(f"{scale} > 0.9")
    view.zoom_out()
    view.zoom_out()
    them.wait_for(f"{scale} < 0.75")
    view.zoom_to_fit()
    them.wait_for(f"{scale} > 0.75 && {scale} <= 1")
    view.show_block("battery")
    them.wait_for("!!document.querySelector('[data-id=battery].blocklySelected')")


def test_the_toolbox_is_that_of_the_picture(person):
    them = person()
    labels = them.ask(
        "[...document.querySelectorAll('.nepHeading, .blocklyToolboxCategoryLabel')].map(e => e.textContent)"
    )
    assert labels == [
        "Blocks", "Events", "Control", "Values", "Variables", "Functions", "Messages",
        "Peppervirtual", "Speech", "Movement", "Face and lights", "Sensors", "NAOnot connected",
    ]  # fmt: skip
    box = them.box(".blocklyToolbox")
    assert box["right"] - box["left"] == 196
    row = them.box(".blocklyToolboxCategory")
    assert row["bottom"] - row["top"] == 36
    tile = "getComputedStyle(document.querySelector('.nepTile')).backgroundColor"
    events = QColor(TOKENS["block"]["events"]["light"]["primary"]).getRgb()[:3]
    assert them.ask(tile) == "rgb({}, {}, {})".format(*events)


# -- robots come and go -------------------------------------------------------------------------------


def with_rover() -> dict:
    more = copy.deepcopy(DEFINITIONS)
    more["toolbox"]["contents"][-1:] = [
        {"kind": "robotHeading", "name": "Rover", "connected": True},
        {"kind": "category", "name": "Wheels", "categorystyle": "robot", "icon": "car",
         "contents": [{"kind": "block", "type": "control_wait"}]},
    ]  # fmt: skip
    for block in more["blocks"]:
        for arg in block.get("args0", []):
            if arg.get("source") == "robots:pepper":
                arg["options"].append(["Pepper two", "Pepper two"])
    more["topics"] = ["/new"]
    return more


WHEELS = "document.querySelector('.blocklyToolbox').textContent.includes('Wheels')"


def test_a_robot_that_connects_during_a_drag_does_not_break_it(qtbot, view, person):
    them = person(START)
    hat = them.box("[data-id=start] > .blocklyPath")
    them.open_category("Control")
    start = them.hold(".blocklyFlyout .control_wait")
    them.move(start, QPoint(700, 300))
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    view.set_definitions(with_rover())
    qtbot.wait(200)
    assert them.ask(WHEELS) is False
    end = QPoint(round(hat["left"] + 16), round(hat["bottom"] + 22))
    them.move(QPoint(700, 300), end)
    them.drop(end)
    them.wait_for(WHEELS)
    (top,) = them.tops()
    assert top["next"]["block"]["type"] == "control_wait"


def test_an_open_category_stays_open_when_robots_come(qtbot, view, person):
    them = person(START)
    them.open_category("Control")
    them.ask("document.querySelector('.blocklyFlyout .control_wait').setAttribute('data-same', 'yes')")
    view.set_definitions(with_rover())
    them.wait_for(WHEELS)
    assert them.ask("!!document.querySelector('.blocklyFlyout [data-same=yes]')")
    assert them.ask("document.querySelector('.blocklyToolboxSelected').textContent") == "Control"
    them.drag(".blocklyFlyout .control_wait", QPoint(700, 400))
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)


def test_equal_definitions_touch_nothing(qtbot, view, person):
    them = person(START)
    them.ask("document.querySelector('.nepHeading').setAttribute('data-same', 'yes')")
    view.set_definitions(copy.deepcopy(DEFINITIONS))
    topics = copy.deepcopy(DEFINITIONS)
    topics["topics"].append("/more")
    view.set_definitions(topics)
    qtbot.wait(200)
    assert them.ask("!!document.querySelector('.nepHeading[data-same=yes]')")


def test_a_block_whose_definition_changes_keeps_its_place_and_undo(qtbot, view, person):
    wait = {"type": "control_wait", "id": "w", "x": 140, "y": 140}
    them = person(wait, START)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: len(them.tops()) == 1, timeout=WAIT_MS)
    changed = copy.deepcopy(DEFINITIONS)
    next(each for each in changed["blocks"] if each["type"] == "control_wait")["message0"] = "%1 pause %2 s"
    view.set_definitions(changed)
    them.wait_for("document.querySelector('[data-id=w]').textContent.includes('pause')")
    view.undo()
    qtbot.waitUntil(lambda: sorted(top["id"] for top in them.tops()) == ["start", "w"], timeout=WAIT_MS)
    assert next(top for top in them.tops() if top["id"] == "w") == wait


def test_new_robots_are_offered_and_unknown_ones_stay(view, person):
    say = {"type": "robot_pepper_do_say", "id": "say", "x": 28, "y": 28, "fields": {"ROBOT": "Old one"}}
    them = person(say)
    view.set_definitions(with_rover())
    them.wait_for(WHEELS)
    them.click("[data-id=say] .blocklyDropdownField", dx=10, dy=10)
    them.wait_for("[...document.querySelectorAll('.blocklyMenuItemContent')].map(e => e.textContent)",
                  ["Pepper", "Pepper two", "Old one"])  # fmt: skip
    assert them.tops() == [say]


# -- the web process dies -----------------------------------------------------------------------------


def test_a_killed_web_process_loses_nothing(qtbot, view, person, caplog):
    them = person(START)
    them.open_category("Control")
    with qtbot.waitSignal(view.changed, timeout=WAIT_MS):
        them.drag(".blocklyFlyout .control_wait", QPoint(700, 400))
    before = them.newest()
    view.set_theme(TOKENS, dark=True)
    view.highlight(["start"])
    got: list[dict] = []
    with qtbot.waitSignal(view.ready, timeout=20_000):
        import os
        import signal

        os.kill(view.web.page.renderProcessPid(), signal.SIGKILL)
        view.flush(got.append)
    qtbot.waitUntil(lambda: got == [before], timeout=WAIT_MS)
    assert them.newest() == before
    them.wait_for(outlined("running"), ["start"])
    dark = QColor(TOKENS["colour"]["dark"]["workspace"]).getRgb()[:3]
    assert them.ask("getComputedStyle(document.body).backgroundColor") == "rgb({}, {}, {})".format(*dark)
    with qtbot.waitSignal(view.key_pressed, timeout=WAIT_MS):
        them.press(Qt.Key_F12)
    assert "ended" in caplog.text
