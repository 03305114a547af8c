"""JSONPath queries (RFC 9535) on decoded messages, with bounded run time.

Every visited value is counted, so that an expensive query (``$..*..*..*``) stops and returns the values
found up to then. Regular expressions are disabled, because their run time can't be bounded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, overload

from app.errors import QueryError
from nep.i18n import _
from nep.messages.fields import path_text
from nep.system.lazy_import import lazy_module
from nep.text import escaped, shortened

if TYPE_CHECKING:
    import jsonpath
else:
    jsonpath = lazy_module("jsonpath")  # takes 30 ms to import, needed only for queries

MAX_LENGTH = 500
"""Maximum length of a query in characters."""
MAX_VISITED_VALUES = 50_000
"""Maximum number of visited values."""
MAX_RESULTS = 2_000
Steps = tuple[str | int, ...]


class FoundPath(str):
    """Path of a value as text.

    Attributes:
        steps: Keys and indices that lead from the message to the value.
    """

    __slots__ = ("steps",)
    steps: Steps

    @classmethod
    def from_steps(cls, steps: Steps) -> FoundPath:
        """Return the path with these steps; ``$`` for the whole message."""
        path = cls(path_text(steps) if steps else "$")
        path.steps = steps
        return path


@dataclass(frozen=True, slots=True)
class QueryResult:
    """Result of a query.

    Attributes:
        values: Found values, by path.
        incomplete_reason: Reason why the result is incomplete, or "".
    """

    values: Mapping[FoundPath, object]
    incomplete_reason: str = ""


class JsonQuery:
    """Parsed query. Usable in any thread, but not in several threads at the same time.

    Raises `QueryError` if the text isn't a valid query or is too long.
    """

    def __init__(self, text: str) -> None:
        # Raises `QueryError` with the reason and its position.
        self.text = text.strip()
        if len(self.text) > MAX_LENGTH:
            raise QueryError(_("a query can have at most {most} characters").format(most=MAX_LENGTH))
        try:
            self._path = _environment().compile(self.text)
        except jsonpath.JSONPathError as error:
            raise QueryError(_error_message(error, self.text)) from error
        except OverflowError as error:
            raise QueryError(_("a number in the query is too large")) from error
        except (RecursionError, ValueError) as error:  # brackets nested a thousand deep; numbers out of range
            raise QueryError(_("the query isn't valid")) from error

    def evaluate(
        self, value: object, max_steps: int = MAX_VISITED_VALUES, max_results: int = MAX_RESULTS
    ) -> QueryResult:
        """Run the query on a decoded message.

        Args:
            value: Decoded message.
            max_steps: Maximum number of visited values.
            max_results: Maximum number of returned values.
        """
        counter = _StepCounter(max_steps)
        counted_value = _wrap_counted(value, counter)
        results: dict[FoundPath, object] = {}
        if not isinstance(counted_value, (_CountedObject, _CountedList)):
            return QueryResult({FoundPath.from_steps(()): value} if self.text == "$" else {})
        incomplete_reason = ""
        try:
            for match in self._path.finditer(counted_value):
                if len(results) >= max_results:
                    incomplete_reason = _("Only the first {count} matches are shown.").format(
                        count=max_results
                    )
                    break
                results[FoundPath.from_steps(tuple(match.parts))] = _unwrap(match.obj)
        except _LimitReached:
            incomplete_reason = _(
                "The search stopped after {count} values. Only the matches found until then are shown."
            ).format(count=max_steps)
        except RecursionError:
            incomplete_reason = _("The message is nested too deeply for a query.")
        except jsonpath.JSONPathError as error:
            incomplete_reason = _error_message(error, self.text)
        return QueryResult(results, incomplete_reason)


@cache
def _environment() -> jsonpath.JSONPathEnvironment:
    environment = jsonpath.JSONPathEnvironment(strict=True)
    for name in ("match", "search"):
        environment.function_extensions.pop(name, None)
    return environment


def _error_message(error: jsonpath.JSONPathError, text: str) -> str:
    reason, token = escaped(str(error.message or "")), error.token
    remainder = text[token.index :] if token is not None and 0 <= token.index < len(text) else ""
    if not remainder:
        return _("the query is incomplete: {reason}").format(reason=reason)
    template = _("the query isn't valid from {rest} on: {reason}")
    return template.format(rest=escaped(shortened(remainder, 20)), reason=reason)


class _LimitReached(Exception):  # noqa: N818  not an error: it ends the search
    """Raised when the maximum number of visited values is reached."""


class _StepCounter:
    """Counter of visited values."""

    def __init__(self, max_steps: int) -> None:
        self._remaining_steps = max_steps

    def add(self, steps: int = 1) -> None:
        self._remaining_steps -= steps
        if self._remaining_steps < 0:
            raise _LimitReached


def _wrap_counted(value: object, counter: _StepCounter) -> object:
    if isinstance(value, Mapping):
        return _CountedObject(value, counter)
    if isinstance(value, (bytes, bytearray, memoryview)):
        return _WrappedBytes(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        return _CountedList(value, counter)
    return value


def _unwrap(value: object) -> object:
    # Unwraps a counted value.
    return value.raw if isinstance(value, (_CountedObject, _CountedList, _WrappedBytes)) else value


def _are_equal(one: object, other: object) -> bool:
    # JSON equality: true is not 1.
    return isinstance(one, bool) is isinstance(other, bool) and one == other


@dataclass(frozen=True, slots=True)
class _WrappedBytes:
    """Wrapper of msgpack bytes, so that they count as one value and not as an array."""

    raw: object


class _CountedObject(Mapping[str, object]):
    __slots__ = ("_counter", "raw")

    def __init__(self, raw: Mapping[object, object], counter: _StepCounter) -> None:
        self.raw, self._counter = raw, counter

    def __getitem__(self, key: str) -> object:
        self._counter.add()
        return _wrap_counted(self.raw[key], self._counter)

    def __iter__(self) -> Iterator[str]:
        for key in self.raw:
            self._counter.add()
            yield str(key)

    def items(self) -> Iterator[tuple[str, object]]:  # type: ignore[override]
        # Avoids looking up each key again, and supports numeric keys of msgpack.
        for key, value in self.raw.items():
            self._counter.add()
            yield str(key), _wrap_counted(value, self._counter)

    def __len__(self) -> int:
        return len(self.raw)

    def __eq__(self, other: object) -> bool:
        self._counter.add()
        if not isinstance(other, _CountedObject) or len(self) != len(other):
            return False
        return self.raw is other.raw or all(
            key in other.raw and _are_equal(value, other[key]) for key, value in self.items()
        )

    __hash__ = None  # type: ignore[assignment]


class _CountedList(Sequence[object]):
    __slots__ = ("_counter", "raw")

    def __init__(self, raw: Sequence[object], counter: _StepCounter) -> None:
        self.raw, self._counter = raw, counter

    @overload
    def __getitem__(self, row: int) -> object: ...

    @overload
    def __getitem__(self, row: slice) -> Sequence[object]: ...

    def __getitem__(self, row: int | slice) -> object:
        if isinstance(row, slice):
            self._counter.add(len(range(*row.indices(len(self.raw)))))
            return [_wrap_counted(value, self._counter) for value in self.raw[row]]
        self._counter.add()
        return _wrap_counted(self.raw[row], self._counter)

    def __iter__(self) -> Iterator[object]:
        for value in self.raw:
            self._counter.add()
            yield _wrap_counted(value, self._counter)

    def __len__(self) -> int:
        return len(self.raw)

    def __eq__(self, other: object) -> bool:
        self._counter.add()
        if not isinstance(other, _CountedList) or len(self) != len(other):
            return False
        return self.raw is other.raw or all(map(_are_equal, self, other))

    __hash__ = None  # type: ignore[assignment]
