"""Expressions for curves: a field of a topic, or a calculation with fields.

::

    /odom.pose.x          difference(/odom.speed)          mean(/odom.speed, 2 s)
    hypot(/odom.pose.x, /odom.pose.y)                      /odom.speed - 2 * /cmd_vel.linear

Fields are first replaced with names; then `ast` parses the expression. Only the operations listed in
this module are executed, on numpy arrays. The text is never executed as Python.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.core.series.field_path import FieldPath
from app.core.series.samples import Floats
from app.errors import CurveError
from nep.errors import nearest
from nep.i18n import _
from nep.system.syntax import parse_expression

MAX_LENGTH, MAX_NODES = 400, 120
MAX_WINDOW_S = 600.0
WindowFunction = Literal["difference", "derivative", "integral", "mean"]
WINDOW_FUNCTIONS: tuple[WindowFunction, ...] = ("difference", "derivative", "integral", "mean")
Calculation = Callable[[Sequence[Floats]], Floats]

FUNCTIONS: dict[str, tuple[int, Callable[..., Floats]]] = {
    "abs": (1, np.abs), "sqrt": (1, np.sqrt), "exp": (1, np.exp), "log": (1, np.log), "log10": (1, np.log10),
    "sin": (1, np.sin), "cos": (1, np.cos), "tan": (1, np.tan), "asin": (1, np.arcsin),
    "acos": (1, np.arccos), "atan": (1, np.arctan), "atan2": (2, np.arctan2), "hypot": (2, np.hypot),
    "min": (2, np.minimum), "max": (2, np.maximum), "floor": (1, np.floor), "ceil": (1, np.ceil),
    "sign": (1, np.sign), "deg": (1, np.degrees), "rad": (1, np.radians),
}  # fmt: skip
"""Number of arguments of each allowed function, by name."""
CONSTANTS = {"pi": np.pi, "e": np.e}
OPERATORS: dict[type[ast.operator], Callable[[Floats, Floats], Floats]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Mod: np.mod,
    ast.Pow: np.power,
}  # fmt: skip
_FIELD_PATTERN = re.compile(r"""(?:\.[^.\[\]"\s,()+*/%^-]+|\[-?\d+\]|\[\*\]|\["(?:[^"\\]|\\.)*"\])+""")
_UNKNOWN_TOPIC_PATTERN = re.compile(r"/[\w/]+")
_DURATION_PATTERN = re.compile(r"(\d+(?:\.\d+)?)\s*(ms|s|min)\b")
_UNIT_SECONDS = {"ms": 0.001, "s": 1.0, "min": 60.0}


@dataclass(frozen=True, slots=True)
class FieldSource:
    """Source of a curve that is a field of a topic."""

    topic: str
    path: FieldPath

    def __str__(self) -> str:
        path = str(self.path)
        return f"{self.topic}{path}" if path.startswith("[") else f"{self.topic}.{path}"


@dataclass(frozen=True, slots=True)
class WindowSource:
    """Source of a curve that is calculated from consecutive values of another source.

    Attributes:
        kind: Calculation, such as "difference" or "mean".
        source: Other source.
        window_s: Length of the window for the mean, in seconds.
    """

    kind: WindowFunction
    source: Source
    window_s: float = 0.0

    def __str__(self) -> str:
        return (
            f"mean({self.source}, {self.window_s:g} s)"
            if self.kind == "mean"
            else f"{self.kind}({self.source})"
        )


@dataclass(frozen=True, slots=True)
class ExpressionSource:
    """Source of a curve that is calculated from several sources.

    Attributes:
        text: Display name.
        inputs: Sources.
        calculate: Function that calculates the values; takes the values of `inputs` in order.
    """

    text: str
    inputs: tuple[Source, ...]
    calculate: Calculation

    def __str__(self) -> str:
        return self.text


Source = FieldSource | WindowSource | ExpressionSource


def parse_field(text: str, topics: Sequence[str]) -> FieldSource | None:
    """Parse an expression that is a single field.

    Args:
        text: Text that the user typed.
        topics: Names of the existing topics.

    Returns:
        The field; None if the text is a formula or doesn't start with an existing topic.

    Raises:
        CurveError: The text is a topic without a field, or with an invalid path.
    """
    topic = _topic_at(text, topics)
    if topic is None:
        return None
    remainder = text[len(topic) :]
    if remainder and not _FIELD_PATTERN.fullmatch(remainder):
        return None
    return FieldSource(topic, FieldPath.parse(remainder.removeprefix(".")))


def parse(text: str, topics: Sequence[str]) -> Source:
    """Parse a curve expression: a field, or a formula with fields.

    Args:
        text: Text that the user typed.
        topics: Names of the existing topics.

    Raises:
        CurveError: The expression is invalid; the message says how to fix it.
    """
    text = text.strip()
    if not text or len(text) > MAX_LENGTH:
        raise CurveError(_("enter a field, such as /odom.speed, or a formula with fields"))
    field_source = parse_field(text, topics)
    return field_source if field_source is not None else _Parser(text, topics).parse()


def _topic_at(text: str, topics: Sequence[str]) -> str | None:
    # Longest topic at the start of the text.
    matching = [name for name in topics if text.startswith(name) and _ends_at(text, len(name))]
    return max(matching, key=len, default=None)


def _ends_at(text: str, position: int) -> bool:
    return position == len(text) or not (text[position].isalnum() or text[position] in "_/")


class _Parser:
    """Parser of one expression."""

    def __init__(self, text: str, topics: Sequence[str]) -> None:
        self._text, self._topics = text, topics
        self._fields: list[FieldSource] = []

    def parse(self) -> Source:
        python = self._to_python()
        try:
            tree = parse_expression(python)
        except (SyntaxError, ValueError, MemoryError, RecursionError):
            raise CurveError(_("'{text}' isn't a valid formula").format(text=self._text[:80])) from None
        if sum(1 for _node in ast.walk(tree)) > MAX_NODES:
            raise CurveError(_("this is too complex for one curve; use several curves"))
        source = self._parse_source(tree.body)
        if source is None:
            raise CurveError(_("the formula has no field, so its value never changes"))
        return source

    def _to_python(self) -> str:
        # As Python source: a name for each field, seconds for each duration.
        parts: list[str] = []
        position, expects_value = 0, True
        while position < len(self._text):
            letter = self._text[position]
            if expects_value and (letter == "/" or _topic_at(self._text[position:], self._topics)):
                end = self._parse_field(position)
                parts.append(f"_{len(self._fields) - 1}")
                position, expects_value = end, False
                continue
            duration = _DURATION_PATTERN.match(self._text, position) if expects_value else None
            if duration is not None:
                parts.append(repr(float(duration[1]) * _UNIT_SECONDS[duration[2]]))
                position, expects_value = duration.end(), False
                continue
            previous_letter = self._text[position - 1 : position]
            # Only fields get names that begin with an underscore.
            if letter == "_" and not (previous_letter.isalnum() or previous_letter in {"_", "."}):
                raise CurveError(_("'{text}' isn't a valid formula").format(text=self._text[:80]))
            parts.append("**" if letter == "^" else letter)
            if not letter.isspace():
                expects_value = letter in "(,+-*/%^"
            position += 1
        return "".join(parts)

    def _parse_field(self, position: int) -> int:
        # Adds the field at this position; returns its end.
        remainder = self._text[position:]
        topic = _topic_at(remainder, self._topics)
        if topic is None:
            unknown_topic = _UNKNOWN_TOPIC_PATTERN.match(remainder)
            raise unknown_topic_error(
                unknown_topic[0] if unknown_topic is not None else remainder[:40], self._topics
            )
        path = _FIELD_PATTERN.match(remainder, len(topic))
        if path is None:
            raise CurveError(_("the field after {topic} is missing").format(topic=topic))
        field_source = FieldSource(topic, FieldPath.parse(path[0].removeprefix(".")))
        if field_source.path.has_wildcard:
            raise CurveError(_("a formula can't use [*]; choose one element, such as [0]"))
        self._fields.append(field_source)
        return position + path.end()

    def _parse_source(self, node: ast.expr) -> Source | None:
        # None for a number.
        if isinstance(node, ast.Name) and node.id[1:].isdigit() and node.id.startswith("_"):
            return self._fields[int(node.id[1:])]
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in WINDOW_FUNCTIONS
        ):
            return self._parse_window(node, node.func.id)
        inputs: list[Source] = []
        calculate = self._parse_calculation(node, inputs)
        return ExpressionSource(self._source_text(node), tuple(inputs), calculate) if inputs else None

    def _parse_window(self, node: ast.Call, kind: str) -> WindowSource:
        arg_count = 2 if kind == "mean" else 1
        if len(node.args) != arg_count or node.keywords:
            example = "mean(/odom.speed, 2 s)" if kind == "mean" else f"{kind}(/odom.speed)"
            raise CurveError(
                _("wrong arguments for {name}; use {example}").format(name=kind, example=example)
            )
        source = self._parse_source(node.args[0])
        if source is None:
            raise CurveError(_("the formula has no field, so its value never changes"))
        window_s = 0.0
        if kind == "mean":
            window = node.args[1]
            if isinstance(window, ast.Constant) and type(window.value) in {int, float}:
                window_s = float(window.value)  # type: ignore[arg-type]
            if not 0 < window_s <= MAX_WINDOW_S:
                raise CurveError(_("the duration of a mean must be greater than 0 and at most 600 s"))
        return WindowSource(next(each for each in WINDOW_FUNCTIONS if each == kind), source, window_s)

    def _parse_calculation(self, node: ast.expr, inputs: list[Source]) -> Calculation:
        # Adds the needed sources to `inputs`.
        if isinstance(node, ast.Constant) and type(node.value) in {int, float}:
            number = _constant(node.value)
            return lambda _arrays: number
        if isinstance(node, ast.Name) and node.id in CONSTANTS:
            constant = np.float64(CONSTANTS[node.id])
            return lambda _arrays: constant  # type: ignore[return-value]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            operand = self._parse_calculation(node.operand, inputs)
            sign = -1.0 if isinstance(node.op, ast.USub) else 1.0
            return lambda arrays: sign * operand(arrays)
        if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
            operator = OPERATORS[type(node.op)]
            left, right = (
                self._parse_calculation(node.left, inputs),
                self._parse_calculation(node.right, inputs),
            )
            return lambda arrays: operator(left(arrays), right(arrays))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS:
            return self._parse_call(node, node.func.id, inputs)
        if isinstance(node, (ast.Name, ast.Call)):
            return self._parse_input(node, inputs)
        raise CurveError(_("'{text}' can't be evaluated").format(text=self._source_text(node)[:80]))

    def _parse_call(self, node: ast.Call, name: str, inputs: list[Source]) -> Calculation:
        arg_count, function = FUNCTIONS[name]
        if len(node.args) != arg_count or node.keywords:
            raise CurveError(_("{name} needs {count} numbers").format(name=name, count=arg_count))
        arguments = [self._parse_calculation(each, inputs) for each in node.args]
        return lambda arrays: function(*(each(arrays) for each in arguments))

    def _parse_input(self, node: ast.Name | ast.Call, inputs: list[Source]) -> Calculation:
        # A field, or a function that needs more than the samples of one time.
        function_node = node.func if isinstance(node, ast.Call) else node
        name = function_node.id if isinstance(function_node, ast.Name) else self._source_text(function_node)
        is_field = isinstance(node, ast.Name) and re.fullmatch(r"_\d+", name)
        if not is_field and not (isinstance(node, ast.Call) and name in WINDOW_FUNCTIONS):
            suggestion = nearest(name, [*FUNCTIONS, *WINDOW_FUNCTIONS])
            template = _("'{name}' doesn't exist; {hint}")
            hint = (
                _("did you mean '{near}'?").format(near=suggestion)
                if suggestion
                else _("topics begin with a slash, such as /odom.speed")
            )
            raise CurveError(template.format(name=name[:40], hint=hint))
        source = self._parse_source(node)
        assert source is not None  # noqa: S101  a field, or a function of one
        if source not in inputs:
            inputs.append(source)
        index = inputs.index(source)
        return lambda arrays: arrays[index]

    def _source_text(self, node: ast.expr) -> str:
        text = ast.unparse(node).replace("**", "^")
        return re.sub(r"\b_(\d+)\b", lambda match: str(self._fields[int(match[1])]), text)


def _constant(value: object) -> Floats:
    try:
        return np.float64(value)  # type: ignore[arg-type, return-value]
    except OverflowError:
        raise CurveError(_("'{text}' can't be evaluated").format(text=str(value)[:40])) from None


def unknown_topic_error(name: str, topics: Sequence[str]) -> CurveError:
    """Return an error for an unknown topic, which suggests the existing topic with the most similar name."""
    suggestion = nearest(name, list(topics))
    if suggestion is None:
        return CurveError(_("topic {topic} doesn't exist").format(topic=name))
    return CurveError(
        _("topic {topic} doesn't exist; did you mean {near}?").format(topic=name, near=suggestion)
    )
