"""Census: the tables behind the graph: nodes, their publishers and subscribers, and their statistics."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from nep.masters.rates import Meter
from nep.protocol.graph_view import Alert
from nep.protocol.records import (
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    RemotePublisher,
    SubscriberCount,
    SubscriberRecord,
    as_count,
)
from nep.protocol.requests import RENEW_S
from nep.text import escaped, shortened

__all__ = ["Census", "Member", "Publisher", "Subscriber", "as_ratio"]

_HUNG_MAX = 100
"""So many nodes are noted that one does not answer."""
_CORES_MAX = 100_000.0
_PROBLEM_MAX = 500
"""Letters of the sentence about what a subscriber cannot read."""
FADES_S = 12.0
"""So long after its last message a publisher's rate may still sink."""


@dataclass
class Publisher:
    """A publisher and what its node counted."""

    record: PublisherRecord
    meter: Meter = field(default_factory=Meter)
    count: int = 0
    bytes: int = 0
    last_seq: int = 0
    last_stamp_ns: int | None = None
    problem: str = ""
    changed_at: float = 0.0


@dataclass
class Subscriber:
    """A subscriber and what its node counted."""

    record: SubscriberRecord
    received: int | None = None
    lost: int | None = None
    problem: str = ""


@dataclass
class Member:
    """A node with all that it has. `hung`: it did not answer publishers of the nodes with these ids.

    Its next renewal is due `renew_s` after `renewed_at`: that is what it was told. `route` is the connection
    that speaks for it; empty for what is attached to the master.
    """

    node: NodeRecord
    renewed_at: float
    renew_s: float = RENEW_S
    is_managed: bool = False
    route: str = ""
    publishers: dict[int, Publisher] = field(default_factory=dict)
    subscribers: dict[int, Subscriber] = field(default_factory=dict)
    hung: set[str] = field(default_factory=set)
    cpu_ratio: float | None = None
    heard: dict[int, Publisher] = field(default_factory=dict)
    """Whom its subscribers can connect to, as of the revision `heard_at`. See `Census.heard_by`."""
    heard_at: int = -1


class Census:
    """The tables, and the few ways in which they change."""

    def __init__(self) -> None:
        self.members: dict[str, Member] = {}
        self.speaking: dict[str, Member] = {}
        """By connection: the node that it speaks for."""
        self.publisher_owners: dict[int, Member] = {}
        """By the id of a publisher: the node that has it."""
        self.subscriber_owners: dict[int, Member] = {}
        """The same of subscribers."""
        self.revision = 1
        self.publishers_revision = 0
        """The revision at which the publishers of some topic changed last."""
        self.touched: set[str] = set()
        """Topics of which something has changed, also a count, since whoever looks emptied this.

        Names that nobody uses any more leave nothing behind: a program may use a new one every second.
        """
        self._topic_revisions: dict[str, int] = {}
        self._publishing: dict[str, dict[int, Member]] = {}
        self._subscribing: dict[str, dict[int, Member]] = {}
        self._reported: dict[str, tuple[Alert, ...]] = {}

    # ---- reading

    def publishers_of(self, topic: str) -> tuple[RemotePublisher, ...]:
        """The publishers of a topic that can be connected to."""
        found = self._publishing.get(topic, {})
        return tuple(
            self.remote(member, member.publishers[known].record)
            for known, member in found.items()
            if member.publishers[known].record.endpoints
        )

    @property
    def topics(self) -> list[str]:
        """The names of all topics that somebody publishes or subscribes."""
        return sorted(set(self._publishing) | set(self._subscribing))

    def publishing(self, topic: str) -> list[tuple[Member, Publisher]]:
        """All publishers of a topic, also those that cannot be connected to, each with its node."""
        found = self._publishing.get(topic)
        return [(member, member.publishers[known]) for known, member in found.items()] if found else []

    def subscribers_of(self, topic: str) -> list[tuple[Member, Subscriber]]:
        """The subscribers of a topic, each with its node."""
        found = self._subscribing.get(topic)
        return [(member, member.subscribers[known]) for known, member in found.items()] if found else []

    def remote(self, member: Member, record: PublisherRecord) -> RemotePublisher:
        """A publisher as subscribers have to know it."""
        return RemotePublisher(record, member.node.id, member.node.name)

    def topic_revision(self, topic: str) -> int:
        """The revision at which the publishers of this topic changed last."""
        return self._topic_revisions.get(topic, 0)

    def heard_by(self, member: Member) -> dict[int, Publisher]:
        """Everybody who can be connected to on the topics that this node subscribes to."""
        if member.heard_at != self.revision:
            member.heard_at = self.revision
            topics = {subscriber.record.topic for subscriber in member.subscribers.values()}
            member.heard = {
                known: other.publishers[known]
                for topic in topics
                for known, other in self._publishing.get(topic, {}).items()
                if other.publishers[known].record.endpoints
            }
        return member.heard

    def last_seqs(self, member: Member) -> dict[int, int]:
        """Publisher id → newest message, for everybody who can be connected to on this node's topics."""
        return {known: publisher.last_seq for known, publisher in self.heard_by(member).items()}

    # ---- changing

    def meet(self, node: NodeRecord, now: float, *, is_managed: bool | None = None) -> Member:
        """The member for a node, made when it is new. Its lease begins anew."""
        member = self.members.get(node.id)
        if member is None:
            member = self.members[node.id] = Member(node, now)
            self.revision += 1
        elif member.node != node:  # an original's version shows only in what it sends
            member.node = node
            self.revision += 1
        member.renewed_at = now
        if is_managed is not None:
            member.is_managed = is_managed
        return member

    def bind(self, member: Member, route: str) -> None:
        """From now on this connection speaks for the member."""
        if member.route != route:
            self._unbind(member)
            member.route = route
        if route:
            self.speaking[route] = member

    def _unbind(self, member: Member) -> None:
        if self.speaking.get(member.route) is member:
            del self.speaking[member.route]

    def add_publisher(self, member: Member, record: PublisherRecord) -> bool:
        """Register a publisher; False when it was registered just so before."""
        known = member.publishers.get(record.id)
        if known is not None and known.record == record:
            return False
        if known is not None:
            self.remove_publisher(member.node.id, record.id)
        member.publishers[record.id] = Publisher(record)
        self.publisher_owners[record.id] = member
        self._publishing.setdefault(record.topic, {})[record.id] = member
        self._changed(record.topic)
        return True

    def add_subscriber(self, member: Member, record: SubscriberRecord) -> None:
        """Register a subscriber, once."""
        if record.id not in member.subscribers:
            member.subscribers[record.id] = Subscriber(record)
            self.subscriber_owners[record.id] = member
            self._subscribing.setdefault(record.topic, {})[record.id] = member
            self.touched.add(record.topic)
            self.revision += 1

    def remove_publisher(self, node_id: str, publisher: int) -> PublisherRecord | None:
        """Unlist a publisher; its record, or None when there was none."""
        member = self.members.get(node_id)
        gone = member.publishers.pop(publisher, None) if member else None
        if gone is None:
            return None
        self.publisher_owners.pop(publisher, None)
        _take_out(self._publishing, gone.record.topic, publisher)
        self._changed(gone.record.topic)
        self._forget_unused(gone.record.topic)
        return gone.record

    def remove_subscriber(self, node_id: str, subscriber: int) -> None:
        """Unlist a subscriber, if there is such a one."""
        member = self.members.get(node_id)
        gone = member.subscribers.pop(subscriber, None) if member else None
        if gone is not None:
            self.subscriber_owners.pop(subscriber, None)
            _take_out(self._subscribing, gone.record.topic, subscriber)
            self.touched.add(gone.record.topic)
            self.revision += 1
            self._forget_unused(gone.record.topic)

    def _forget_unused(self, topic: str) -> None:
        """Forget what was noted of a topic that nobody publishes or subscribes: who comes is told all."""
        if topic not in self._publishing and topic not in self._subscribing:
            self.touched.discard(topic)
            self._topic_revisions.pop(topic, None)

    def forget(self, node_id: str) -> None:
        """Unlist a node with all that it has."""
        member = self.members[node_id]
        for publisher in list(member.publishers):
            self.remove_publisher(node_id, publisher)
        for subscriber in list(member.subscribers):
            self.remove_subscriber(node_id, subscriber)
        self._unbind(member)
        del self.members[node_id]
        self.revision += 1

    def renew(
        self,
        member: Member,
        publishers: Iterable[PublisherCount],
        subscribers: Iterable[SubscriberCount],
        now: float,
        cpu_ratio: float | None = None,
    ) -> None:
        """Take over a node's statistics; it is alive. Numbers that can't be become the nearest."""
        member.renewed_at = now
        member.cpu_ratio = as_ratio(cpu_ratio)
        member.hung.clear()
        for count in publishers:
            publisher = member.publishers[count.id]
            self.counted(publisher, count.count, count.bytes, now)
            self.reached(publisher, count.last_seq, count.last_stamp_ns)
            if count.problem != publisher.problem:
                self.troubled(publisher, count.problem)
        for seen in subscribers:
            self.seen(member.subscribers[seen.id], seen.received, seen.lost, seen.problem)

    def counted(self, publisher: Publisher, count: int, size_bytes: int, now: float) -> None:
        """A publisher has sent so much until now."""
        count, size_bytes = as_count(count), as_count(size_bytes)
        if count != publisher.count:
            publisher.changed_at = now
            publisher.count, publisher.bytes = count, size_bytes
            self.touched.add(publisher.record.topic)
        elif now - publisher.changed_at < FADES_S:
            self.touched.add(publisher.record.topic)
        publisher.meter.add(now, count, size_bytes)

    def reached(self, publisher: Publisher, last_seq: int, last_stamp_ns: int | None) -> None:
        """The number and the stamp of a publisher's newest message."""
        publisher.last_seq = as_count(last_seq)
        publisher.last_stamp_ns = None if last_stamp_ns is None else as_count(last_stamp_ns)

    def troubled(self, publisher: Publisher, problem: str) -> None:
        """A publisher cannot send what it is given, and why; an empty sentence means that it can again."""
        publisher.problem = escaped(shortened(problem, _PROBLEM_MAX)) if problem else ""
        self.touched.add(publisher.record.topic)

    def seen(self, subscriber: Subscriber, received: int | None, lost: int | None, problem: str) -> None:
        """A subscriber has received so much until now."""
        received = None if received is None else as_count(received)
        lost = None if lost is None else as_count(lost)
        if problem:
            problem = escaped(shortened(problem, _PROBLEM_MAX))
        if received != subscriber.received or lost != subscriber.lost or problem != subscriber.problem:
            self.touched.add(subscriber.record.topic)
            subscriber.received, subscriber.lost, subscriber.problem = received, lost, problem

    def report_missing(self, node_id: str, publisher: int, subscribers: Iterable[int]) -> None:
        """These subscribers did not answer that publisher; forgotten at their next renewal."""
        reporter = self.members.get(node_id)
        known = reporter.publishers.get(publisher) if reporter else None
        if reporter is None or known is None:
            return
        for subscriber in subscribers:
            member = self._subscribing.get(known.record.topic, {}).get(subscriber)
            if member is not None and len(member.hung) < _HUNG_MAX:
                member.hung.add(reporter.node.id)

    def report_alerts(self, source: str, alerts: tuple[Alert, ...]) -> None:
        """These are all alerts of `source` now."""
        if self._reported.get(source, ()) != alerts:
            self._reported[source] = alerts
            self.revision += 1

    @property
    def reported_alerts(self) -> tuple[Alert, ...]:
        """What is attached to the master reported."""
        return tuple(alert for alerts in self._reported.values() for alert in alerts)

    def _changed(self, topic: str) -> None:
        self.touched.add(topic)
        self.revision += 1
        self.publishers_revision = self._topic_revisions[topic] = self.revision


def as_ratio(value: float | None) -> float | None:
    """A share of a processor as somebody told it; None for what can be none."""
    return value if value is not None and 0.0 <= value < _CORES_MAX else None


def _take_out(table: dict[str, dict[int, Member]], topic: str, known: int) -> None:
    entries = table.get(topic, {})
    entries.pop(known, None)
    if not entries:
        table.pop(topic, None)
