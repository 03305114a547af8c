"""Pieces of a program: what it may call, how its file begins and ends, a block's template and keywords."""

from __future__ import annotations

import ast
import keyword
from collections.abc import Mapping, Sequence

from app.blocks.compiler.uses import saved_value
from app.blocks.model.block import Block
from app.blocks.model.template import literal, statements
from app.blocks.model.workspace import Placed

COMMANDS = frozenset(
    {
        "add_item", "contains", "each", "fail", "insert_item", "is_known", "item", "join", "join_items",
        "length", "new_list", "newest", "on_message", "on_start", "on_true", "part", "position", "publish",
        "random_number", "remove_item", "repeat", "robot", "rounded", "rounded_down", "rounded_up", "run",
        "set_item", "split_text", "stop_program", "stop_script", "wait", "wait_until", "write",
    }
)  # fmt: skip
"""What a program may call (`app.blocks.commands`); no variable gets one of these names."""

RESERVED = COMMANDS | {"step", "value", "number", "called", "message", "_"}


def keywords(block: Block, expressions: Mapping[str, ast.expr]) -> dict[str, list[ast.keyword]]:
    """Arguments by name; a name that Python could not write goes in as ``**{"a-b": …}``."""
    made: dict[str, list[ast.keyword]] = {}
    for hole, pairs in block.keywords.items():
        plain = [ast.keyword(name, expressions[at]) for at, name in pairs if _is_plain(name)]
        odd = [(literal(name), expressions[at]) for at, name in pairs if not _is_plain(name)]
        if odd:
            table = ast.Dict([key for key, _ in odd], [value for _, value in odd])
            plain.append(ast.keyword(None, table))
        made[hole] = plain
    return made


def template(block: Block, placed: Placed, *, in_function: bool) -> str:
    """The Python template of a block as it was placed."""
    if in_function and block.python_in_function:
        return block.python_in_function
    if isinstance(block.python, str):
        return block.python
    chosen = saved_value(block, placed, block.variant or "")
    return block.python[str(chosen)]


def _is_plain(name: str) -> bool:
    """Whether Python can write this name before an equals sign."""
    return name.isidentifier() and name.isascii() and not keyword.iskeyword(name)


def imports(body: Sequence[ast.stmt]) -> list[ast.stmt]:
    """What a program file begins with."""
    names = {
        node.id for statement in body for node in ast.walk(statement) if isinstance(node, ast.Name)
    } & COMMANDS
    return statements(f"from app.blocks.commands import {', '.join(sorted({*names, 'run'}))}", {})


def ending(name: str) -> list[ast.stmt]:
    """What a program file ends with."""
    return statements("run(%NAME)", {"NAME": literal(name)})
