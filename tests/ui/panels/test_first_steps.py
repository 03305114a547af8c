"""Tests of the First steps tutorial: completion from blocks and runs, saved progress, delayed hints."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from app import resources
from app.core.projects.file_format import read_file
from app.intents import PointAtBlock
from app.ui.intents import HideBlockHint, PointAtButton
from app.ui.panels.base import Panel
from app.ui.panels.build.first_steps.panel import HINT_DELAY_S, FirstStepsPanel
from app.ui.panels.build.first_steps.steps import (
    SAY,
    STEPS,
    TURN,
    TutorialBlocks,
    TutorialState,
    completed_steps,
    find_tutorial_blocks,
)
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, has_keys, press
from tests.ui.sample_data import pepper


def block(kind: str, below: dict | None = None, **inputs: dict) -> dict:
    made: dict = {"type": kind, "id": kind}
    if below is not None:
        made["next"] = {"block": below}
    if inputs:
        made["inputs"] = {name: {"block": held} for name, held in inputs.items()}
    return made


def page(*tops: dict) -> dict:
    return {"blocks": {"blocks": list(tops)}}


SAYS, TURNS = "robot_pepper_do_say", "robot_pepper_do_turn"


def test_blocks_nested_below_when_started_count_and_detached_blocks_do_not() -> None:
    assert find_tutorial_blocks({}) == TutorialBlocks()
    assert find_tutorial_blocks(page(block("events_started"))) == TutorialBlocks(has_start_block=True)
    inside = block("events_started", block("control_repeat", block(TURNS), BODY=block(SAYS)))
    assert find_tutorial_blocks(page(inside)) == TutorialBlocks(True, frozenset({SAYS}), True)
    loose = page(block("events_started"), block(SAYS))
    assert find_tutorial_blocks(loose) == TutorialBlocks(True, detached_suffixes=frozenset({SAY})), (
        "it stands on the page, and does not run"
    )


def test_malformed_behaviours_are_searched_for_tutorial_blocks_without_error() -> None:
    assert find_tutorial_blocks({"blocks": 3}) == TutorialBlocks()
    assert find_tutorial_blocks(
        {"blocks": {"blocks": [3, {"type": "events_started", "next": 3, "inputs": 4}]}}
    ) == TutorialBlocks(True)


def test_each_step_is_completed_once_and_stays_completed() -> None:
    now, done = TutorialState(), frozenset[str]()
    for change, step in (
        ({"can_speak": True}, "robot"),
        ({"blocks": TutorialBlocks(has_start_block=True)}, "start"),
        ({"blocks": TutorialBlocks(True, frozenset({"a"}))}, "say"),
        ({"executed_ids": ("a",)}, "run"),
        ({"blocks": TutorialBlocks(True, frozenset({"a"}), True), "executed_ids": ()}, "turn"),
        ({"was_stopped": True}, "stop"),
    ):
        now = replace(now, **change)
        done, before = completed_steps(now, done), done
        assert done - before == {step}
    assert completed_steps(TutorialState(), done) == done == {step.id for step in STEPS}


def test_blocks_of_an_example_complete_no_step(panel, window) -> None:
    window.session.join(pepper())
    shipped = read_file(min(resources.path("examples").glob("*.nepb"))).always.workspace.blocks
    tops = shipped["blocks"]["blocks"]
    build(panel, *tops)
    assert panel.completed_ids == {"robot"}
    build(panel, *tops, block("events_started", block(SAYS, block(TURNS))))
    assert panel.completed_ids == {"robot", "start", "say", "turn"}


def test_stopping_a_program_without_tutorial_blocks_does_not_complete_the_last_step() -> None:
    done = {"robot", "start", "say", "run", "turn"}
    assert completed_steps(TutorialState(True, TutorialBlocks(), was_stopped=True), done) == done


def test_stop_before_any_run_completes_no_tutorial_step() -> None:
    built = TutorialBlocks(True, frozenset({"a"}), True)
    assert "stop" not in completed_steps(TutorialState(True, built, was_stopped=True), ())


def test_block_types_of_the_steps_match_the_shipped_robot() -> None:
    described = json.loads(resources.path("robots", "pepper.tm.jsonld").read_text("utf-8"))
    assert {"say", "turn"} <= described["actions"].keys()
    assert (SAY, TURN) == ("_do_say", "_do_turn")


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session())


@pytest.fixture
def panel(qtbot, window, clock) -> FirstStepsPanel:
    described = Panel("first_steps", "First steps", "lightbulb", (), lambda it: FirstStepsPanel(it, clock))
    made = window.make(described, (384, 300))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, FirstStepsPanel)
    return made


def names(panel: FirstStepsPanel) -> list[str]:
    return [row.accessibleName() for row in panel.rows]


def build(panel: FirstStepsPanel, *tops: dict) -> None:
    panel.session.document.apply_edit(page(*tops))
    panel.refresh()


def test_next_step_shows_its_hint_and_button(panel, window) -> None:
    assert names(panel)[:2] == ["Use the virtual robot: the next step", "Drag “when started” onto the page"]
    assert panel.rows[0].hint.isVisible()
    assert not panel.rows[1].hint.isVisible()
    press(panel.rows[0].button)
    assert window.commands == ["robots.virtual"]
    window.session.join(pepper())
    panel.refresh()
    assert names(panel)[:2] == [
        "Use the virtual robot: done",
        "Drag “when started” onto the page: the next step",
    ]
    press(panel.rows[1].button)
    assert window.commands[-1] == PointAtBlock("events_started")
    assert panel.chip.text == "1 of 6"


def test_keyboard_focus_moves_to_the_next_step(qtbot, panel, window) -> None:
    panel.activateWindow()
    qtbot.waitUntil(panel.isActiveWindow)
    panel.rows[0].button.setFocus()
    window.session.join(pepper())
    panel.refresh()
    assert has_keys(panel.rows[1].button)


def test_show_me_points_at_the_block_of_the_connected_robot(panel, window) -> None:
    window.session.join(pepper())
    build(panel, block("events_started"))
    press(panel.rows[2].button)
    assert window.commands[-1] == PointAtBlock("robot_virtual_pepper_do_say")
    build(panel, block("events_started", block(SAYS)))
    press(panel.rows[3].button)
    assert window.commands[-1] == PointAtButton("run.run")


def test_hint_for_a_detached_block_says_where_to_attach_it(panel, window) -> None:
    window.session.join(pepper())
    build(panel, block("events_started"))
    assert panel.rows[2].hint.text() == "You'll find it under Speech, on the left."
    build(panel, block("events_started"), block(SAYS))
    assert panel.rows[2].hint.text() == "Drag it up until it snaps below “when started”."
    assert "say" not in panel.completed_ids


def test_completed_steps_are_restored_after_restart(panel, window, qtbot) -> None:
    window.session.join(pepper())
    build(panel, block("events_started"))
    assert window.session.settings.completed_steps == ("robot", "start")
    again = window.make(Panel("first_steps", "", "", (), FirstStepsPanel))
    qtbot.addWidget(again)
    for widget in again.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(again, FirstStepsPanel)
    assert again.completed_ids == {"robot", "start"}
    window.session.settings.completed_steps = ("nonsense",)
    assert FirstStepsPanel(window.context()).completed_ids == frozenset()


def test_next_step_is_highlighted_once_after_twenty_idle_seconds(panel, window, clock) -> None:
    window.session.join(pepper())
    panel.refresh()
    clock.now = HINT_DELAY_S - 1
    panel.refresh()
    assert window.commands == []
    build(panel, block("control_wait"))  # building resets the idle time
    clock.now += 2
    panel.refresh()
    assert window.commands == []
    clock.now += HINT_DELAY_S
    panel.refresh()
    panel.refresh()
    assert window.commands == [PointAtBlock("events_started")]
    build(panel, block("events_started"))
    assert window.commands[-1] == HideBlockHint(), "the ring goes with its step"


def test_completed_first_steps_show_next_steps_and_can_be_restarted(panel, window) -> None:
    panel.completed_ids = frozenset(step.id for step in STEPS) - {"robot"}
    window.session.join(pepper())
    panel.refresh()
    assert panel.pages.currentWidget() is panel.end_page
    assert panel.chip.text == "6 of 6"
    build(panel, block("events_started"))
    panel.start_again()
    assert window.commands == ["file.new"], "nobody's blocks are touched"
    assert panel.completed_ids == frozenset()
    assert panel.pages.currentIndex() == 0
