"""Tests of the trial of a stack: its description and the value that its program prints."""

from __future__ import annotations

from app.blocks.model.stack import Stack
from app.core.projects.open_project import OpenProject
from app.core.run.requests import RequestedRun
from app.core.run.trial import Trial
from tests.blocks.samples import block, robot, say, started, workspace

BATTERY = Stack("bat", "value", block("robot_pepper_get_battery", "bat", ROBOT="Pepper"))


def began(stack: Stack | None) -> tuple[Trial, str]:
    """Return a started trial and the description of its block."""
    document = OpenProject()
    document.set_connected([robot("Pepper")])
    document.apply_edit(workspace(started(say("Hi") | {"id": "hi"})))
    wanted = RequestedRun(document, stack=stack)
    program = wanted.program()
    assert program is not None
    made = Trial()
    made.prepare(wanted)
    return made, made.start(program, [robot("Pepper")])


def test_trial_value_is_shown_with_its_unit() -> None:
    trial, words = began(BATTERY)
    assert words == "battery"
    assert trial.value is None
    assert trial.parse_line("84") == "84 %"
    assert trial.value is not None
    assert (trial.value.block, trial.value.text) == ("bat", "84 %")


def test_empty_output_line_is_an_unknown_value() -> None:
    trial, _words = began(BATTERY)
    assert trial.parse_line("") == "not known yet"


def test_next_run_clears_the_trial_value() -> None:
    trial, _words = began(BATTERY)
    trial.parse_line("84")
    trial.prepare(RequestedRun(OpenProject()))
    assert trial.value is None
    assert trial.parse_line("printed") is None


def test_printed_lines_of_stack_or_behaviour_are_not_a_value() -> None:
    for stack, words in ((Stack("hi"), "say"), (None, "")):
        trial, said = began(stack)
        assert said == words
        assert trial.parse_line("printed") is None
        assert trial.value is None
    assert Trial().parse_line("early") is None
