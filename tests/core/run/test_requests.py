"""Tests of run requests: a behaviour or one stack, with the reason why it can't be tried."""

from __future__ import annotations

from app.blocks.model.stack import Stack
from app.core.projects.open_project import OpenProject
from app.core.run.requests import RequestedRun
from tests.blocks.samples import block, robot, say, started, workspace


def document(*connected: str) -> OpenProject:
    made = OpenProject()
    made.set_connected([robot("Pepper"), robot("Ada")])
    gap = block("control_wait_until", "gap")
    made.apply_edit(workspace(started(say("Hi") | {"id": "hi"}, say("Hi", "Ada") | {"id": "ada"}, gap)))
    made.set_connected([robot(name) for name in connected])
    return made


def test_requested_behaviour_has_the_program_of_its_document() -> None:
    wanted = RequestedRun(document("Pepper"))
    program = wanted.program()
    assert program is wanted.document.program()
    assert program is not None
    assert list(wanted.problems(program)) == ["gap"], "robots that are missing are skipped"
    assert wanted.label(program) == ""
    assert not wanted.has_value


def test_requested_stack_is_named_by_its_first_block() -> None:
    wanted = RequestedRun(document("Pepper", "Ada"), stack=Stack("ada"))
    program = wanted.program()
    assert program is not None
    assert wanted.label(program) == "say"
    assert "needs a condition" in wanted.problems(program)["gap"]


def test_stack_with_block_of_disconnected_robot_cannot_be_tried() -> None:
    wanted = RequestedRun(document("Pepper"), stack=Stack("ada", state=say("Hi", "Ada") | {"id": "ada"}))
    program = wanted.program()
    assert program is not None
    assert wanted.problems(program) == {"ada": "Ada isn't connected, so these blocks can't be tried."}


def test_requested_value_has_the_unit_of_its_sensor() -> None:
    battery = block("robot_pepper_get_battery", "bat", ROBOT="Pepper")
    wanted = RequestedRun(document("Pepper"), stack=Stack("bat", "value", battery))
    program = wanted.program()
    assert program is not None
    assert wanted.has_value
    assert wanted.unit(program, [robot("Pepper")]) == "%"
    assert wanted.unit(program, []) == ""
    assert wanted.problems(program) == {}
    assert wanted.label(program) == "battery"


def test_deleted_stack_has_no_program() -> None:
    assert RequestedRun(document("Pepper"), stack=Stack("nowhere")).program() is None
