"""Tests of compiling one stack of blocks as a program of its own.

The program has a start event and the functions and variables of its behaviour.
"""

from __future__ import annotations

import copy

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.program import Program
from app.blocks.model.stack import SHOW_BLOCK_ID, Stack
from tests.blocks.fakes import play
from tests.blocks.samples import block, call, define, get, number, robot, say, stack, started, workspace

BATTERY = block("robot_pepper_get_battery", "bat", ROBOT="Pepper")


def behaviour() -> dict[str, object]:
    """Return a workspace with a start of three blocks, a script with an event block, and a function."""
    chain = stack(say("one") | {"id": "1"}, say("two") | {"id": "2"}, call("f", id="3"))
    loop = block("control_forever", "loop", BODY=[say("in") | {"id": "in"}])
    touched = block("robot_pepper_when_touched", "hat", ROBOT="Pepper", PLACE="head", below=loop)
    return workspace(started(chain), touched, define("f", "greet", (), say("hello")), variables=("n",))


def program(tried: Stack) -> Program:
    before = behaviour()
    kept = copy.deepcopy(before)
    made = tried.workspace(before)
    assert before == kept
    assert made is not None
    return compile_behaviour(made, [robot()])


@pytest.mark.parametrize(
    ("tried", "says"),
    [
        (Stack("2"), ["two", "hello"]),
        (Stack("1"), ["one", "two", "hello"]),
        (Stack("3"), ["hello"]),
        (Stack("in"), ["in"]),
        (Stack("x", state=say("new") | {"id": "x"}), ["new"]),
    ],
    ids=["and all below", "the first", "a function", "inside another", "of the toolbox"],
)
def test_trial_runs_the_selected_block_and_all_blocks_below(tried: Stack, says: list[str]) -> None:
    made = tried.workspace(behaviour())
    assert made is not None
    link = play(made).link
    assert [given["text"] for _robot, _action, given in link.invoked] == says
    assert program(tried).starts == 1


def test_trial_of_event_block_runs_the_blocks_below() -> None:
    made = program(Stack("hat", "hat"))
    assert "when_touched" not in made.source
    assert "on_start" in made.source
    assert Stack("hat", "hat", started() | {"id": "hat"}).workspace(behaviour()) is None, "nothing is below"


def test_trial_program_keeps_block_ids_for_highlights_and_errors() -> None:
    assert "step('2')" in program(Stack("2")).runnable
    assert "step('1')" not in program(Stack("2")).runnable


def test_trial_of_value_block_prints_its_value() -> None:
    made = Stack("bat", "value", BATTERY).workspace(behaviour())
    assert made is not None
    assert SHOW_BLOCK_ID in compile_behaviour(made, [robot()]).runnable
    sum_ = block("values_arithmetic", "sum", A=number(2), SIGN="+", B=get("n"))
    made = Stack("sum", "value", sum_).workspace(behaviour())
    assert made is not None
    assert play(made).lines == ["2"]


def test_trial_of_deleted_block_has_no_program() -> None:
    assert Stack("nowhere").workspace(behaviour()) is None
    assert Stack("nowhere").workspace({}) is None
