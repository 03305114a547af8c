"""Inboxes of subscribers whose library delivers messages by callback: queues, waiting threads, and sinks."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Sequence

from nep.backends.base import SubscriberSpec, SubscriberTransport
from nep.backends.bases.waking import WakingSubscriber
from nep.backends.services import CallQueue, wake_on_call
from nep.messages.message import Message
from nep.messages.queue import Inbox
from nep.system.forks import current_generation

_logger = logging.getLogger("nep")
_BATCH_BYTES = 64 * 2**20
"""Maximum size of a sink's batch in bytes, which is subtracted from the inbox's limit.

The inbox and a batch together thus stay within the subscriber's `max_bytes`.
"""
_BATCH_INTERVAL_S = 0.005  # at most 200 calls of a sink per second
_WAIT_SLICE_S = 0.1


class Inboxes:
    """State that the subscribers of one node share: a condition, and a thread that calls the sinks.

    The condition `changed` guards all inboxes.

    Args:
        name: Name of the node.
    """

    def __init__(self, name: str) -> None:
        self.changed = threading.Condition()
        self._name = name
        self._wake_count = 0
        self._sinks: tuple[InboxSubscriber, ...] = ()
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()
        self._generation = current_generation()

    def wait(
        self,
        subscribers: Sequence[SubscriberTransport | InboxSubscriber],
        timeout_s: float,
        calls: Sequence[CallQueue] = (),
    ) -> None:
        """Wait for a message in `subscribers`, for one of them to close, a call in `calls`, or `wake`.

        Args:
            subscribers: Subscribers to wait for.
            timeout_s: Maximum time to wait in seconds.
            calls: Queues of calls to wait for.
        """
        own_subscribers = [each for each in subscribers if isinstance(each, InboxSubscriber)]
        before = self._wake_count
        with wake_on_call(calls, self.wake) as is_empty:
            if is_empty:
                with self.changed:
                    self.changed.wait_for(
                        lambda: self._wake_count != before or any(each.has_input for each in own_subscribers),
                        timeout_s,
                    )

    def wake(self) -> None:
        """End all waits in progress."""
        with self.changed:
            self._wake_count += 1
            self.changed.notify_all()

    def add_sink(self, subscriber: InboxSubscriber) -> None:
        """Start delivering the subscriber's messages to its sink."""
        with self.changed:  # a concurrent close finds either no thread or a started one
            self._sinks = (*self._sinks, subscriber)
            if self._thread is None and not self._closing.is_set():
                self._thread = threading.Thread(target=self._run, name=f"nep-sinks-{self._name}", daemon=True)
                self._thread.start()
            self.changed.notify_all()

    def remove_sink(self, subscriber: InboxSubscriber) -> None:
        """Stop delivering messages to the subscriber's sink. No effect without `add_sink`."""
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
                messages, sink = subscriber.take_batch(), subscriber.spec.sink
                if messages and sink is not None:
                    try:
                        sink(messages)
                    except BaseException:  # also SystemExit: the sink thread continues with the next batch
                        _logger.exception("the sink of '%s' failed", subscriber.spec.topic)
                    if self._generation.is_inherited:  # the sink forked: the child has no other thread
                        return
            self._closing.wait(_BATCH_INTERVAL_S)


class InboxSubscriber(WakingSubscriber):
    """Subscriber whose messages a reader or the sink thread takes from an inbox.

    Subclasses add messages with `_put_locked`.

    Args:
        spec: Settings of the subscriber.
        inboxes: Shared state of the node's inboxes.
    """

    def __init__(self, spec: SubscriberSpec, inboxes: Inboxes) -> None:
        super().__init__(inboxes.changed)
        self.spec = spec
        self.ready: deque[Message] = deque()
        self.is_closed = False
        self._inboxes = inboxes
        batch_bytes = 0 if spec.sink is None else _BATCH_BYTES
        self._inbox = Inbox(spec.keep, spec.max_messages, spec.max_bytes - batch_bytes)
        self._decoding_problem = ""

    @property
    def has_input(self) -> bool:
        """True if a message is available or the subscriber is closed."""
        return self.is_closed or len(self._inbox) > 0

    def poll(self) -> Message | None:
        """Return the next message, or None if there is none or the subscriber is closed."""
        with self._changed:
            return None if self.is_closed else self._inbox.pop()

    def receive(self, timeout_s: float) -> Message | None:
        """Wait up to `timeout_s` seconds for the next message and return it; may return None earlier."""
        self._inboxes.wait((self,), timeout_s)
        return self.poll()

    def take_batch(self) -> list[Message]:
        """Remove and return the messages for one call of the sink."""
        with self._changed:
            return self._inbox.pop_all(_BATCH_BYTES)

    @property
    def problem(self) -> str:
        """Reason why messages can't be decoded, shown in the graph; "" if there is none."""
        return self._decoding_problem

    def report(self, problem: str) -> None:
        """Set the reason why messages can't be decoded; "" clears it."""
        self._decoding_problem = problem

    def _put_locked(self, *messages: Message) -> int:
        # Appends messages and wakes the waiting threads; returns the number of dropped messages.
        dropped = sum(map(self._inbox.put, messages))
        self.notify_waiting()
        return dropped

    def _close_inbox(self) -> bool:
        # Discards the unread messages and wakes the waiting threads; returns False if already closed.
        with self._changed:
            if self.is_closed:
                return False
            self.is_closed = True
            self._inbox.pop_all()
            self.notify_waiting()
        self._inboxes.remove_sink(self)
        return True
