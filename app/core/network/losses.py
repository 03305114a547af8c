"""How many messages were lost lately, from totals that only grow."""

from __future__ import annotations

from collections import deque

WINDOW_S = 30.0


class RecentLosses:
    """Counts what was lost in the last 30 s."""

    def __init__(self) -> None:
        """What was lost before the first total is not counted."""
        self._grew: deque[tuple[float, int]] = deque()
        self._before: int | None = None

    def count(self, total: int, now: float) -> int:
        """The losses of the last 30 s; ``total`` is all that were ever lost, ``now`` monotonic seconds."""
        if self._before is not None and total > self._before:
            self._grew.append((now, total - self._before))
        self._before = total
        while self._grew and now - self._grew[0][0] > WINDOW_S:
            self._grew.popleft()
        return sum(lost for _, lost in self._grew)
