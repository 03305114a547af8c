"""Tests that text from a behaviour file can't become code.

Hostile strings are put into every field of every block.
"""

from __future__ import annotations

import ast
import copy

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.compiler.program_names import COMMANDS
from app.blocks.model.fields import StatementInput, ValueInput, VariableField
from app.blocks.toolbox.catalogue import Catalogue
from app.blocks.toolbox.definitions import editor_definitions
from app.errors import DescriptionError
from app.robots.description.description import parse, thing_description
from tests.blocks.samples import MODEL, block, robot, stack, started, workspace
from tests.examples import examples

CATALOGUE = Catalogue([robot()])
TYPES = sorted(CATALOGUE.blocks)

ATTACKS = (
    "');boom();('",
    '");boom();("',
    "\\",
    "\\'",
    "\n    boom()\n",
    "\r\nboom()",
    "%A",
    "%ROBOT",
    "_hole_A",
    "{boom()}",
    "__import__('os').system('boom')",
    "'''",
    '"""',
    "#",
    "\0",
    "\ud800",
    "\u2028boom()",
    "a b",
    "lambda: boom()",
    "\uff11",
    "boom",
    "*boom",
    "x=1, **boom",
)

texts = st.sampled_from(ATTACKS) | st.text(max_size=20) | st.text(st.characters(), max_size=5)
hostile = texts | st.integers() | st.floats() | st.none() | st.booleans() | st.lists(texts, max_size=2)

shapes = st.fixed_dictionaries(
    {},
    optional={
        "items": st.integers(-3, 60) | hostile,
        "function": texts,
        "name": hostile,
        "inputs": st.lists(st.fixed_dictionaries({"id": texts, "name": hostile}), max_size=3),
    },
)

OUR_NAMES = COMMANDS | {"step", "value", "number", "called", "message", "_", "__builtins__"}


@st.composite
def blocks(draw, depth: int = 0) -> dict[str, object]:
    described = CATALOGUE.blocks[draw(st.sampled_from(TYPES))]
    return filled(draw, described, depth)


def filled(draw, described, depth: int) -> dict[str, object]:
    saved: dict[str, object] = {"type": described.type, "id": draw(texts)}
    fields: dict[str, object] = {}
    inputs: dict[str, object] = {}
    for argument in described.arguments:
        if isinstance(argument, (ValueInput, StatementInput)):
            if depth < 3:
                inputs[argument.name] = {draw(st.sampled_from(["block", "shadow"])): draw(blocks(depth + 1))}
        elif isinstance(argument, VariableField):
            fields[argument.name] = draw(hostile | st.builds(lambda name: {"id": name, "name": name}, texts))
        elif argument.name == "ROBOT":
            fields[argument.name] = draw(st.just("Pepper") | hostile)
        else:
            fields[argument.name] = draw(hostile | st.just(None))
    shape = draw(hostile | shapes)
    for each in (shape.get("inputs") or []) if isinstance(shape, dict) else []:
        inputs[f"IN_{each['id']}"] = {"block": draw(blocks(3))}
    return saved | {"fields": fields, "inputs": inputs, "extraState": shape}


@settings(
    max_examples=examples(200),
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
@given(st.lists(blocks(), max_size=4), texts, st.lists(texts, max_size=3))
def test_generated_program_calls_only_known_functions(tops, name, variables):
    saved = workspace(started(*copy.deepcopy(tops)), *tops, variables=tuple(variables))
    program = compile_behaviour(saved, [robot()], name=name)
    check(program.source)
    check(program.runnable)


def check(text: str) -> None:
    """Assert that the program contains only calls of known functions, definitions and literals."""
    tree = ast.parse(text)
    made = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    functions = {node.name for node in made}
    parameters = {argument.arg for node in made for argument in node.args.args} - {"message"}
    stored = {
        node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }
    assert not (functions | stored | parameters) & OUR_NAMES - {"_"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            assert isinstance(node.func, (ast.Name, ast.Attribute))
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            assert node.id in OUR_NAMES | stored | functions | parameters, node.id
        if isinstance(node, ast.Attribute):
            assert node.attr in {"do", "ask", "get", "on", "on_change", "on_pass"}
            assert isinstance(node.value, ast.Call)
        if isinstance(node, ast.ImportFrom):
            assert node.module == "app.blocks.commands"
            assert {alias.name for alias in node.names} <= COMMANDS
        assert not isinstance(node, (ast.Import, ast.ClassDef, ast.AsyncFunctionDef, ast.Await, ast.Starred))


@settings(max_examples=examples(150), deadline=None)
@given(texts, texts, texts, texts)
def test_hostile_robot_description_is_never_executed(action, parameter, words, robot_name):
    wave = {
        "title": words,
        "input": {
            "type": "object",
            "properties": {parameter: {"title": words, "type": "string", "default": words}},
        },
        "rb:block": {
            "category": words,
            "icon": words,
            "text": {"en": f"%robot {words} %{parameter} %TEXT %ROBOT"},
        },
    }
    model = MODEL | {"actions": {action: wave, "stop": MODEL["actions"]["stop"]}}  # type: ignore[index]
    try:
        hostile_robot = parse(thing_description(model, robot_name))
    except DescriptionError:
        return
    editor_definitions([hostile_robot])
    made = Catalogue([hostile_robot]).blocks
    uses = [
        each
        for each in made.values()
        if each.robot and each.robot.kind == "action" and each.robot.name == action
    ]
    for described in uses:
        assert not described.problems()
        inputs = {
            argument.name: {"block": block("values_text", TEXT=words)}
            for argument in described.arguments
            if isinstance(argument, ValueInput)
        }
        it = block(described.type, ROBOT=robot_name) | {"inputs": inputs}
        program = compile_behaviour(workspace(stack(block("events_started"), it)), [hostile_robot])
        check(program.source)
        check(program.runnable)
        called = [node for node in ast.walk(ast.parse(program.source)) if isinstance(node, ast.Attribute)]
        assert len(called) <= 1
