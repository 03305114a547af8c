"""Registry: tables of nodes, publishers and subscribers, and their statistics.

Also validates registrations (`check_request`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from nep.errors import NepError, WireError
from nep.i18n import _
from nep.masters.departed import DepartedPublishers
from nep.masters.pattern_index import PatternIndex
from nep.masters.rates import TrafficMeter
from nep.protocol.graph_view import Alert
from nep.protocol.requests import (
    MAX_COUNT,
    RENEW_INTERVAL_S,
    AddPublisher,
    AddSubscriber,
    Join,
    NodeRecord,
    PublisherRecord,
    RemotePublisher,
    Renew,
    Request,
    SubscriberRecord,
    clamp_count,
)
from nep.protocol.wire import check_node_name, check_topic
from nep.text import escaped, first_control, shortened

MAX_RECORDS_PER_NODE = 5_000
"""Maximum number of publishers and subscribers of one node."""
MAX_RECORDS = 20_000
"""Maximum number of publishers and subscribers of all nodes."""
GUARANTEED_RECORDS = 100
"""Number of publishers and subscribers allowed per node even if the limit for all nodes is reached."""
_MAX_ENDPOINTS = 32
_MAX_PID = 2**32 - 1
_NODE_ID_PATTERN = re.compile("[0-9a-f]{16}")
_ENDPOINT_PATTERN = re.compile(
    r"(?:tcp|nanomsg)://(?:[A-Za-z0-9._-]{1,253}|\[[0-9A-Fa-f:.]{2,45}(?:%[\w.-]{1,20})?\]):(\d{1,5})",
    re.ASCII,
)

_MAX_UNCONNECTED_NODES = 100
"""Maximum number of ids in `RegisteredNode.unconnected_node_ids`."""
_MAX_CORES = 100_000.0
_MAX_PROBLEM_LENGTH = 500
"""Maximum length in characters of a problem that a node reports."""
RATE_DECAY_S = 12.0
"""Time in seconds after a publisher's last message during which its rate is still updated."""


@dataclass
class RegisteredPublisher:
    """Registered publisher and its statistics."""

    record: PublisherRecord
    meter: TrafficMeter = field(default_factory=TrafficMeter)
    count: int = 0
    bytes: int = 0
    last_seq: int = 0
    last_stamp_ns: int | None = None
    problem: str = ""
    errors: int = 0
    changed_at: float = 0.0


@dataclass
class RegisteredSubscriber:
    """Registered subscriber and its statistics."""

    record: SubscriberRecord
    received: int | None = None
    lost: int | None = None
    problem: str = ""


class NodeClock(NamedTuple):
    """Clock of a node.

    Attributes:
        offset_ns: Nanoseconds to add to a time of the node's clock to get a time of the master's clock.
        uncertainty_ns: Uncertainty (±) of the offset when it was reported.
        reported_at: Time of the report (s, monotonic); None for nodes that share the master's clock,
            which can't drift.
    """

    offset_ns: int
    uncertainty_ns: int
    reported_at: float | None


@dataclass
class RegisteredNode:
    """Registered node.

    Attributes:
        node: Record of the node.
        renewed_at: Time of the last renewal.
        renew_interval_s: Requested interval in seconds between the last and the next renewal.
        is_managed: True for a node without a lease, whose end an attachment reports.
        route: Connection over which the node sends requests; "" for nodes of attachments.
        publishers: Publishers by id.
        subscribers: Subscribers by id.
        unconnected_node_ids: Ids of nodes to whose publishers this node's subscribers did not connect.
        cpu_ratio: CPU usage of the node's process (1.0 is one core), or None if unknown.
        sources: Publishers that the node's subscribers receive, cached by `Registry.sources_of`.
        sources_version: Version of `sources` and `remote_nodes`.
        remote_nodes: Nodes of the publishers in `sources`, except those known to be on the same computer.
        clock: Clock of the node, or None if unknown.
    """

    node: NodeRecord
    renewed_at: float
    renew_interval_s: float = RENEW_INTERVAL_S
    is_managed: bool = False
    route: str = ""
    publishers: dict[int, RegisteredPublisher] = field(default_factory=dict)
    subscribers: dict[int, RegisteredSubscriber] = field(default_factory=dict)
    unconnected_node_ids: set[str] = field(default_factory=set)
    cpu_ratio: float | None = None
    sources: dict[int, RegisteredPublisher] = field(default_factory=dict)
    sources_version: int = -1
    remote_nodes: tuple[RegisteredNode, ...] = ()
    clock: NodeClock | None = None


class Registry:
    """Tables of registrations, and the operations that change them."""

    def __init__(self) -> None:
        self.members: dict[str, RegisteredNode] = {}
        self.members_by_route: dict[str, RegisteredNode] = {}
        """Node by the connection that speaks for the node."""
        self.publisher_owners: dict[int, RegisteredNode] = {}
        """Node by the id of its publisher."""
        self.subscriber_owners: dict[int, RegisteredNode] = {}
        """Node by the id of its subscriber."""
        self.revision = 1
        self.publishers_revision = 0
        """Revision of the last change of any topic's publishers."""
        self.changed_topics: set[str] = set()
        """Topics that changed since the last snapshot, including their statistics. Cleared by the snapshot.

        Unused names are removed, because a program may use a new name every second.
        """
        self._topic_revisions: dict[str, int] = {}
        self._publisher_owners_by_topic: dict[str, dict[int, RegisteredNode]] = {}
        self._subscriber_owners_by_topic: dict[str, dict[int, RegisteredNode]] = {}
        self._alerts_by_source: dict[str, tuple[Alert, ...]] = {}
        self.patterns: PatternIndex[RegisteredNode] = PatternIndex()
        self.departed: DepartedPublishers[RegisteredPublisher] = DepartedPublishers()

    # ---- reading

    def publishers_of(self, topic: str) -> tuple[RemotePublisher, ...]:
        """Return the publishers of a topic to which subscribers can connect."""
        owners = self._publisher_owners_by_topic.get(topic, {})
        return tuple(
            self.remote_publisher(member, member.publishers[publisher_id].record)
            for publisher_id, member in owners.items()
            if member.publishers[publisher_id].record.endpoints
        )

    @property
    def topics(self) -> list[str]:
        """Names of all topics with publishers or subscribers."""
        return sorted(set(self._publisher_owners_by_topic) | set(self._subscriber_owners_by_topic))

    def publishers_with_nodes(self, topic: str) -> list[tuple[RegisteredNode, RegisteredPublisher]]:
        """Return all publishers of a topic with their nodes, including those without endpoints."""
        owners = self._publisher_owners_by_topic.get(topic)
        return (
            [(member, member.publishers[publisher_id]) for publisher_id, member in owners.items()]
            if owners
            else []
        )

    def subscribers_of(self, topic: str) -> list[tuple[RegisteredNode, RegisteredSubscriber]]:
        """Return the subscribers of a topic with their nodes."""
        owners = self._subscriber_owners_by_topic.get(topic)
        return (
            [(member, member.subscribers[subscriber_id]) for subscriber_id, member in owners.items()]
            if owners
            else []
        )

    def receivers_of(self, topic: str) -> list[tuple[RegisteredNode, RegisteredSubscriber]]:
        """Return the subscribers that receive a topic, including those whose pattern matches it."""
        receivers = [each for each in self.subscribers_of(topic) if not each[1].record.pattern]
        return receivers + [
            (member, member.subscribers[subscriber_id])
            for member, subscriber_id in self.patterns.subscribers_of(topic)
        ]

    def topics_of(self, record: SubscriberRecord) -> set[str]:
        """Return the topics that a subscriber receives; for a pattern, the published ones that match."""
        return self.patterns.topics_of(record.topic) if record.pattern else {record.topic}

    def topics_received_by(self, member: RegisteredNode) -> set[str]:
        """Return the topics that a node's subscribers receive."""
        return {
            topic for subscriber in member.subscribers.values() for topic in self.topics_of(subscriber.record)
        }

    def remote_publisher(self, member: RegisteredNode, record: PublisherRecord) -> RemotePublisher:
        """Return a publisher in the form that is sent to subscribers."""
        return RemotePublisher(record, member.node.id, member.node.name, member.node.computer)

    def topic_revision(self, topic: str) -> int:
        """Return the revision of the graph at which a topic's publishers last changed."""
        return self._topic_revisions.get(topic, 0)

    def sources_of(self, member: RegisteredNode) -> dict[int, RegisteredPublisher]:
        """Return the publishers that a node's subscribers can connect to, by id.

        Recently unregistered publishers are included.
        """
        version = self.revision + self.departed.removal_count
        if member.sources_version != version:
            member.sources_version = version
            topics = self.topics_received_by(member)
            names = {subscriber.record.topic for subscriber in member.subscribers.values()}
            member.sources = {
                publisher_id: departed_publisher
                for name in names
                for publisher_id, departed_publisher in self.departed.for_topic(name).items()
            }
            member.sources |= {
                publisher_id: other.publishers[publisher_id]
                for topic in topics
                for publisher_id, other in self._publisher_owners_by_topic.get(topic, {}).items()
                if other.publishers[publisher_id].record.endpoints
            }
            owners = {
                owner.node.id: owner for owner in map(self.publisher_owners.get, member.sources) if owner
            }
            computer = member.node.computer
            member.remote_nodes = tuple(
                each for each in owners.values() if not computer or each.node.computer != computer
            )
        return member.sources

    def remote_nodes_of(self, member: RegisteredNode) -> tuple[RegisteredNode, ...]:
        """Return the nodes of the publishers in `sources_of`.

        Nodes that are known to be on the same computer are omitted.
        """
        self.sources_of(member)
        return member.remote_nodes

    def last_seqs(self, member: RegisteredNode) -> dict[int, int]:
        """Return the newest sequence number of each publisher in `sources_of`, by publisher id.

        Includes recently unregistered publishers, because the node may have been disconnected when they
        closed.
        """
        return {
            publisher_id: publisher.last_seq for publisher_id, publisher in self.sources_of(member).items()
        }

    # ---- changing

    def add_node(self, node: NodeRecord, now: float, *, is_managed: bool | None = None) -> RegisteredNode:
        """Register a node or update its record, renew its lease, and return the registered node.

        Args:
            node: Record of the node.
            now: Current time (s, monotonic).
            is_managed: True for a node without a lease; None leaves the value unchanged.
        """
        member = self.members.get(node.id)
        if member is None:
            member = self.members[node.id] = RegisteredNode(node, now)
            self.revision += 1
        elif member.node != node:  # the version of an original program is known only after its first messages
            member.node = node
            self.revision += 1
        member.renewed_at = now
        if is_managed is not None:
            member.is_managed = is_managed
        return member

    def bind_route(self, member: RegisteredNode, route: str) -> None:
        """Set the connection over which a node sends requests; "" for none."""
        if member.route != route:
            self._unbind_route(member)
            member.route = route
        if route:
            self.members_by_route[route] = member

    def _unbind_route(self, member: RegisteredNode) -> None:
        if self.members_by_route.get(member.route) is member:
            del self.members_by_route[member.route]

    def add_publisher(self, member: RegisteredNode, record: PublisherRecord) -> bool:
        """Register a publisher; return False if it was already registered identically."""
        existing = member.publishers.get(record.id)
        if existing is not None and existing.record == record:
            return False
        if existing is not None:
            self.remove_publisher(member.node.id, record.id)
        member.publishers[record.id] = RegisteredPublisher(record)
        self.publisher_owners[record.id] = member
        self._publisher_owners_by_topic.setdefault(record.topic, {})[record.id] = member
        self.patterns.add_topic(record.topic)
        self._bump_revision(record.topic)
        return True

    def add_subscriber(self, member: RegisteredNode, record: SubscriberRecord) -> None:
        """Register a subscriber. Idempotent."""
        if record.id not in member.subscribers:
            member.subscribers[record.id] = RegisteredSubscriber(record)
            self.subscriber_owners[record.id] = member
            self._subscriber_owners_by_topic.setdefault(record.topic, {})[record.id] = member
            if record.pattern:
                self.patterns.add(record.topic, record.id, member, self._publisher_owners_by_topic)
            self.changed_topics.add(record.topic)
            self.revision += 1

    def remove_publisher(self, node_id: str, publisher: int) -> PublisherRecord | None:
        """Unregister a publisher; return its record, or None if unknown."""
        member = self.members.get(node_id)
        removed = member.publishers.pop(publisher, None) if member else None
        if removed is None:
            return None
        self.publisher_owners.pop(publisher, None)
        if removed.record.endpoints:
            self.departed.add(self._names_of(removed.record.topic), publisher, removed)
        _discard(self._publisher_owners_by_topic, removed.record.topic, publisher)
        if removed.record.topic not in self._publisher_owners_by_topic:
            self.patterns.remove_topic(removed.record.topic)
        self._bump_revision(removed.record.topic)
        self._discard_unused(removed.record.topic)
        return removed.record

    def _names_of(self, topic: str) -> set[str]:
        # The topic and the patterns that match it.
        subscribers = self.patterns.subscribers_of(topic)
        return {
            topic,
            *(member.subscribers[subscriber_id].record.topic for member, subscriber_id in subscribers),
        }

    def remove_subscriber(self, node_id: str, subscriber: int) -> None:
        """Unregister a subscriber. Idempotent."""
        member = self.members.get(node_id)
        removed = member.subscribers.pop(subscriber, None) if member else None
        if removed is not None:
            self.subscriber_owners.pop(subscriber, None)
            _discard(self._subscriber_owners_by_topic, removed.record.topic, subscriber)
            if removed.record.pattern:
                self.patterns.remove(removed.record.topic, subscriber)
            self.changed_topics.add(removed.record.topic)
            self.revision += 1
            self._discard_unused(removed.record.topic)

    def _discard_unused(self, topic: str) -> None:
        # Discards data of unused topics; a new subscriber or publisher gets the full state anyway.
        if topic not in self._publisher_owners_by_topic and topic not in self._subscriber_owners_by_topic:
            self.changed_topics.discard(topic)
            self._topic_revisions.pop(topic, None)

    def remove_node(self, node_id: str) -> None:
        """Unregister a node with all its publishers and subscribers."""
        member = self.members[node_id]
        for publisher in list(member.publishers):
            self.remove_publisher(node_id, publisher)
        for subscriber in list(member.subscribers):
            self.remove_subscriber(node_id, subscriber)
        self._unbind_route(member)
        del self.members[node_id]
        self.revision += 1

    def renew(self, member: RegisteredNode, renewal: Renew, now: float) -> bool:
        """Store a node's statistics and renew its lease. Numbers out of range are clamped.

        Args:
            member: The node.
            renewal: Renewal of the node.
            now: Current time (s, monotonic).

        Returns:
            False if the statistics don't match the registrations; some may have been stored by then.
        """
        publishers, subscribers = member.publishers, member.subscribers
        if len(renewal.publishers) != len(publishers) or len(renewal.subscribers) != len(subscribers):
            return False
        for counts in renewal.publishers:
            publisher = publishers.get(counts.id)
            if publisher is None:
                return False
            self.update_counts(publisher, counts.count, counts.bytes, now)
            self.update_last_message(publisher, counts.last_seq, counts.last_stamp_ns)
            publisher.errors = clamp_count(counts.errors)
            if counts.problem != publisher.problem:
                self.update_problem(publisher, counts.problem)
        for stats in renewal.subscribers:
            subscriber = subscribers.get(stats.id)
            if subscriber is None:
                return False
            self.update_subscriber(subscriber, stats.received, stats.lost, stats.problem)
        member.renewed_at, member.cpu_ratio = now, _plausible_ratio(renewal.cpu_ratio)
        member.unconnected_node_ids.clear()
        return True

    def update_counts(self, publisher: RegisteredPublisher, count: int, size_bytes: int, now: float) -> None:
        """Store a publisher's counters."""
        count, size_bytes = clamp_count(count), clamp_count(size_bytes)
        if count != publisher.count:
            publisher.changed_at = now
            publisher.count, publisher.bytes = count, size_bytes
            self.changed_topics.add(publisher.record.topic)
        elif now - publisher.changed_at < RATE_DECAY_S:
            self.changed_topics.add(publisher.record.topic)
        publisher.meter.add(now, count, size_bytes)

    def update_last_message(
        self, publisher: RegisteredPublisher, last_seq: int, last_stamp_ns: int | None
    ) -> None:
        """Store sequence number and time stamp of a publisher's newest message."""
        publisher.last_seq = clamp_count(last_seq)
        publisher.last_stamp_ns = None if last_stamp_ns is None else clamp_count(last_stamp_ns)

    def update_problem(self, publisher: RegisteredPublisher, problem: str) -> None:
        """Store the problem that a publisher reports, or "" if the problem is solved."""
        publisher.problem = escaped(shortened(problem, _MAX_PROBLEM_LENGTH)) if problem else ""
        self.changed_topics.add(publisher.record.topic)

    def update_subscriber(
        self, subscriber: RegisteredSubscriber, received: int | None, lost: int | None, problem: str
    ) -> None:
        """Store a subscriber's statistics."""
        received = None if received is None else clamp_count(received)
        lost = None if lost is None else clamp_count(lost)
        if problem:
            problem = escaped(shortened(problem, _MAX_PROBLEM_LENGTH))
        if received != subscriber.received or lost != subscriber.lost or problem != subscriber.problem:
            self.changed_topics.add(subscriber.record.topic)
            subscriber.received, subscriber.lost, subscriber.problem = received, lost, problem

    def report_missing(self, node_id: str, publisher: int, subscribers: Iterable[int]) -> None:
        """Record that subscribers did not connect to a publisher.

        Each subscriber's next renewal clears the record.

        Args:
            node_id: Node of the publisher.
            publisher: Id of the publisher.
            subscribers: Ids of the subscribers.
        """
        reporter = self.members.get(node_id)
        registered = reporter.publishers.get(publisher) if reporter else None
        if reporter is None or registered is None:
            return
        for subscriber in subscribers:
            member = self._subscriber_owners_by_topic.get(registered.record.topic, {}).get(subscriber)
            if member is not None and len(member.unconnected_node_ids) < _MAX_UNCONNECTED_NODES:
                member.unconnected_node_ids.add(reporter.node.id)

    def report_alerts(self, source: str, alerts: tuple[Alert, ...]) -> None:
        """Replace the alerts that the attachment `source` reports."""
        if self._alerts_by_source.get(source, ()) != alerts:
            self._alerts_by_source[source] = alerts
            self.revision += 1

    @property
    def reported_alerts(self) -> tuple[Alert, ...]:
        """Alerts of all attachments."""
        return tuple(alert for alerts in self._alerts_by_source.values() for alert in alerts)

    def _bump_revision(self, topic: str) -> None:
        self.changed_topics.add(topic)
        self.revision += 1
        self.publishers_revision = self._topic_revisions[topic] = self.revision


def _plausible_ratio(value: float | None) -> float | None:
    # None for an implausible CPU usage.
    return value if value is not None and 0.0 <= value < _MAX_CORES else None


def _discard(table: dict[str, dict[int, RegisteredNode]], topic: str, record_id: int) -> None:
    entries = table.get(topic, {})
    entries.pop(record_id, None)
    if not entries:
        table.pop(topic, None)


# ---- validation of registrations


def is_publisher_endpoint(endpoint: str) -> bool:
    """Return True for `tcp://HOST:PORT` (ZeroMQ) and `nanomsg://HOST:PORT`, the endpoints of publishers."""
    match = _ENDPOINT_PATTERN.fullmatch(endpoint)
    return match is not None and 1 <= int(match.group(1)) <= 65535


def check_request(request: Request) -> None:
    """Raise `WireError` if a registration is invalid on its own.

    The graph checks for conflicts with other nodes.
    """
    if not isinstance(request, Join | AddPublisher | AddSubscriber):
        return
    _check_node(request.node)
    if isinstance(request, Join) and request.managed:
        raise WireError(
            _("only programs attached to the master, such as its gateway, can manage other nodes"),
            code="managed",
        )
    for record in records_of(request):
        _check_registration(record)


def records_of(
    request: Join | AddPublisher | AddSubscriber,
) -> tuple[PublisherRecord | SubscriberRecord, ...]:
    """Return all publishers and subscribers that a request registers."""
    if isinstance(request, Join):
        return (*request.publishers, *request.subscribers)
    return (request.publisher if isinstance(request, AddPublisher) else request.subscriber,)


def check_record(record: PublisherRecord | SubscriberRecord) -> None:
    """Raise `WireError` if the topic of a publisher or subscriber is invalid."""
    try:
        check_topic(record.topic)
    except NepError as error:
        raise WireError(str(error), code="topic") from error


def _check_node(node: NodeRecord) -> None:
    if not _NODE_ID_PATTERN.fullmatch(node.id):
        raise WireError(
            _("'{id}' isn't a node id; node ids have 16 hexadecimal digits").format(
                id=shortened(node.id, 40)
            ),
            code="node-id",
        )
    try:
        check_node_name(node.name)
    except NepError as error:
        raise WireError(str(error), code="node-name") from error
    _check_text("host", node.host, 255)
    _check_text("language", node.language, 50)
    _check_text("generation", node.generation, 50)
    _check_text("key", node.key, 200)
    _check_text("computer", node.computer, 64)
    if node.pid is not None and not 0 <= node.pid <= _MAX_PID:
        raise WireError(_("{pid} isn't a process id").format(pid=node.pid), code="pid")
    if not 0 <= node.since_ns <= MAX_COUNT:
        reason = _("{since_ns} isn't a valid start time of a node").format(since_ns=node.since_ns)
        raise WireError(reason, code="since")


def _check_registration(record: PublisherRecord | SubscriberRecord) -> None:
    check_record(record)
    if not 1 <= record.id <= MAX_COUNT:
        raise WireError(
            _("{id} isn't the id of a publisher or subscriber; it must be from 1 to 2^63-1").format(
                id=record.id
            ),
            code="record-id",
        )
    _check_text("type", record.msg_type, 200)
    if isinstance(record, PublisherRecord):
        _check_text("codec", record.codec, 50)
        if len(record.endpoints) > _MAX_ENDPOINTS:
            raise WireError(
                _("a publisher has {count} endpoints; at most {most} are allowed").format(
                    count=len(record.endpoints), most=_MAX_ENDPOINTS
                ),
                code="endpoint-count",
            )
        for endpoint in record.endpoints:
            if not is_publisher_endpoint(endpoint):
                shown_endpoint = escaped(shortened(endpoint, 80))
                raise WireError(
                    _(
                        "'{said}' isn't a publisher endpoint; it must have the form 'tcp://HOST:PORT' or "
                        "'nanomsg://HOST:PORT'"
                    ).format(said=shown_endpoint),
                    code="endpoint",
                )


def _check_text(kind: str, text: str, max_length: int) -> None:
    control = first_control(text)
    if len(text) > max_length or control:
        hint = (
            _("the character '{control}' isn't allowed").format(control=control)
            if control
            else _("use at most {most} characters").format(most=max_length)
        )
        raise WireError(
            _("'{word}' isn't a valid {what}; {hint}").format(
                word=escaped(shortened(text, 40)), what=kind, hint=hint
            ),
            code="text",
        )
