"""Snapshot of the graph as immutable values: nodes, topics, publishers, subscribers, services, alerts."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct, field

BRIDGES_TOPIC = "/nep/bridges"
"""Topic of the bridges' state (connected networks, message counts). Every publisher of it is a bridge."""


def to_plain(value: Struct) -> dict[str, object]:
    """Convert a value of this module to maps, lists and scalars, with all fields."""
    return {name: _plain_field(getattr(value, name)) for name in value.__struct_fields__}


def _plain_field(value: object) -> object:
    if isinstance(value, Struct):
        return to_plain(value)
    return [_plain_field(each) for each in value] if isinstance(value, tuple) else value


class Alert(Struct, frozen=True, gc=False, omit_defaults=True):
    """Current problem of the network, described for people.

    Attributes:
        id: Kind and subject, such as "type:/camera".
        sentence: Description of the problem.
        hint: Advice for fixing it.
    """

    id: str
    sentence: str
    hint: str = ""


class NodeInfo(Struct, frozen=True, gc=False):
    """Node of the graph.

    Attributes:
        id: 16 hexadecimal digits, new at each start.
        name: Name of the node; need not be unique.
        host: Name of the node's computer.
        pid: Process id, or None if unknown.
        language: Programming language.
        generation: "native", "gateway", or the original NEP's "A" or "B".
        since_ns: Start time by the node's clock, in nanoseconds since 1970.
        cpu_ratio: CPU usage of the node's process between the last two renewals (1.0 is one core), or
            None if unknown. Nodes of one process have the same value.
        clock_offset_ns: Nanoseconds to add to a time of the node's clock to get a time of the master's
            clock; 0 on the master's computer, None if unknown.
        clock_uncertainty_ns: Uncertainty (±) of `clock_offset_ns`.
    """

    id: str
    name: str
    host: str
    pid: int | None
    language: str
    generation: str
    since_ns: int
    cpu_ratio: float | None = None
    clock_offset_ns: int | None = None
    clock_uncertainty_ns: int | None = None


class PublisherInfo(Struct, frozen=True, gc=False):
    """Publisher of a topic. Counters are as of the last renewal: 1 s old at most, more in large graphs.

    Attributes:
        id: Id of the publisher.
        node_id: Id of the publisher's node.
        endpoints: Addresses; empty for publishers of the original NEP.
        latched: True if the publisher sends its newest message to later subscribers.
        count: Number of messages.
        bytes: Total size of the payloads.
        last_seq: Sequence number of the newest message.
        last_stamp_ns: Time stamp of the newest message, in nanoseconds since 1970 by the publisher's
            clock.
        rate_hz: Messages per second, or None if unknown.
        bandwidth_Bps: Bytes per second, or None if unknown.
    """

    id: int
    node_id: str
    endpoints: tuple[str, ...]
    latched: bool
    count: int
    bytes: int
    last_seq: int
    last_stamp_ns: int | None
    rate_hz: float | None
    bandwidth_Bps: float | None  # noqa: N815 - B/s


class SubscriberInfo(Struct, frozen=True, gc=False):
    """Subscriber of a topic.

    Attributes:
        id: Id of the subscriber.
        node_id: Id of its node.
        received: Number of received messages; None for the original NEP.
        lost: Number of lost messages; None for the original NEP.
    """

    id: int
    node_id: str
    received: int | None
    lost: int | None


class TopicInfo(Struct, frozen=True, gc=False):
    """Topic with its publishers and subscribers. Unknown values are None.

    Attributes:
        name: Name of the topic.
        msg_type: Message type.
        codec: Codec of the publishers, or "" if there is no publisher.
        publishers: Publishers.
        subscribers: Subscribers to this topic, without subscribers to a pattern.
        rate_hz: Messages per second of all publishers.
        bandwidth_Bps: Bytes per second of all publishers.
        last_stamp_ns: Time stamp of the newest message, in nanoseconds since 1970.
        lost: Number of messages lost by all subscribers.
        loss_ratio: Share of messages lost, 0 to 1.
    """

    name: str
    msg_type: str
    codec: str
    publishers: tuple[PublisherInfo, ...] = ()
    subscribers: tuple[SubscriberInfo, ...] = ()
    rate_hz: float | None = None
    bandwidth_Bps: float | None = None  # noqa: N815 - B/s
    last_stamp_ns: int | None = None
    lost: int | None = None
    loss_ratio: float | None = None


class PatternInfo(Struct, frozen=True, gc=False, omit_defaults=True):
    """Subscribers with a pattern, such as "/robot/*/camera". The pattern itself is not a topic.

    Attributes:
        name: The pattern.
        msg_type: Message type.
        subscribers: Subscribers.
    """

    name: str
    msg_type: str
    subscribers: tuple[SubscriberInfo, ...] = ()


class ServerInfo(Struct, frozen=True, gc=False, omit_defaults=True):
    """Server of a service.

    Attributes:
        id: Id of the server.
        node_id: Id of its node.
        endpoints: Addresses.
        calls: Number of answered calls.
        errors: Number of calls answered with an error.
        bytes: Total size of the replies.
    """

    id: int
    node_id: str
    endpoints: tuple[str, ...]
    calls: int
    errors: int
    bytes: int


class ClientInfo(Struct, frozen=True, gc=False, omit_defaults=True):
    """Client of a service.

    Attributes:
        id: Id of the client.
        node_id: Id of its node.
        answered: Number of answered calls, including errors, or None if unknown.
        failed: Number of calls without a reply, or None if unknown.
    """

    id: int
    node_id: str
    answered: int | None
    failed: int | None


class ServiceInfo(Struct, frozen=True, gc=False, omit_defaults=True):
    """Service with its servers and clients.

    Attributes:
        name: Name of the service.
        msg_type: Service type.
        servers: Servers; clients call the first one first.
        clients: Clients.
        calls: Number of calls answered by all servers.
        errors: Number of calls answered with an error.
    """

    name: str
    msg_type: str
    servers: tuple[ServerInfo, ...] = ()
    clients: tuple[ClientInfo, ...] = ()
    calls: int = 0
    errors: int = 0


class GraphView(Struct, frozen=True, gc=False, omit_defaults=True):
    """Snapshot of the whole graph. Returned by `Node.graph`.

        for topic in node.graph().topics.values():
            print(topic.name, topic.rate_hz)

    Attributes:
        epoch: Number of the master's run, which changes when the master is restarted.
        revision: Number that increases when nodes, publishers or subscribers are added or removed.
            Statistics don't change it.
        nodes: Nodes by id.
        topics: Topics by name.
        alerts: Current problems.
        listens: Addresses at which the master serves other computers; empty if it serves only its own
            computer.
        services: Services by name.
        patterns: Subscriptions with wildcards by pattern.
    """

    epoch: int
    revision: int
    nodes: Mapping[str, NodeInfo] = field(default_factory=dict)
    topics: Mapping[str, TopicInfo] = field(default_factory=dict)
    alerts: tuple[Alert, ...] = ()
    listens: tuple[str, ...] = ()
    services: Mapping[str, ServiceInfo] = field(default_factory=dict)
    patterns: Mapping[str, PatternInfo] = field(default_factory=dict)

    def to_plain(self) -> dict[str, object]:
        """Convert the graph to maps and lists, for the wire and for `--json`."""
        return {
            "epoch": self.epoch,
            "revision": self.revision,
            "nodes": [to_plain(node) for node in self.nodes.values()],
            "topics": [to_plain(topic) for topic in self.topics.values()],
            "alerts": [to_plain(alert) for alert in self.alerts],
            "listens": list(self.listens),
            "services": [to_plain(service) for service in self.services.values()],
            "patterns": [to_plain(pattern) for pattern in self.patterns.values()],
        }
