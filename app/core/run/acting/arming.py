"""Switch that allows sending for some minutes, to selected topics and services."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Literal, NamedTuple

ARMED_S = 300.0
MIN_ARMED_S, MAX_ARMED_S = 60.0, 3600.0
MAX_TARGETS = 20


class Target(NamedTuple):
    """Topic to which messages are sent, or service that is called."""

    kind: Literal["topic", "service"]
    name: str


class Arming:
    """Switch for sending, initially off.

    Thread-safe: after `disarm` has returned, `run_if_armed` calls nothing.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.RLock()
        self._start_s = self._duration_s = 0.0
        self._is_on = False
        self._targets: tuple[Target, ...] = ()
        self._confirmed_topics: frozenset[str] = frozenset()
        self.turn = 0
        """Number that increases with each switching; requests made during one turn are invalid in the next.
        """
        self.revision = 0

    @property
    def is_on(self) -> bool:
        """True if sending is allowed now."""
        return self.remaining_s > 0

    @property
    def has_expired(self) -> bool:
        """True if the time has elapsed and `disarm` has not been called since then."""
        return self._is_on and self.remaining_s <= 0

    @property
    def remaining_s(self) -> float:
        """Remaining time in seconds, at most the duration given to `arm`; 0 if sending is off."""
        # start + duration - now can exceed the duration by a rounding error, and the window rounds up.
        elapsed_s = self._clock() - self._start_s
        return max(0.0, self._duration_s - elapsed_s) if self._is_on else 0.0

    @property
    def targets(self) -> tuple[Target, ...]:
        """Allowed targets, in the order in which they were allowed."""
        return self._targets

    def allows(self, target: Target) -> bool:
        """Return True if sending to a target is allowed now."""
        return self.is_on and target in self._targets

    def arm(self, seconds: float = ARMED_S) -> None:
        """Switch sending on, or extend the time.

        Args:
            seconds: Time from now in seconds, limited to `MIN_ARMED_S` to `MAX_ARMED_S`.
        """
        with self._lock:
            if not self.is_on:
                self._targets, self._confirmed_topics = (), frozenset()
                self.turn += 1
            self._is_on = True
            self._start_s, self._duration_s = self._clock(), min(MAX_ARMED_S, max(MIN_ARMED_S, seconds))
            self.revision += 1

    def allow(self, target: Target, *, is_confirmed: bool = False) -> bool:
        """Allow a target; return False if sending is off or `MAX_TARGETS` targets are already allowed.

        Args:
            target: Topic or service.
            is_confirmed: True if the user has confirmed that the topic moves robots.
        """
        with self._lock:
            if not self.is_on or (target not in self._targets and len(self._targets) >= MAX_TARGETS):
                return False
            if target not in self._targets:
                self._targets = (*self._targets, target)
            if is_confirmed:
                self._confirmed_topics |= {target.name}
            self.revision += 1
            return True

    def is_confirmed(self, topic: str) -> bool:
        """Return True if the user has confirmed that the topic moves robots."""
        return topic in self._confirmed_topics

    def deny(self, target: Target) -> None:
        """Deny a target."""
        with self._lock:
            self._targets = tuple(each for each in self._targets if each != target)
            self._confirmed_topics -= {target.name}
            self.revision += 1

    def disarm(self) -> bool:
        """Switch sending off; return True if it was on. Nothing is sent after this returns."""
        with self._lock:
            was_on, self._is_on = self._is_on, False
            self._targets, self._confirmed_topics = (), frozenset()
            if was_on:
                self.turn += 1
                self.revision += 1
            return was_on

    def run_if_armed(self, turn: int, target: Target, send: Callable[[], object]) -> bool:
        """Call ``send`` if a target is allowed; return True if it was called.

        A lock is held during the call, so ``send`` must not block.

        Args:
            turn: Number of the arming. If sending was switched off or on again since, ``send`` is not
                called.
            target: Topic or service.
            send: Function that sends.
        """
        with self._lock:
            if turn != self.turn or not self.allows(target):
                return False
            send()
            return True
