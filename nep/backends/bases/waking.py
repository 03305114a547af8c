"""Base class of subscribers that have no file descriptor."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod

from nep.backends.base import Wakeable


class WakingSubscriber(ABC):
    """Subscriber that wakes its waiting threads through wakers. The condition `changed` guards its input."""

    fd = -1

    def __init__(self, changed: threading.Condition) -> None:
        self._changed = changed
        self._wakers: tuple[Wakeable, ...] = ()

    @property
    @abstractmethod
    def has_input(self) -> bool:
        """True if input is available or the subscriber is closed. Call with `changed` held."""

    def enter_wait(self, waker: Wakeable) -> bool:
        """Register `waker` and return True; return False without registering it if input is available.

        A closed subscriber counts as having input.
        """
        with self._changed:
            if self.has_input:
                return False
            self._wakers = (*self._wakers, waker)
            return True

    def leave_wait(self, waker: Wakeable) -> None:
        """Unregister `waker`."""
        with self._changed:
            self._wakers = tuple(each for each in self._wakers if each is not waker)

    def notify_waiting(self) -> None:
        """Wake all waiting threads. Call with `changed` held."""
        self._changed.notify_all()
        for waker in self._wakers:
            waker.wake()
