"""Filter expressions of `nep topic echo --filter`, such as `pose.x > 1.5 and state == "moving"`.

The syntax is a subset of Python for comparisons of fields. Expressions are parsed with `ast` and never
evaluated as Python. Fields are written as for `nep topic echo`; `m` is the whole message.
"""

from __future__ import annotations

import ast
import itertools
import operator
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from nep.errors import NepError
from nep.i18n import _
from nep.messages.fields import MISSING, Path, value_at
from nep.system.syntax import parse_expression
from nep.text import quotable

_MAX_LENGTH = 1_000
_EXAMPLE = 'pose.x > 1.5 and state == "moving"'
_CONSTANTS: Mapping[str, object] = {"true": True, "false": False, "null": None}
_Term = Callable[[object], object]
_Test = Callable[[Any, Any], object]


class _UnsupportedError(Exception):
    def __init__(self, node: ast.AST) -> None:
        self.node = node
        super().__init__()


class MessageFilter:
    """Condition on payloads. Comparisons with a missing field or a value of another type are false."""

    def __init__(self, text: str) -> None:
        # Raises `NepError` naming the part that is not supported.
        if len(text) > _MAX_LENGTH:
            raise NepError(_("a filter can have at most {count} characters").format(count=_MAX_LENGTH))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Python's SyntaxWarnings about odd comparisons
                tree = parse_expression(text.strip())
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            message = _("'{text}' isn't a valid filter; use a condition such as '{example}'")
            raise NepError(message.format(text=quotable(text), example=_EXAMPLE)) from error
        try:
            self._term = _parse_condition(tree.body)
        except _UnsupportedError as error:
            part = ast.get_source_segment(text.strip(), error.node) or text
            message = _("a filter can't use '{part}'; it compares fields with values, like '{example}'")
            raise NepError(message.format(part=quotable(part), example=_EXAMPLE)) from error

    def matches(self, payload: object) -> bool:
        """Return True if a payload fulfils the condition."""
        return _is_true(self._term(payload))


def _is_true(value: object) -> bool:
    return value is not MISSING and bool(value)


def _parse_condition(node: ast.expr) -> _Term:
    match node:
        case ast.BoolOp(op=ast.And(), values=values):
            parts = [_parse_condition(each) for each in values]
            return lambda payload: all(_is_true(part(payload)) for part in parts)
        case ast.BoolOp(values=values):
            parts = [_parse_condition(each) for each in values]
            return lambda payload: any(_is_true(part(payload)) for part in parts)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            negated_term = _parse_condition(operand)
            return lambda payload: not _is_true(negated_term(payload))
        case ast.Compare(left=left, ops=ops, comparators=right):
            tests = [_OPERATORS.get(type(op)) for op in ops]
            operators = [test for test in tests if test is not None]
            if len(operators) < len(tests):
                raise _UnsupportedError(node)
            return _create_comparison([_parse_term(each) for each in (left, *right)], operators)
        case _:
            return _parse_term(node)


def _create_comparison(terms: Sequence[_Term], tests: Sequence[_Test]) -> _Term:
    def holds(payload: object) -> bool:
        values = [term(payload) for term in terms]
        if any(value is MISSING for value in values):
            return False
        try:
            return all(test(*pair) for test, pair in zip(tests, itertools.pairwise(values), strict=True))
        except TypeError:
            return False

    return holds


def _is_contained(item: object, container: Any) -> bool:  # noqa: ANN401 - a TypeError means false
    return item in container


_OPERATORS: Mapping[type[ast.cmpop], _Test] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: _is_contained,
    ast.NotIn: lambda item, container: not _is_contained(item, container),
}


def _parse_term(node: ast.expr) -> _Term:
    match node:
        case ast.Constant(value=str() | int() | float() | None) | ast.UnaryOp(op=ast.USub()):
            constant = _parse_constant(node)
            return lambda _payload: constant
        case ast.Name(id=name) if name in _CONSTANTS:
            constant = _CONSTANTS[name]
            return lambda _payload: constant
        case ast.List(elts=elements) | ast.Tuple(elts=elements):
            constants = [_parse_constant(each) for each in elements]
            return lambda _payload: constants
        case _:
            path = _parse_field_path(node)
            return lambda payload: value_at(payload, path)


def _parse_constant(node: ast.expr) -> object:
    match node:
        case ast.Constant(value=str() | int() | float() | None):
            return node.value
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float() as number)):
            return -number
        case ast.Name(id=name) if name in _CONSTANTS:
            return _CONSTANTS[name]
        case _:
            raise _UnsupportedError(node)


def _parse_field_path(node: ast.expr) -> Path:
    match node:
        case ast.Name(id="m"):
            return ()
        case ast.Name(id=name):
            return (name,)
        case ast.Attribute(value=ast.List(elts=[ast.Constant(value=str() as key)]), attr=name):
            return (key, name)
        case ast.Attribute(value=value, attr=name):
            return (*_parse_field_path(value), name)
        case ast.Subscript(value=ast.List(elts=[ast.Constant(value=str() as key)]), slice=step):
            return (key, _parse_step(step))
        case ast.Subscript(value=value, slice=step):
            return (*_parse_field_path(value), _parse_step(step))
        case _:
            raise _UnsupportedError(node)


def _parse_step(node: ast.expr) -> str | int:
    step = _parse_constant(node)
    if isinstance(step, str) or (isinstance(step, int) and not isinstance(step, bool)):
        return step
    raise _UnsupportedError(node)
