"""Tests of user-defined functions: names, inputs, results, recursion depth and stopping."""

from __future__ import annotations

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.fixes.fixes import fix
from tests.blocks.fakes import Play, play, until
from tests.blocks.samples import (
    block,
    boolean,
    call,
    define,
    get,
    given,
    number,
    robot,
    say,
    started,
    text,
    workspace,
    write,
)


def minus_one(value: dict[str, object]) -> dict[str, object]:
    return block("values_arithmetic", A=value, SIGN="-", B=number(1))


def times(a: dict[str, object], b: dict[str, object]) -> dict[str, object]:
    return block("values_arithmetic", A=a, SIGN="*", B=b)


def below(a: dict[str, object], b: int) -> dict[str, object]:
    return block("values_compare", A=a, RELATION="<", B=number(b))


FACTORIAL = define(
    "f", "factorial", ("n",),
    block("functions_return_if", CONDITION=below(given("n"), 2), VALUE=number(1)),
    result=times(given("n"), call("f", value=True, n=minus_one(given("n")))),
)  # fmt: skip


def test_function_with_inputs_returns_its_result() -> None:
    run = play(workspace(started(write(call("f", value=True, n=number(6)))), FACTORIAL))
    assert run.lines == ["720"]
    assert run.program.source.startswith(
        "from app.blocks.commands import on_start, run, write\n\n\ndef factorial(n):"
    )
    assert "    return n * factorial(n - 1)\n" in run.program.source
    assert "write(factorial(6))" in run.program.source
    assert not run.program.problems


def test_inputs_are_local_to_call_and_variables_are_global() -> None:
    greet = define(
        "g", "greet", ("who",),
        block("variables_change", VAR={"id": "count"}, BY=number(1)),
        write(given("who")),
    )  # fmt: skip
    run = play(
        workspace(
            started(
                call("g", who=text("Ada")), call("g", who=text("Bob")), write(get("count")), write(get("who"))
            ),
            greet,
            variables=("count", "who"),
        )
    )
    assert run.lines == ["Ada", "Bob", "2", "0"]


def test_infinite_recursion_is_stopped_with_explanation() -> None:
    loop = define("g", "loop", (), call("g", id="inner"))
    run = play(workspace(started(call("g", id="outer")), loop))
    error = run.runtime.error
    assert error is not None
    assert error.sentence == "“loop” calls itself more than 200 times."
    assert error.block == "inner"


def test_recursion_depth_of_200_works_with_long_arithmetic() -> None:
    deep = call("f", value=True, n=number(199))
    run = play(
        workspace(started(write(block("lists_length", LIST=block("lists_empty"))), write(deep)), FACTORIAL)
    )
    assert run.runtime.error is None
    assert run.lines[1].startswith("3943")


def test_error_in_function_names_its_block_and_returned_value_can_be_joined_to_text() -> None:
    bad = define("g", "bad", (), write(block("values_arithmetic", "sum", A=number(1), SIGN="/", B=number(0))))
    assert play(workspace(started(call("g")), bad)).runtime.error.block == "sum"
    five = define("g", "five", (), write(text("in")), result=number(5))
    run = play(workspace(started(block("control_wait", "w", SECONDS=call("g", value=True)) | {
        "type": "robot_pepper_do_say", "fields": {"ROBOT": "Pepper"},
        "inputs": {"TEXT": {"block": block("values_join", "j", A=call("g", value=True), B=boolean(True))}},
    }), five))  # fmt: skip
    assert run.runtime.error is None
    assert run.link.invoked[-1] == ("Pepper", "say", {"text": "5yes"})


def test_error_after_function_returns_names_calling_block() -> None:
    five = define("g", "five", (), write(text("in")), result=text("not a number"))
    run = play(workspace(started(block("control_wait", "w", SECONDS=call("g", value=True))), five))
    assert run.runtime.error is not None
    assert run.runtime.error.block == "w"
    assert run.runtime.error.sentence == "“wait” needs a number, not a text."


def test_pause_and_step_enter_function() -> None:
    greet = define("g", "greet", (), write(text("one")), write(text("two")))
    program = compile_behaviour(workspace(started(call("g", id="c"), write(text("three"))), greet), [])
    run = Play(program).start(paused=True)
    scheduler = run.runtime.scheduler
    seen, passed = [], []
    for _ in range(4):
        until(
            lambda: scheduler.snapshot().is_paused and scheduler.snapshot().next_block not in (None, *passed)
        )
        passed.append(scheduler.snapshot().next_block)
        seen.append((scheduler.snapshot().next_block == "c", len(run.lines)))
        scheduler.step_once()
    run.end()
    assert seen == [(True, 0), (False, 0), (False, 1), (False, 2)]
    assert run.lines == ["one", "two", "three"]


def test_stop_script_in_function_ends_the_script() -> None:
    leave = define("g", "leave", (), block("control_stop_script"))
    run = play(workspace(started(call("g"), write(text("not"))), started(write(text("other"))), leave))
    assert run.lines == ["other"]
    assert run.runtime.error is None


def test_early_return_continues_after_the_call() -> None:
    maybe = define(
        "g", "maybe", ("so",), block("functions_leave_if", CONDITION=given("so")), write(text("in"))
    )
    run = play(
        workspace(
            started(call("g", so=boolean(True)), call("g", so=boolean(False)), write(text("after"))), maybe
        )
    )
    assert run.lines == ["in", "after"]


def test_function_can_be_used_as_condition() -> None:
    ready = define("g", "ready", (), result=boolean(True))
    run = play(
        workspace(
            started(block("control_wait_until", CONDITION=call("g", value=True)), write(text("done"))), ready
        )
    )
    assert run.lines == ["done"]


def test_robots_used_in_functions_are_found() -> None:
    greet = define("g", "greet", (), say("Hello"))
    program = compile_behaviour(workspace(started(call("g")), greet), [robot()])
    assert program.robots == ("Pepper",)


def test_call_resolves_function_by_id_then_by_name() -> None:
    renamed = define("g", "say hello", ("who",), write(given("who")))
    assert play(workspace(started(call("g", who=text("Ada"))), renamed)).lines == ["Ada"]
    pasted = call("elsewhere", who=text("Bob"))
    pasted["extraState"]["name"] = "say hello"  # type: ignore[index]
    assert play(workspace(started(pasted), renamed)).lines == ["Bob"]


def test_call_of_missing_function_is_an_error_with_fix() -> None:
    saved = workspace(started(call("greet", id="c", who=text("Ada"))))
    run = play(saved)
    (problem,) = run.program.errors
    sentence = "The function “greet” is missing. Define it, or delete this block."
    assert (problem.message, problem.block_id, problem.fix) == (sentence, "c", "Define the function")
    assert run.runtime.error is not None
    assert (run.runtime.error.sentence, run.runtime.error.block) == (sentence, "c")
    fixed = fix(saved, problem.fix_action)
    assert fixed is not None
    again = compile_behaviour(fixed, [])
    assert not again.problems
    assert "def greet(who):\n    pass" in again.source


def test_inputs_and_returns_outside_their_function_are_skipped_and_reported() -> None:
    program = compile_behaviour(
        workspace(
            started(
                write(given("who")),
                block("functions_return_if", CONDITION=boolean(True), VALUE=number(1)),
                block("functions_leave_if", CONDITION=boolean(True)),
                write(text("after")),
            ),
            define("g", "greet", ("who",), write(given("who"))),
        ),
        [],
    )
    sentences = [problem.message for problem in program.problems]
    assert "“who” only works inside its own function. It stays in the file but is skipped." in sentences
    assert (
        sum(
            sentence.endswith("can't be used here. It stays in the file but is skipped.")
            for sentence in sentences
        )
        == 2
    )
    assert "write('after')" in program.source


@pytest.mark.parametrize(
    "extra",
    [
        None, 7, [], {}, {"inputs": 7}, {"inputs": [7, {}, {"id": 3}, {"id": "a"}, {"id": "a", "name": 5}]},
        {"inputs": [{"id": str(n), "name": "x" * 999} for n in range(99)], "function": [], "name": {}},
        {"items": -5}, {"items": 10**12}, {"items": True}, {"items": "3"},
    ],
)  # fmt: skip
def test_blocks_with_arbitrary_extra_state_compile(extra) -> None:
    tops = []
    for each in ("functions_define", "functions_define_result", "functions_call", "lists_create"):
        tops.append(block(each, NAME="x") | {"extraState": extra})
        tops.append(started(block(each) | {"extraState": extra}))
        tops.append(started(write(block(each) | {"extraState": extra})))
        tops.append(started(write(block("functions_result") | {"extraState": extra})))
    program = compile_behaviour(workspace(*tops), [])
    compile(program.source, "", "exec")
    compile(program.runnable, "", "exec")
