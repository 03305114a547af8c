"""Census: the tables behind the graph: nodes, their publishers and subscribers, statistics, alerts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from nep.rates import Meter
from nep.records import (
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    RemotePublisher,
    SubscriberCount,
    SubscriberRecord,
)
from nep.views import Alert, GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo

__all__ = ["Census", "Member", "Publisher", "Subscriber"]


@dataclass
class Publisher:
    """A publisher and what its node counted."""

    record: PublisherRecord
    meter: Meter = field(default_factory=Meter)
    count: int = 0
    bytes: int = 0
    last_seq: int = 0
    last_stamp_ns: int | None = None


@dataclass
class Subscriber:
    """A subscriber and what its node counted."""

    record: SubscriberRecord
    received: int | None = None
    lost: int | None = None
    problem: str = ""


@dataclass
class Member:
    """A node with all that it has. `hung`: it did not answer the publishers of these node names."""

    node: NodeRecord
    renewed_at: float
    is_managed: bool = False
    publishers: dict[int, Publisher] = field(default_factory=dict)
    subscribers: dict[int, Subscriber] = field(default_factory=dict)
    hung: set[str] = field(default_factory=set)


class Census:
    """The tables, and the few ways in which they change."""

    def __init__(self) -> None:
        self.members: dict[str, Member] = {}
        self.revision = 1
        self._topic_revisions: dict[str, int] = {}
        self._publishing: dict[str, dict[int, Member]] = {}
        self._subscribing: dict[str, dict[int, Member]] = {}

    # ---- reading

    def publishers_of(self, topic: str) -> tuple[RemotePublisher, ...]:
        """The publishers of a topic that can be connected to."""
        found = self._publishing.get(topic, {})
        return tuple(
            self.remote(member, member.publishers[known].record)
            for known, member in found.items()
            if member.publishers[known].record.endpoints
        )

    def subscribers_of(self, topic: str) -> Iterator[tuple[Member, Subscriber]]:
        """The subscribers of a topic, each with its node."""
        for known, member in list(self._subscribing.get(topic, {}).items()):
            yield member, member.subscribers[known]

    def remote(self, member: Member, record: PublisherRecord) -> RemotePublisher:
        """A publisher as subscribers have to know it."""
        return RemotePublisher(record, member.node.id, member.node.name)

    def topic_revision(self, topic: str) -> int:
        """The revision at which the publishers of this topic changed last."""
        return self._topic_revisions.get(topic, 0)

    def last_seqs(self, topics: Iterable[str]) -> dict[int, int]:
        """Publisher id → newest message, for everybody who can be connected to on these topics."""
        return {
            known: member.publishers[known].last_seq
            for topic in topics
            for known, member in self._publishing.get(topic, {}).items()
            if member.publishers[known].record.endpoints
        }

    # ---- changing

    def meet(self, node: NodeRecord, now: float, *, is_managed: bool | None = None) -> Member:
        """The member for a node, made when it is new. Its lease begins anew."""
        member = self.members.get(node.id)
        if member is None:
            member = self.members[node.id] = Member(node, now)
            self.revision += 1
        member.renewed_at = now
        if is_managed is not None:
            member.is_managed = is_managed
        return member

    def add_publisher(self, member: Member, record: PublisherRecord) -> bool:
        """Register a publisher; False when it was registered just so before."""
        known = member.publishers.get(record.id)
        if known is not None and known.record == record:
            return False
        if known is not None:
            self.remove_publisher(member.node.id, record.id)
        member.publishers[record.id] = Publisher(record)
        self._publishing.setdefault(record.topic, {})[record.id] = member
        self._changed(record.topic)
        return True

    def add_subscriber(self, member: Member, record: SubscriberRecord) -> None:
        """Register a subscriber, once."""
        if record.id not in member.subscribers:
            member.subscribers[record.id] = Subscriber(record)
            self._subscribing.setdefault(record.topic, {})[record.id] = member
            self.revision += 1

    def remove_publisher(self, node_id: str, publisher: int) -> PublisherRecord | None:
        """Unlist a publisher; its record, or None when there was none."""
        member = self.members.get(node_id)
        gone = member.publishers.pop(publisher, None) if member else None
        if gone is None:
            return None
        _take_out(self._publishing, gone.record.topic, publisher)
        self._changed(gone.record.topic)
        return gone.record

    def remove_subscriber(self, node_id: str, subscriber: int) -> None:
        """Unlist a subscriber, if there is such a one."""
        member = self.members.get(node_id)
        gone = member.subscribers.pop(subscriber, None) if member else None
        if gone is not None:
            _take_out(self._subscribing, gone.record.topic, subscriber)
            self.revision += 1

    def forget(self, node_id: str) -> None:
        """Unlist a node with all that it has."""
        member = self.members[node_id]
        for publisher in list(member.publishers):
            self.remove_publisher(node_id, publisher)
        for subscriber in list(member.subscribers):
            self.remove_subscriber(node_id, subscriber)
        del self.members[node_id]
        self.revision += 1

    def renew(
        self,
        member: Member,
        publishers: Iterable[PublisherCount],
        subscribers: Iterable[SubscriberCount],
        now: float,
    ) -> None:
        """Take over a node's statistics; it is alive."""
        member.renewed_at = now
        member.hung.clear()
        for count in publishers:
            publisher = member.publishers[count.id]
            publisher.count, publisher.bytes = count.count, count.bytes
            publisher.last_seq, publisher.last_stamp_ns = count.last_seq, count.last_stamp_ns
            publisher.meter.add(now, count.count, count.bytes)
        for seen in subscribers:
            subscriber = member.subscribers[seen.id]
            subscriber.received, subscriber.lost = seen.received, seen.lost
            subscriber.problem = seen.problem

    def report_missing(self, node_id: str, publisher: int, subscribers: Iterable[int]) -> None:
        """These subscribers did not answer that publisher; forgotten at their next renewal."""
        reporter = self.members.get(node_id)
        known = reporter.publishers.get(publisher) if reporter else None
        if reporter is None or known is None:
            return
        for subscriber in subscribers:
            member = self._subscribing.get(known.record.topic, {}).get(subscriber)
            if member is not None:
                member.hung.add(reporter.node.name)

    def _changed(self, topic: str) -> None:
        self.revision += 1
        self._topic_revisions[topic] = self.revision

    # ---- the view

    def view(self, epoch: int) -> GraphView:
        """Everything, as frozen values."""
        nodes = {
            each.node.id: NodeInfo(
                each.node.id,
                each.node.name,
                each.node.host,
                each.node.pid,
                each.node.language,
                each.node.generation,
                each.node.since_ns,
            )
            for each in self.members.values()
        }
        names = sorted(set(self._publishing) | set(self._subscribing))
        topics = {name: self._topic(name) for name in names}
        return GraphView(epoch, self.revision, nodes, topics, tuple(self._alerts(topics)))

    def _topic(self, name: str) -> TopicInfo:
        publishing = self._publishing.get(name, {})
        publishers = [(member, member.publishers[known]) for known, member in publishing.items()]
        subscribers = [(member, each) for member, each in self.subscribers_of(name)]
        records = [each.record for _member, each in publishers]
        msg_type = records[0].msg_type if records else subscribers[0][1].record.msg_type
        # The gateway's own publishers repeat what the originals sent: they do not count twice.
        originals = [
            each for member, each in publishers if member.node.generation not in {"native", "gateway"}
        ]
        counted = [
            each for member, each in publishers if not (originals and member.node.generation == "gateway")
        ]
        rates = [rate for each in counted if (rate := each.meter.rates()) is not None]
        stamps = [each.last_stamp_ns for each in counted if each.last_stamp_ns is not None]
        lost = [each.lost for _member, each in subscribers if each.lost is not None]
        received = [each.received for _member, each in subscribers if each.received is not None]
        all_lost = sum(lost) if lost else None
        total = sum(lost) + sum(received)
        return TopicInfo(
            name,
            msg_type,
            records[0].codec if records else "",
            tuple(_publisher_info(member, each) for member, each in publishers),
            tuple(
                SubscriberInfo(each.record.id, member.node.id, each.received, each.lost)
                for member, each in subscribers
            ),
            sum(rate for rate, _ in rates) if rates else None,
            sum(size for _, size in rates) if rates else None,
            max(stamps) if stamps else None,
            all_lost,
            None if all_lost is None else (all_lost / total if total else 0.0),
        )

    def _alerts(self, topics: Mapping[str, TopicInfo]) -> Iterator[Alert]:
        by_name: dict[str, list[Member]] = {}
        for member in self.members.values():
            by_name.setdefault(member.node.name, []).append(member)
        for name, members in sorted(by_name.items()):
            if len(members) > 1:
                yield Alert(
                    f"name:{name}",
                    f"{len(members)} programs call themselves “{name}”",
                    "Give each program a name of its own; both go on working.",
                )
        for topic in topics.values():
            yield from self._topic_alerts(topic)
        for member in self.members.values():
            if member.hung:
                yield Alert(
                    f"missing:{member.node.id}",
                    f"“{member.node.name}” does not answer {_names(member.hung)}",
                    "It may be busy or stopped in a debugger. What is published meanwhile may not reach it.",
                )

    def _topic_alerts(self, topic: TopicInfo) -> Iterator[Alert]:
        types: dict[str, list[str]] = {}
        for known, member in self._publishing.get(topic.name, {}).items():
            types.setdefault(member.publishers[known].record.msg_type, []).append(member.node.name)
        if len(types) > 1:
            said = " and ".join(f"{_names(names)} as “{kind}”" for kind, names in sorted(types.items()))
            yield Alert(
                f"type:{topic.name}",
                f"The topic “{topic.name}” has two types: it is published by {said}",
                "Use the same type in all programs, or give one of the topics another name.",
            )
        for member, subscriber in self.subscribers_of(topic.name):
            if subscriber.problem:
                yield Alert(
                    f"message:{topic.name}",
                    f"“{member.node.name}” cannot read “{topic.name}”: {subscriber.problem}",
                    "Look at the program that publishes them.",
                )
                return


def _publisher_info(member: Member, publisher: Publisher) -> PublisherInfo:
    rates = publisher.meter.rates()
    return PublisherInfo(
        publisher.record.id,
        member.node.id,
        publisher.record.endpoints,
        publisher.record.latched,
        publisher.count,
        publisher.bytes,
        publisher.last_seq,
        publisher.last_stamp_ns,
        None if rates is None else rates[0],
        None if rates is None else rates[1],
    )


def _names(names: Iterable[str]) -> str:
    return ", ".join(f"“{name}”" for name in sorted(names))


def _take_out(table: dict[str, dict[int, Member]], topic: str, known: int) -> None:
    entries = table.get(topic, {})
    entries.pop(known, None)
    if not entries:
        table.pop(topic, None)
