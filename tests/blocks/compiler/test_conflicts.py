"""Tests of the check for scripts that use the same robot part at the same time, and of its fix."""

from __future__ import annotations

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.fixes.fixes import fix
from app.blocks.model.program import Problem
from app.intents import JoinScripts
from tests.blocks.fighting import fighter, home, look, turn
from tests.blocks.samples import block, boolean, call, define, number, say, started, workspace

Saved = dict[str, object]


def conflicts(*scripts: Saved, robots: tuple[str, ...] = ("Pepper",)) -> list[Problem]:
    found = compile_behaviour(
        workspace(*scripts, variables=("n",)), [fighter(name) for name in robots]
    ).problems
    return [problem for problem in found if problem.severity == "warning"]


def wait() -> Saved:
    return block("control_wait", SECONDS=number(5))


def forever(*body: Saved) -> Saved:
    return block("control_forever", BODY=list(body))


def when(*body: Saved) -> Saved:
    return block("control_if", CONDITION=boolean(True), BODY=list(body))


def test_two_started_scripts_that_move_the_base_conflict() -> None:
    (problem,) = conflicts(started(turn("t")), started(home("h")))
    assert (problem.block_id, problem.subject, problem.fix) == ("h", "go home", "Run one after the other")
    assert problem.message == (
        "“turn” and “go home” both move Pepper at the same time: one replaces the other."
    )


def test_conflict_message_names_the_shared_robot_part() -> None:
    (problem,) = conflicts(started(look("a")), started(look("b")))
    assert "“look” both use the face of Pepper" in problem.message


def set_variable() -> Saved:
    return block("variables_set", VAR={"id": "n"}, VALUE=number(0))


@pytest.mark.parametrize(
    "scripts",
    [
        (lambda: started(forever(turn("a"))), lambda: started(turn("b"))),
        (lambda: started(forever(turn("a"))), lambda: started(wait(), home("b"))),
        (lambda: started(wait(), forever(turn("a"))), lambda: started(forever(say("x"), turn("b")))),
        (lambda: started(set_variable(), turn("a")), lambda: started(turn("b"))),
        (
            lambda: started(block("control_repeat", TIMES=number(3), BODY=[turn("a")])),
            lambda: started(home("b")),
        ),
    ],
    ids=["for ever and once", "for ever and later", "both for ever", "after what takes no time", "in a loop"],
)
def test_simultaneous_commands_are_a_conflict(scripts) -> None:
    assert len(conflicts(*(make() for make in scripts))) == 1


@pytest.mark.parametrize(
    "scripts",
    [
        (lambda: started(turn("a"), home("b")),),
        (lambda: started(turn("a")), lambda: started(say("x"))),
        (lambda: started(turn("a")), lambda: started(look("b"))),
        (lambda: started(say("x")), lambda: started(say("y"))),
        (lambda: started(turn("a")), lambda: started(turn("b", "Other"))),
        (lambda: started(turn("a")), lambda: started(wait(), turn("b"))),
        (lambda: started(turn("a")), lambda: started(say("x"), turn("b"))),
        (lambda: started(forever(when(turn("a")))), lambda: started(turn("b"))),
        (lambda: started(forever(turn("a"))),
         lambda: started(block("control_wait_until", CONDITION=boolean(True)), turn("b"))),
        (lambda: started(turn("a")), lambda: turn("b") | {"x": 1, "y": 1}),
        (lambda: started(turn("a")), lambda: started(turn("b") | {"enabled": False})),
        (lambda: started(turn("a")),
         lambda: block("robot_pepper_when_touched", ROBOT="Pepper", PLACE="head", below=turn("b"))),
    ],
    ids=["one script", "speech", "another part", "queued", "another robot", "after a wait", "later",
         "perhaps", "after a condition", "not started", "switched off", "of an event"],
)  # fmt: skip
def test_scripts_without_overlap_do_not_conflict(scripts) -> None:
    found = conflicts(*(make() for make in scripts), robots=("Pepper", "Other"))
    assert [each for each in found if "same time" in each.message] == []


def test_conflict_inside_called_function_is_found() -> None:
    moves = define("f", "dance", (), turn("in f"))
    (problem,) = conflicts(moves, started(call("f")), started(home("h")))
    assert problem.block_id == "h"
    assert "“turn” and “go home”" in problem.message


def test_conflict_in_recursive_function_is_reported_once() -> None:
    moves = define("f", "dance", (), turn("in f"), call("f"))
    assert len(conflicts(moves, started(call("f")), started(home("h")))) == 1


def ids(saved: object) -> list[str]:
    """Return the IDs of a script's blocks from top to bottom."""
    found: list[str] = []
    while isinstance(saved, dict):
        found.append(str(saved["id"]))
        below = saved.get("next")
        saved = below.get("block") if isinstance(below, dict) else None
    return found


def fixed(*scripts: Saved) -> list[list[str]]:
    (problem,) = conflicts(*scripts)
    assert problem.fix_action is not None
    made = fix(workspace(*scripts), problem.fix_action)
    assert made is not None
    tops = made["blocks"]
    assert isinstance(tops, dict)
    return [ids(top) for top in tops["blocks"]]


def named(script: Saved, id: str) -> Saved:
    return {**script, "id": id}


def test_conflict_fix_appends_second_script_to_the_first() -> None:
    first, second = named(started(turn("a"), say("x") | {"id": "x"}), "s1"), named(started(home("b")), "s2")
    assert fixed(first, second) == [["s1", "a", "x", "b"]]
    assert conflicts(named(started(turn("a"), home("b")), "s1")) == []


def test_conflict_fix_handles_event_block_ids_with_colons() -> None:
    first, second = named(started(turn("a")), ":s:1"), named(started(home("b")), "s::2:")
    assert fixed(first, second) == [[":s:1", "a", "b"]]


def test_conflict_fix_does_not_append_below_forever_loop() -> None:
    first, second = named(started(forever(turn("a")) | {"id": "e"}), "s1"), named(started(home("b")), "s2")
    assert fixed(first, second) == [["s2", "b", "e"]]
    (problem,) = conflicts(started(forever(turn("a"))), started(forever(turn("b"))))
    assert (problem.fix, problem.fix_action) == (None, None)


def test_conflict_fix_for_missing_script_does_nothing() -> None:
    assert fix(workspace(named(started(turn("a")), "s1")), JoinScripts("s2", "s1")) is None
    assert fix(workspace(named(started(turn("a")), "s1")), JoinScripts("s1", "s1")) is None
