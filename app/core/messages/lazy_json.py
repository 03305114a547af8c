"""Large JSON texts that are decoded only where a value is accessed.

A text of 10 MB is scanned once for brackets, commas and colons (with numpy, which releases the GIL).
Objects and arrays are then represented by `LazyObject` and `LazyList`, whose values are decoded at each
access. Decoding the whole text at once would block all threads of the program for a tenth of a second.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, overload

import orjson

from nep.i18n import _

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Positions = NDArray[np.int64]

CHUNK_BYTES = 1 << 20
MAX_DEPTH = 1000
MIN_CACHED_SEPARATORS = 256
"""Number of separators of an object or array above which their positions are cached."""
MAX_CACHED_CONTAINERS = 1000
"""Maximum number of objects and arrays that are cached."""
OPEN, CLOSE = b"{[", b"}]"
QUOTE, BACKSLASH, COMMA, COLON = b'"\\,:'
WHITESPACE = b" \t\r\n"


class UnreadableValue:
    """Placeholder for a value whose text is not valid JSON."""

    def __init__(self, text: bytes) -> None:
        self.text = text

    def __str__(self) -> str:
        return f"invalid JSON: {self.text[:60].decode('utf-8', 'replace')}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, UnreadableValue) and other.text == self.text

    def __hash__(self) -> int:
        return hash(self.text)


class JsonIndex:
    """Positions of the brackets, commas and colons of one JSON text.

    Raises ValueError for unbalanced brackets, an unterminated string, a text that isn't an object or
    array, and more than `MAX_DEPTH` nested levels. Other errors become `UnreadableValue`.
    """

    def __init__(self, data: memoryview) -> None:
        # Scans the text; safe in any thread.
        import numpy as np  # noqa: PLC0415  slow import, needed only by large messages

        self.data = data
        self._separator_positions, kinds = _find_separators(data)
        is_open, is_close = np.isin(kinds, list(OPEN)), np.isin(kinds, list(CLOSE))
        depths_after = np.cumsum(is_open.astype(np.int32) - is_close)
        if not len(depths_after) or depths_after[-1] != 0 or depths_after.min() < 0:
            raise ValueError(_("unbalanced brackets"))
        depths = depths_after + is_close
        if depths.max() > MAX_DEPTH:
            raise ValueError(_("nested deeper than {most} levels").format(most=MAX_DEPTH))
        order = np.argsort(depths.astype(np.int16), kind="stable")
        bounds = np.searchsorted(np.take(depths, order), np.arange(1, int(depths.max()) + 2))
        self._levels = [  # `take` releases the GIL, unlike indexing with brackets
            (np.take(self._separator_positions, order[a:b]), np.take(kinds, order[a:b]))
            for a, b in pairwise(bounds)
        ]
        self._cached_containers: dict[int, _LazyContainer] = {}
        self._cached_separators: dict[int, tuple[int, Positions, Positions]] = {}
        self._end_positions = [positions[np.isin(kinds, list(CLOSE))] for positions, kinds in self._levels]

    @cached_property
    def root(self) -> object:
        """Top-level value of the text."""
        return self.value(0, len(self.data), 0)

    def value(self, start: int, end: int, level: int) -> object:
        """Return the value between two positions of the text.

        Objects and arrays are returned as `LazyObject` and `LazyList`, invalid JSON as `UnreadableValue`.

        Args:
            start: Position of the first character.
            end: Position after the last character.
            level: Nesting level of the value.
        """
        while start < end and self.data[start] in WHITESPACE:
            start += 1
        first = self.data[start] if start < end else 0
        if first in OPEN:
            return self._container(start, level, first)
        text = bytes(self.data[start:end])
        try:
            decoded: object = orjson.loads(text)
        except orjson.JSONDecodeError:
            return UnreadableValue(text)
        return decoded

    def _container(self, start: int, level: int, first: int) -> _LazyContainer:
        # Cached, so that it is the same object each time, up to `MAX_CACHED_CONTAINERS` containers.
        container = self._cached_containers.get(start)
        if container is None:
            container = (LazyObject if first == OPEN[0] else LazyList)(self, start, level)
            if len(self._cached_containers) < MAX_CACHED_CONTAINERS:
                self._cached_containers[start] = container
        return container

    def separators(self, start: int, level: int) -> tuple[int, Positions, Positions]:
        """Return the end, the comma positions and the colon positions of an object or array.

        Args:
            start: Position of the opening bracket.
            level: Nesting level of the object or array.
        """
        import numpy as np  # noqa: PLC0415

        if start in self._cached_separators:
            return self._cached_separators[start]
        positions, kinds = self._levels[level]
        end_positions = self._end_positions[level]
        end = int(end_positions[np.searchsorted(end_positions, start)])
        first, last = np.searchsorted(positions, start) + 1, np.searchsorted(positions, end)
        inner_positions, inner_kinds = positions[first:last], kinds[first:last]
        separators = end, inner_positions[inner_kinds == COMMA], inner_positions[inner_kinds == COLON]
        if len(inner_positions) > MIN_CACHED_SEPARATORS:  # requested repeatedly, and slow to find
            self._cached_separators[start] = separators
        return separators

    def path_to(self, position: int) -> tuple[str | int, ...]:
        """Return the keys and indices that lead to the value at a position of the text."""
        path: list[str | int] = []
        container = self.root
        while isinstance(container, _LazyContainer):
            row = container.row_at(position)
            if row is None:
                break
            path.append(container.key_at(row))
            container = container.value_at(row)
        return tuple(path)


class _LazyContainer:
    """Base class of lazy objects and arrays, with the positions of their elements."""

    def __init__(self, index: JsonIndex, start: int, level: int) -> None:
        self._index, self._start, self._level = index, start, level

    @cached_property
    def _separators(self) -> tuple[int, Positions, Positions]:
        return self._index.separators(self._start, self._level)

    @cached_property
    def _count(self) -> int:
        end, commas, _colons = self._separators
        if len(commas) or bytes(self._index.data[self._start + 1 : end]).strip(WHITESPACE):
            return len(commas) + 1
        return 0

    def _bounds(self, row: int) -> tuple[int, int]:
        end, commas, _colons = self._separators
        start = self._start + 1 if row == 0 else int(commas[row - 1]) + 1
        return start, int(commas[row]) if row < len(commas) else end

    def row_at(self, position: int) -> int | None:
        # Index of the child at a position of the text.
        end, commas, _colons = self._separators
        if not self._start < position < end or not self._count:
            return None
        return int(commas.searchsorted(position))

    def key_at(self, row: int) -> str | int:
        return row

    def value_at(self, row: int) -> object:
        start, end = self._bounds(row)
        return self._index.value(start, end, self._level + 1)

    @property
    def raw(self) -> memoryview:
        # JSON text as a view of the message.
        return self._index.data[self._start : self._separators[0] + 1]

    @property
    def text(self) -> bytes:
        return bytes(self.raw)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)) or len(other.raw) != len(self.raw):
            return False
        import numpy as np  # noqa: PLC0415

        return bool(np.array_equal(np.frombuffer(self.raw, np.uint8), np.frombuffer(other.raw, np.uint8)))

    def __hash__(self) -> int:
        return hash(self.text)


class LazyList(_LazyContainer, Sequence[object]):
    """JSON array whose elements are decoded at each access."""

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, row: int) -> object: ...

    @overload
    def __getitem__(self, row: slice) -> list[object]: ...

    def __getitem__(self, row: int | slice) -> object:
        if isinstance(row, slice):
            return [self.value_at(each) for each in range(*row.indices(self._count))]
        index = row + self._count if row < 0 else row
        if not 0 <= index < self._count:
            raise IndexError(row)
        return self.value_at(index)


class LazyObject(_LazyContainer, Mapping[str, object]):
    """JSON object whose values are decoded at each access. For duplicate keys, the last value is used."""

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __getitem__(self, key: str) -> object:
        return self.value_at(self._rows[key])

    def key_at(self, row: int) -> str:
        """Return the key of the entry at an index."""
        start, _end = self._bounds(row)
        text = bytes(self._index.data[start : self._colon(row)])
        try:
            return str(orjson.loads(text))
        except orjson.JSONDecodeError:
            return text.decode("utf-8", "replace").strip()

    def value_at(self, row: int) -> object:
        """Return the value of the entry at an index."""
        _start, end = self._bounds(row)
        colon = self._colon(row)
        if colon == end:
            return UnreadableValue(b"")
        return self._index.value(colon + 1, end, self._level + 1)

    def _colon(self, row: int) -> int:
        # Position of a child's colon; its end if there is none.
        start, end = self._bounds(row)
        colons = self._separators[2]
        index = int(colons.searchsorted(start))
        return int(colons[index]) if index < len(colons) and colons[index] < end else end

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {self.key_at(row): row for row in range(self._count)}

    def __eq__(self, other: object) -> bool:
        return _LazyContainer.__eq__(self, other)

    def __hash__(self) -> int:
        return _LazyContainer.__hash__(self)


def _find_separators(data: memoryview) -> tuple[Positions, NDArray[np.uint8]]:
    # Positions and kinds of all brackets, commas and colons outside of strings.
    import numpy as np  # noqa: PLC0415

    is_separator = np.zeros(256, bool)
    is_separator[list(OPEN + CLOSE + bytes((COMMA, COLON)))] = True
    positions, kinds = [], []
    in_string, is_escaped = 0, False
    for start in range(0, len(data), CHUNK_BYTES):
        chunk = np.frombuffer(data[start : start + CHUNK_BYTES], np.uint8)
        quotes = chunk == QUOTE
        backslashes = np.flatnonzero(chunk == BACKSLASH)
        if is_escaped or len(backslashes):
            escaped_positions, is_escaped = _find_escaped(backslashes, len(chunk), is_escaped)
            quotes[escaped_positions] = False
        inside_string = (np.cumsum(quotes, dtype=np.int32) + in_string) & 1
        indexes = np.flatnonzero(np.take(is_separator, chunk) & (inside_string == 0))
        positions.append(indexes + start)
        kinds.append(chunk[indexes])
        in_string = int(inside_string[-1])
    if in_string or not positions:
        raise ValueError(_("unterminated string"))
    return np.concatenate(positions), np.concatenate(kinds)


def _find_escaped(
    backslashes: Positions, length: int, is_first_escaped: bool
) -> tuple[list[int] | Positions, bool]:
    # Positions after an effective backslash, and whether the next chunk starts with such a position.
    import numpy as np  # noqa: PLC0415

    if is_first_escaped and len(backslashes) and backslashes[0] == 0:
        backslashes = backslashes[1:]  # it is escaped itself
    if not len(backslashes):
        return ([0] if is_first_escaped else []), False
    is_run_start = np.concatenate(([True], np.diff(backslashes) != 1))
    starts = np.flatnonzero(is_run_start)
    run_offsets = np.arange(len(backslashes)) - np.repeat(
        starts, np.diff(np.append(starts, len(backslashes)))
    )
    positions_after = backslashes[run_offsets % 2 == 0] + 1
    carries_over = bool(positions_after[-1] == length)
    escaped_positions = positions_after[:-1] if carries_over else positions_after
    return (np.append(escaped_positions, 0) if is_first_escaped else escaped_positions), carries_over
