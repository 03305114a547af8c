"""Subscriber for all topics that match a pattern.

A `PatternSubscriber` creates a member for each published topic: a subscriber with its own socket whose
hello has the same subscriber id. The master lists one subscriber and reports every matching publisher
to its node. Publishers therefore wait for the member as for any other subscriber, and their first
messages aren't lost.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from nep.backends.base import SubscriberSpec
from nep.backends.bases.waking import WakingSubscriber
from nep.backends.zeromq.io_thread import IoThread
from nep.backends.zeromq.subscriber import NativeReadable, NativeSubscriber
from nep.errors import NepError
from nep.messages.clocks import ClockDifference
from nep.messages.message import Message
from nep.messages.queue import MAX_MESSAGES, Inbox
from nep.protocol.requests import RemotePublisher, SubscriberCount, clamp_count
from nep.system.log_rarely import is_logged
from nep.system.wakeup import Waker

_logger = logging.getLogger("nep")
_MAX_MEMBERS = 2_000
"""Maximum number of topics per subscriber, because any program can publish on any number of topics."""


class PatternSubscriber(WakingSubscriber):
    """Subscriber to a pattern. See the module docstring.

    Args:
        new_readable: Creates the socket of a member.
        io: Thread that serves the members.
        spec: Settings; the topic is the pattern.
        on_close: Unregisters the subscriber with this id.
    """

    def __init__(
        self,
        new_readable: Callable[[SubscriberSpec], NativeReadable],
        io: IoThread,
        spec: SubscriberSpec,
        on_close: Callable[[int], None],
    ) -> None:
        super().__init__(threading.Condition())
        self.spec = spec
        self.is_closed = False
        self.ready: deque[Message] = deque()
        self._new_readable = new_readable
        self._io = io
        self._on_close = on_close
        self._members: dict[str, NativeSubscriber] = {}
        self._early_closed_ids: set[int] | None = set()
        """Ids of publishers that closed before `connect_listed`; None after `connect_listed`."""
        self._inbox = Inbox(spec.keep, spec.max_messages, spec.max_bytes)
        self._removed_totals = _RemovedTotals()
        self._dropped_count = 0
        self._problem = self._member_error = ""
        self._failure_count = 0
        self._members_lock = threading.RLock()

    # ---- reading

    def poll(self) -> Message | None:
        """Return the next message, or None if there is none or the subscriber is closed."""
        with self._changed:
            return None if self.is_closed else self._inbox.pop()

    def receive(self, timeout_s: float) -> Message | None:
        """Wait up to `timeout_s` seconds for the next message; return None on timeout."""
        with self._changed:
            self._changed.wait_for(lambda: self.is_closed or len(self._inbox), timeout_s)
            return None if self.is_closed else self._inbox.pop()

    @property
    def has_input(self) -> bool:
        """True if input is available or the subscriber is closed."""
        return self.is_closed or len(self._inbox) > 0

    def _handle_messages(self, messages: Sequence[Message]) -> None:
        # Called in the thread that serves the members.
        if self.spec.sink is not None:
            self.spec.sink(messages)
            return
        with self._changed:
            if not self.is_closed:
                self._dropped_count += sum(map(self._inbox.put, messages))
                self.notify_waiting()

    # ---- statistics

    @property
    def received(self) -> int:
        """Number of messages received on all topics."""
        with self._members_lock:
            return (
                self._removed_totals.received
                + sum(each.received for each in self._members.values())
                - self._dropped_count
            )

    @property
    def lost(self) -> int:
        """Number of messages lost in transit or dropped from the full queue."""
        with self._members_lock:
            return (
                self._removed_totals.lost
                + sum(each.lost or 0 for each in self._members.values())
                + self._dropped_count
            )

    @property
    def refused(self) -> int:
        """Number of received frames rejected because they are not valid messages."""
        with self._members_lock:
            return self._removed_totals.refused + sum(each.refused for each in self._members.values())

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Endpoints of all connections."""
        return tuple(endpoint for each in list(self._members.values()) for endpoint in each.endpoints)

    def report(self, problem: str) -> None:
        """Set the reason why messages can't be decoded; the next renewal reports it."""
        self._problem = problem

    def counts(self) -> SubscriberCount:
        """Return the statistics that a renewal reports."""
        with self._members_lock:
            problems = (each.counts().problem for each in self._members.values())
            problem = self._problem or self._member_error or next(filter(None, problems), "")
            return SubscriberCount(self.spec.id, clamp_count(self.received), clamp_count(self.lost), problem)

    # ---- publishers

    def member(self, topic: str, *, may_create: bool = True) -> NativeSubscriber | None:
        """Return the member for a topic, or None if there is none and it isn't created.

        Args:
            topic: Name of the topic.
            may_create: True to create a missing member. Not possible after `close`, beyond
                `_MAX_MEMBERS` or if the process is out of file descriptors.
        """
        with self._members_lock:
            member = self._members.get(topic)
            if member is not None or not may_create or self.is_closed:
                return member
            try:
                member = self._members[topic] = self._new_member(topic)
            except NepError as error:
                self._member_error = str(error)
                self._failure_count += 1
                if is_logged(self._failure_count):
                    _logger.warning("'%s' can't subscribe to '%s': %s", self.spec.topic, topic, error)
                return None
            self._member_error = ""
            is_registered = self._early_closed_ids is None
        if is_registered:
            member.connect_listed(())
        self._io.add(member)
        return member

    def _new_member(self, topic: str) -> NativeSubscriber:
        if len(self._members) >= _MAX_MEMBERS:
            raise NepError(f"the pattern is already subscribed to {_MAX_MEMBERS} topics")
        spec = replace(
            self.spec,
            topic=topic,
            keep="all",
            max_messages=MAX_MESSAGES,
            sink=self._handle_messages,
            is_pattern=False,
        )
        return NativeSubscriber(self._new_readable(spec), self._io, spec, lambda _id: None)

    def connect_listed(self, remotes: Iterable[RemotePublisher]) -> None:
        """Connect to the publishers listed at registration, except those that have closed in the meantime."""
        with self._members_lock:
            closed_ids, self._early_closed_ids = self._early_closed_ids or set(), None
            members = list(self._members.values())
        for member in members:
            member.connect_listed(())
        for remote in remotes:
            if remote.publisher.id not in closed_ids:
                topic_member = self.member(remote.publisher.topic)
                if topic_member is not None:
                    topic_member.connect((remote,))

    def record_early_close(self, publisher: int) -> None:
        """Record the id of a closed publisher, which the reply to the registration may still list."""
        with self._members_lock:
            if self._early_closed_ids is not None:
                self._early_closed_ids.add(publisher)

    def wait_for(self, publishers: Iterable[int], timeout_s: float, waker: Waker) -> bool:
        """Wait for the echo of these publishers; return False on timeout. See `NativeSubscriber.wait_for`."""
        ids = tuple(publishers)
        deadline = time.monotonic() + timeout_s
        members = list(self._members.values())
        return all(each.wait_for(ids, max(0.0, deadline - time.monotonic()), waker) for each in members)

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics that have a member."""
        return tuple(self._members)

    def set_clock_differences(self, clocks: Mapping[str, ClockDifference]) -> None:
        """Set the clock differences of other computers, given by node id."""
        for member in list(self._members.values()):
            member.set_clock_differences(clocks)

    def handle_renewal(self, now: float, last_seqs: Iterable[tuple[int, int]]) -> None:
        """Handle a renewal like `NativeSubscriber.handle_renewal`.

        Members without publishers are removed, unless the subscriber has a sink.
        """
        seqs = tuple(last_seqs)
        for topic, member in list(self._members.items()):
            member.handle_renewal(now, seqs)
            if self.spec.sink is None and not member.has_publishers:
                with self._members_lock:
                    del self._members[topic]
                    self._removed_totals.add(member)
                member.close()

    def reconnect_remote(self) -> None:
        """Reconnect to publishers on other computers."""
        for member in list(self._members.values()):
            member.reconnect_remote()

    # ---- closing

    def close(self) -> None:
        """Unregister the subscriber and discard its unread messages."""
        with self._members_lock, self._changed:
            if self.is_closed:
                return
            self.is_closed = True
            self._inbox.pop_all()
            self.notify_waiting()
            members = list(self._members.values())
        self._on_close(self.spec.id)
        for member in members:
            member.close()


class _RemovedTotals:
    """Statistics of removed members."""

    def __init__(self) -> None:
        self.received = self.lost = self.refused = 0

    def add(self, member: NativeSubscriber) -> None:
        self.received += member.received
        self.lost += member.lost or 0
        self.refused += member.refused
