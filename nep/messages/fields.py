"""Field paths: `pose.x`, `joints[3]`, `["a key"].b`; `.` is the whole message.

`FieldPathError` is the error of every conversion that checks values: typed messages, ROS messages, and files.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from nep.errors import NepError
from nep.i18n import _
from nep.text import escaped, quotable, shortened

Path = tuple[str | int, ...]
MISSING = object()
"""Value that `value_at` returns for a missing field."""

_STEP_PATTERN = re.compile(r"""\.?(?:\[(-?\d{1,19})\]|\["((?:[^"\\]|\\.)*)"\]|([^.\[\]"]+))""")
_MAX_DEPTH = 40
_PLAIN_NAME = re.compile(r"[^.\[\]\"\s]+")
_MAX_NAME_LENGTH = 100
"""Maximum length in characters of a name in an error message."""


class FieldPathError(Exception):
    """The value at a field path doesn't fit its type or its rules.

    Whoever detects the error knows only the end of the path; enclosing values add their steps with `within`.

    Args:
        reason: Continuation of a sentence that begins with the path, such as "is missing".
        path: Known end of the path: names and indexes, outermost first.

    Attributes:
        reason: Continuation of a sentence that begins with the path.
    """

    def __init__(self, reason: str, *path: str | int) -> None:
        super().__init__(reason)
        self.reason = reason
        self._steps = list(reversed(path))

    def within(self, step: str | int) -> FieldPathError:
        """Add the name or index of the value that contains the path so far; return self."""
        self._steps.append(step)
        return self

    @property
    def steps(self) -> Path:
        """Steps of the path, outermost first; empty for the whole value."""
        return tuple(reversed(self._steps))

    @property
    def path(self) -> str:
        """Path for messages, such as "pose.position.x" or "joints[3]"; "" for the whole value."""
        return "".join(
            f"[{step}]" if isinstance(step, int) else f".{escaped(shortened(step, _MAX_NAME_LENGTH))}"
            for step in reversed(self._steps)
        ).removeprefix(".")

    @property
    def message(self) -> str:
        """Path and reason as a sentence."""
        return f"{self.path or _('the value')} {self.reason}"


def wrong_type_error(value: object, expected: str) -> FieldPathError:
    """Return the error for a value of a wrong type.

    Args:
        value: Value that was found.
        expected: Description of a right value, such as "a 'float'".
    """
    return FieldPathError(
        _("is a '{kind}'; expected {wanted}").format(kind=type(value).__name__, wanted=expected)
    )


def parse_path(text: str) -> Path:
    """Parse a field path; "." is the whole value, an empty path.

    Raises `NepError` if the syntax is invalid.
    """
    if text == ".":
        return ()
    steps: list[str | int] = []
    position = 0
    while position < len(text):
        match = _STEP_PATTERN.match(text, position)
        if match is None or (text[position] != "." and text[position] != "[" and position > 0):
            raise NepError(
                _(
                    "'{text}' isn't a valid field path; use a path such as 'pose.x' or 'joints[3]', or "
                    "'.' for "
                    "the whole value"
                ).format(text=quotable(text))
            )
        index, quoted, unquoted = match.groups()
        if index is not None:
            steps.append(int(index))
        else:
            steps.append(unquoted if quoted is None else re.sub(r"\\(.)", r"\1", quoted))
        position = match.end()
    if not steps:
        raise NepError(_("a field path needs a name, such as 'pose.x'"))
    return tuple(steps)


def value_at(payload: object, path: Path) -> object:
    """Return the value at a path, or `MISSING` if the payload has no such field or index."""
    value = payload
    for step in path:
        if type(value) is dict:  # common case: isinstance checks of abstract classes take ten times as long
            value = value.get(step, MISSING)
            if value is MISSING:
                return MISSING
        elif isinstance(step, int) and isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
            if not -len(value) <= step < len(value):
                return MISSING
            value = value[step]
        elif isinstance(value, Mapping) and step in value:
            value = value[step]
        else:
            return MISSING
    return value


def path_text(path: Path) -> str:
    """Format a path; the inverse of `parse_path`."""
    return "".join(_format_step(step) for step in path).removeprefix(".") or "."


def _format_step(step: str | int) -> str:
    if isinstance(step, int):
        return f"[{step}]"
    return f".{step}" if _PLAIN_NAME.fullmatch(step) else '["' + re.sub(r'(["\\])', r"\\\1", step) + '"]'


def leaf_paths(payload: object, max_count: int = 200) -> Iterator[str]:
    """Yield the paths of at most `max_count` scalar values, of each list only those in its first 10 items.

    An empty list or map, or a value at the depth limit, counts as a scalar.
    """
    remaining = [max_count]
    yield from _leaf_paths(payload, "", remaining, _MAX_DEPTH)


def _leaf_paths(value: object, path: str, remaining: list[int], depth: int) -> Iterator[str]:
    if remaining[0] <= 0:
        return
    if depth and isinstance(value, Mapping) and value:
        for key, item in value.items():
            yield from _leaf_paths(item, path + _format_step(str(key)), remaining, depth - 1)
    elif depth and isinstance(value, Sequence) and not isinstance(value, (str, bytes)) and value:
        for number, item in enumerate(value[:10]):
            yield from _leaf_paths(item, f"{path}[{number}]", remaining, depth - 1)
    else:
        remaining[0] -= 1
        yield path.removeprefix(".") or "."
