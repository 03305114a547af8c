"""Samples: the numbers of one series over time, bounded, with their gaps and a pyramid of peaks.

Numbers are finite; where one is missing the next is marked as coming after a gap. For drawing, and for the
figures of a range, the least, the greatest, the sum are kept for every 16, 128 and 1024 numbers, so that a
million cost no more than some thousands. It is appended to; what comes late is put in its place.
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
MOST_SAMPLES = 1 << 20
"""About a million numbers: a quarter of an hour of 1 kHz, 20 MB."""
LATE_S = 1.0
"""What comes this much too late is put in its place; what is older says that the clock was set back."""
SHIFTS = (4, 7, 10)
RAW_PER_COLUMN = 4
"""As long as there are no more numbers for each pixel, all of them are drawn."""
FEW_RANGES, FEW_NUMBERS = 8, 4096
"""Of so many, one after the other is quicker than all at once."""
_FIRST_ROOM = 1024
_GRAIN = 1 << SHIFTS[-1]
_REWRITES_KEPT = 256


@dataclass(frozen=True, slots=True)
class Figures:
    """What is known of a range: how many numbers, the least, the greatest and their mean (None: none)."""

    count: int = 0
    least: float | None = None
    most: float | None = None
    mean: float | None = None


@dataclass(frozen=True, slots=True)
class Line:
    """What is to be drawn: times (s) and values, NaN where the line is broken; whether these are all."""

    times: Floats
    values: Floats
    points: int
    is_whole: bool


class _Level:
    """Of every ``1 << shift`` numbers the least, the greatest and the sum, as far as they are complete."""

    def __init__(self, shift: int) -> None:
        self.shift, self.built = shift, 0
        self.low, self.high, self.total = np.empty(0), np.empty(0), np.empty(0)

    def build(self, values: Floats, count: int) -> None:
        whole = count >> self.shift
        if whole <= self.built:
            return
        if whole > len(self.low):
            room = max(whole, 2 * len(self.low), 64)
            self.low, self.high, self.total = (
                np.concatenate([each, np.empty(room - len(each))])
                for each in (self.low, self.high, self.total)
            )
        part = values[self.built << self.shift : whole << self.shift].reshape(-1, 1 << self.shift)
        new = slice(self.built, whole)
        self.low[new], self.high[new] = part.min(axis=1), part.max(axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            self.total[new] = part.sum(axis=1)
        self.built = whole

    def forget(self, buckets: int) -> None:
        kept = max(0, self.built - buckets)
        for each in (self.low, self.high, self.total):
            each[:kept] = each[buckets : buckets + kept].copy()
        self.built = kept


@dataclass(slots=True)
class _Pixels:
    """Pixels from ``first`` to before ``end`` (their numbers) as they are drawn: two points each.

    ``keys`` are the numbers of those that have any, ``broken`` whether something is missing before them.
    """

    first: float = 0.0
    end: float = 0.0
    keys: Floats = field(default_factory=lambda: np.empty(0))
    times: Floats = field(default_factory=lambda: np.empty(0))
    values: Floats = field(default_factory=lambda: np.empty(0))
    broken: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=bool))

    def part(self, first: float, end: float) -> _Pixels:
        """Those of them from ``first`` to before ``end``; views."""
        first, end = max(first, self.first), min(end, self.end)
        if end <= first:
            return _Pixels(first, first)
        low, high = np.searchsorted(self.keys, (first, end))
        both = slice(2 * low, 2 * high)
        return _Pixels(
            first, end, self.keys[low:high], self.times[both], self.values[both], self.broken[low:high]
        )

    @classmethod
    def joined(cls, parts: Sequence[_Pixels]) -> _Pixels:
        """Parts that follow each other."""
        names = ("keys", "times", "values", "broken")
        arrays = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
        return cls(parts[0].first, parts[-1].end, *arrays)


@dataclass(slots=True)
class _Drawn:
    """The pixels that were drawn last, as far as nothing that comes after what came then changes them.

    A plot that moves on draws nearly the same pixels again; they need not be looked through once more.
    """

    width_s: float = 0.0
    rewritten: int = 0
    begun: int = 0
    pixels: _Pixels = field(default_factory=_Pixels)


class Samples:
    """Times in s, never falling, and finite values. One thread uses it.

    ``begun`` were forgotten to stay within ``limit`` (the oldest go first, a quarter at a time), ``undone``
    because a clock was set back. An absolute index counts what was forgotten, too.
    """

    def __init__(self, limit: int = MOST_SAMPLES) -> None:
        """Nothing is known yet."""
        self.limit = limit
        self.begun = self.undone = 0
        self._count = 0
        self._times, self._values = np.empty(_FIRST_ROOM), np.empty(_FIRST_ROOM)
        self._gaps = np.zeros(_FIRST_ROOM, dtype=bool)
        self._levels = tuple(_Level(shift) for shift in SHIFTS)
        self._drawn = _Drawn()
        self._rewrites: deque[tuple[int, float]] = deque(maxlen=_REWRITES_KEPT)
        self.rewritten = 0
        self._gap_wanted = False

    def __len__(self) -> int:
        """How many are kept."""
        return self._count

    @property
    def end(self) -> int:
        """The absolute index of the next one."""
        return self.begun + self._count

    @property
    def times(self) -> Floats:
        """When they were (s), oldest first; a view."""
        return self._times[: self._count]

    @property
    def values(self) -> Floats:
        """The numbers; a view."""
        return self._values[: self._count]

    @property
    def gaps(self) -> NDArray[np.bool_]:
        """Whether something is missing right before each; a view."""
        return self._gaps[: self._count]

    @property
    def last_s(self) -> float | None:
        """When the newest was."""
        return float(self._times[self._count - 1]) if self._count else None

    @property
    def size_bytes(self) -> int:
        """The memory that it has."""
        levels = sum(each.low.nbytes * 3 for each in self._levels)
        return self._times.nbytes + self._values.nbytes + self._gaps.nbytes + levels

    # -- what comes ------------------------------------------------------------------------------------------

    def break_line(self) -> None:
        """Something is missing before whatever comes next."""
        self._gap_wanted = self._count > 0

    def extend(self, times: Floats, values: Floats, gaps: NDArray[np.bool_]) -> None:
        """Add numbers that came in this order; what is not finite is left out, and a gap."""
        good = np.isfinite(times) & np.isfinite(values)
        if not good.all():
            gaps = _gaps_carried(gaps, good)
            if not good.any():
                self._gap_wanted = self._gap_wanted or self._count > 0
                return
            trailing = not good[-1]
            times, values, gaps = times[good], values[good], gaps[good]
        else:
            trailing = False
        if len(times) == 0:
            return
        last = self.last_s
        if (last is None or times[0] >= last) and bool(np.all(times[1:] >= times[:-1])):
            self._append(times, values, gaps)
        else:
            for time_s, value, gap in zip(times.tolist(), values.tolist(), gaps.tolist(), strict=True):
                self._put(time_s, value, gap=gap)
        if trailing:
            self.break_line()
        self._forget_old()

    def add(self, time_s: float, value: float, *, gap: bool = False) -> None:
        """Add one number."""
        self.extend(np.array([time_s]), np.array([value]), np.array([gap]))

    def _append(self, times: Floats, values: Floats, gaps: NDArray[np.bool_]) -> None:
        self._make_room(len(times))
        new = slice(self._count, self._count + len(times))
        self._times[new], self._values[new], self._gaps[new] = times, values, gaps
        self._gaps[self._count] = self._count > 0 and (bool(gaps[0]) or self._gap_wanted)
        self._gap_wanted = False
        self._count += len(times)

    def _put(self, time_s: float, value: float, *, gap: bool) -> None:
        last = self.last_s
        one = np.array([time_s]), np.array([value]), np.array([gap])
        if last is None or time_s >= last:
            self._append(*one)
        elif last - time_s > LATE_S:
            self.truncate(time_s)
            self.break_line()
            self._append(*one)
        else:
            self._insert(time_s, value)

    def _insert(self, time_s: float, value: float) -> None:
        place = int(np.searchsorted(self.times, time_s, side="right"))
        self._make_room(1)
        for each in (self._times, self._values, self._gaps):
            each[place + 1 : self._count + 1] = each[place : self._count].copy()
        self._times[place], self._values[place] = time_s, value
        self._gaps[place] = self._gaps[place + 1]
        self._gaps[place + 1] = False
        self._count += 1
        self._rewrite(place, time_s)

    def truncate(self, time_s: float) -> None:
        """Undo what is at or after a time: the clock was set back, or a recording goes on from there."""
        place = int(np.searchsorted(self.times, time_s, side="left"))
        if place < self._count:
            self.undone += self._count - place
            self._count = place
            self._rewrite(place, time_s)
        self._gap_wanted = self._gap_wanted and self._count > 0

    def clear(self) -> None:
        """Begin anew."""
        self.truncate(-np.inf)
        self.begun = self.undone = 0

    def _rewrite(self, place: int, time_s: float) -> None:
        for level in self._levels:
            level.built = min(level.built, place >> level.shift)
        self.rewritten += 1
        self._rewrites.append((self.rewritten, time_s))

    def rewritten_from(self, seen: int) -> float | None:
        """From which time on it is not as it was when ``rewritten`` was ``seen``; None when all is."""
        if seen == self.rewritten:
            return None
        if not self._rewrites or self._rewrites[0][0] > seen + 1:
            return -np.inf
        return min(time_s for number, time_s in self._rewrites if number > seen)

    def _make_room(self, more: int) -> None:
        need = self._count + more
        if need > len(self._times):
            room = max(need, 2 * len(self._times))
            for name in ("_times", "_values", "_gaps"):
                old = getattr(self, name)
                new = np.zeros(room, dtype=old.dtype)
                new[: self._count] = old[: self._count]
                setattr(self, name, new)

    def _give_room_back(self) -> None:
        """Where the limit has become much smaller, as more curves share what a plot may keep."""
        if len(self._times) > 4 * max(self.limit, self._count, _FIRST_ROOM):
            for name in ("_times", "_values", "_gaps"):
                setattr(self, name, getattr(self, name)[: self._count].copy())

    def _forget_old(self) -> None:
        if self._count <= self.limit:
            return
        oldest = self._count - self.limit * 3 // 4
        drop = min(-(-oldest // _GRAIN) * _GRAIN, self._count // _GRAIN * _GRAIN)
        if drop <= 0:
            return
        kept = self._count - drop
        for level in self._levels:
            level.build(self.values, self._count)
        for each in (self._times, self._values, self._gaps):
            each[:kept] = each[drop : self._count].copy()
        for level in self._levels:
            level.forget(drop >> level.shift)
        self._count, self.begun = kept, self.begun + drop
        self._give_room_back()

    # -- what is asked ---------------------------------------------------------------------------------------

    def places(self, begin_s: float, end_s: float) -> tuple[int, int]:
        """The indexes of what lies in a range, both ends too: the first, and one behind the last."""
        first = np.searchsorted(self.times, begin_s, side="left")
        return int(first), int(np.searchsorted(self.times, end_s, side="right"))

    def at(self, time_s: float) -> tuple[float, float] | None:
        """The newest number up to a time and when it was; None before the first one, and in a gap."""
        place = int(np.searchsorted(self.times, time_s, side="right")) - 1
        if place < 0:
            return None
        if place + 1 < self._count and self._gaps[place + 1] and self._times[place] < time_s:
            return None
        return float(self._times[place]), float(self._values[place])

    def beside(self, time_s: float, steps: int) -> float | None:
        """The time of the number so many ``steps`` after (or before) a time; None when there is none."""
        if steps > 0:
            place = int(np.searchsorted(self.times, time_s, side="right")) + steps - 1
        else:
            place = int(np.searchsorted(self.times, time_s, side="left")) + steps
        return float(self._times[place]) if 0 <= place < self._count else None

    def figures(self, begin_s: float, end_s: float) -> Figures:
        """The least, the greatest and the mean of a range."""
        first, end = self.places(begin_s, end_s)
        if end <= first:
            return Figures()
        low, high, total = self._reduced(np.array([first]), np.array([end]))
        mean = float(total[0]) / (end - first)
        return Figures(end - first, float(low[0]), float(high[0]), mean if isfinite(mean) else None)

    def line(self, begin_s: float, end_s: float, columns: int) -> Line:
        """What to draw of a range on so many pixels: all, or the least and greatest of each pixel.

        One number on each side of the range comes with it, so that the line reaches the edges.
        """
        first, end = self.places(begin_s, end_s)
        points = end - first
        first, end = max(0, first - 1), min(self._count, end + 1)
        columns = max(1, columns)
        if end - first <= RAW_PER_COLUMN * columns or end_s <= begin_s:
            pixel_s = max(0.0, end_s - begin_s) / columns
            return Line(*self._whole(first, end, pixel_s), points, is_whole=True)
        return self._peaks(begin_s, end_s, columns, (first, end))

    def _whole(self, first: int, end: int, pixel_s: float) -> tuple[Floats, Floats]:
        """All numbers between two indexes, NaN in the gaps; one alone between two gaps is a pixel wide."""
        times, values, gaps = self._times[first:end], self._values[first:end], self._gaps[first:end]
        begins, ends = gaps.copy(), np.append(gaps[1:], end == self._count or self._gaps[end])
        if first == 0:
            begins[:1] = True
        alone = np.flatnonzero(begins & ends[: len(begins)])
        until = np.minimum(times[alone] + pixel_s, np.append(times[1:], np.inf)[alone])
        broken = np.flatnonzero(gaps)
        broken = broken[broken > 0]
        places = np.concatenate([alone + 1, broken])
        return (
            np.insert(times, places, np.concatenate([until, times[broken]])),
            np.insert(values, places, np.concatenate([values[alone], np.full(len(broken), np.nan)])),
        )

    def _peaks(self, begin_s: float, end_s: float, columns: int, part: tuple[int, int]) -> Line:
        width = (end_s - begin_s) / columns
        if 1e-30 < width < 1e30:  # rounded, so that pixels have the same edges while the plot moves on
            width = float(np.float32(width))
        begin = float(np.floor(begin_s / width))
        first, end = begin - 1, begin + columns + 1  # one pixel more, so that the line reaches the edge
        known = self._known(width).part(first, end - 1)
        if len(known.keys) and known.keys[0] == first:
            pixels = _Pixels.joined((known, self._pixels(width, (known.end, end), None, part[1])))
        else:
            place, inside = np.searchsorted(self.times, (width * first, width * begin))
            alone = bool(place == inside)  # then the number before the range stands in for it
            pixels = self._pixels(width, (first, end), max(0, int(place) - alone), part[1])
            first += alone
        sure = float(np.floor(self._times[self._count - 1] / width)) - 1  # later ones may get more numbers
        kept = pixels.part(first, max(first, min(sure, end - 1)))
        self._drawn = _Drawn(width, self.rewritten, self.begun, kept)
        times, values = pixels.times, pixels.values
        broken = 2 * np.flatnonzero(pixels.broken)
        broken = broken[broken > 0]
        if len(broken):
            times, values = np.insert(times, broken, times[broken]), np.insert(values, broken, np.nan)
        return Line(times, values, part[1] - part[0], is_whole=False)

    def _known(self, width_s: float) -> _Pixels:
        """What of the pixels that were drawn last is still as it was."""
        drawn = self._drawn
        if drawn.width_s != width_s:
            return _Pixels()
        pixels = drawn.pixels
        changed_s = self.rewritten_from(drawn.rewritten)
        if changed_s is not None:
            pixels = pixels.part(-np.inf, float(np.floor(changed_s / width_s)) - 1)
        if drawn.begun != self.begun:
            pixels = pixels.part(float(np.floor(self._times[0] / width_s)) + 2, np.inf)
        return pixels

    def _pixels(self, width: float, keys: tuple[float, float], first: int | None, last: int) -> _Pixels:
        """The pixels from a number to before another; the last has all to before ``last``, too.

        ``first`` is the place of the first number of them; None: where their edge is.
        """
        edges = width * (keys[0] + np.arange(round(keys[1] - keys[0]) + 1))
        places = np.searchsorted(self._times[:last], edges)
        if first is not None:
            places[0] = first
        places[-1] = last
        there = np.flatnonzero(places[1:] > places[:-1])
        if not len(there):
            return _Pixels(*keys)
        starts, ends = places[there], places[there + 1]
        low, high = self._least_and_most(starts, ends)
        times, values = np.repeat(edges[there] + width / 2, 2), np.empty(2 * len(there))
        rising = self._values[ends - 1] < self._values[starts]  # nearer to how the line really runs
        values[0::2], values[1::2] = np.where(rising, high, low), np.where(rising, low, high)
        times[1::2] += np.where(low == high, width / 2, 0.0)  # or one alone between two gaps would be nothing
        return _Pixels(*keys, keys[0] + there.astype(np.float64), times, values, self._gaps[starts])

    def _least_and_most(self, starts: Indexes, ends: Indexes) -> tuple[Floats, Floats]:
        """Of each range of indexes; none is empty."""
        if len(starts) > FEW_RANGES or ends[-1] - starts[0] > FEW_NUMBERS:
            low, high, _total = self._reduced(starts, ends)
            return low, high
        parts = [self._values[start:end] for start, end in zip(starts, ends, strict=True)]
        return np.array([part.min() for part in parts]), np.array([part.max() for part in parts])

    def _reduced(self, starts: Indexes, ends: Indexes) -> tuple[Floats, Floats, Floats]:
        """The least, greatest and sum of each range of indexes; none is empty. Exact: no bucket is cut."""
        mean_count = float(np.mean(ends - starts))
        fitting = [level for level in self._levels if 4**level.shift <= mean_count * 4]
        if not fitting:
            return _reduce(self._values, self._values, self._values, starts, ends)
        level = fitting[-1]
        level.build(self._values, self._count)
        firsts = -(-starts >> level.shift)
        lasts = np.maximum(firsts, np.minimum(ends >> level.shift, level.built))
        inside = lasts > firsts
        heads = np.where(inside, firsts << level.shift, ends)
        low, high, total = _reduce(self._values, self._values, self._values, starts, heads)
        tails = np.where(inside, lasts << level.shift, ends)
        more = _reduce(level.low, level.high, level.total, firsts, np.where(inside, lasts, firsts))
        rest = _reduce(self._values, self._values, self._values, tails, ends)
        with np.errstate(over="ignore", invalid="ignore"):
            total = total + more[2] + rest[2]
        low = np.minimum(np.minimum(low, more[0]), rest[0])
        return low, np.maximum(np.maximum(high, more[1]), rest[1]), total


def _reduce(
    lows: Floats, highs: Floats, totals: Floats, starts: Indexes, ends: Indexes
) -> tuple[Floats, Floats, Floats]:
    """As `Samples._reduced`; ranges may be empty: then the least is inf, the greatest -inf, the sum 0."""
    low, high = np.full(len(starts), np.inf), np.full(len(starts), -np.inf)
    total = np.zeros(len(starts))
    there = ends > starts
    if there.any():
        lengths = (ends - starts)[there]
        offsets = np.concatenate([[0], np.cumsum(lengths)])
        gather = np.arange(offsets[-1]) + np.repeat(starts[there] - offsets[:-1], lengths)
        low[there] = np.minimum.reduceat(lows[gather], offsets[:-1])
        high[there] = np.maximum.reduceat(highs[gather], offsets[:-1])
        with np.errstate(over="ignore", invalid="ignore"):
            total[there] = np.add.reduceat(totals[gather], offsets[:-1])
    return low, high, total


def _gaps_carried(gaps: NDArray[np.bool_], good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The gaps with those that what is left out leaves before what comes next."""
    bad_before = np.concatenate([[False], ~good[:-1]])
    carried = gaps.copy()
    pending = False
    for place in np.flatnonzero(~good | bad_before | gaps).tolist():
        pending = pending or bool(gaps[place])
        if not good[place]:
            pending = True
        else:
            carried[place] = pending or bool(bad_before[place])
            pending = False
    return carried
