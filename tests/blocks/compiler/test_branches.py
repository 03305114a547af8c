"""Tests of compiling *if* blocks with several branches to ``if``, ``elif`` and ``else``."""

from __future__ import annotations

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.mutators import Branches
from tests.blocks.samples import block, boolean, started, text, workspace, write


def condition(value: bool) -> dict[str, object]:
    return boolean(value)


def chosen(extra: object, kind: str = "control_if", **parts: object) -> dict[str, object]:
    made = block(kind, "if", CONDITION=condition(False), BODY=[write(text("first"))], **parts)
    return made if extra is None else made | {"extraState": extra}


def lines(made: dict[str, object]) -> list[str]:
    """Return the program's source lines, stripped, from the first ``if`` on."""
    program = compile_behaviour(workspace(started(made)), [])
    assert not program.problems
    source = program.source.splitlines()
    start = next(number for number, line in enumerate(source) if line.strip().startswith("if "))
    return [line.strip() for line in source[start:]]


def test_else_if_compiles_to_elif_and_else_comes_last() -> None:
    made = chosen(
        {"elseIfs": 2, "else": True},
        CONDITION1=condition(True),
        BODY1=[write(text("second"))],
        CONDITION2=condition(True),
        BODY2=[write(text("third"))],
        ELSE=[write(text("none"))],
    )
    found = lines(made)
    words = [
        "if ",
        "write('first')",
        "elif ",
        "write('second')",
        "elif ",
        "write('third')",
        "else:",
        "write('none')",
    ]
    assert [line[: len(word)] for line, word in zip(found, words, strict=False)] == words


@pytest.mark.parametrize(
    ("kind", "extra", "has_else"),
    [
        ("control_if", None, False),
        ("control_if", {"elseIfs": 0, "else": True}, True),
        ("control_if", {"elseIfs": "many", "else": "yes"}, False),
        ("control_if", {"elseIfs": True}, False),
        ("control_if", {"elseIfs": -3}, False),
        ("control_if_else", None, True),
        ("control_if_else", {"elseIfs": 0, "else": False}, False),
    ],
)
def test_else_branch_follows_the_saved_state_or_if_missing_or_invalid_the_block_type(
    kind: str, extra: object, has_else: bool
) -> None:
    found = lines(chosen(extra, kind, ELSE=[write(text("none"))]))
    assert ("else:" in found) is has_else
    assert not any(line.startswith("elif") for line in found)


def test_number_of_else_if_branches_is_limited() -> None:
    assert Branches.from_extra_state({"elseIfs": 10**6}, has_else=False) == Branches(20)
    empty = compile_behaviour(workspace(started(chosen({"elseIfs": 1}))), [])
    assert [each.message for each in empty.problems] == ["if needs a condition. Drag one into its slot."]
