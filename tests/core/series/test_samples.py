"""Tests of `Samples` against a naive reference implementation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.core.series.samples import LEVEL_SHIFTS, MAX_LATENESS_S, MAX_SAMPLES_PER_PIXEL, RangeStats, Samples

Row = tuple[float, float, bool]
ODD = [math.nan, math.inf, -math.inf, float(2**64 - 1), 1.7e308, -1.7e308, 0.0, -0.0, 5e-324]


class Naive:
    """Reference implementation that stores one sample at a time."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.pending = False
        self.undone = 0

    def add(self, time_s: float, value: float, gap: bool) -> None:
        self.pending = bool(self.rows) and (self.pending or gap)
        if not (math.isfinite(time_s) and math.isfinite(value)):
            self.pending = bool(self.rows)
            return
        last = self.rows[-1][0] if self.rows else None
        if last is not None and time_s < last:
            if last - time_s <= MAX_LATENESS_S:
                place = next(n for n, row in enumerate(self.rows) if row[0] > time_s)
                after = self.rows[place]
                self.rows.insert(place, (time_s, value, after[2]))
                self.rows[place + 1] = (after[0], after[1], False)
                self.pending = False if not gap else self.pending
                return
            kept = [row for row in self.rows if row[0] < time_s]
            self.undone += len(self.rows) - len(kept)
            self.rows, self.pending = kept, bool(kept)
        self.rows.append((time_s, value, bool(self.rows) and self.pending))
        self.pending = False


def rows_of(samples: Samples) -> list[Row]:
    return list(zip(samples.times.tolist(), samples.values.tolist(), samples.gaps.tolist(), strict=True))


def filled(rows: list[Row]) -> Samples:
    made = Samples()
    if rows:
        times, values, gaps = (np.array(each) for each in zip(*rows, strict=True))
        made.extend(times.astype(float), values.astype(float), gaps.astype(bool))
    return made


numbers = st.one_of(st.floats(-1e6, 1e6), st.sampled_from(ODD))
steps = st.one_of(st.floats(0, 2), st.sampled_from([0.0, -0.2, -5.0, 100.0, -MAX_LATENESS_S]))
batches = st.lists(st.lists(st.tuples(steps, numbers, st.booleans()), max_size=12), max_size=12)


@settings(max_examples=30, deadline=None)
@given(batches)
def test_batches_at_any_times_stay_sorted_and_every_sample_is_kept_or_counted(given_batches) -> None:
    samples, time_s = Samples(), 10.0
    wanted: list[float] = []
    for batch in given_batches:
        rows = []
        for step, value, gap in batch:
            time_s = max(0.0, time_s + step)
            rows.append((time_s, value, gap))
        if rows:
            times, values, gaps = (np.array(each) for each in zip(*rows, strict=True))
            samples.extend(times.astype(float), values.astype(float), gaps.astype(bool))
        wanted += [row[0] for row in rows if math.isfinite(row[1])]
    times = samples.times
    assert bool(np.all(times[1:] >= times[:-1]))
    assert bool(np.all(np.isfinite(samples.values)))
    assert len(samples) + samples.removed_count == len(wanted), "each is kept, or counted"
    assert not len(samples) or not samples.gaps[0]


@settings(max_examples=25, deadline=None)
@given(batches.map(lambda found: [[(abs(step), v, g) for step, v, g in batch] for batch in found]))
def test_gaps_match_reference_implementation(given_batches) -> None:
    samples, naive, time_s = Samples(), Naive(), 0.0
    for batch in given_batches:
        rows = []
        for step, value, gap in batch:
            time_s += step
            rows.append((time_s, value, gap))
            naive.add(time_s, value, gap)
        if rows:
            times, values, gaps = (np.array(each) for each in zip(*rows, strict=True))
            samples.extend(times.astype(float), values.astype(float), gaps.astype(bool))
    assert rows_of(samples) == naive.rows


def test_slightly_late_sample_is_inserted_in_order() -> None:
    samples = filled([(1.0, 1, False), (2.0, 2, False), (3.0, 3, True)])
    samples.add(2.5, 2.5)
    assert rows_of(samples) == [(1, 1, False), (2, 2, False), (2.5, 2.5, True), (3, 3, False)]
    assert samples.earliest_change_s(0) == 2.5


def test_clock_set_back_discards_the_samples_after_that_time() -> None:
    samples = filled([(float(n), n, False) for n in range(100)])
    samples.add(50.5, 7.0)
    assert len(samples) == 52
    assert rows_of(samples)[-1] == (50.5, 7.0, True)
    assert samples.removed_count == 49


def test_sample_with_future_time_stamp_is_removed_by_the_next_valid_sample() -> None:
    samples = filled([(1.0, 1, False), (1e10, 2, False), (2.0, 3, False)])
    assert [row[:2] for row in rows_of(samples)] == [(1.0, 1.0), (2.0, 3.0)]


@st.composite
def series(draw) -> tuple[Samples, list[Row]]:
    """Return up to 5000 samples at irregular times with some gaps, and the same samples as rows."""
    seed, count = draw(st.integers(0, 2**32 - 1)), draw(st.sampled_from([1, 2, 15, 16, 17, 900, 5000]))
    random = np.random.default_rng(seed)
    times = np.cumsum(random.exponential(0.01, count))
    values = random.normal(size=count) * 10.0 ** random.integers(-3, 9)
    gaps = random.random(count) < 0.01
    gaps[0] = False
    samples = Samples()
    for part in np.array_split(np.arange(count), min(count, 7)):
        samples.extend(times[part], values[part], gaps[part])
    return samples, list(zip(times.tolist(), values.tolist(), gaps.tolist(), strict=True))


@settings(max_examples=15, deadline=None)
@given(series(), st.floats(-0.1, 1.1), st.floats(-0.1, 1.1))
def test_stats_of_a_range_match_its_samples(made, one, other) -> None:
    samples, rows = made
    length = rows[-1][0]
    begin, end = sorted((one * length, other * length))
    inside = [value for time_s, value, _gap in rows if begin <= time_s <= end]
    found = samples.stats(begin, end)
    if not inside:
        assert found == RangeStats()
        return
    assert (found.count, found.minimum, found.maximum) == (len(inside), min(inside), max(inside))
    assert found.mean == pytest.approx(
        math.fsum(inside) / len(inside), rel=1e-9, abs=1e-9 * max(map(abs, inside))
    )


@settings(max_examples=15, deadline=None)
@given(series(), st.sampled_from([3, 40, 333]), st.floats(0, 0.5), st.floats(0.5, 1))
def test_drawn_line_includes_the_extremes_and_is_broken_at_gaps(made, columns, one, other) -> None:
    samples, rows = made
    length = rows[-1][0]
    begin, end = one * length, other * length
    inside = [(t, v) for t, v, _gap in rows if begin <= t <= end]
    line = samples.line(begin, end, columns)
    drawn = line.values[np.isfinite(line.values)]
    assert bool(np.all(line.times[1:] >= line.times[:-1]))
    if inside:
        assert drawn.min() <= min(v for _t, v in inside)
        assert drawn.max() >= max(v for _t, v in inside)
        assert set(drawn.tolist()) <= {v for _t, v, _gap in rows}, "nothing is invented"
    if line.is_complete:
        gaps_inside = sum(gap for t, _v, gap in rows if begin < t <= end)
        assert int(np.isnan(line.values).sum()) >= gaps_inside
    else:
        assert len(line.times) <= 3 * (columns + 2)
        assert line.sample_count > MAX_SAMPLES_PER_PIXEL * columns


def test_long_gap_is_not_drawn_when_samples_are_reduced() -> None:
    times = np.concatenate([np.arange(0, 50, 0.001), np.arange(70, 120, 0.001)])
    gaps = np.zeros(len(times), dtype=bool)
    gaps[50_000] = True
    samples = Samples()
    samples.extend(times, np.sin(times), gaps)
    line = samples.line(0, 120, 300)
    assert not line.is_complete
    (broken,) = np.flatnonzero(np.isnan(line.values))
    assert line.times[broken - 1] < 50.5
    assert line.times[broken + 1] > 69.5


def test_single_sample_between_two_gaps_is_visible() -> None:
    samples = filled([(1.0, 1, False), (2.0, 2, False), (3.0, 7, True), (4.0, 4, True), (4.1, 4, False)])
    line = samples.line(0, 10, 100)
    assert line.times[2:6].tolist() == pytest.approx([3.0, 3.0, 3.1, 4.0])
    assert line.values[2:6].tolist() == pytest.approx([math.nan, 7, 7, math.nan], nan_ok=True)
    assert filled([(1.0, 1, False)]).line(0, 10, 100).times.tolist() == pytest.approx([1.0, 1.1])
    assert filled([]).line(0, 10, 100).times.tolist() == []
    same = filled([(1.0, 1, False), (1.0, 2, True), (1.0, 3, True)]).line(0, 10, 100)
    assert bool(np.all(np.diff(same.times) >= 0))
    far = np.concatenate([np.arange(0, 50, 0.001), [60.0], np.arange(70, 120, 0.001)])
    gaps = np.zeros(len(far), dtype=bool)
    gaps[50_000:50_002] = True
    many = Samples()
    many.extend(far, np.where(far == 60.0, 5.0, 0.0), gaps)
    seen = many.line(0, 120, 300)
    (alone,) = np.flatnonzero(seen.values[:-1] == 5.0)[:1]
    assert seen.values[alone + 1] == 5.0
    assert 0 < seen.times[alone + 1] - seen.times[alone] < 120 / 300


def test_memory_is_released_when_the_limit_is_lowered() -> None:
    samples = Samples()
    times = np.arange(200_000) / 1000
    samples.extend(times, times, np.zeros(len(times), dtype=bool))
    samples.limit = 8192
    samples.add(201.0, 1.0)
    assert len(samples) <= 8192
    assert samples.times.base is not None
    assert samples.times.base.nbytes < 8192 * 8 * 4
    assert samples.values[-1] == 1.0
    samples.extend(times + 300, times, np.zeros(len(times), dtype=bool))
    assert samples.evicted_count + len(samples) == 400_001


def test_most_drawn_points_stay_the_same_while_the_plot_scrolls() -> None:
    samples = Samples()
    times = np.arange(0, 100, 0.001)
    samples.extend(times, np.sin(times * 300), np.zeros(len(times), dtype=bool))
    one, two = samples.line(10, 70, 480), samples.line(12, 72, 480)
    points = [set(zip(each.times.tolist(), each.values.tolist(), strict=True)) for each in (one, two)]
    assert len(points[0] & points[1]) > 900


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([20_000, 1 << 20]), st.sampled_from([30, 200]))
def test_incremental_drawing_equals_full_drawing(seed, limit, columns) -> None:
    random = np.random.default_rng(seed)
    samples, now_s = Samples(limit), 0.0
    for _turn in range(12):
        count = int(random.integers(1, 6000))
        times = now_s + np.cumsum(random.exponential(0.001 if random.random() < 0.8 else 0.02, count))
        samples.extend(times, random.normal(size=count), random.random(count) < 0.001)
        now_s = float(times[-1])
        if random.random() < 0.3:
            samples.add(now_s - random.uniform(0, MAX_LATENESS_S), 50.0 * random.normal())  # late
        if random.random() < 0.15:
            now_s -= 2 * MAX_LATENESS_S + random.exponential(5)
            samples.add(now_s, 1.0)  # the clock was set back
        span_s = float(random.choice([10.0, 10.0, 3.0, 1e-40]))
        fresh = Samples()
        fresh.extend(samples.times.copy(), samples.values.copy(), samples.gaps.copy())
        # The view is scrolled back, or another curve has newer samples.
        end_s = now_s - float(random.choice([0.0, random.uniform(0, 5), -random.uniform(0, 3)]))
        one, two = (each.line(end_s - span_s, end_s, columns) for each in (samples, fresh))
        assert np.array_equal(one.times, two.times)
        assert np.array_equal(one.values, two.values, equal_nan=True)


def test_rewritten_samples_are_redrawn() -> None:
    samples, times = Samples(), np.arange(20_000) / 1000
    none = np.zeros(len(times), dtype=bool)
    samples.extend(times, np.zeros(len(times)), none)
    assert samples.line(0, 20, 100).values.max() == 0
    samples.truncate(10.0)
    samples.extend(times[10_000:], np.ones(10_000), none[10_000:])
    line = samples.line(0, 20, 100)
    assert line.values[line.times < 9.5].max() == 0
    assert line.values[line.times > 10.5].min() == 1


def test_oldest_samples_are_evicted_and_counted_with_correct_stats() -> None:
    samples = Samples(limit=8192)
    random = np.random.default_rng(1)
    rows: list[float] = []
    for begin in range(0, 40_000, 500):
        values = random.normal(size=500)
        samples.extend(np.arange(begin, begin + 500) / 10, values, np.zeros(500, dtype=bool))
        rows += values.tolist()
        samples.line(0, 4000, 3)  # builds the pyramid in between
    assert len(samples) <= 8192
    assert samples.evicted_count + len(samples) == 40_000
    assert samples.values.tolist() == rows[samples.evicted_count :]
    found = samples.stats(0, 1e9)
    assert (found.minimum, found.maximum) == (
        min(rows[samples.evicted_count :]),
        max(rows[samples.evicted_count :]),
    )
    assert samples.size_bytes < 8192 * 80


def test_out_of_order_sample_updates_the_maximum() -> None:
    samples = Samples()
    times = np.arange(5000) / 1000
    samples.extend(times, np.zeros(5000), np.zeros(5000, dtype=bool))
    assert samples.stats(0, 10).maximum == 0
    samples.add(4.2, 99.0)
    assert samples.stats(0, 10).maximum == 99.0
    assert samples.stats(0, 10).count == 5001
    assert samples.stats(4.3, 10).maximum == 0


def test_mean_that_overflows_is_unknown() -> None:
    samples = filled([(float(n), 1.7e308, False) for n in range(1 << LEVEL_SHIFTS[-1])])
    assert samples.stats(0, 1e9) == RangeStats(1 << LEVEL_SHIFTS[-1], 1.7e308, 1.7e308, None)


def test_time_of_previous_and_next_sample_is_found() -> None:
    samples = filled([(1.0, 1, False), (2.0, 2, False), (3.0, 3, True)])
    assert [samples.time_at_step(2.0, step) for step in (-2, -1, 1, 2)] == [None, 1.0, 3.0, None]
    assert samples.at(0.5) is None
    assert samples.at(1.5) == (1.0, 1.0)
    assert samples.at(2.5) is None, "nothing is known in a gap"
    assert samples.at(2.0) == (2.0, 2.0)
    assert samples.at(9.0) == (3.0, 3.0)
