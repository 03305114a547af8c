"""Requests of nodes, and replies and pushes of the master. Wire encoding: `nep.protocol.encoding`.

Every reply and push contains the master's `epoch`, which changes when the master is restarted, and the
`revision` of the graph.

A node has a secret *key*, shared only with its masters, from which its id is derived. No other program can
register that id, whether the node is registered, unlisted or returns to a restarted master. Ids of publishers
and subscribers are derived from the key and a number. See docs/adr/0014-who-speaks-for-a-node.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256

from nep.protocol.graph_view import Alert, GraphView

COUNT_MAX = 2**63 - 1
"""Maximum value of counters; every language and encoding can represent it."""

RENEW_S = 1.0
"""Default interval of renewals in seconds. The master may request another interval."""


def as_count(value: int) -> int:
    """Clamp a received counter to 0 … `COUNT_MAX`."""
    return value if 0 <= value <= COUNT_MAX else 0 if value < 0 else COUNT_MAX


@dataclass(frozen=True)
class NodeRecord:
    """Registration record of a node.

    Attributes:
        id: Id derived from the key.
        name: Name of the node.
        host: Name of its computer.
        pid: Process id, or None if unknown.
        language: Programming language.
        generation: See `NodeInfo`.
        since_ns: Start time by its own clock, in nanoseconds since 1970.
        key: Secret that proves the id (`is_proven`).
        computer: Id of the computer; nodes with the same value share a clock. "" if unknown.
    """

    id: str
    name: str
    host: str
    pid: int | None
    language: str = "Python"
    generation: str = "native"
    since_ns: int = 0
    key: str = field(default="", repr=False)
    computer: str = ""


@dataclass(frozen=True)
class PublisherRecord:
    """Registration record of a publisher.

    Attributes:
        id: Id derived from the node's key and `number` (`is_proven`).
        topic: Name of the topic.
        msg_type: Message type.
        codec: Name of the codec.
        endpoints: Addresses; empty if subscribers can't connect directly.
        latched: True if it keeps messages for later subscribers.
        local: True if it is also bound to the Unix socket that belongs to its loopback endpoint.
        number: Proves the id.
        history: Number of messages kept for later subscribers, if more than one.
    """

    id: int
    topic: str
    msg_type: str
    codec: str
    endpoints: tuple[str, ...] = ()
    latched: bool = False
    local: bool = False
    number: int = 0
    history: int = 0


@dataclass(frozen=True)
class SubscriberRecord:
    """Registration record of a subscriber.

    Attributes:
        id: Id derived from the node's key and `number` (`is_proven`).
        topic: Name of the topic, or a pattern.
        msg_type: Message type.
        number: Proves the id.
        pattern: True if `topic` is a pattern. See `nep.protocol.topic_pattern`.
    """

    id: int
    topic: str
    msg_type: str
    number: int = 0
    pattern: bool = False


def node_id_from(key: str) -> str:
    """Return the node id derived from a key: 16 hexadecimal digits."""
    return sha256(key.encode("utf-8", "replace")).hexdigest()[:16]


def id_from(key: str, number: int) -> int:
    """Return the id of a publisher or subscriber, derived from its node's key and a number (from 1)."""
    digest = sha256(f"{key}/{number}".encode("utf-8", "replace")).digest()
    return int.from_bytes(digest[:8], "little") >> 1 or 1


def is_proven(node: NodeRecord, record: PublisherRecord | SubscriberRecord | None = None) -> bool:
    """Return True if a node's id is derived from its key; with a record, the record's id must be, too."""
    if not node.key or node_id_from(node.key) != node.id:
        return False
    return record is None or (record.number > 0 and id_from(node.key, record.number) == record.id)


@dataclass(frozen=True)
class PublisherCount:
    """Statistics of a publisher: totals and the newest message.

    `problem` is the reason why payloads can't be encoded, or "". For a server, the statistics are its calls,
    the bytes of its replies, and the calls that ended with `errors`.
    """

    id: int
    count: int
    bytes: int
    last_seq: int
    last_stamp_ns: int | None = None
    problem: str = ""
    errors: int = 0


@dataclass(frozen=True)
class SubscriberCount:
    """Statistics of a subscriber. `problem` is the reason why messages can't be decoded, or ""."""

    id: int
    received: int | None
    lost: int | None
    problem: str = ""


@dataclass(frozen=True)
class RemotePublisher:
    """Publisher and its node: everything a subscriber needs to connect. `computer` as in `NodeRecord`."""

    publisher: PublisherRecord
    node_id: str
    node_name: str
    computer: str = ""


@dataclass(frozen=True)
class ExpectedSubscriber:
    """Registered subscriber that a new publisher waits for."""

    id: int
    node_id: str
    node_name: str


# ---- requests


@dataclass(frozen=True)
class Join:
    """Request to register a node and all its records, replacing its previous registration.

    Attributes:
        node: Record of the node.
        epoch: Epoch of its previous master, or 0.
        publishers: Records of its publishers.
        subscribers: Records of its subscribers.
        managed: True for programs of the original NEP. They have neither a connection nor a lease; their
            manager reports their end.
    """

    node: NodeRecord
    epoch: int = 0
    publishers: tuple[PublisherRecord, ...] = ()
    subscribers: tuple[SubscriberRecord, ...] = ()
    managed: bool = False


@dataclass(frozen=True)
class AddPublisher:
    """Request to register a publisher, and its node if unknown. Reply: `Added`."""

    node: NodeRecord
    publisher: PublisherRecord


@dataclass(frozen=True)
class AddSubscriber:
    """Request to register a subscriber, and its node if unknown. Reply: `Found`."""

    node: NodeRecord
    subscriber: SubscriberRecord


@dataclass(frozen=True)
class RemovePublisher:
    """Request to unregister a publisher, whose last message is `last_seq`."""

    node_id: str
    id: int
    last_seq: int = 0


@dataclass(frozen=True)
class RemoveSubscriber:
    """Request to unregister a subscriber."""

    node_id: str
    id: int


@dataclass(frozen=True)
class Leave:
    """Request to unregister a node with all its records."""

    node_id: str


@dataclass(frozen=True)
class Renew:
    """Request to renew a lease, with statistics. Reply: `Renewed`.

    Attributes:
        node_id: Id of the node.
        epoch: Epoch of the master.
        revision: Revision of the last reply.
        publishers: Statistics of its publishers.
        subscribers: Statistics of its subscribers.
        cpu_ratio: CPU usage of its process since the last renewal (1.0 is one core), or None if unknown.
        clock: Offset to add to its clock for the master's, and the uncertainty, in ns. Empty if unknown yet;
            None from nodes that don't compare clocks.
    """

    node_id: str
    epoch: int
    revision: int
    publishers: tuple[PublisherCount, ...] = ()
    subscribers: tuple[SubscriberCount, ...] = ()
    cpu_ratio: float | None = None
    clock: tuple[int, ...] | None = None


@dataclass(frozen=True)
class ReportMissing:
    """Report of subscribers that did not connect to a new publisher in time."""

    node_id: str
    publisher_id: int
    subscriber_ids: tuple[int, ...]


@dataclass(frozen=True)
class ReportAlerts:
    """Report of all current alerts of an attachment (`source`), replacing its previous alerts.

    Only for `Master.submit`; has no wire encoding.
    """

    source: str
    alerts: tuple[Alert, ...]


@dataclass(frozen=True)
class Listen:
    """Request to serve other computers at these addresses of the master's computer; none serves only its own.

    Reply: `Done`. Rejected from other computers.
    """

    hosts: tuple[str, ...]


@dataclass(frozen=True)
class QueryGraph:
    """Request for the whole graph. Reply: `Seen`."""


@dataclass(frozen=True)
class Ping:
    """Request to check that a master is running. Reply: `Done`."""


Request = (
    Join
    | AddPublisher
    | AddSubscriber
    | RemovePublisher
    | RemoveSubscriber
    | Leave
    | Renew
    | ReportMissing
    | ReportAlerts
    | Listen
    | QueryGraph
    | Ping
)


# ---- replies


@dataclass(frozen=True)
class _MasterMessage:
    """Base class of replies and pushes.

    Attributes:
        epoch: Changes when the master is restarted.
        revision: Revision of the graph.
    """

    epoch: int
    revision: int


@dataclass(frozen=True)
class Done(_MasterMessage):
    """Request executed; also the reply to a ping."""


@dataclass(frozen=True)
class Added(_MasterMessage):
    """Publisher registered.

    Attributes:
        expected: Subscribers that the publisher waits for.
        hung: Subscribers of nodes that are known not to respond at present.
        hosts: Addresses at which the master serves other computers. Publishers on the master's computer bind
            to them, too.
    """

    expected: tuple[ExpectedSubscriber, ...] = ()
    hung: tuple[ExpectedSubscriber, ...] = ()
    hosts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Found(_MasterMessage):
    """Subscriber registered, or node joined.

    Attributes:
        publishers: Publishers to connect to.
        hosts: Addresses at which the master serves other computers.
        pattern: True if the master supports patterns; older masters don't.
    """

    publishers: tuple[RemotePublisher, ...] = ()
    hosts: tuple[str, ...] = ()
    pattern: bool = False


@dataclass(frozen=True)
class TopicPublishers:
    """All publishers of one topic."""

    topic: str
    publishers: tuple[RemotePublisher, ...]


@dataclass(frozen=True)
class Renewed(_MasterMessage):
    """Lease renewed.

    Attributes:
        again: True if the node must join again, because its registration at the master is missing or
            different.
        topics: Publishers of topics that changed since the node's revision.
        last_seqs: Newest messages of the publishers that the node subscribes to, by publisher id.
        hosts: Addresses at which the master serves other computers.
        next_s: Time until the next renewal in seconds; longer in large graphs.
        times: Receipt and reply of the renewal by the master's clock (ns since 1970); empty for nodes with
            the same clock.
        clocks: Offset to add to times of a node on another computer for the receiver's clock, and its
            uncertainty (ns), by node id. Only for nodes whose publishers it receives.
    """

    again: bool = False
    topics: tuple[TopicPublishers, ...] = ()
    last_seqs: Mapping[int, int] = field(default_factory=dict)
    hosts: tuple[str, ...] = ()
    next_s: float = RENEW_S
    times: tuple[int, ...] = ()
    clocks: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class GraphReply(_MasterMessage):
    """Reply with the whole graph."""

    view: GraphView


@dataclass(frozen=True)
class Refused(_MasterMessage):
    """Request rejected. `reason` is a sentence in the master's language.

    `code` is independent of the language; docs/wire.md lists the codes. Older masters send none ("").
    """

    reason: str
    code: str = ""


Reply = Done | Added | Found | Renewed | GraphReply | Refused


# ---- pushes


@dataclass(frozen=True)
class PublisherAdded(_MasterMessage):
    """Notification of a new publisher on a subscribed topic, or of a publisher's new endpoints.

    `is_new` is True if the publisher was just created and has not sent anything, False if it rejoined or
    moved.
    """

    publisher: RemotePublisher
    is_new: bool = False


@dataclass(frozen=True)
class PublisherRemoved(_MasterMessage):
    """Notification that a publisher of a subscribed topic is no longer registered.

    `is_closed` is True if the publisher unregistered; `last_seq` was then its last message. Otherwise its
    node doesn't respond, and the connection stays, because the publisher may only be suspended.
    """

    id: int
    topic: str
    is_closed: bool = False
    last_seq: int = 0


@dataclass(frozen=True)
class Probe(_MasterMessage):
    """Test of the connection to a node that missed a renewal. Ignored by the receiver."""


Push = PublisherAdded | PublisherRemoved | Probe


def node_of(request: Request) -> str | None:
    """Return the id of the node in whose name a request is sent, or None."""
    if isinstance(request, Join | AddPublisher | AddSubscriber):
        return request.node.id
    if isinstance(request, ReportAlerts | Listen | QueryGraph | Ping):
        return None
    return request.node_id
