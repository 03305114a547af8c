"""Calculated curves, which are extended when their inputs grow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.core.series.formula import Calculation, WindowFunction
from app.core.series.samples import Floats, Samples

MAX_WAIT_S = 0.5
"""Maximum time in seconds, by time stamps, that the newest sample of one input waits for other inputs."""
MIN_HOLD_S, MAX_HELD_INTERVALS = 1.0, 8.0
"""Maximum validity of a sample of another input: seconds, and number of usual intervals."""
BATCH_SIZE = 200_000
"""Maximum number of samples that are calculated in one tick."""


class CalculatedSamples:
    """Samples that are calculated from other samples. `advance` processes new input."""

    def __init__(self, inputs: Sequence[Samples]) -> None:
        # Sampled at the times of the first input.
        self.samples = Samples()
        self._inputs = tuple(inputs)
        self._input_revisions = [each.rewrite_count for each in inputs]
        self._next_index = self._inputs[0].evicted_count  # absolute index in the first input

    def advance(self) -> None:
        """Calculate the samples for which all inputs are available, at most `BATCH_SIZE` per call."""
        base = self._inputs[0]
        change_times_s = [
            each.earliest_change_s(revision)
            for each, revision in zip(self._inputs, self._input_revisions, strict=True)
        ]
        self._input_revisions = [each.rewrite_count for each in self._inputs]
        change_s = min((each for each in change_times_s if each is not None), default=None)
        if change_s is not None:
            self.samples.truncate(change_s)
            self._next_index = min(
                self._next_index, base.evicted_count + int(np.searchsorted(base.times, change_s, side="left"))
            )
        if self._next_index < base.evicted_count:
            self.samples.break_line()
        first = max(self._next_index, base.evicted_count) - base.evicted_count
        end = min(self._ready_count(base), first + BATCH_SIZE)
        if end > first:
            with np.errstate(all="ignore"):  # undefined results become gaps
                self.samples.extend(*self._compute(base, first, end))
            self._next_index = base.evicted_count + end

    def _ready_count(self, base: Samples) -> int:
        # Number of the first input's samples that need not wait for other inputs.
        return len(base)

    def _compute(self, base: Samples, first: int, end: int) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        raise NotImplementedError


class WindowCurve(CalculatedSamples):
    """Difference, derivative, integral or moving average of another curve."""

    def __init__(self, kind: WindowFunction, source: Samples, window_s: float) -> None:
        # `window_s` applies only to "mean".
        super().__init__([source])
        self._kind, self._window_s = kind, window_s

    def _compute(self, base: Samples, first: int, end: int) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        times, gaps = base.times[first:end].copy(), base.gaps[first:end].copy()
        if self._kind == "mean":
            return times, self._means(base, first, end), gaps
        previous_index = max(0, first - 1)
        steps_s = np.diff(base.times[previous_index:end], prepend=np.nan if previous_index == first else [])
        values = base.values[previous_index:end]
        is_connected = ~gaps
        if self._kind == "integral":
            means = 0.5 * (values[1:] + values[:-1])
            areas = np.concatenate([[0.0], means * np.diff(base.times[previous_index:end])])[-(end - first) :]
            areas[~is_connected] = 0.0  # unknown across a gap
            start_value = float(self.samples.values[-1]) if len(self.samples) else 0.0
            return times, start_value + np.cumsum(areas), gaps
        changes = np.diff(values, prepend=np.nan if previous_index == first else [])
        if self._kind == "derivative":
            changes = changes / steps_s
        changes[~is_connected] = np.nan
        return times, changes, gaps

    def _means(self, base: Samples, first: int, end: int) -> Floats:
        times, values = base.times, base.values
        window_starts = np.searchsorted(times, times[first:end] - self._window_s, side="right")
        lowest_start = int(window_starts[0])
        # Scaling avoids an overflow of the sum.
        scale = max(1.0, float(np.abs(values[lowest_start:end]).max()) / 1e290)
        sums = np.concatenate([[0.0], np.cumsum(values[lowest_start:end] / scale)])
        counts = np.arange(first, end) + 1 - window_starts
        means: Floats = (
            (sums[first + 1 - lowest_start : end + 1 - lowest_start] - sums[window_starts - lowest_start])
            / counts
            * scale
        )
        return means


class ExpressionCurve(CalculatedSamples):
    """Curve calculated by an expression from several curves.

    The expression is evaluated at the times of the first input, with the newest sample of each other
    input.
    """

    def __init__(self, calculate: Calculation, inputs: Sequence[Samples]) -> None:
        super().__init__(inputs)
        self._calculate = calculate

    def _ready_count(self, base: Samples) -> int:
        last_s = base.last_s
        if last_s is None:
            return 0
        last_times = [-np.inf if each.last_s is None else each.last_s for each in self._inputs[1:]]
        until_s = max(min(last_times, default=last_s), last_s - MAX_WAIT_S)
        return int(np.searchsorted(base.times, until_s, side="right"))

    def _compute(self, base: Samples, first: int, end: int) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        times = base.times[first:end].copy()
        arrays = [base.values[first:end], *(held_values(each, times) for each in self._inputs[1:])]
        values = np.broadcast_to(np.asarray(self._calculate(arrays), dtype=float), times.shape).copy()
        return times, values, base.gaps[first:end].copy()


def held_values(samples: Samples, times: Floats) -> Floats:
    """Return the newest value at each of the given times.

    The result is NaN before the first sample, in a gap, and if the newest sample is much older than the
    usual interval between samples.
    """
    if not len(samples):
        return np.full(len(times), np.nan)
    indexes = np.searchsorted(samples.times, times, side="right") - 1
    clamped = np.maximum(indexes, 0)
    values: Floats = samples.values[clamped].copy()
    age_s = times - samples.times[clamped]
    next_indexes = np.minimum(clamped + 1, len(samples) - 1)
    is_in_gap = samples.gaps[next_indexes] & (next_indexes > clamped) & (age_s > 0)
    is_too_old = np.zeros(len(times), dtype=bool)
    if len(samples) > 1:
        usual_interval_s = float(samples.times[-1] - samples.times[0]) / (len(samples) - 1)
        is_too_old = age_s > max(MIN_HOLD_S, MAX_HELD_INTERVALS * usual_interval_s)
    values[(indexes < 0) | is_in_gap | is_too_old] = np.nan
    return values
