"""Periodic timers in the thread that spins a node. Created by `Node.new_timer`."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence

from nep.system.forks import current_generation


class Timer:
    """Periodic timer of a node. Thread-safe. Created by `Node.new_timer`.

    The first call is after one period. Missed ticks are coalesced, and the schedule stays aligned to the
    period.

        timer = node.new_timer(0.1, lambda: pub.publish(read_sensor()))
        node.spin()
    """

    def __init__(
        self,
        period_s: float,
        callback: Callable[[], object],
        clock: Callable[[], float],
        on_cancel: Callable[[Timer], object] | None = None,
    ) -> None:
        self._period_s = period_s
        self._callback = callback
        self._clock = clock
        self._on_cancel = on_cancel
        self._is_cancelled = False
        self._generation = current_generation()
        self._lock = threading.Lock()
        self._due = clock() + period_s

    @property
    def period_s(self) -> float:
        """Period in seconds."""
        return self._period_s

    @property
    def callback(self) -> Callable[[], object]:
        """Function that the timer calls."""
        return self._callback

    @property
    def is_cancelled(self) -> bool:
        """True if the timer was cancelled, its node was closed, or this is a forked child process."""
        return self._is_cancelled or self._generation.is_inherited

    @property
    def due(self) -> float:
        """Time of the next call, by the timer's clock."""
        return self._due

    def run_if_due(self) -> bool:
        """Call the function if the timer is due; return True if it was. Exceptions propagate."""
        is_due = self.claim_tick()
        if is_due:
            self._callback()
        return is_due

    def claim_tick(self) -> bool:
        """Claim the current tick; return True if the timer is due and this thread must run the callback.

        If several threads call this at the same time, only one gets True. The next due time is set
        before the call, so that it is correct even if the function raises or spins itself.
        """
        now = self._clock()
        if self.is_cancelled or now < self._due:
            return False
        with self._lock:
            if now < self._due:  # another thread was faster
                return False
            self._due = now + self._period_s - math.fmod(now - self._due, self._period_s)
        return True

    def cancel(self) -> None:
        """Cancel the timer. A running call is not interrupted. Thread-safe; idempotent."""
        if self._generation.is_inherited:
            return
        self._is_cancelled = True
        if self._on_cancel is not None:
            self._on_cancel(self)

    def on_node_close(self) -> None:
        """Cancel the timer because its node is closed."""
        self._is_cancelled = True

    def __repr__(self) -> str:
        return f"Timer({self._period_s!r})"


def next_due(timers: Sequence[Timer]) -> float:
    """Return the earliest due time, or infinity without timers."""
    return min((each.due for each in timers), default=math.inf)
