"""Where a robot's class says what: the lines of its declarations, and names that it gives twice."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Line:
    """A line of a file, as people look it up: ``table.py, line 12``."""

    file: str
    number: int

    def __str__(self) -> str:
        """In words."""
        return f"{self.file}, line {self.number}"


def line_of(function: object) -> Line | None:
    """Where a function begins; None for what was not written in Python."""
    code = getattr(inspect.unwrap(function), "__code__", None) if callable(function) else None
    return None if code is None else Line(Path(code.co_filename).name, code.co_firstlineno)


def lines_of(body: type) -> dict[str, list[Line]]:
    """The lines at which a class gives each of its names something; empty where its source can't be read.

    What a property's setter or an overload gives again is no second name.
    """
    try:
        lines, first = inspect.getsourcelines(body)
        file = Path(inspect.getsourcefile(body) or "").name
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError, ValueError):
        return {}
    found: dict[str, list[Line]] = {}
    (declared,) = tree.body
    for statement in declared.body if isinstance(declared, ast.ClassDef) else ():
        for name in _given(statement):
            found.setdefault(name, []).append(Line(file, first + statement.lineno - 1))
    return found


def _given(statement: ast.stmt) -> Iterator[str]:
    if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef)):
        again = (_word(each) for each in statement.decorator_list)
        if not {"setter", "getter", "deleter", "overload"} & set(again):
            yield statement.name
    elif isinstance(statement, ast.Assign):
        yield from (each.id for each in statement.targets if isinstance(each, ast.Name))
    elif isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name) and statement.value:
        yield statement.target.id


def _word(decorator: ast.expr) -> str:
    if isinstance(decorator, ast.Attribute):
        return decorator.attr
    return decorator.id if isinstance(decorator, ast.Name) else ""
