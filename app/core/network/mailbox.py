"""Bounded mailbox from background threads to the window.

Threads post; the window drains the mailbox once per tick. Each topic has a ring buffer for the newest
messages and counts dropped ones. Events (a new graph, a robot's reply, the end of a program) are rare
and must not be lost, so their queue is long; events beyond its limit are counted.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from nep.messages.message import Message

MAX_MESSAGES_PER_TOPIC = 256
MAX_BYTES_PER_TOPIC = 64 * 1024 * 1024
MAX_EVENTS = 20_000


@dataclass(slots=True)
class Batch:
    """Newest messages of one topic since the last drain.

    Attributes:
        dropped: Number of older messages that were dropped.
    """

    messages: list[Message] = field(default_factory=list)
    dropped: int = 0

    @property
    def arrived_count(self) -> int:
        """Number of messages that arrived, including dropped ones."""
        return len(self.messages) + self.dropped


class _Ring:
    __slots__ = ("dropped", "messages", "size_bytes")

    def __init__(self) -> None:
        self.messages: deque[Message] = deque()
        self.size_bytes = 0
        self.dropped = 0


class Mailbox:
    """Thread-safe mailbox: any thread posts, one thread drains."""

    def __init__(
        self,
        messages_per_topic: int = MAX_MESSAGES_PER_TOPIC,
        bytes_per_topic: int = MAX_BYTES_PER_TOPIC,
        max_events: int = MAX_EVENTS,
    ) -> None:
        self._messages_per_topic = messages_per_topic
        self._bytes_per_topic = bytes_per_topic
        self._max_events = max_events
        self._lock = threading.Lock()
        self._rings: dict[str, _Ring] = {}
        self._events: deque[object] = deque()
        self._lost_event_count = 0
        self._capacities: dict[str, int] = {}

    def set_capacity(self, topic: str, messages: int | None) -> None:
        """Set the capacity of a topic's ring buffer. The byte limit still applies.

        Args:
            topic: Key of the topic.
            messages: Maximum number of messages, at least 1; None restores the default.
        """
        with self._lock:
            if messages is None:
                self._capacities.pop(topic, None)
            else:
                self._capacities[topic] = max(1, messages)

    def post(self, topic: str, messages: Sequence[Message]) -> None:
        """Post a batch of messages of one topic, oldest first.

        Messages beyond the ring's size are only counted, so that a batch of thousands costs no more than a
        full ring.
        """
        capacity = self._capacities.get(topic, self._messages_per_topic)
        newest = messages[-capacity:]
        size_bytes = sum(message.size_bytes for message in newest)
        with self._lock:
            ring = self._rings.get(topic)
            if ring is None:
                ring = self._rings[topic] = _Ring()
            ring.messages.extend(newest)
            ring.size_bytes += size_bytes
            ring.dropped += len(messages) - len(newest)
            # the newest message is never evicted, whatever its size
            while len(ring.messages) > 1 and (
                len(ring.messages) > capacity or ring.size_bytes > self._bytes_per_topic
            ):
                ring.size_bytes -= ring.messages.popleft().size_bytes
                ring.dropped += 1

    def discard(self, topic: str) -> None:
        """Discard the pending messages of a topic without counting them as dropped."""
        with self._lock:
            self._rings.pop(topic, None)

    def post_event(self, event: object) -> None:
        """Post an event. If the event queue is full, the event is counted as lost instead."""
        with self._lock:
            if len(self._events) >= self._max_events:
                self._lost_event_count += 1
            else:
                self._events.append(event)

    def drain(self) -> dict[str, Batch]:
        """Return and clear all messages posted since the last call, by topic."""
        with self._lock:
            rings, self._rings = self._rings, {}
        return {topic: Batch(list(ring.messages), ring.dropped) for topic, ring in rings.items()}

    def drain_events(self) -> tuple[list[object], int]:
        """Return and clear all events posted since the last call, oldest first.

        Returns:
            The events, and the number of events that were lost because the queue was full.
        """
        with self._lock:
            events, self._events = self._events, deque()
            lost_count, self._lost_event_count = self._lost_event_count, 0
        return list(events), lost_count
