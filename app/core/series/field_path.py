"""Paths of values in messages, such as ``pose.x[2]`` or ``joints[*].position``.

A key that is not a plain word is written as a JSON string in brackets, as in ``people["first name"]``;
``[*]`` matches every element of an array. If a message is neither an object nor an array, the path of
its value is ``value``.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Final, Literal

from app.errors import CurveError
from nep.errors import nearest
from nep.i18n import _

WILDCARD: Final = "*"
"""Text of the step that matches every element of an array.

A key with this text is written in quotes.
"""
MAX_STEPS, MAX_EXPANDED_PATHS, MAX_FIELDS = 32, 65, 2000
MAX_LENGTH = 400
BARE_VALUE_KEY = "value"
_STEP_PATTERN = re.compile(
    r"""\.?(?P<name>[^.\[\]"\s]+)|\[(?P<index>-?\d{1,9})\]"""
    r"""|\[(?P<every>\*)\]|\[(?P<key>"(?:[^"\\]|\\.)*")\]"""
)
_PLAIN_KEY_PATTERN = re.compile(r"""[^.\[\]"\s,()+*/%^-]+\Z""")
"""Pattern of keys that can't be confused with a calculation.

The key `head-yaw`, for example, looks like a difference, so it is written as `["head-yaw"]`.
"""

FieldKind = Literal["number", "state", "list"]


class Missing:
    """Type of `MISSING`, the result of a path that has no value."""

    def __repr__(self) -> str:
        return "MISSING"


MISSING: Final = Missing()


class Wildcard:
    """Type of `ALL`, the step ``[*]``."""

    def __repr__(self) -> str:
        return "[*]"


ALL: Final = Wildcard()
Step = str | int | Wildcard


def is_list(value: object) -> bool:
    """Return True if a value is an array; strings and bytes are not arrays."""
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray, memoryview))


@dataclass(frozen=True, slots=True)
class FieldPath:
    """Path from a message to a value, as a sequence of keys, indices and `ALL`."""

    steps: tuple[Step, ...]

    @classmethod
    def parse(cls, text: str) -> FieldPath:
        """Parse the text of a path. Raises `CurveError` if the path is invalid."""
        steps: list[Step] = []
        position = 0
        while position < len(text):
            match = _STEP_PATTERN.match(text, position)
            is_bare = (
                match is not None and match["name"] is not None and bool(steps) and text[position] != "."
            )
            if match is None or is_bare or len(steps) >= MAX_STEPS or len(text) > MAX_LENGTH:
                raise CurveError(
                    _("'{path}' isn't a valid field path; use a path such as pose.x or joints[3]").format(
                        path=text[:80]
                    )
                )
            steps.append(_parse_step(match))
            position = match.end()
        if not steps:
            raise CurveError(_("the field after the topic is missing"))
        return cls(tuple(steps))

    @property
    def has_wildcard(self) -> bool:
        """True if the path contains a wildcard and so may match several values."""
        return ALL in self.steps

    def __str__(self) -> str:
        # Can be parsed again.
        text = "".join(_format_step(step) for step in self.steps)
        return text.removeprefix(".")

    def value_in(self, payload: object) -> object:
        """Return the value at the path in a decoded message; `MISSING` if there is none."""
        value = payload
        for step in self.steps:
            # `isinstance` with an ABC takes ten times as long
            if type(value) is dict or isinstance(value, Mapping):
                value = value.get(step, MISSING)
            elif isinstance(step, int) and is_list(value):
                items: Sequence[object] = value  # type: ignore[assignment]
                value = items[step] if -len(items) <= step < len(items) else MISSING
            elif self.steps == (BARE_VALUE_KEY,) and not is_list(value):
                return value
            else:
                return MISSING
        return value

    def expand(self, payload: object) -> list[FieldPath]:
        """Return the paths in which each `ALL` is replaced with the indices of the array in a message.

        A path without `ALL` is returned as the only one. At most 65 paths are returned, one more than
        the maximum number of curves in a plot, so that the caller can detect that there are too many.
        The list is empty if there is no array.
        """
        if not self.has_wildcard:
            return [self]
        index = self.steps.index(ALL)
        array = FieldPath(self.steps[:index]).value_in(payload) if index else payload
        count = min(len(array), MAX_EXPANDED_PATHS) if is_list(array) else 0  # type: ignore[arg-type]
        paths: list[FieldPath] = []
        for number in range(count):
            path = FieldPath((*self.steps[:index], number, *self.steps[index + 1 :]))
            paths += path.expand(payload)
        return paths[:MAX_EXPANDED_PATHS]


def _parse_step(match: re.Match[str]) -> Step:
    if match["name"] is not None:
        return match["name"]
    if match["index"] is not None:
        return int(match["index"])
    if match["every"] is not None:
        return ALL
    try:
        key = json.loads(match["key"])
    except ValueError:
        raise CurveError(
            _("'{path}' isn't a valid field path; use a path such as pose.x or joints[3]").format(
                path=match["key"][:80]
            )
        ) from None
    return str(key)


def _format_step(step: Step) -> str:
    if isinstance(step, Wildcard):
        return "[*]"
    if isinstance(step, int):
        return f"[{step}]"
    return f".{step}" if _PLAIN_KEY_PATTERN.match(step) else f"[{json.dumps(step, ensure_ascii=False)}]"


@dataclass(frozen=True, slots=True)
class PlottableField:
    """Value of a message that can be plotted.

    Attributes:
        path: Path of the value.
        kind: Kind of value: a number, a state (text or boolean), or an array of numbers.
        value: Value in the message.
        count: Number of curves that the value results in.
    """

    path: FieldPath
    kind: FieldKind
    value: object
    count: int = 1


def fields_of(payload: object, max_fields: int = MAX_FIELDS) -> Iterator[PlottableField]:
    """Yield the plottable values of a message, outermost first.

    The first four elements of an array are included, and ``[*]`` for all elements of an array of
    numbers.

    Args:
        payload: Decoded message.
        max_fields: Maximum number of values.
    """
    queue: list[tuple[tuple[Step, ...], object]] = [((), payload)]
    if not isinstance(payload, Mapping) and not is_list(payload):
        queue = [((BARE_VALUE_KEY,), payload)]
    yielded_count = 0
    while queue and yielded_count < max_fields:
        steps, value = queue.pop(0)
        kind = kind_of_value(value)
        if kind is not None:
            yielded_count += 1
            count = len(value) if kind == "list" else 1  # type: ignore[arg-type]
            yield PlottableField(FieldPath((*steps, ALL) if kind == "list" else steps), kind, value, count)
        if len(steps) >= MAX_STEPS or len(queue) > max_fields:
            continue
        if isinstance(value, Mapping):
            entries = ((key, nested) for key, nested in value.items() if isinstance(key, str))
            queue += [((*steps, key), nested) for key, nested in islice(entries, max_fields)]
        elif is_list(value):
            queue += [((*steps, index), nested) for index, nested in enumerate(islice(value, 4))]  # type: ignore[call-overload]


def kind_of_value(value: object) -> FieldKind | None:
    """Return the kind of a plottable value, or None if the value can't be plotted.

    Booleans and strings are a "state"; an array of numbers is a "list". Objects, bytes, null, empty
    arrays, and arrays with anything but numbers among the first 8 elements can't be plotted.
    """
    if isinstance(value, (bool, str)):
        return "state"
    if isinstance(value, (int, float)):
        return "number"
    if is_list(value):
        first_items = list(islice(value, 8))  # type: ignore[call-overload]
        are_numbers = all(
            isinstance(each, (int, float)) and not isinstance(each, bool) for each in first_items
        )
        return "list" if first_items and are_numbers else None
    return None


def complete(text: str, candidates: Sequence[str]) -> str:
    """Complete a text as far as all matching candidates agree, up to the next dot, bracket or slash.

    Returns ``text`` unchanged if no candidate starts with it.
    """
    matching = [candidate for candidate in candidates if candidate.startswith(text)]
    if not matching:
        return text
    common = matching[0]
    for candidate in matching[1:]:
        while not candidate.startswith(common):
            common = common[:-1]
    boundaries = [index for index in range(len(text) + 1, len(common)) if common[index] in ".[/"]
    return common[: boundaries[0] + 1] if boundaries else common


def nearest_field(path: FieldPath, payload: object) -> str | None:
    """Return the path in a message that is most similar to ``path``; None if no path is similar."""
    return nearest(str(path), [str(each.path) for each in fields_of(payload)])
