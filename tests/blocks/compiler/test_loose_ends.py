"""Variables that are read and never set, and the button that sets them."""

from __future__ import annotations

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.fixes.fixes import mend
from tests.blocks.fakes import play
from tests.blocks.samples import block, get, list_of, number, stack, started, text, workspace, write


def told(*scripts: dict[str, object], variables: tuple[str, ...] = ("scores", "n")) -> list[str]:
    return [
        problem.sentence
        for problem in compile_behaviour(workspace(*scripts, variables=variables), []).problems
    ]


def put(variable: str, value: object, **more: object) -> dict[str, object]:
    return block("variables_set", VAR={"id": variable}, VALUE=value, **more)


ADD = ("lists_add", {"VALUE": text("Ada"), "LIST": get("scores")})


def add() -> dict[str, object]:
    return block("lists_add", "add", VALUE=text("Ada"), LIST=get("scores"))


NEVER = "“scores” is used but never set."


def test_a_list_that_is_never_set_is_named_and_the_button_sets_it_where_the_behaviour_starts():
    saved = workspace(
        started(add(), write(get("scores"))),
        stack(block("events_message", TOPIC="/x"), add()),
        variables=("scores",),
    )
    (problem,) = compile_behaviour(saved, []).problems
    assert (problem.severity, problem.sentence) == ("warning", NEVER)
    assert problem.subject in problem.sentence
    assert problem.mend == "Set it to an empty list at the start"
    mended = mend(saved, problem.mend_action or "")
    assert mended is not None
    program = compile_behaviour(mended, [])
    assert program.problems == ()
    first = mended["blocks"]["blocks"][0]["next"]["block"]
    assert (first["type"], first["next"]["block"]["id"]) == ("variables_set", "add")


def test_the_mended_program_runs():
    saved = workspace(started(add(), write(block("lists_length", LIST=get("scores")))), variables=("scores",))
    assert play(saved).runtime.error is not None
    mended = mend(saved, compile_behaviour(saved, []).problems[0].mend_action or "")
    assert mended is not None
    assert play(mended).lines == ["1"]


def test_a_number_that_is_never_set():
    saved = workspace(stack(block("events_message", TOPIC="/x"), write(get("n"))), variables=("n",))
    (problem,) = compile_behaviour(saved, []).problems
    assert (problem.sentence, problem.mend) == ("“n” is used but never set.", "Set it to 0 at the start")
    mended = mend(saved, problem.mend_action or "")  # nothing is started yet: it gets a script of its own
    assert mended is not None
    assert compile_behaviour(mended, []).problems == ()
    assert compile_behaviour(mended, []).starts == 2


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
def test_whatever_sets_it_wherever_is_enough(sets):
    assert told(started(add()), stack(block("events_message", TOPIC="/x"), sets())) == []


def test_a_number_that_is_counted_up_begins_with_0_but_a_list_does_not():
    change = block("variables_change", VAR={"id": "scores"}, BY=number(1))
    assert told(started(change, write(get("scores")))) == []
    assert told(started(change, add())) == [NEVER]


def test_what_does_not_run_neither_sets_nor_reads():
    off = put("scores", list_of()) | {"disabledReasons": ["MANUALLY_DISABLED"]}
    assert told(started(off, add())) == [NEVER]
    assert told(started(add() | {"disabledReasons": ["MANUALLY_DISABLED"]})) == []


@pytest.mark.parametrize("name", ["", "👍", "x" * 300, "%VAR {x}"])
def test_any_name(name):
    saved = workspace(started(write(get("v"))))
    saved["variables"] = [{"name": name, "id": "v"}]
    (problem,) = compile_behaviour(saved, []).problems
    assert problem.sentence == f"“{name or 'v'}” is used but never set."


@pytest.mark.parametrize(
    "blocks", [None, 7, {}, {"blocks": None}, {"blocks": [None, {"type": "events_started", "next": 3}]}]
)
def test_nothing_raises_for_what_is_no_workspace(blocks):
    assert mend({"blocks": blocks}, "begin:list:v") is not None
    assert mend({"blocks": blocks}, "receive:x") is not None
