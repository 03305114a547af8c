"""Rendering of a syntax tree as readable source code, and as code that reports the block being executed."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet

from app.blocks.model.template import literal
from nep.system.syntax import parse_module

BlockIdByNode = Mapping[ast.AST, str]
"""Block ids by the first syntax node of each block."""


def render_source(body: Sequence[ast.stmt], marks: BlockIdByNode) -> tuple[str, dict[int, str]]:
    """Return readable source code, and the block id for each line at which a block starts.

    Args:
        body: Statements of the program.
        marks: Block ids by node.
    """
    parts: list[str] = []
    for previous, statement in zip((None, *body[:-1]), body, strict=True):
        ast.fix_missing_locations(statement)
        parts += (_blank_lines_between(previous, statement), ast.unparse(statement).strip("\n"), "\n")
    text = "".join(parts)
    lines: dict[int, str] = {}
    for original, parsed in _matched_statements(body, parse_module(text).body):
        if original in marks:
            first = getattr(parsed, "decorator_list", None) or [parsed]
            for line in range(first[0].lineno, parsed.lineno + 1):
                lines.setdefault(line, marks[original])
    return text, lines


def render_instrumented(
    body: Sequence[ast.stmt], marks: BlockIdByNode, numbers: AbstractSet[str], calls: AbstractSet[str]
) -> str:
    """Return the source code that is executed. Modifies the syntax tree, so call `render_source` first.

    Args:
        body: Statements of the program.
        marks: Block ids by node.
        numbers: Ids of blocks that must return a number.
        calls: Ids of blocks that call a function.
    """
    instrumenter = _Instrumenter(marks, numbers, calls)
    instrumented: list[ast.stmt] = []
    for statement in body:
        instrumented += instrumenter.instrument_statement(statement)
    return ast.unparse(ast.fix_missing_locations(ast.Module(instrumented, []))) + "\n"


def _blank_lines_between(previous: ast.stmt | None, statement: ast.stmt) -> str:
    if previous is None or (isinstance(previous, ast.Assign) and isinstance(statement, ast.Assign)):
        return ""
    return "\n\n" if isinstance(previous, ast.FunctionDef) or isinstance(statement, ast.FunctionDef) else "\n"


def _matched_statements(
    originals: Sequence[ast.stmt], parsed: Sequence[ast.stmt]
) -> Iterator[tuple[ast.stmt, ast.stmt]]:
    for original, other in zip(originals, parsed, strict=True):
        yield original, other
        for name in ("body", "orelse"):
            inner = getattr(original, name, None)
            if isinstance(inner, list):
                yield from _matched_statements(inner, getattr(other, name))


class _Instrumenter(ast.NodeTransformer):
    """Transformer that inserts ``step(id)`` before blocks and at the end of loop bodies, and wraps values.

    The step at the end of a loop body highlights the loop while its condition is evaluated, and lets Stop
    interrupt an empty loop.
    """

    def __init__(self, marks: BlockIdByNode, numbers: AbstractSet[str], calls: AbstractSet[str]) -> None:
        self._block_ids = marks
        self._numbers = numbers
        self._calls = calls

    def instrument_statement(self, node: ast.stmt) -> list[ast.stmt]:
        id = self._block_ids.get(node)
        instrumented = node
        self.generic_visit(instrumented)
        for name in ("body", "orelse"):
            inner = getattr(instrumented, name, None)
            if isinstance(inner, list):
                setattr(
                    instrumented, name, [step for each in inner for step in self.instrument_statement(each)]
                )
        if id is None or isinstance(instrumented, ast.FunctionDef):
            return [instrumented]
        if isinstance(instrumented, (ast.While, ast.For)):
            instrumented.body.append(_step_call(id))
        return [_step_call(id), instrumented]

    def generic_visit(self, node: ast.AST) -> ast.AST:
        # Visits expressions only; `instrument_statement` handles nested statements.
        for name, value in ast.iter_fields(node):
            if isinstance(value, list):
                if not any(isinstance(item, ast.stmt) for item in value):
                    value[:] = [self.visit(item) if isinstance(item, ast.AST) else item for item in value]
            elif isinstance(value, ast.AST):
                setattr(node, name, self.visit(value))
        return node

    def visit(self, node: ast.AST) -> ast.AST:
        visited = self.generic_visit(node)
        id = self._block_ids.get(node)
        if id is None or not isinstance(visited, ast.expr):
            return visited
        no_parameters = ast.arguments([], [], None, [], [], None, [])
        deferred_value = ast.Lambda(no_parameters, visited)
        name = "called" if id in self._calls else "number" if id in self._numbers else "value"
        return ast.Call(ast.Name(name, ast.Load()), [literal(id), deferred_value], [])


def _step_call(id: str) -> ast.stmt:
    return ast.Expr(ast.Call(ast.Name("step", ast.Load()), [literal(id)], []))
