"""Counts of received, lost, late, undecodable and dropped messages by topic.

Lost messages are gaps in the sequence numbers of a publisher. Performs no input or output. Used in the
writer's thread.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import orjson

MAX_TOPICS = 10_000
"""Maximum number of topics with their own counter. All further topics share one counter."""
MAX_PUBLISHERS = 1_000
"""Maximum number of publishers per topic whose losses are counted.

Losses of further publishers are unknown.
"""
MAX_LOST = 2**63 - 1
"""Maximum count of losses, because random sequence numbers would cause values that JSON can't represent."""


@dataclass(frozen=True)
class TopicStats:
    """Message counts of one topic.

    Attributes:
        received: Number of received messages.
        lost: Number of lost messages according to sequence numbers; None if there are no sequence numbers.
        late: Number of messages received out of order.
        undecodable: Number of recorded messages that can't be decoded.
        unkept: Number of received messages that were not recorded because writing was too slow.
        size_bytes: Total size of the received payloads.
    """

    received: int = 0
    lost: int | None = None
    late: int = 0
    undecodable: int = 0
    unkept: int = 0
    size_bytes: int = 0

    def difference(self, earlier: TopicStats) -> TopicStats:
        """Return the difference between these counts and earlier ones."""
        return TopicStats(
            max(0, self.received - earlier.received),
            None if self.lost is None else max(0, self.lost - (earlier.lost or 0)),
            max(0, self.late - earlier.late),
            max(0, self.undecodable - earlier.undecodable),
            max(0, self.unkept - earlier.unkept),
            max(0, self.size_bytes - earlier.size_bytes),
        )

    def to_plain(self) -> dict[str, int | None]:
        """Return the counts as a JSON-serializable dict."""
        return {
            "received": self.received,
            "lost": self.lost,
            "late": self.late,
            "undecodable": self.undecodable,
            "unkept": self.unkept,
            "size_bytes": self.size_bytes,
        }


def parse_stats(value: object) -> TopicStats | None:
    """Convert a map, or its JSON text, to counts; return None if the data is invalid."""
    if isinstance(value, str):
        try:
            value = orjson.loads(value)
        except orjson.JSONDecodeError:
            return None
    if not isinstance(value, Mapping):
        return None
    lost = value.get("lost")
    names = ("received", "late", "undecodable", "unkept", "size_bytes")
    counts = {name: each for name in names if type(each := value.get(name)) is int and each >= 0}
    is_complete = len(counts) == len(names) and (lost is None or (type(lost) is int and lost >= 0))
    return TopicStats(lost=lost, **counts) if is_complete else None


@dataclass
class _SequenceRange:
    """Range of the sequence numbers received from one publisher."""

    first: int
    last: int
    received: int = 0

    @property
    def lost(self) -> int:
        return max(0, self.last - self.first + 1 - self.received)


@dataclass
class TopicCounter:
    """Counter of the messages of one topic."""

    received: int = 0
    late: int = 0
    undecodable: int = 0
    unkept: int = 0
    size_bytes: int = 0
    is_changed: bool = True
    """True if the counts have changed since they were last written."""
    _publishers: dict[int | None, _SequenceRange] = field(default_factory=dict)

    def add(self, publisher: int | None, seq: int | None, size_bytes: int, *, is_decodable: bool) -> None:
        """Count a recorded message.

        Args:
            publisher: Id of the publisher, if known.
            seq: Sequence number, if any.
            size_bytes: Size of the payload.
            is_decodable: True if the message can be decoded.
        """
        self.received += 1
        self.size_bytes += size_bytes
        self.is_changed = True
        if not is_decodable:
            self.undecodable += 1
        if seq is None:
            return
        sequence_range = self._publishers.get(publisher)
        if sequence_range is None:
            if len(self._publishers) < MAX_PUBLISHERS:
                self._publishers[publisher] = _SequenceRange(seq, seq, 1)
            return
        sequence_range.received += 1
        if seq > sequence_range.last:
            sequence_range.last = seq
        else:
            self.late += 1
            sequence_range.first = min(sequence_range.first, seq)

    def count_dropped(self, publisher: int | None, count: int, size_bytes: int) -> None:
        """Count received messages of a publisher that are not recorded because the queue is full.

        Args:
            publisher: Id of the publisher, if known.
            count: Number of messages.
            size_bytes: Total size of the payloads.
        """
        self.received += count
        self.unkept += count
        self.size_bytes += size_bytes
        self.is_changed = True
        sequence_range = self._publishers.get(publisher)
        if sequence_range is not None:
            sequence_range.received += count

    def stats(self) -> TopicStats:
        """Return the current counts."""
        lost = None
        if self._publishers:
            lost = min(sum(each.lost for each in self._publishers.values()), MAX_LOST)
        return TopicStats(self.received, lost, self.late, self.undecodable, self.unkept, self.size_bytes)


def changed_counters(counters: Mapping[str, TopicCounter]) -> Iterable[tuple[str, TopicCounter]]:
    """Return the (topic, counter) pairs whose counts have changed since they were last written."""
    return [(topic, each) for topic, each in counters.items() if each.is_changed]
