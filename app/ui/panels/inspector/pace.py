"""How often what a person reads may change: the first few at once, then ten times a second."""

from __future__ import annotations

BURST = 3
"""So many come at once after a pause: one message after the other, as by hand, never waits."""
HZ = 10.0
"""Nobody reads what changes more often, and each time may cost a graphics driver the whole window."""


class ReadingPace:
    """Lets ``burst`` changes through at once, and then ``hz`` a second; whoever waits asks again."""

    def __init__(self, burst: int = BURST, hz: float = HZ) -> None:
        self._most, self._hz = float(burst), hz
        self.begin_anew()

    def begin_anew(self) -> None:
        """What comes next comes at once: a person asked for it."""
        self._left, self._asked_s = self._most, 0.0

    def may(self, now_s: float) -> bool:
        """Whether it may change now (monotonic s); then it is counted as done."""
        grown = max(0.0, now_s - self._asked_s) * self._hz
        self._left, self._asked_s = min(self._most, self._left + grown), now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True

    def spend(self, now_s: float) -> None:
        """It changed already: the next change is one of those that wait."""
        self._left, self._asked_s = 0.0, now_s
