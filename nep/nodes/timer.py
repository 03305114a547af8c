"""Timer: calls a function again and again, in the thread that spins. Made by `Node.new_timer`."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence

__all__ = ["Timer", "next_due"]


class Timer:
    """Due every `period_s` seconds, for the first time after one period; late, it is due once.

    So a timer whose periods passed while something else ran does not make up for them, and keeps its beat:
    it is due at whole periods after it was made. May be used from any thread, and by several that spin.
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
        self._lock = threading.Lock()
        self._due = clock() + period_s

    @property
    def period_s(self) -> float:
        """Seconds from one call to the next."""
        return self._period_s

    @property
    def callback(self) -> Callable[[], object]:
        """What it calls."""
        return self._callback

    @property
    def is_cancelled(self) -> bool:
        """Whether it, or its node, was ended."""
        return self._is_cancelled

    @property
    def due(self) -> float:
        """When it is due, by its clock."""
        return self._due

    def run_if_due(self) -> bool:
        """Call the function if it is time; whether it was. What the function raises comes out here."""
        is_due = self.take_turn()
        if is_due:
            self._callback()
        return is_due

    def take_turn(self) -> bool:
        """Whether it is time to call the function; True to one of several threads that ask, which then does.

        It is not due again before the next period, also when the function raises, or spins itself.
        """
        now = self._clock()
        if self._is_cancelled or now < self._due:
            return False
        with self._lock:
            if now < self._due:  # another thread was first
                return False
            self._due = now + self._period_s - math.fmod(now - self._due, self._period_s)
        return True

    def cancel(self) -> None:
        """Call no more; a call that is under way ends by itself. From any thread; may be called twice."""
        self._is_cancelled = True
        if self._on_cancel is not None:
            self._on_cancel(self)

    def node_closes(self) -> None:
        """Call no more: the node is closed, or this is a child that was forked. Takes no lock."""
        self._is_cancelled = True

    def __repr__(self) -> str:
        return f"Timer({self._period_s!r})"


def next_due(timers: Sequence[Timer]) -> float:
    """When the first of them is due; infinite when there are none."""
    return min((each.due for each in timers), default=math.inf)
