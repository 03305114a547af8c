"""Condition variable and sink thread that the subscribers of one node share."""

from __future__ import annotations

import logging
import threading
from collections.abc import Sequence
from typing import Protocol

from nep.backends.base import Sink
from nep.messages.message import Message

_logger = logging.getLogger("nep")
_BATCH_INTERVAL_S = 0.005  # at most 200 calls of a sink per second
_WAIT_SLICE_S = 0.1


class SinkSubscriber(Protocol):
    """Interface of a subscriber to the sink thread."""

    is_closed: bool

    @property
    def has_input(self) -> bool:
        """True if a message is available or the subscriber is closed. Call with `Inboxes.changed` held."""

    @property
    def sink(self) -> Sink | None:
        """Callback that receives the messages; None if they are read with `poll` or `receive`."""

    def take_batch(self) -> list[Message]:
        """Remove and return the messages for one call of the sink."""


class Inboxes:
    """Shared state of one node's inboxes. The condition `changed` guards all these inboxes."""

    def __init__(self, name: str) -> None:
        self.changed = threading.Condition()
        self._name = name
        self._wake_count = 0
        self._sinks: tuple[SinkSubscriber, ...] = ()
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()

    @property
    def wake_count(self) -> int:
        """Number of `wake` calls so far."""
        return self._wake_count

    def wait(
        self, subscribers: Sequence[SinkSubscriber], timeout_s: float, previous_count: int | None = None
    ) -> None:
        """Wait for a message in `subscribers`, for one of them to close, or for `wake`.

        Args:
            subscribers: Subscribers to wait for.
            timeout_s: Maximum time to wait in seconds.
            previous_count: Earlier value of `wake_count`; returns immediately if `wake` was called since
                then. None selects the current value.
        """
        with self.changed:
            before = self._wake_count if previous_count is None else previous_count
            self.changed.wait_for(
                lambda: self._wake_count != before or any(each.has_input for each in subscribers),
                timeout_s,
            )

    def wake(self) -> None:
        """End all waits in progress."""
        with self.changed:
            self._wake_count += 1
            self.changed.notify_all()

    def add_sink(self, subscriber: SinkSubscriber) -> None:
        """Start delivering the subscriber's messages to its sink."""
        with self.changed:
            self._sinks = (*self._sinks, subscriber)
            if self._thread is None and not self._closing.is_set():
                self._thread = threading.Thread(target=self._run, name=f"nep-sinks-{self._name}", daemon=True)
                self._thread.start()
            self.changed.notify_all()

    def remove_sink(self, subscriber: SinkSubscriber) -> None:
        """Stop delivering messages to the subscriber's sink."""
        with self.changed:
            self._sinks = tuple(each for each in self._sinks if each is not subscriber)

    def close(self, timeout_s: float) -> None:
        """Stop the sink thread and wait up to `timeout_s` seconds for it to end."""
        self._closing.set()
        self.wake()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout_s)

    def _run(self) -> None:
        while not self._closing.is_set():
            self.wait(self._sinks, _WAIT_SLICE_S)
            for subscriber in self._sinks:
                messages = subscriber.take_batch()
                if messages and subscriber.sink is not None:
                    try:
                        subscriber.sink(messages)
                    except BaseException:  # also SystemExit: the sink thread continues with the next batch
                        _logger.exception("the sink of '%s' failed", messages[0].topic)
            self._closing.wait(_BATCH_INTERVAL_S)
