"""Waiting for subscribers of any nodes and back ends in one thread."""

from __future__ import annotations

import selectors
from collections import deque
from contextlib import suppress

from nep.backends.base import SubscriberTransport
from nep.errors import TooManyFilesError
from nep.i18n import _
from nep.system.descriptors import descriptor_limit, is_descriptor_shortage, open_descriptor_count
from nep.system.wakeup import Waker

_POLL_INTERVAL_S = 0.01
"""Polling interval in seconds for subscribers that can't notify."""


class _ReadyCallback:
    """Object that a transport wakes when its subscriber may have a message. Implements `Wakeable`."""

    def __init__(self, shared_wait: SharedWait, subscriber: SubscriberTransport) -> None:
        self._shared_wait = shared_wait
        self._subscriber = subscriber

    def wake(self) -> None:
        # Thread-safe.
        self._shared_wait.set_ready(self._subscriber)


class SharedWait:
    """Wait of one thread for several subscribers, by their descriptors or, without one, by notification.

    Only the waiting thread may call `arm`, `disarm` and `close`; `wake` is thread-safe. If `wake` is
    called while no thread waits, the next wait ends immediately.

    Raises:
        TooManyFilesError: The process has too many open files.
    """

    def __init__(self) -> None:
        self._waker = Waker()
        try:
            self._selector = selectors.DefaultSelector()
        except OSError as error:
            self._waker.close()
            if is_descriptor_shortage(error.errno):
                raise TooManyFilesError(
                    _("a waiting thread"), open_descriptor_count(), descriptor_limit()
                ) from error
            raise
        self._selector.register(self._waker.fd, selectors.EVENT_READ)
        self._armed_callbacks: dict[SubscriberTransport, _ReadyCallback] = {}
        self._polled_subscribers: set[SubscriberTransport] = set()
        self._ready_queue: deque[SubscriberTransport] = deque()

    def arm(self, subscriber: SubscriberTransport) -> bool:
        """Add a subscriber to the wait. Idempotent.

        Returns False, without adding the subscriber, if it may have a message already or is closed.
        """
        if subscriber in self._armed_callbacks or subscriber in self._polled_subscribers:
            return True
        if getattr(subscriber, "enter_wait", None) is None:  # an older plug-in
            self._polled_subscribers.add(subscriber)
            return not subscriber.is_closed
        callback = _ReadyCallback(self, subscriber)
        if not subscriber.enter_wait(callback):
            return False
        self._armed_callbacks[subscriber] = callback
        if subscriber.fd >= 0:
            try:
                self._selector.register(subscriber.fd, selectors.EVENT_READ, subscriber)
            except (OSError, ValueError, KeyError):  # not pollable
                subscriber.leave_wait(self._armed_callbacks.pop(subscriber))
                self._polled_subscribers.add(subscriber)
        return True

    def disarm(self, subscriber: SubscriberTransport) -> None:
        """Remove a subscriber from the wait."""
        self._polled_subscribers.discard(subscriber)
        callback = self._armed_callbacks.pop(subscriber, None)
        if callback is not None:
            if subscriber.fd >= 0:
                with suppress(
                    OSError, ValueError, KeyError
                ):  # closed; its descriptor may now belong to another file
                    self._selector.unregister(subscriber.fd)
            subscriber.leave_wait(callback)

    def disarm_all(self) -> None:
        """Remove all subscribers from the wait."""
        for subscriber in list(self._armed_callbacks):
            self.disarm(subscriber)
        self._polled_subscribers.clear()

    def wait(self, timeout_s: float) -> list[SubscriberTransport]:
        """Wait until a subscriber is ready or `wake` is called; return the ready subscribers.

        The returned subscribers are removed from the wait; call `arm` to wait for them again.

        Args:
            timeout_s: Time limit in seconds.
        """
        ready = self._selector.select(
            min(timeout_s, _POLL_INTERVAL_S) if self._polled_subscribers else timeout_s
        )
        self._waker.clear()
        self._ready_queue.extend(key.data for key, _events in ready if key.data is not None)
        self._ready_queue.extend(self._polled_subscribers)
        ready_subscribers: dict[SubscriberTransport, None] = {}
        while self._ready_queue:
            subscriber = self._ready_queue.popleft()
            if subscriber in self._armed_callbacks or subscriber in self._polled_subscribers:
                self.disarm(subscriber)
                ready_subscribers[subscriber] = None
        return list(ready_subscribers)

    def set_ready(self, subscriber: SubscriberTransport) -> None:
        """Mark a subscriber as ready and end the wait. Thread-safe."""
        self._ready_queue.append(subscriber)
        self._waker.wake()

    def wake(self) -> None:
        """End the current wait; if no thread waits, the next wait ends immediately. Thread-safe."""
        self._waker.wake()

    def close(self) -> None:
        """Disarm all subscribers and close the descriptors."""
        self.disarm_all()
        self._selector.close()
        self._waker.close()
