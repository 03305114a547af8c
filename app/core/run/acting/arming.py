"""The switch without which nothing is sent: on for some minutes, for topics and services chosen by name."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Literal, NamedTuple

ARMED_S = 300.0
LEAST_S, MOST_S = 60.0, 3600.0
MOST_NAMES = 20


class Target(NamedTuple):
    """Where something is sent to."""

    kind: Literal["topic", "service"]
    name: str


class Arming:
    """Off at first. Any thread may use it: nothing is done by `if_armed` once `disarm` has returned."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """``clock`` is monotonic seconds."""
        self._clock = clock
        self._lock = threading.RLock()
        self._until_s = 0.0
        self._is_on = False
        self._targets: tuple[Target, ...] = ()
        self._confirmed: frozenset[str] = frozenset()
        self.turn = 0
        """Another number each time that it is switched: what was asked for in one turn ends with it."""
        self.revision = 0

    @property
    def is_on(self) -> bool:
        """Whether anything may be sent now."""
        return self._is_on and self._clock() < self._until_s

    @property
    def is_over(self) -> bool:
        """Whether its time is over, and nobody has switched it off since."""
        return self._is_on and self._clock() >= self._until_s

    @property
    def left_s(self) -> float:
        """How long it stays on."""
        return max(0.0, self._until_s - self._clock()) if self._is_on else 0.0

    @property
    def targets(self) -> tuple[Target, ...]:
        """What may be sent to, in the order in which it was chosen."""
        return self._targets

    def allows(self, target: Target) -> bool:
        """Whether something may be sent there now."""
        return self.is_on and target in self._targets

    def arm(self, seconds: float = ARMED_S) -> None:
        """Switch it on, or give it so much time from now: 1 to 60 minutes."""
        with self._lock:
            if not self.is_on:
                self._targets, self._confirmed = (), frozenset()
                self.turn += 1
            self._is_on = True
            self._until_s = self._clock() + min(MOST_S, max(LEAST_S, seconds))
            self.revision += 1

    def allow(self, target: Target, *, is_confirmed: bool = False) -> bool:
        """Let something be sent there; False while it is off, and for more than 20 names.

        ``is_confirmed``: a person knows that this moves a robot.
        """
        with self._lock:
            if not self.is_on or (target not in self._targets and len(self._targets) >= MOST_NAMES):
                return False
            if target not in self._targets:
                self._targets = (*self._targets, target)
            if is_confirmed:
                self._confirmed |= {target.name}
            self.revision += 1
            return True

    def is_confirmed(self, topic: str) -> bool:
        """Whether a person knows that this topic moves a robot."""
        return topic in self._confirmed

    def forbid(self, target: Target) -> None:
        """Let nothing be sent there any more."""
        with self._lock:
            self._targets = tuple(each for each in self._targets if each != target)
            self._confirmed -= {target.name}
            self.revision += 1

    def disarm(self) -> bool:
        """Switch it off; whether it was on. From when this returns on nothing is sent."""
        with self._lock:
            was_on, self._is_on = self._is_on, False
            self._targets, self._confirmed = (), frozenset()
            if was_on:
                self.turn += 1
                self.revision += 1
            return was_on

    def if_armed(self, turn: int, target: Target, do: Callable[[], object]) -> bool:
        """Do it, if it is still the same ``turn`` and allowed; whether it was done. ``do`` must not wait."""
        with self._lock:
            if turn != self.turn or not self.allows(target):
                return False
            do()
            return True
