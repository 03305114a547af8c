"""Samples of one series over time, limited in number, with gaps and a multi-resolution pyramid.

All values are finite. If a value is missing, there is a gap before the next sample. Minimum, maximum
and sum are stored for every 16, 128 and 1024 samples, so that drawing a million samples costs no more
than some thousands. Samples are appended; late samples are inserted in order.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indexes = NDArray[np.intp]
MAX_SAMPLES = 1 << 20
"""Maximum number of samples: a quarter of an hour at 1 kHz, 20 MB."""
MAX_LATENESS_S = 1.0
"""Maximum lateness in seconds of a sample that is inserted.

A later sample means that the clock was set back.
"""
LEVEL_SHIFTS = (4, 7, 10)
MAX_SAMPLES_PER_PIXEL = 4
"""Maximum number of samples per pixel for which each sample is drawn."""
MAX_DIRECT_RANGES, MAX_DIRECT_SAMPLES = 8, 4096
"""Numbers of ranges and samples up to which a Python loop is faster than a vectorized reduction."""
_INITIAL_CAPACITY = 1024
_EVICTION_UNIT = 1 << LEVEL_SHIFTS[-1]
_MAX_REWRITES = 256


@dataclass(frozen=True, slots=True)
class RangeStats:
    """Statistics of a time range. Minimum, maximum and mean are None if it contains no samples."""

    count: int = 0
    minimum: float | None = None
    maximum: float | None = None
    mean: float | None = None


@dataclass(frozen=True, slots=True)
class Polyline:
    """Polyline to draw.

    Attributes:
        times: Times in seconds.
        values: Values, NaN at gaps.
        sample_count: Number of samples in the range.
        is_complete: True if the polyline contains all samples of the range.
    """

    times: Floats
    values: Floats
    sample_count: int
    is_complete: bool


class _Level:
    """Minimum, maximum and sum of each complete group of ``1 << shift`` samples."""

    def __init__(self, shift: int) -> None:
        self.shift, self.built_count = shift, 0
        self.low, self.high, self.total = np.empty(0), np.empty(0), np.empty(0)

    def build(self, values: Floats, count: int) -> None:
        bucket_count = count >> self.shift
        if bucket_count <= self.built_count:
            return
        if bucket_count > len(self.low):
            capacity = max(bucket_count, 2 * len(self.low), 64)
            self.low, self.high, self.total = (
                np.concatenate([each, np.empty(capacity - len(each))])
                for each in (self.low, self.high, self.total)
            )
        groups = values[self.built_count << self.shift : bucket_count << self.shift].reshape(
            -1, 1 << self.shift
        )
        new_range = slice(self.built_count, bucket_count)
        self.low[new_range], self.high[new_range] = groups.min(axis=1), groups.max(axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            self.total[new_range] = groups.sum(axis=1)
        self.built_count = bucket_count

    def discard(self, buckets: int) -> None:
        remaining = max(0, self.built_count - buckets)
        for array in (self.low, self.high, self.total):
            array[:remaining] = array[buckets : buckets + remaining].copy()
        self.built_count = remaining


@dataclass(slots=True)
class _Pixels:
    """Drawn pixel columns from ``first`` (inclusive) to ``end`` (exclusive), with two points each.

    Attributes:
        keys: Indices of the columns that contain samples.
        gaps: True for each column that follows a gap.
    """

    first: float = 0.0
    end: float = 0.0
    keys: Floats = field(default_factory=lambda: np.empty(0))
    times: Floats = field(default_factory=lambda: np.empty(0))
    values: Floats = field(default_factory=lambda: np.empty(0))
    gaps: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=bool))

    def part(self, first: float, end: float) -> _Pixels:
        # Views, not copies.
        first, end = max(first, self.first), min(end, self.end)
        if end <= first:
            return _Pixels(first, first)
        low, high = np.searchsorted(self.keys, (first, end))
        points = slice(2 * low, 2 * high)
        return _Pixels(
            first, end, self.keys[low:high], self.times[points], self.values[points], self.gaps[low:high]
        )

    @classmethod
    def join(cls, parts: Sequence[_Pixels]) -> _Pixels:
        # The parts must be adjacent.
        names = ("keys", "times", "values", "gaps")
        arrays = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
        return cls(parts[0].first, parts[-1].end, *arrays)


@dataclass(slots=True)
class _PixelCache:
    """Cache of the last drawn pixel columns that later samples can't change.

    A scrolling plot draws almost the same columns at each frame.
    """

    width_s: float = 0.0
    rewrite_count: int = 0
    evicted_count: int = 0
    pixels: _Pixels = field(default_factory=_Pixels)


class Samples:
    """Samples with ascending times (s) and finite values. Not thread-safe; use it from the main thread.

    Absolute indices count evicted samples too.

    Attributes:
        evicted_count: Number of evicted samples. When ``limit`` is reached, the oldest quarter is
            evicted.
        removed_count: Number of samples that were removed because a clock was set back.
    """

    def __init__(self, limit: int = MAX_SAMPLES) -> None:
        self.limit = limit
        self.evicted_count = self.removed_count = 0
        self._count = 0
        self._times, self._values = np.empty(_INITIAL_CAPACITY), np.empty(_INITIAL_CAPACITY)
        self._gaps = np.zeros(_INITIAL_CAPACITY, dtype=bool)
        self._levels = tuple(_Level(shift) for shift in LEVEL_SHIFTS)
        self._render_cache = _PixelCache()
        self._rewrites: deque[tuple[int, float]] = deque(maxlen=_MAX_REWRITES)
        self.rewrite_count = 0
        self._has_pending_gap = False

    def __len__(self) -> int:
        return self._count

    @property
    def end(self) -> int:
        """Absolute index of the next sample."""
        return self.evicted_count + self._count

    @property
    def times(self) -> Floats:
        """Times in seconds, oldest first, as a view."""
        return self._times[: self._count]

    @property
    def values(self) -> Floats:
        """Values in the order of `times`, as a view."""
        return self._values[: self._count]

    @property
    def gaps(self) -> NDArray[np.bool_]:
        """True for each sample that follows a gap, as a view."""
        return self._gaps[: self._count]

    @property
    def last_s(self) -> float | None:
        """Time of the newest sample in seconds; None without samples."""
        return float(self._times[self._count - 1]) if self._count else None

    @property
    def size_bytes(self) -> int:
        """Allocated memory in bytes."""
        levels = sum(each.low.nbytes * 3 for each in self._levels)
        return self._times.nbytes + self._values.nbytes + self._gaps.nbytes + levels

    # -- input -------------------------------------------------------------------------------------

    def break_line(self) -> None:
        """Insert a gap before the next sample."""
        self._has_pending_gap = self._count > 0

    def extend(self, times: Floats, values: Floats, gaps: NDArray[np.bool_]) -> None:
        """Add samples in order of arrival. Samples that aren't finite become gaps.

        A sample up to `MAX_LATENESS_S` older than the newest one is inserted in order. A still older
        one means that the clock was set back: the samples after it are removed first.

        Args:
            times: Times in seconds.
            values: Values.
            gaps: True for each sample that follows a gap.
        """
        is_finite = np.isfinite(times) & np.isfinite(values)
        if not is_finite.all():
            gaps = _carry_gaps(gaps, is_finite)
            if not is_finite.any():
                self._has_pending_gap = self._has_pending_gap or self._count > 0
                return
            has_trailing_gap = not is_finite[-1]
            times, values, gaps = times[is_finite], values[is_finite], gaps[is_finite]
        else:
            has_trailing_gap = False
        if len(times) == 0:
            return
        last = self.last_s
        if (last is None or times[0] >= last) and bool(np.all(times[1:] >= times[:-1])):
            self._append(times, values, gaps)
        else:
            for time_s, value, gap in zip(times.tolist(), values.tolist(), gaps.tolist(), strict=True):
                self._add_sample(time_s, value, gap=gap)
        if has_trailing_gap:
            self.break_line()
        self._evict_old()

    def add(self, time_s: float, value: float, *, gap: bool = False) -> None:
        """Add one sample, as `extend` does.

        Args:
            time_s: Time in seconds.
            value: Value.
            gap: True if the sample follows a gap.
        """
        self.extend(np.array([time_s]), np.array([value]), np.array([gap]))

    def _append(self, times: Floats, values: Floats, gaps: NDArray[np.bool_]) -> None:
        self._reserve(len(times))
        new_range = slice(self._count, self._count + len(times))
        self._times[new_range], self._values[new_range], self._gaps[new_range] = times, values, gaps
        self._gaps[self._count] = self._count > 0 and (bool(gaps[0]) or self._has_pending_gap)
        self._has_pending_gap = False
        self._count += len(times)

    def _add_sample(self, time_s: float, value: float, *, gap: bool) -> None:
        last = self.last_s
        sample = np.array([time_s]), np.array([value]), np.array([gap])
        if last is None or time_s >= last:
            self._append(*sample)
        elif last - time_s > MAX_LATENESS_S:
            self.truncate(time_s)
            self.break_line()
            self._append(*sample)
        else:
            self._insert(time_s, value)

    def _insert(self, time_s: float, value: float) -> None:
        index = int(np.searchsorted(self.times, time_s, side="right"))
        self._reserve(1)
        for array in (self._times, self._values, self._gaps):
            array[index + 1 : self._count + 1] = array[index : self._count].copy()
        self._times[index], self._values[index] = time_s, value
        self._gaps[index] = self._gaps[index + 1]
        self._gaps[index + 1] = False
        self._count += 1
        self._record_rewrite(index, time_s)

    def truncate(self, time_s: float) -> None:
        """Remove the samples at and after a time.

        Used when the clock was set back, or when a recording continues at that time.
        """
        index = int(np.searchsorted(self.times, time_s, side="left"))
        if index < self._count:
            self.removed_count += self._count - index
            self._count = index
            self._record_rewrite(index, time_s)
        self._has_pending_gap = self._has_pending_gap and self._count > 0

    def clear(self) -> None:
        """Remove all samples."""
        self.truncate(-np.inf)
        self.evicted_count = self.removed_count = 0

    def _record_rewrite(self, index: int, time_s: float) -> None:
        for level in self._levels:
            level.built_count = min(level.built_count, index >> level.shift)
        self.rewrite_count += 1
        self._rewrites.append((self.rewrite_count, time_s))

    def earliest_change_s(self, revision: int) -> float | None:
        """Return the earliest time at which samples were changed, other than by appending.

        Returns None if there was no such change, and -inf if the changes are too old to be known.

        Args:
            revision: Value of ``rewrite_count`` up to which the caller knows the changes.
        """
        if revision == self.rewrite_count:
            return None
        if not self._rewrites or self._rewrites[0][0] > revision + 1:
            return -np.inf
        return min(time_s for number, time_s in self._rewrites if number > revision)

    def _reserve(self, sample_count: int) -> None:
        required_count = self._count + sample_count
        if required_count > len(self._times):
            capacity = max(required_count, 2 * len(self._times))
            for name in ("_times", "_values", "_gaps"):
                old = getattr(self, name)
                new = np.zeros(capacity, dtype=old.dtype)
                new[: self._count] = old[: self._count]
                setattr(self, name, new)

    def _shrink_arrays(self) -> None:
        # After the limit became much smaller, because more curves share the plot's capacity.
        if len(self._times) > 4 * max(self.limit, self._count, _INITIAL_CAPACITY):
            for name in ("_times", "_values", "_gaps"):
                setattr(self, name, getattr(self, name)[: self._count].copy())

    def _evict_old(self) -> None:
        if self._count <= self.limit:
            return
        min_evicted_count = self._count - self.limit * 3 // 4
        evicted_count = min(
            -(-min_evicted_count // _EVICTION_UNIT) * _EVICTION_UNIT,
            self._count // _EVICTION_UNIT * _EVICTION_UNIT,
        )
        if evicted_count <= 0:
            return
        remaining = self._count - evicted_count
        for level in self._levels:
            level.build(self.values, self._count)
        for array in (self._times, self._values, self._gaps):
            array[:remaining] = array[evicted_count : self._count].copy()
        for level in self._levels:
            level.discard(evicted_count >> level.shift)
        self._count, self.evicted_count = remaining, self.evicted_count + evicted_count
        self._shrink_arrays()

    # -- queries -----------------------------------------------------------------------------------

    def index_range(self, begin_s: float, end_s: float) -> tuple[int, int]:
        """Return the index range of the samples in an inclusive time range, as (first, last + 1)."""
        first = np.searchsorted(self.times, begin_s, side="left")
        return int(first), int(np.searchsorted(self.times, end_s, side="right"))

    def at(self, time_s: float) -> tuple[float, float] | None:
        """Return time and value of the newest sample at or before a time.

        Returns None before the first sample and in a gap.
        """
        index = int(np.searchsorted(self.times, time_s, side="right")) - 1
        if index < 0:
            return None
        if index + 1 < self._count and self._gaps[index + 1] and self._times[index] < time_s:
            return None
        return float(self._times[index]), float(self._values[index])

    def time_at_step(self, time_s: float, steps: int) -> float | None:
        """Return the time of the sample that is ``steps`` samples after a time, or before it if negative.

        Returns None if there is no such sample.
        """
        if steps > 0:
            index = int(np.searchsorted(self.times, time_s, side="right")) + steps - 1
        else:
            index = int(np.searchsorted(self.times, time_s, side="left")) + steps
        return float(self._times[index]) if 0 <= index < self._count else None

    def stats(self, begin_s: float, end_s: float) -> RangeStats:
        """Return the statistics of the samples in a time range."""
        first, end = self.index_range(begin_s, end_s)
        if end <= first:
            return RangeStats()
        low, high, total = self._reduce_ranges(np.array([first]), np.array([end]))
        mean = float(total[0]) / (end - first)
        return RangeStats(end - first, float(low[0]), float(high[0]), mean if isfinite(mean) else None)

    def line(self, begin_s: float, end_s: float, columns: int) -> Polyline:
        """Return the polyline of a time range.

        The polyline contains all samples, or the minimum and the maximum in each pixel column. One
        sample on each side of the range is added, so that the polyline reaches the edges.

        Args:
            begin_s: Start of the range.
            end_s: End of the range.
            columns: Width in pixels.
        """
        first, end = self.index_range(begin_s, end_s)
        sample_count = end - first
        first, end = max(0, first - 1), min(self._count, end + 1)
        columns = max(1, columns)
        if end - first <= MAX_SAMPLES_PER_PIXEL * columns or end_s <= begin_s:
            pixel_s = max(0.0, end_s - begin_s) / columns
            return Polyline(*self._all_samples(first, end, pixel_s), sample_count, is_complete=True)
        return self._peak_line(begin_s, end_s, columns, (first, end))

    def _all_samples(self, first: int, end: int, pixel_s: float) -> tuple[Floats, Floats]:
        # NaN at gaps; a sample between two gaps is drawn one pixel wide.
        times, values, gaps = self._times[first:end], self._values[first:end], self._gaps[first:end]
        is_after_gap, is_before_gap = gaps.copy(), np.append(gaps[1:], end == self._count or self._gaps[end])
        if first == 0:
            is_after_gap[:1] = True
        isolated_indexes = np.flatnonzero(is_after_gap & is_before_gap[: len(is_after_gap)])
        end_times = np.minimum(
            times[isolated_indexes] + pixel_s, np.append(times[1:], np.inf)[isolated_indexes]
        )
        gap_indexes = np.flatnonzero(gaps)
        gap_indexes = gap_indexes[gap_indexes > 0]
        indexes = np.concatenate([isolated_indexes + 1, gap_indexes])
        return (
            np.insert(times, indexes, np.concatenate([end_times, times[gap_indexes]])),
            np.insert(
                values, indexes, np.concatenate([values[isolated_indexes], np.full(len(gap_indexes), np.nan)])
            ),
        )

    def _peak_line(self, begin_s: float, end_s: float, columns: int, part: tuple[int, int]) -> Polyline:
        width = (end_s - begin_s) / columns
        if 1e-30 < width < 1e30:  # rounded, so that the edges of pixels stay the same while the plot moves
            width = float(np.float32(width))
        begin = float(np.floor(begin_s / width))
        first, end = begin - 1, begin + columns + 1  # one more pixel, so that the line reaches the edge
        cached = self._valid_pixels(width).part(first, end - 1)
        if len(cached.keys) and cached.keys[0] == first:
            pixels = _Pixels.join((cached, self._pixels(width, (cached.end, end), None, part[1])))
        else:
            previous_index, first_index = np.searchsorted(self.times, (width * first, width * begin))
            uses_previous_sample = bool(
                previous_index == first_index
            )  # then the sample before the range is used instead
            pixels = self._pixels(
                width, (first, end), max(0, int(previous_index) - uses_previous_sample), part[1]
            )
            first += uses_previous_sample
        last_stable_key = (
            float(np.floor(self._times[self._count - 1] / width)) - 1
        )  # later pixels may get more samples
        cacheable = pixels.part(first, max(first, min(last_stable_key, end - 1)))
        self._render_cache = _PixelCache(width, self.rewrite_count, self.evicted_count, cacheable)
        times, values = pixels.times, pixels.values
        gap_indexes = 2 * np.flatnonzero(pixels.gaps)
        gap_indexes = gap_indexes[gap_indexes > 0]
        if len(gap_indexes):
            times, values = (
                np.insert(times, gap_indexes, times[gap_indexes]),
                np.insert(values, gap_indexes, np.nan),
            )
        return Polyline(times, values, part[1] - part[0], is_complete=False)

    def _valid_pixels(self, width_s: float) -> _Pixels:
        # The part of the last rendering that is still valid.
        cache = self._render_cache
        if cache.width_s != width_s:
            return _Pixels()
        pixels = cache.pixels
        changed_s = self.earliest_change_s(cache.rewrite_count)
        if changed_s is not None:
            pixels = pixels.part(-np.inf, float(np.floor(changed_s / width_s)) - 1)
        if cache.evicted_count != self.evicted_count:
            pixels = pixels.part(float(np.floor(self._times[0] / width_s)) + 2, np.inf)
        return pixels

    def _pixels(self, width: float, keys: tuple[float, float], first: int | None, last: int) -> _Pixels:
        # The last pixel includes all samples before `last`. `first` is the index of the first sample; None:
        # at the edge of the first pixel.
        edges = width * (keys[0] + np.arange(round(keys[1] - keys[0]) + 1))
        indexes = np.searchsorted(self._times[:last], edges)
        if first is not None:
            indexes[0] = first
        indexes[-1] = last
        non_empty = np.flatnonzero(indexes[1:] > indexes[:-1])
        if not len(non_empty):
            return _Pixels(*keys)
        starts, ends = indexes[non_empty], indexes[non_empty + 1]
        low, high = self._min_and_max(starts, ends)
        times, values = np.repeat(edges[non_empty] + width / 2, 2), np.empty(2 * len(non_empty))
        rising = self._values[ends - 1] < self._values[starts]  # closer to the actual shape of the line
        values[0::2], values[1::2] = np.where(rising, high, low), np.where(rising, low, high)
        # otherwise a sample between two gaps would be invisible
        times[1::2] += np.where(low == high, width / 2, 0.0)
        return _Pixels(*keys, keys[0] + non_empty.astype(np.float64), times, values, self._gaps[starts])

    def _min_and_max(self, starts: Indexes, ends: Indexes) -> tuple[Floats, Floats]:
        # Of each index range; none is empty.
        if len(starts) > MAX_DIRECT_RANGES or ends[-1] - starts[0] > MAX_DIRECT_SAMPLES:
            low, high, _total = self._reduce_ranges(starts, ends)
            return low, high
        parts = [self._values[start:end] for start, end in zip(starts, ends, strict=True)]
        return np.array([part.min() for part in parts]), np.array([part.max() for part in parts])

    def _reduce_ranges(self, starts: Indexes, ends: Indexes) -> tuple[Floats, Floats, Floats]:
        # Minimum, maximum and sum of each index range; none is empty. Exact: partial buckets use the samples.
        mean_count = float(np.mean(ends - starts))
        levels = [level for level in self._levels if 4**level.shift <= mean_count * 4]
        if not levels:
            return _reduce(self._values, self._values, self._values, starts, ends)
        level = levels[-1]
        level.build(self._values, self._count)
        firsts = -(-starts >> level.shift)
        lasts = np.maximum(firsts, np.minimum(ends >> level.shift, level.built_count))
        has_buckets = lasts > firsts
        head_ends = np.where(has_buckets, firsts << level.shift, ends)
        low, high, total = _reduce(self._values, self._values, self._values, starts, head_ends)
        tails = np.where(has_buckets, lasts << level.shift, ends)
        bucket_stats = _reduce(
            level.low, level.high, level.total, firsts, np.where(has_buckets, lasts, firsts)
        )
        tail_stats = _reduce(self._values, self._values, self._values, tails, ends)
        with np.errstate(over="ignore", invalid="ignore"):
            total = total + bucket_stats[2] + tail_stats[2]
        low = np.minimum(np.minimum(low, bucket_stats[0]), tail_stats[0])
        return low, np.maximum(np.maximum(high, bucket_stats[1]), tail_stats[1]), total


def _reduce(
    lows: Floats, highs: Floats, totals: Floats, starts: Indexes, ends: Indexes
) -> tuple[Floats, Floats, Floats]:
    # As `Samples._reduce_ranges`, but ranges may be empty: minimum inf, maximum -inf, sum 0.
    low, high = np.full(len(starts), np.inf), np.full(len(starts), -np.inf)
    total = np.zeros(len(starts))
    non_empty = ends > starts
    if non_empty.any():
        lengths = (ends - starts)[non_empty]
        offsets = np.concatenate([[0], np.cumsum(lengths)])
        gathered_indexes = np.arange(offsets[-1]) + np.repeat(starts[non_empty] - offsets[:-1], lengths)
        low[non_empty] = np.minimum.reduceat(lows[gathered_indexes], offsets[:-1])
        high[non_empty] = np.maximum.reduceat(highs[gathered_indexes], offsets[:-1])
        with np.errstate(over="ignore", invalid="ignore"):
            total[non_empty] = np.add.reduceat(totals[gathered_indexes], offsets[:-1])
    return low, high, total


def _carry_gaps(gaps: NDArray[np.bool_], is_finite: NDArray[np.bool_]) -> NDArray[np.bool_]:
    # Moves the gaps of skipped samples to the next one.
    is_after_invalid = np.concatenate([[False], ~is_finite[:-1]])
    carried_gaps = gaps.copy()
    has_pending_gap = False
    for index in np.flatnonzero(~is_finite | is_after_invalid | gaps).tolist():
        has_pending_gap = has_pending_gap or bool(gaps[index])
        if not is_finite[index]:
            has_pending_gap = True
        else:
            carried_gaps[index] = has_pending_gap or bool(is_after_invalid[index])
            has_pending_gap = False
    return carried_gaps
