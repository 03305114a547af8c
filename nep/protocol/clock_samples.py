"""Clock offset between this computer and the master, estimated from renewals. Performs no I/O."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from nep.messages.clocks import MAX_UNCERTAINTY_NS, drift_ns, is_plausible_clock

_MAX_SAMPLES = 8
"""Maximum number of stored samples; the sample with the shortest round trip determines the offset."""
_MIN_STEP_NS = 50_000
_SLEW_DIVISOR = 2_000
"""Reciprocal of the fastest clock slew. A larger change (plus `_MIN_STEP_NS`) is treated as a step."""


class Moment(NamedTuple):
    """Simultaneous readings of both clocks of this computer.

    Attributes:
        wall_ns: Clock of message time stamps, in nanoseconds since 1970.
        steady_ns: Monotonic clock in nanoseconds: the middle of two readings.
        uncertainty_ns: Uncertainty (±) of `steady_ns`.
    """

    wall_ns: int
    steady_ns: int
    uncertainty_ns: int


class _Sample(NamedTuple):
    offset_ns: int
    uncertainty_ns: int
    steady_ns: int

    def uncertainty_at(self, steady_ns: int) -> int:
        return self.uncertainty_ns + drift_ns(steady_ns - self.steady_ns)


class ClockSamples:
    """Estimator of the clock offset to the master, from four time stamps as in NTP.

    A renewal is sent (this clock), received and answered (the master's clock), and its reply arrives
    (this clock). The delay may lie entirely in one direction, so half of it is the uncertainty. When
    one of the clocks is set, all samples are discarded.

    Args:
        wall: Clock of message time stamps, in ns since 1970.
        steady: Monotonic clock in ns.
        resolution_s: Resolution of `wall` in seconds.
    """

    def __init__(
        self,
        wall: Callable[[], int] | None = None,
        steady: Callable[[], int] = time.monotonic_ns,
        resolution_s: float | None = None,
    ) -> None:
        self._wall = wall or time.time_ns
        self._steady = steady
        if resolution_s is None:
            resolution_s = time.get_clock_info("time").resolution
        self._resolution_ns = int(resolution_s * 1e9)
        self._samples: deque[_Sample] = deque(maxlen=_MAX_SAMPLES)
        self._last_moment: Moment | None = None
        self.steps = 0
        """Number of detected clock steps."""

    def now(self) -> Moment:
        """Return the current readings of both clocks.

        Discards all samples if this computer's clock was set since the last reading.
        """
        before = self._steady()
        wall_ns = self._wall()
        after = self._steady()
        moment = Moment(wall_ns, (before + after) // 2, (after - before) // 2 + 1)
        if self._last_moment is not None and not self._is_consistent(self._last_moment, moment):
            self._on_step()
        self._last_moment = moment
        return moment

    def add(self, sent: Moment, received_ns: int, answered_ns: int, now: Moment | None = None) -> bool:
        """Add the time stamps of a renewal; return False if they are unusable.

        Args:
            sent: Readings at sending.
            received_ns: Time of receipt by the master's clock.
            answered_ns: Time of the reply by the master's clock.
            now: Readings at the arrival of the reply; None for the current ones.
        """
        now = now or self.now()
        elapsed_ns = now.steady_ns - sent.steady_ns
        round_trip_ns = elapsed_ns - (answered_ns - received_ns)
        is_possible = (
            answered_ns >= received_ns and round_trip_ns >= -now.uncertainty_ns - sent.uncertainty_ns
        )
        if not is_possible or not self._is_consistent(sent, now):
            return False
        offset_ns = (received_ns - sent.wall_ns + answered_ns - now.wall_ns) // 2
        uncertainty_ns = (
            max(0, round_trip_ns) // 2 + self._resolution_ns + now.uncertainty_ns + sent.uncertainty_ns
        )
        if not is_plausible_clock(offset_ns, uncertainty_ns):
            return False
        sample = _Sample(offset_ns, uncertainty_ns, now.steady_ns)
        best = self._best_sample(now.steady_ns)
        if best is not None:
            difference_ns = abs(offset_ns - best.offset_ns)
            if difference_ns > uncertainty_ns + best.uncertainty_at(now.steady_ns):
                self._on_step()  # contradiction: the master's clock was set
        self._samples.append(sample)
        return True

    def offset(self, now: Moment | None = None) -> tuple[int, int] | None:
        """Return the offset to add to this computer's time, and its uncertainty, in ns; None if unknown."""
        now = now or self.now()
        best = self._best_sample(now.steady_ns)
        if best is None or best.uncertainty_at(now.steady_ns) > MAX_UNCERTAINTY_NS:
            return None
        return best.offset_ns, best.uncertainty_at(now.steady_ns)

    def clear(self) -> None:
        """Discard all samples, because another master may have another clock."""
        self._samples.clear()

    def _best_sample(self, steady_ns: int) -> _Sample | None:
        return min(self._samples, key=lambda each: each.uncertainty_at(steady_ns), default=None)

    def _is_consistent(self, previous: Moment, now: Moment) -> bool:
        # True if both clocks have advanced equally.
        elapsed_ns = now.steady_ns - previous.steady_ns
        allowed = _MIN_STEP_NS + previous.uncertainty_ns + now.uncertainty_ns + 2 * self._resolution_ns
        return (
            abs(now.wall_ns - previous.wall_ns - elapsed_ns) <= allowed + max(0, elapsed_ns) // _SLEW_DIVISOR
        )

    def _on_step(self) -> None:
        self.steps += 1
        self._samples.clear()
