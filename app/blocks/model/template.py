"""Python templates: text with ``%PLACEHOLDERS``, parsed once and filled with syntax trees.

Only Studio's block categories contain templates. Values from files are inserted as trees (`literal`), never
as text, so that no text in a file can become code.

``%NAME`` in an expression takes an expression, ``%NAME`` alone on a line takes statements, ``**%NAME`` takes
keyword arguments.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TypeVar

from nep.system.syntax import parse_expression, parse_module

_PLACEHOLDER = re.compile(r"%([A-Z][A-Z0-9_]*)")
_PLACEHOLDER_PREFIX = "_hole_"
Node = TypeVar("Node", bound=ast.AST)


def literal(value: object) -> ast.expr:
    """Return the syntax tree of a plain value (None, bool, int, float, str, and lists and dicts of them).

    Raises:
        ValueError: The value has another type or is not finite.
    """
    if isinstance(value, str) or value is None or isinstance(value, bool):
        return ast.Constant(value)
    if isinstance(value, (int, float)):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not a finite number")
        # ast.Constant(-1) would unparse to "-1 ** 2", which differs: parse its repr instead.
        return parse_expression(repr(value)).body
    if isinstance(value, (list, tuple)):
        return ast.List([literal(item) for item in value], ast.Load())
    if isinstance(value, Mapping):
        keys: list[ast.expr | None] = [literal(str(key)) for key in value]
        return ast.Dict(keys, [literal(item) for item in value.values()])
    raise ValueError(f"a {type(value).__name__} can't be part of a program")


def statements(
    text: str,
    expressions: Mapping[str, ast.expr],
    bodies: Mapping[str, Sequence[ast.stmt]] | None = None,
    keywords: Mapping[str, Sequence[ast.keyword]] | None = None,
) -> list[ast.stmt]:
    """Return the statements of a template, with all placeholders filled.

    Args:
        text: Template.
        expressions: Expressions by placeholder.
        bodies: Statements by placeholder.
        keywords: Keyword arguments by placeholder.

    Raises:
        KeyError: A placeholder has no value.
    """
    filled_statements: list[ast.stmt] = []
    filler = _PlaceholderFiller(expressions, bodies or {}, keywords or {})
    for statement in _parse_template(text).body:
        result = filler.visit(_copy_node(statement))
        filled_statements.extend(result if isinstance(result, list) else [result])
    return filled_statements


def expression(
    text: str,
    expressions: Mapping[str, ast.expr],
    keywords: Mapping[str, Sequence[ast.keyword]] | None = None,
) -> ast.expr:
    """Return the expression of a template, with all placeholders filled; arguments as for `statements`.

    Raises:
        KeyError: A placeholder has no value.
        ValueError: The template is not a single expression.
    """
    (statement,) = statements(text, expressions, None, keywords)
    if isinstance(statement, ast.Expr):
        return statement.value
    raise ValueError(f"not an expression: {text}")


def placeholders(text: str) -> frozenset[str]:
    """Return the names of the placeholders in a template."""
    return frozenset(_PLACEHOLDER.findall(text))


@lru_cache(maxsize=1024)
def _parse_template(text: str) -> ast.Module:
    return parse_module(_PLACEHOLDER.sub(_PLACEHOLDER_PREFIX + r"\1", text))


def _copy_node(node: Node) -> Node:
    fields: dict[str, object] = {}
    for name, value in ast.iter_fields(node):
        if isinstance(value, list):
            fields[name] = [_copy_node(item) if isinstance(item, ast.AST) else item for item in value]
        else:
            fields[name] = _copy_node(value) if isinstance(value, ast.AST) else value
    return type(node)(**fields)


def _placeholder_name(node: ast.AST | None) -> str | None:
    if isinstance(node, ast.Name) and node.id.startswith(_PLACEHOLDER_PREFIX):
        return node.id[len(_PLACEHOLDER_PREFIX) :]
    return None


class _PlaceholderFiller(ast.NodeTransformer):
    def __init__(
        self,
        expressions: Mapping[str, ast.expr],
        bodies: Mapping[str, Sequence[ast.stmt]],
        keywords: Mapping[str, Sequence[ast.keyword]],
    ) -> None:
        self._expressions = expressions
        self._bodies = bodies
        self._keywords = keywords

    def visit_Expr(self, node: ast.Expr) -> ast.stmt | list[ast.stmt]:
        name = _placeholder_name(node.value)
        if name is not None and name in self._bodies:
            return list(self._bodies[name]) or [ast.Pass()]
        node.value = self.visit(node.value)
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        name = _placeholder_name(node)
        if name is None:
            return node
        replacement = self._expressions[name]
        # A variable may fill several placeholders with different contexts: create one node for each.
        return ast.Name(replacement.id, node.ctx) if isinstance(replacement, ast.Name) else replacement

    def visit_Call(self, node: ast.Call) -> ast.Call:
        keywords: list[ast.keyword] = []
        for keyword in node.keywords:
            name = _placeholder_name(keyword.value)
            if keyword.arg is None and name is not None and name in self._keywords:
                keywords.extend(self._keywords[name])
            else:
                keyword.value = self.visit(keyword.value)
                keywords.append(keyword)
        node.func = self.visit(node.func)
        node.args = [self.visit(argument) for argument in node.args]
        node.keywords = keywords
        return node
