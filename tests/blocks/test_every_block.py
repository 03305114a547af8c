"""Tests that every block compiles, that its Python code runs, and that every description is valid."""

from __future__ import annotations

import ast

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.compiler.program_names import COMMANDS
from app.blocks.model.fields import StatementInput, ValueInput
from app.blocks.runtime.questions import ProgramQuestion
from app.blocks.toolbox.catalogue import Catalogue, categories
from tests.blocks.fakes import FakeLink, Play, until
from tests.blocks.samples import (
    block,
    boolean,
    call,
    define,
    given,
    list_of,
    number,
    robot,
    stack,
    started,
    text,
    workspace,
    write,
)

CATALOGUE = Catalogue([robot()])
ALL = sorted(CATALOGUE.blocks.values(), key=lambda each: each.type)


def made_by_hand(described) -> dict[str, object] | None:
    """Return the workspace of a block that needs a function, or None for all other blocks."""
    greet = define("greet", "greet", ("who",), write(given("who")))
    double = define("double", "double", ("number",), result=given("number"))
    end = block("control_stop_program")
    made: dict[str, tuple[dict[str, object], ...]] = {
        "functions_define": (define("it", "greet", ("who",), write(given("who"))),),
        "functions_define_result": (define("it", "double", (), result=number(2)),),
        "functions_call": (greet, started(call("greet", id="it", who=text("Ada")), end)),
        "functions_result": (
            double,
            started(write(call("double", value=True, id="it", number=number(2))), end),
        ),
        "functions_input": (
            define("greet", "greet", ("who",), write(block("functions_input", "it", INPUT="i who"))),
            started(call("greet", who=text("Ada")), end),
        ),
        "functions_return_if": (
            define(
                "double", "double", (),
                block("functions_return_if", "it", CONDITION=boolean(True), VALUE=number(3)),
                result=number(2),
            ),
            started(write(call("double", value=True)), end),
        ),
        "functions_leave_if": (
            define("greet", "greet", (), block("functions_leave_if", "it", CONDITION=boolean(True))),
            started(call("greet"), end),
        ),
    }  # fmt: skip
    tops = made.get(described.type)
    if tops is None:
        return None
    return workspace(*tops) if len(tops) == 2 else workspace(*tops, started(end))


def filled(described) -> dict[str, object]:
    """Return the block with a value in each slot."""
    parts: dict[str, object] = {}
    for argument in described.arguments:
        if isinstance(argument, ValueInput):
            default = argument.default
            if described.type == "lists_total":
                parts[argument.name] = list_of(number(1), number(4))
            elif argument.check == "List" or argument.variable:
                parts[argument.name] = list_of(text("a"), text("b"))
            elif argument.check == "Boolean":
                parts[argument.name] = boolean(False)
            else:
                parts[argument.name] = text(default) if isinstance(default, str) else number(default or 1)
        elif isinstance(argument, StatementInput):
            parts[argument.name] = [write(text("inside"))]
    parts |= own(described)
    if described.type == "lists_create":
        return list_of(text("a")) | {"id": "it"}
    return block(described.type, "it", **parts)


def own(described) -> dict[str, object]:
    """Return the field values that some blocks require."""
    parts: dict[str, object] = {}
    if described.argument("ROBOT"):
        parts["ROBOT"] = "Pepper"
    if described.argument("VAR"):
        parts["VAR"] = {"id": "score"}
    if described.type.startswith(("events_broadcast", "events_received")):
        parts["NAME"] = "go"
    if described.argument("SECONDS"):
        parts["SECONDS"] = number(0.05)
    if described.type == "robot_pepper_do_listen":
        parts["WORDS"] = text("yes, no")
    return parts


def around(described) -> dict[str, object]:
    """Return a workspace with the block in a script that ends without intervention."""
    by_hand = made_by_hand(described)
    if by_hand is not None:
        return by_hand
    it = filled(described)
    if described.shape == "hat":
        return workspace(stack(it, write(text("ran"))), started(), variables=("score",))
    if described.shape in ("value", "boolean"):
        it = write(it)
    if described.needs_message:
        return workspace(stack(block("events_message", TOPIC="/x"), it), variables=("score",))
    end = [] if described.shape == "cap" else [block("control_stop_program")]
    begin = block("variables_set", VAR={"id": "score"}, VALUE=number(0))
    go = stack(block("events_received", NAME="go"), write(text("received")))
    return workspace(started(begin, it, *end), go, variables=("score",))


def link() -> FakeLink:
    made = FakeLink()
    made.sensors = {
        ("Pepper", "battery"): 80,
        ("Pepper", "distance"): 1.5,
        ("Pepper", "sees_face"): True,
        ("Pepper", "pose"): {"x": 1.0, "y": 2.0},
    }
    made.topics = {"/faces": {"name": "Ada"}}
    made.answers = {"listen": ("succeeded", {"word": "yes"}, "")}
    return made


def yes(question: ProgramQuestion | None) -> None:
    """Answer every question with yes."""
    if question is not None:
        question.answer = "yes"


@pytest.mark.parametrize("described", ALL, ids=lambda each: each.type)
def test_every_block_compiles_and_its_python_runs(described):
    pepper = robot()
    program = compile_behaviour(around(described), [pepper])
    assert not [problem for problem in program.problems if problem.severity != "info"]
    ast.parse(program.source)
    assert "it" in program.readings
    run = Play(program, (pepper,), link(), asked=yes).start()
    endless = ("control_forever", "control_wait_until", "control_while")
    if described.type in endless or (described.shape == "hat" and described.type != "events_started"):
        run.stop()
    elif described.needs_message:
        run.link.happen("/x", {"name": "Ada"})
        until(lambda: bool(run.lines))
        run.stop()
    run.end()
    assert run.runtime.error is None


def test_block_descriptions_are_valid():
    assert not [problem for described in ALL for problem in described.problems()]
    assert {category.name for category in categories()} >= {
        "events",
        "control",
        "logic",
        "numbers",
        "texts",
        "sensing",
        "asking",
        "variables",
        "lists",
        "functions",
        "messages",
        "robot",
    }
    names = (*(category.name for category in categories()), "values")
    for category in categories():
        assert all(described.type.partition("_")[0] in names for described in category.blocks)
        assert {described.type for described in category.blocks} >= set(category.headings)
        assert all(described.tooltip.endswith(".") for described in category.blocks)


def test_module_imported_by_exported_programs_defines_every_command():
    import app.blocks.commands as commands

    assert set(commands.__all__) == COMMANDS
    assert all(callable(getattr(commands, name)) for name in COMMANDS)
