"""Requests, replies and pushes of nodes and the master. Wire encoding: `nep.protocol.encoding`.

Every reply and push has the master's `epoch`, which changes when the master is restarted, and the `revision`
of the graph.

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
"""Maximum of counters, which every language and encoding can represent."""

RENEW_S = 1.0
"""Default interval of renewals; the master may ask for another."""


def as_count(value: int) -> int:
    """Clamp a received counter to 0 … `COUNT_MAX`."""
    return value if 0 <= value <= COUNT_MAX else 0 if value < 0 else COUNT_MAX


@dataclass(frozen=True)
class NodeRecord:
    """Node as it registers itself.

    Attributes:
        id: Derived from the key.
        name: Name of the node.
        host: Name of its computer.
        pid: Process id, or None if unknown.
        language: Programming language.
        generation: See `NodeInfo`.
        since_ns: Start time by its own clock.
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
    """Publisher as its node registers it.

    Attributes:
        id: Derived from the node's key and `number` (`is_proven`).
        topic: Name of the topic.
        msg_type: Message type.
        codec: Name of the codec.
        endpoints: Addresses; empty if subscribers can't connect directly.
        latched: True if it keeps messages for later subscribers.
        local: True if it is also bound to the local (ipc) name of its loopback endpoint.
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
    """Subscriber as its node registers it. `number` proves its id (`is_proven`).

    With `pattern` its topic is a pattern: see `nep.protocol.topic_pattern`.
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
    """Return the publisher or subscriber id derived from a node's key and a number (from 1)."""
    digest = sha256(f"{key}/{number}".encode("utf-8", "replace")).digest()
    return int.from_bytes(digest[:8], "little") >> 1 or 1


def is_proven(node: NodeRecord, record: PublisherRecord | SubscriberRecord | None = None) -> bool:
    """Return True if the node's id is derived from its key and, with a record, the record's id, too."""
    if not node.key or node_id_from(node.key) != node.id:
        return False
    return record is None or (record.number > 0 and id_from(node.key, record.number) == record.id)


@dataclass(frozen=True)
class PublisherCount:
    """Statistics of a publisher: totals and the newest message.

    `problem` describes payloads that can't be encoded, or is "". A server counts its calls, the bytes of its
    replies, and calls with `errors`.
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
    """Statistics of a subscriber. `problem` describes messages that it can't decode, or is ""."""

    id: int
    received: int | None
    lost: int | None
    problem: str = ""


@dataclass(frozen=True)
class RemotePublisher:
    """Publisher with its node: everything a subscriber needs to connect. `computer` as in `NodeRecord`."""

    publisher: PublisherRecord
    node_id: str
    node_name: str
    computer: str = ""


@dataclass(frozen=True)
class Expected:
    """Subscriber that a new publisher waits for."""

    id: int
    node_id: str
    node_name: str


# ---- requests


@dataclass(frozen=True)
class Join:
    """Register a node with everything it has, replacing its previous registration.

    `epoch` is that of its previous master, or 0. A `managed` node (a program of the original NEP) has neither
    connection nor lease: its manager reports its end.
    """

    node: NodeRecord
    epoch: int = 0
    publishers: tuple[PublisherRecord, ...] = ()
    subscribers: tuple[SubscriberRecord, ...] = ()
    managed: bool = False


@dataclass(frozen=True)
class AddPublisher:
    """Register a publisher, and its node if unknown. Reply: `Added`."""

    node: NodeRecord
    publisher: PublisherRecord


@dataclass(frozen=True)
class AddSubscriber:
    """Register a subscriber, and its node if unknown. Reply: `Found`."""

    node: NodeRecord
    subscriber: SubscriberRecord


@dataclass(frozen=True)
class RemovePublisher:
    """Unregister a publisher; `last_seq` is its last message."""

    node_id: str
    id: int
    last_seq: int = 0


@dataclass(frozen=True)
class RemoveSubscriber:
    """Unregister a subscriber."""

    node_id: str
    id: int


@dataclass(frozen=True)
class Leave:
    """Unregister a node with everything it has."""

    node_id: str


@dataclass(frozen=True)
class Renew:
    """Renew a lease and report statistics.

    Attributes:
        node_id: Id of the node.
        epoch: Epoch of the master.
        revision: Revision of the last reply.
        publishers: Statistics of its publishers.
        subscribers: Statistics of its subscribers.
        cpu_ratio: CPU usage of its process since the last renewal, or None if unknown.
        clock: Offset to add to its clock for the master's, and the uncertainty, in ns; empty if unknown yet;
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
    """Report subscribers that did not answer a new publisher in time."""

    node_id: str
    publisher_id: int
    subscriber_ids: tuple[int, ...]


@dataclass(frozen=True)
class ReportAlerts:
    """Report all current alerts of an attachment (`source`), replacing its previous ones.

    Only for `Master.submit`; has no wire encoding.
    """

    source: str
    alerts: tuple[Alert, ...]


@dataclass(frozen=True)
class Listen:
    """Serve other computers at these addresses of the master's computer; none: only its own.

    Reply: `Done`. Rejected from other computers.
    """

    hosts: tuple[str, ...]


@dataclass(frozen=True)
class Look:
    """Request the whole graph. Reply: `Seen`."""


@dataclass(frozen=True)
class Ping:
    """Check that a master is running. Reply: `Done`."""


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
    | Look
    | Ping
)


# ---- replies


@dataclass(frozen=True)
class _FromMaster:
    """Base of replies and pushes: `epoch` changes when the master is restarted; `revision` of the graph."""

    epoch: int
    revision: int


@dataclass(frozen=True)
class Done(_FromMaster):
    """Success; also the reply to a ping."""


@dataclass(frozen=True)
class Added(_FromMaster):
    """Publisher registered. It waits for `expected`; `hung` are known not to respond at present.

    `hosts` (here and below) are the addresses at which the master serves other computers; publishers on the
    master's computer serve there, too.
    """

    expected: tuple[Expected, ...] = ()
    hung: tuple[Expected, ...] = ()
    hosts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Found(_FromMaster):
    """Subscriber registered, or node joined: the publishers to connect to.

    `pattern`: the master supports patterns; older ones don't.
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
class Renewed(_FromMaster):
    """Lease renewed.

    Attributes:
        again: True if the master does not know the node as it is: it must join again.
        topics: Publishers of topics that changed since the node's revision.
        last_seqs: Newest messages of the publishers that the node subscribes to, by publisher id.
        hosts: Addresses at which the master serves other computers.
        next_s: Time until the next renewal in seconds; longer in large graphs.
        times: Receipt and reply of the renewal by the master's clock (ns since 1970); empty for nodes with
            the same clock.
        clocks: By node id of publishers on other computers: offset to add to their times for the node's
            clock, and its uncertainty (ns).
    """

    again: bool = False
    topics: tuple[TopicPublishers, ...] = ()
    last_seqs: Mapping[int, int] = field(default_factory=dict)
    hosts: tuple[str, ...] = ()
    next_s: float = RENEW_S
    times: tuple[int, ...] = ()
    clocks: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Seen(_FromMaster):
    """The whole graph."""

    view: GraphView


@dataclass(frozen=True)
class Refused(_FromMaster):
    """Rejection of a request; `reason` is a sentence in the master's language.

    `code` is language-independent: see the table of codes in docs/wire.md. Empty from older masters.
    """

    reason: str
    code: str = ""


Reply = Done | Added | Found | Renewed | Seen | Refused


# ---- pushes


@dataclass(frozen=True)
class PublisherCame(_FromMaster):
    """New publisher of a subscribed topic, or one with new endpoints.

    `is_new`: it was just created and has not sent anything; it did not rejoin or move.
    """

    publisher: RemotePublisher
    is_new: bool = False


@dataclass(frozen=True)
class PublisherGone(_FromMaster):
    """Publisher of a subscribed topic no longer registered.

    `is_closed`: it unregistered, and `last_seq` was its last message. Otherwise its node does not respond,
    and the connection stays, because the publisher may only be suspended.
    """

    id: int
    topic: str
    is_closed: bool = False
    last_seq: int = 0


@dataclass(frozen=True)
class Probe(_FromMaster):
    """Probe of a silent node's connection. Ignored by the receiver."""


Push = PublisherCame | PublisherGone | Probe


def node_of(request: Request) -> str | None:
    """Return the id of the node that a request speaks for, or None."""
    if isinstance(request, Join | AddPublisher | AddSubscriber):
        return request.node.id
    if isinstance(request, ReportAlerts | Listen | Look | Ping):
        return None
    return request.node_id
