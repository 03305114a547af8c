"""SharedWait: what one thread waits by for subscribers of any nodes and back ends."""

from __future__ import annotations

import selectors
from collections import deque
from contextlib import suppress

from nep.backends.base import SubscriberTransport
from nep.errors import TooManyFilesError
from nep.system.descriptors import is_lack, limit, opened
from nep.system.wakeup import Waker

__all__ = ["SharedWait"]

_LOOK_S = 0.01
"""How often those are looked at that cannot tell when something comes."""


class _Bell:
    """What a subscriber rings. A `Wakes`."""

    def __init__(self, waits: SharedWait, subscriber: SubscriberTransport) -> None:
        self._waits = waits
        self._subscriber = subscriber

    def wake(self) -> None:
        """There may be something to read. From any thread."""
        self._waits.ring(self._subscriber)


class SharedWait:
    """Subscribers that are armed, until they ring: one that has a descriptor is polled, others ring a bell.

    Only the thread that waits arms, disarms and closes; any thread may `wake` it. A wake that comes early is
    kept. Raises `TooManyFilesError`.
    """

    def __init__(self) -> None:
        self._waker = Waker()
        try:
            self._selector = selectors.DefaultSelector()
        except OSError as error:
            self._waker.close()
            if is_lack(error.errno):
                raise TooManyFilesError("a thread that waits", opened(), limit()) from error
            raise
        self._selector.register(self._waker.fd, selectors.EVENT_READ)
        self._bells: dict[SubscriberTransport, _Bell] = {}
        self._looked_at: set[SubscriberTransport] = set()
        self._rung: deque[SubscriberTransport] = deque()

    def arm(self, subscriber: SubscriberTransport) -> bool:
        """Wait for this one, too; False when it may have something already, or is closed. Twice is once."""
        if subscriber in self._bells or subscriber in self._looked_at:
            return True
        if getattr(subscriber, "enter_wait", None) is None:  # of a plug-in that is older
            self._looked_at.add(subscriber)
            return not subscriber.is_closed
        bell = _Bell(self, subscriber)
        if not subscriber.enter_wait(bell):
            return False
        self._bells[subscriber] = bell
        if subscriber.fd >= 0:
            try:
                self._selector.register(subscriber.fd, selectors.EVENT_READ, subscriber)
            except (OSError, ValueError, KeyError):  # it cannot be polled
                subscriber.leave_wait(self._bells.pop(subscriber))
                self._looked_at.add(subscriber)
        return True

    def disarm(self, subscriber: SubscriberTransport) -> None:
        """Wait for it no more."""
        self._looked_at.discard(subscriber)
        bell = self._bells.pop(subscriber, None)
        if bell is not None:
            if subscriber.fd >= 0:
                with suppress(
                    OSError, ValueError, KeyError
                ):  # it was closed, and the number may be another's
                    self._selector.unregister(subscriber.fd)
            subscriber.leave_wait(bell)

    def disarm_all(self) -> None:
        """Wait for none any more."""
        for subscriber in list(self._bells):
            self.disarm(subscriber)
        self._looked_at.clear()

    def wait(self, timeout_s: float) -> list[SubscriberTransport]:
        """Wait until one rings or `wake` is called, `timeout_s` at most; those that rang are disarmed."""
        ready = self._selector.select(min(timeout_s, _LOOK_S) if self._looked_at else timeout_s)
        self._waker.clear()
        self._rung.extend(key.data for key, _events in ready if key.data is not None)
        self._rung.extend(self._looked_at)
        rung: dict[SubscriberTransport, None] = {}
        while self._rung:
            subscriber = self._rung.popleft()
            if subscriber in self._bells or subscriber in self._looked_at:
                self.disarm(subscriber)
                rung[subscriber] = None
        return list(rung)

    def ring(self, subscriber: SubscriberTransport) -> None:
        """This one may have something to read. From any thread."""
        self._rung.append(subscriber)
        self._waker.wake()

    def wake(self) -> None:
        """End the wait that is under way, or the next one. From any thread."""
        self._waker.wake()

    def close(self) -> None:
        """Disarm all, and give the descriptors back."""
        self.disarm_all()
        self._selector.close()
        self._waker.close()
