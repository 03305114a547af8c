"""Tests of the problem reported for variables that are read but never set, and of its fix."""

from __future__ import annotations

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.fixes.fixes import fix
from app.intents import AddReceiver, SetAtStart
from tests.blocks.fakes import play
from tests.blocks.samples import block, get, list_of, number, stack, started, text, workspace, write


def told(*scripts: dict[str, object], variables: tuple[str, ...] = ("scores", "n")) -> list[str]:
    return [
        problem.message
        for problem in compile_behaviour(workspace(*scripts, variables=variables), []).problems
    ]


def put(variable: str, value: object, **more: object) -> dict[str, object]:
    return block("variables_set", VAR={"id": variable}, VALUE=value, **more)


ADD = ("lists_add", {"VALUE": text("Ada"), "LIST": get("scores")})


def add() -> dict[str, object]:
    return block("lists_add", "add", VALUE=text("Ada"), LIST=get("scores"))


NEVER = "“scores” is used but never set."


def test_list_never_set_is_reported_and_fix_sets_it_at_program_start():
    saved = workspace(
        started(add(), write(get("scores"))),
        stack(block("events_message", TOPIC="/x"), add()),
        variables=("scores",),
    )
    (problem,) = compile_behaviour(saved, []).problems
    assert (problem.severity, problem.message) == ("warning", NEVER)
    assert problem.subject in problem.message
    assert problem.fix == "Set it to an empty list at the start"
    fixed = fix(saved, problem.fix_action)
    assert fixed is not None
    program = compile_behaviour(fixed, [])
    assert program.problems == ()
    first = fixed["blocks"]["blocks"][0]["next"]["block"]
    assert (first["type"], first["next"]["block"]["id"]) == ("variables_set", "add")


def test_program_with_unset_list_runs_after_the_fix():
    saved = workspace(started(add(), write(block("lists_length", LIST=get("scores")))), variables=("scores",))
    assert play(saved).runtime.error is not None
    fixed = fix(saved, compile_behaviour(saved, []).problems[0].fix_action)
    assert fixed is not None
    assert play(fixed).lines == ["1"]


def test_number_never_set_is_reported_and_fix_adds_a_start_script():
    saved = workspace(stack(block("events_message", TOPIC="/x"), write(get("n"))), variables=("n",))
    (problem,) = compile_behaviour(saved, []).problems
    assert (problem.message, problem.fix) == ("“n” is used but never set.", "Set it to 0 at the start")
    fixed = fix(saved, problem.fix_action)  # there is no start script, so the fix adds one
    assert fixed is not None
    assert compile_behaviour(fixed, []).problems == ()
    assert compile_behaviour(fixed, []).starts == 2


@pytest.mark.parametrize(
    "sets",
    [
        lambda: put("scores", list_of()),
        lambda: block("lists_each", VAR={"id": "scores"}, LIST=list_of(list_of()), BODY=[]),
        lambda: block(
            "control_count", VAR={"id": "scores"}, FIRST=number(1), LAST=number(2), STEP=number(1), BODY=[]
        ),
    ],
)
def test_variable_set_in_any_script_is_not_reported(sets):
    assert told(started(add()), stack(block("events_message", TOPIC="/x"), sets())) == []


def test_incremented_number_defaults_to_zero_but_list_must_be_set():
    change = block("variables_change", VAR={"id": "scores"}, BY=number(1))
    assert told(started(change, write(get("scores")))) == []
    assert told(started(change, add())) == [NEVER]


def test_disabled_blocks_neither_set_nor_read_variables():
    off = put("scores", list_of()) | {"disabledReasons": ["MANUALLY_DISABLED"]}
    assert told(started(off, add())) == [NEVER]
    assert told(started(add() | {"disabledReasons": ["MANUALLY_DISABLED"]})) == []


@pytest.mark.parametrize("name", ["", "👍", "x" * 300, "%VAR {x}"])
def test_unset_variable_with_any_name_is_reported(name):
    saved = workspace(started(write(get("v"))))
    saved["variables"] = [{"name": name, "id": "v"}]
    (problem,) = compile_behaviour(saved, []).problems
    assert problem.message == f"“{name or 'v'}” is used but never set."


@pytest.mark.parametrize(
    "blocks", [None, 7, {}, {"blocks": None}, {"blocks": [None, {"type": "events_started", "next": 3}]}]
)
def test_fixes_on_invalid_workspace_do_not_raise(blocks):
    assert fix({"blocks": blocks}, SetAtStart("v", is_list=True)) is not None
    assert fix({"blocks": blocks}, AddReceiver("x")) is not None
