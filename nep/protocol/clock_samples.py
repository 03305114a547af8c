"""ClockSamples: how far this computer's clock is from the master's, by the times in renewals. No sockets."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from nep.messages.clocks import UNCERTAINTY_MAX_NS, drift_ns, is_clock

__all__ = ["ClockSamples", "Moment"]

_KEPT = 8
"""Of the last so many renewals, the one that was answered soonest tells most."""
_STEP_NS = 50_000
_SLEW_PARTS = 2_000
"""Who adjusts a clock slowly does it by one part of so many; what is more, and `_STEP_NS`, was set."""


class Moment(NamedTuple):
    """One moment by both clocks: `steady_ns` is the middle of two readings, `slack_ns` apart from either."""

    wall_ns: int
    steady_ns: int
    slack_ns: int


class _Sample(NamedTuple):
    offset_ns: int
    uncertainty_ns: int
    steady_ns: int

    def uncertainty_at(self, steady_ns: int) -> int:
        return self.uncertainty_ns + drift_ns(steady_ns - self.steady_ns)


class ClockSamples:
    """Knows `offset`: what to add to this computer's time, and it is the master's.

    The four times of NTP: a renewal is sent (this clock), received and answered (the master's), and its
    answer is here (this clock). The way there or the way back may have taken all of the time between, so
    half of it is the uncertainty. When one of the clocks was set, all that was known is forgotten.

    `wall` is the clock that messages are stamped with (ns since 1970), `steady` one that nobody sets (ns),
    and `resolution_s` the step in which `wall` goes on.
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
        self._samples: deque[_Sample] = deque(maxlen=_KEPT)
        self._seen: Moment | None = None
        self.steps = 0
        """How often one of the two clocks was seen to be set."""

    def now(self) -> Moment:
        """This moment. What was known is forgotten when this computer's clock was set since the last one."""
        before = self._steady()
        wall_ns = self._wall()
        after = self._steady()
        moment = Moment(wall_ns, (before + after) // 2, (after - before) // 2 + 1)
        if self._seen is not None and not self._fits(self._seen, moment):
            self._stepped()
        self._seen = moment
        return moment

    def add(self, sent: Moment, received_ns: int, answered_ns: int, now: Moment | None = None) -> bool:
        """A renewal that was sent at `sent` was received and answered at these times; whether it is of use.

        `now` is when its answer came, this moment if left out.
        """
        now = now or self.now()
        taken_ns = now.steady_ns - sent.steady_ns
        away_ns = taken_ns - (answered_ns - received_ns)
        is_possible = answered_ns >= received_ns and away_ns >= -now.slack_ns - sent.slack_ns
        if not is_possible or not self._fits(sent, now):
            return False
        offset_ns = (received_ns - sent.wall_ns + answered_ns - now.wall_ns) // 2
        uncertainty_ns = max(0, away_ns) // 2 + self._resolution_ns + now.slack_ns + sent.slack_ns
        if not is_clock(offset_ns, uncertainty_ns):
            return False
        sample = _Sample(offset_ns, uncertainty_ns, now.steady_ns)
        best = self._best(now.steady_ns)
        if best is not None:
            apart_ns = abs(offset_ns - best.offset_ns)
            if apart_ns > uncertainty_ns + best.uncertainty_at(now.steady_ns):
                self._stepped()  # both cannot be true: it was the master's that was set
        self._samples.append(sample)
        return True

    def offset(self, now: Moment | None = None) -> tuple[int, int] | None:
        """What to add to this computer's time to have the master's, and how surely (ns); None: not known."""
        now = now or self.now()
        best = self._best(now.steady_ns)
        if best is None or best.uncertainty_at(now.steady_ns) > UNCERTAINTY_MAX_NS:
            return None
        return best.offset_ns, best.uncertainty_at(now.steady_ns)

    def forget(self) -> None:
        """Another master may have another clock."""
        self._samples.clear()

    def _best(self, steady_ns: int) -> _Sample | None:
        return min(self._samples, key=lambda each: each.uncertainty_at(steady_ns), default=None)

    def _fits(self, then: Moment, now: Moment) -> bool:
        """Whether both clocks went on by as much since then."""
        by_steady = now.steady_ns - then.steady_ns
        allowed = _STEP_NS + then.slack_ns + now.slack_ns + 2 * self._resolution_ns
        return abs(now.wall_ns - then.wall_ns - by_steady) <= allowed + max(0, by_steady) // _SLEW_PARTS

    def _stepped(self) -> None:
        self.steps += 1
        self._samples.clear()
