"""Switch that allows sending, for some minutes and to selected topics and services."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Literal, NamedTuple

ARMED_S = 300.0
MIN_S, MAX_S = 60.0, 3600.0
MAX_TARGETS = 20


class Target(NamedTuple):
    """Topic or service to which something is sent."""

    kind: Literal["topic", "service"]
    name: str


class Arming:
    """Switch for sending, initially off. Thread-safe: `if_armed` does nothing once `disarm` has returned."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.RLock()
        self._until_s = 0.0
        self._is_on = False
        self._targets: tuple[Target, ...] = ()
        self._confirmed: frozenset[str] = frozenset()
        self.turn = 0
        """Number that increases with each switching; requests made during one turn are invalid in the next.
        """
        self.revision = 0

    @property
    def is_on(self) -> bool:
        """True if sending is allowed now."""
        return self._is_on and self._clock() < self._until_s

    @property
    def is_over(self) -> bool:
        """True if the time has elapsed and `disarm` was not called since."""
        return self._is_on and self._clock() >= self._until_s

    @property
    def remaining_s(self) -> float:
        """Remaining time in seconds."""
        return max(0.0, self._until_s - self._clock()) if self._is_on else 0.0

    @property
    def targets(self) -> tuple[Target, ...]:
        """Allowed targets in the order in which they were added."""
        return self._targets

    def allows(self, target: Target) -> bool:
        """Return True if sending to a target is allowed now."""
        return self.is_on and target in self._targets

    def arm(self, seconds: float = ARMED_S) -> None:
        """Switch on, or extend the time, for ``seconds`` from now (limited to `MIN_S` ... `MAX_S`)."""
        with self._lock:
            if not self.is_on:
                self._targets, self._confirmed = (), frozenset()
                self.turn += 1
            self._is_on = True
            self._until_s = self._clock() + min(MAX_S, max(MIN_S, seconds))
            self.revision += 1

    def allow(self, target: Target, *, is_confirmed: bool = False) -> bool:
        """Allow a target; return False while switched off or if there are `MAX_NAMES` targets already.

        ``is_confirmed`` is True if the user has confirmed that this moves a robot.
        """
        with self._lock:
            if not self.is_on or (target not in self._targets and len(self._targets) >= MAX_TARGETS):
                return False
            if target not in self._targets:
                self._targets = (*self._targets, target)
            if is_confirmed:
                self._confirmed |= {target.name}
            self.revision += 1
            return True

    def is_confirmed(self, topic: str) -> bool:
        """Return True if the user has confirmed that this topic moves a robot."""
        return topic in self._confirmed

    def forbid(self, target: Target) -> None:
        """Disallow a target."""
        with self._lock:
            self._targets = tuple(each for each in self._targets if each != target)
            self._confirmed -= {target.name}
            self.revision += 1

    def disarm(self) -> bool:
        """Switch off; return True if it was on. Nothing is sent after this returns."""
        with self._lock:
            was_on, self._is_on = self._is_on, False
            self._targets, self._confirmed = (), frozenset()
            if was_on:
                self.turn += 1
                self.revision += 1
            return was_on

    def run_if_armed(self, turn: int, target: Target, do: Callable[[], object]) -> bool:
        """Call ``do`` if the target is allowed and the turn is still ``turn``; return True if it was called.

        The lock is held meanwhile, so ``do`` must not block.
        """
        with self._lock:
            if turn != self.turn or not self.allows(target):
                return False
            do()
            return True
