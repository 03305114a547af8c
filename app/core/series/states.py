"""Text and boolean values over time, as runs of equal values, limited in number, with gaps."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import pairwise

from app.core.series.samples import MAX_LATENESS_S

MAX_RUNS = 10_000
MAX_STATE_LENGTH = 200


@dataclass(frozen=True, slots=True)
class StateRun:
    """Run of equal values from `start_s` to `end_s`, in seconds.

    Attributes:
        value: Value; None if it is unknown.
    """

    start_s: float
    end_s: float
    value: str | None


class States:
    """Runs of equal values of one field. Beyond `MAX_RUNS` runs, the oldest are evicted and counted."""

    def __init__(self, limit: int = MAX_RUNS) -> None:
        self._limit = limit
        self._start_times_s: list[float] = []
        self._values: list[str | None] = []
        self.last_s: float | None = None
        self.evicted_count = self.removed_count = 0

    def __len__(self) -> int:
        return len(self._start_times_s)

    def add(self, time_s: float, value: str | None, *, gap: bool = False) -> None:
        """Add a value.

        A value up to `MAX_LATENESS_S` older than the newest one is ignored. A still older one means
        that the clock was set back: the runs that begin after it are removed first.

        Args:
            time_s: Time in seconds.
            value: Value; None if the message has no value.
            gap: True if messages before this one are missing.
        """
        if self.last_s is not None and time_s < self.last_s:
            if self.last_s - time_s <= MAX_LATENESS_S:
                return
            self._truncate(time_s)
            gap = True
        value = value if value is None else value[:MAX_STATE_LENGTH]
        if gap and self._values and self._values[-1] is not None and self.last_s is not None:
            self._start_run(self.last_s, None)
        if not self._values or self._values[-1] != value:
            self._start_run(time_s, value)
        self.last_s = time_s

    def _start_run(self, time_s: float, value: str | None) -> None:
        self._start_times_s.append(time_s)
        self._values.append(value)
        if len(self._start_times_s) > self._limit:
            evicted_count = len(self._start_times_s) - self._limit * 3 // 4
            del self._start_times_s[:evicted_count], self._values[:evicted_count]
            self.evicted_count += evicted_count

    def clear(self) -> None:
        """Remove all runs."""
        self._start_times_s.clear()
        self._values.clear()
        self.last_s = None
        self.evicted_count = self.removed_count = 0

    def _truncate(self, time_s: float) -> None:
        index = bisect_left(self._start_times_s, time_s)
        self.removed_count += len(self._start_times_s) - index
        del self._start_times_s[index:], self._values[index:]
        self.last_s = time_s if self._start_times_s else None

    def runs(
        self,
        begin_s: float,
        end_s: float,
        *,
        step_s: float = 0.0,
        excluded_values: Collection[str] | None = None,
    ) -> Iterator[StateRun]:
        """Yield the runs that overlap a time range, oldest first.

        The newest run ends with the last message.

        Args:
            begin_s: Start of the range in seconds.
            end_s: End of the range in seconds.
            step_s: Time resolution; one run in each interval of this length is sufficient.
            excluded_values: Values to skip. If given, runs with unknown values are skipped too.
        """
        index, end = self._index_range(begin_s, end_s)
        while index < end:
            at_s, value = self._start_times_s[index], self._values[index]
            if excluded_values is not None and (value is None or value in excluded_values):
                index += 1
                continue
            yield StateRun(at_s, self._end_of(index), value)
            # the last run that begins within the step may extend beyond it
            index = max(index + 1, bisect_right(self._start_times_s, at_s + step_s) - 1)

    def values_in(self, begin_s: float, end_s: float) -> set[str]:
        """Return the distinct values in a time range."""
        first, end = self._index_range(begin_s, end_s)
        return {value for value in set(self._values[first:end]) if value is not None}

    def _index_range(self, begin_s: float, end_s: float) -> tuple[int, int]:
        # Index range of the runs in a time range: first, and one behind the last.
        first = max(0, bisect_right(self._start_times_s, begin_s) - 1)
        return first, bisect_right(self._start_times_s, end_s)

    def _end_of(self, index: int) -> float:
        if index + 1 < len(self._start_times_s):
            return self._start_times_s[index + 1]
        return self._start_times_s[index] if self.last_s is None else self.last_s

    def at(self, time_s: float) -> str | None:
        """Return the value at a time; None if the value is unknown."""
        index = bisect_right(self._start_times_s, time_s) - 1
        return self._values[index] if index >= 0 else None

    def change_count(self, begin_s: float, end_s: float) -> int:
        """Return the number of changes of the value in a time range."""
        first, end = self._index_range(begin_s, end_s)
        values = [value for value in self._values[first:end] if value is not None]
        return sum(previous != other for previous, other in pairwise(values))

    def duration_s(self, value: str, begin_s: float, end_s: float) -> float:
        """Return how long the field had the value ``value`` in a time range, in seconds."""
        return sum(
            max(0.0, min(self._end_of(index), end_s) - max(self._start_times_s[index], begin_s))
            for index in range(*self._index_range(begin_s, end_s))
            if self._values[index] == value
        )
