"""WakingSubscriber: what subscribers have in common that wake who waits for them, without a descriptor."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod

from nep.backends.base import Wakes

__all__ = ["WakingSubscriber"]


class WakingSubscriber(ABC):
    """`changed` guards what is there to be read; whoever waits on it is notified as well."""

    fd = -1

    def __init__(self, changed: threading.Condition) -> None:
        self._changed = changed
        self._waiting: tuple[Wakes, ...] = ()

    @property
    @abstractmethod
    def has_input(self) -> bool:
        """Whether there is something to read already, or nothing will come any more. With `changed` held."""

    def enter_wait(self, waker: Wakes) -> bool:
        """Before waiting. See `SubscriberTransport.enter_wait`."""
        with self._changed:
            if self.has_input:
                return False
            self._waiting = (*self._waiting, waker)
            return True

    def leave_wait(self, waker: Wakes) -> None:
        """After waiting."""
        with self._changed:
            self._waiting = tuple(each for each in self._waiting if each is not waker)

    def tell_waiting(self) -> None:
        """Something is there, or will not be any more. With `changed` held."""
        self._changed.notify_all()
        for each in self._waiting:
            each.wake()
