"""Tests of the block editor while robots connect and disconnect, and after its web process was killed."""

from __future__ import annotations

import copy
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor
from PySide6.QtTest import QTest

from app.blocks.model.workspace_json import WorkspaceJson
from app.ui.blockly.view import BlocklyView
from tests.ui.blockly_person import DEFINITIONS, START, TOKENS, WAIT_MS, Person, outlined, workspace

pytestmark = pytest.mark.web

ROOT = Path(__file__).resolve().parents[3]


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


def test_robot_that_connects_during_a_drag_does_not_interrupt_the_drag(qtbot, view, person):
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


def test_open_category_stays_open_when_robots_connect(qtbot, view, person):
    them = person(START)
    them.open_category("Control")
    them.ask("document.querySelector('.blocklyFlyout .control_wait').setAttribute('data-same', 'yes')")
    view.set_definitions(with_rover())
    them.wait_for(WHEELS)
    assert them.ask("!!document.querySelector('.blocklyFlyout [data-same=yes]')")
    assert them.ask("document.querySelector('.blocklyToolboxSelected').textContent") == "Control"
    them.drag(".blocklyFlyout .control_wait", QPoint(700, 400))
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)


def test_equal_definitions_or_new_topics_do_not_rebuild_the_toolbox(qtbot, view, person):
    them = person(START)
    them.ask("document.querySelector('.nepHeading').setAttribute('data-same', 'yes')")
    view.set_definitions(copy.deepcopy(DEFINITIONS))
    topics = copy.deepcopy(DEFINITIONS)
    topics["topics"].append("/more")
    view.set_definitions(topics)
    qtbot.wait(200)
    assert them.ask("!!document.querySelector('.nepHeading[data-same=yes]')")


DOTS = """Object.fromEntries([...document.querySelectorAll('.nepHeading.robot')].map(
    each => [each.textContent, each.querySelector('i').className])
    .filter(([name]) => name.startsWith('Rover')))"""


def test_robot_that_may_still_move_has_no_green_status_dot_even_during_a_drag(view, person):
    them = person(START)
    view.set_definitions(with_rover())
    them.wait_for(DOTS, {"Rover": "on"})
    them.open_category("Control")
    start = them.hold(".blocklyFlyout .control_wait")
    them.move(start, QPoint(700, 300))
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    view.set_alarms({"Rover": ("running", "stopping")})
    them.wait_for(DOTS, {"Roverstopping": "running"})
    view.set_alarms({"Rover": ("error", "may still move"), "__proto__": ("error", "not stopped")})
    them.wait_for(DOTS, {"Rovermay still move": "error"})
    them.drop(QPoint(700, 300))
    more = with_rover()
    more["toolbox"]["contents"][-2]["connected"] = False  # a disconnected robot may still move
    view.set_definitions(more)
    them.wait_for(DOTS, {"Rovermay still move": "error"})
    view.set_alarms({})
    them.wait_for(DOTS, {"Rovernot connected": "off"})


def test_reloaded_page_shows_which_robots_may_still_move(qtbot, view, person):
    them = person(START)
    view.set_definitions(with_rover())
    view.set_alarms({"Rover": ("error", "may still move")})
    with qtbot.waitSignal(view.ready, timeout=60_000):
        os.kill(view.web.page.renderProcessPid(), signal.SIGKILL)
    them.wait_for(DOTS, {"Rovermay still move": "error"})


def test_block_whose_definition_changes_keeps_its_position_and_undo_stack(qtbot, view, person):
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


def test_blocks_of_new_robots_are_offered_and_a_block_of_an_unknown_robot_is_kept(view, person):
    say = {"type": "robot_pepper_do_say", "id": "say", "x": 28, "y": 28, "fields": {"ROBOT": "Old one"}}
    them = person(say)
    view.set_definitions(with_rover())
    them.wait_for(WHEELS)
    them.click("[data-id=say] .blocklyDropdownField", dx=10, dy=10)
    them.wait_for("[...document.querySelectorAll('.blocklyMenuItemContent')].map(e => e.textContent)",
                  ["Pepper", "Pepper two", "Old one"])  # fmt: skip
    assert them.tops() == [say]


def test_killed_web_process_loses_no_edits(qtbot, view, person, caplog):
    them = person(START)
    them.open_category("Control")
    with qtbot.waitSignal(view.changed, timeout=WAIT_MS):
        them.drag(".blocklyFlyout .control_wait", QPoint(700, 400))
    them.wait_for("!document.querySelector('.blocklyDragging')")
    them.render()  # the dropped block snaps to the grid
    before = them.newest()
    view.set_theme(TOKENS, is_dark=True)
    view.highlight(["start"])
    got: list[WorkspaceJson] = []
    with qtbot.waitSignal(view.ready, timeout=60_000):
        os.kill(view.web.page.renderProcessPid(), signal.SIGKILL)
        view.flush(got.append)
    qtbot.waitUntil(lambda: [each.blocks for each in got] == [before], timeout=WAIT_MS)
    assert them.newest() == before
    them.wait_for(outlined("running"), ["start"])
    dark = QColor(TOKENS["colour"]["dark"]["workspace"]).getRgb()[:3]
    them.wait_for("getComputedStyle(document.body).backgroundColor", "rgb({}, {}, {})".format(*dark))
    with qtbot.waitSignal(view.key_pressed, timeout=WAIT_MS):
        them.press(Qt.Key_F12)
    assert "ended" in caplog.text
    (crash,) = [each.crash for each in caplog.records if hasattr(each, "crash")]
    assert crash.part == "editor", "a report of it is kept"


@pytest.mark.parametrize(
    ("language", "words"), [("de", "Baustein löschen"), ("pt-BR", "Deletar bloco"), ("xx", "Delete")]
)
def test_blockly_uses_the_selected_language_or_falls_back_to_english(qtbot, language, words):
    view = BlocklyView(language=language)
    qtbot.addWidget(view)
    view.set_definitions(DEFINITIONS)
    view.resize(1031, 586)
    view.load(workspace(START))
    with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
        view.show()
    them = Person(qtbot, view)
    box = them.box("[data-id=start] > .blocklyPath")
    at = QPoint(round(box["left"] + 14), round(box["top"] + 30))
    QTest.mouseClick(them.target, Qt.RightButton, pos=at)
    them.wait_for(f"!!document.querySelector('.blocklyContextMenu')?.textContent.includes({words!r})")


def test_editor_texts_use_translations_of_the_app_and_fall_back_to_english(qtbot, monkeypatch):
    monkeypatch.setattr(
        "nep.i18n.editor_translations", lambda: {"Find a block": "Buscar un bloque", "Duplicate": "Otra vez"}
    )
    view = BlocklyView(language="es")
    qtbot.addWidget(view)
    view.set_definitions(DEFINITIONS)
    view.resize(1031, 586)
    view.load(workspace(START))
    with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
        view.show()
    them = Person(qtbot, view)
    them.wait_for("document.querySelector('.nepSearch input')?.placeholder === 'Buscar un bloque'")
    titles = them.ask("[...document.querySelectorAll('.nepZoom button')].map(e => e.title)")
    assert "Zoom in" in titles  # has no translation
    assert them.ask("document.querySelector('.nepFind input').placeholder") == "Find in blocks"


ENDING = """
import sys
from PySide6.QtWidgets import QApplication
from app.ui.blockly.view import BlocklyView, register_scheme

register_scheme()
application = QApplication([])
view = BlocklyView()
view.ready.connect(application.quit)
view.show()
sys.exit(application.exec())
"""


def test_application_exits_cleanly_with_an_open_editor():
    done = subprocess.run(
        [sys.executable, "-c", ENDING], cwd=ROOT, capture_output=True, text=True, timeout=140, check=False
    )
    assert done.returncode == 0
    assert "Release of profile" not in done.stderr
