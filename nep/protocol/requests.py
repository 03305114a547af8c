"""Requests of nodes, and replies and pushes of the master. Wire encoding: `nep.protocol.encoding`.

Every reply and push contains the master's `epoch`, which changes when the master is restarted, and the
`revision` of the graph.

A node has a secret *key*, shared only with its masters, from which the node's id is derived. No other
program can register that id, even while the node is not registered or the master is restarting. Ids of
publishers and subscribers are derived from the key and a number. See
docs/adr/0014-who-speaks-for-a-node.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256

from msgspec import Struct, field

from nep.protocol.graph_view import Alert, GraphView

MAX_COUNT = 2**63 - 1
"""Maximum value of counters; every language and encoding can represent it."""

RENEW_INTERVAL_S = 1.0
"""Default interval of renewals in seconds. The master may request another interval."""


def clamp_count(value: int) -> int:
    """Clamp a received counter to 0 … `MAX_COUNT`."""
    return value if 0 <= value <= MAX_COUNT else 0 if value < 0 else MAX_COUNT


class NodeRecord(Struct, frozen=True, gc=False, omit_defaults=True):
    """Registration record of a node.

    Attributes:
        id: Id derived from the key.
        name: Name of the node.
        host: Name of the node's computer.
        pid: Process id, or None if unknown.
        language: Programming language.
        generation: See `NodeInfo`.
        since_ns: Start time by the node's clock, in nanoseconds since 1970.
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
    key: str = ""
    computer: str = ""

    def __repr__(self) -> str:
        shown_fields = (name for name in self.__struct_fields__ if name != "key")  # the key is secret
        return f"NodeRecord({', '.join(f'{name}={getattr(self, name)!r}' for name in shown_fields)})"


class PublisherRecord(Struct, frozen=True, gc=False, omit_defaults=True):
    """Registration record of a publisher.

    Attributes:
        id: Id derived from the node's key and `number` (`is_proven`).
        topic: Name of the topic.
        msg_type: Message type.
        codec: Name of the codec.
        endpoints: Addresses; empty if subscribers can't connect directly.
        latched: True if the publisher sends its newest message to later subscribers.
        local: True if the publisher is also bound to the Unix socket that belongs to its loopback
            endpoint.
        number: Number from which the id is derived, as a proof of the id.
        history: Number of messages sent to later subscribers, if more than one.
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


class SubscriberRecord(Struct, frozen=True, gc=False, omit_defaults=True):
    """Registration record of a subscriber.

    Attributes:
        id: Id derived from the node's key and `number` (`is_proven`).
        topic: Name of the topic, or a pattern.
        msg_type: Message type.
        number: Number from which the id is derived, as a proof of the id.
        pattern: True if `topic` is a pattern. See `nep.protocol.topic_pattern`.
    """

    id: int
    topic: str
    msg_type: str
    number: int = 0
    pattern: bool = False


def derive_node_id(key: str) -> str:
    """Return the node id derived from a key: 16 hexadecimal digits."""
    return sha256(key.encode("utf-8", "replace")).hexdigest()[:16]


def derive_id(key: str, number: int) -> int:
    """Return the id of a publisher or subscriber.

    Args:
        key: Key of the node.
        number: Number of the publisher or subscriber in the node, from 1.
    """
    digest = sha256(f"{key}/{number}".encode("utf-8", "replace")).digest()
    return int.from_bytes(digest[:8], "little") >> 1 or 1


def is_proven(node: NodeRecord, record: PublisherRecord | SubscriberRecord | None = None) -> bool:
    """Return True if a node's id is derived from the node's key.

    Args:
        node: Record of the node.
        record: Record of a publisher or subscriber, whose id must also be derived from the key; or
            None.
    """
    if not node.key or derive_node_id(node.key) != node.id:
        return False
    return record is None or (record.number > 0 and derive_id(node.key, record.number) == record.id)


class PublisherCount(Struct, frozen=True, gc=False, omit_defaults=True):
    """Statistics of a publisher or server: totals and the newest message.

    Attributes:
        id: Id of the publisher.
        count: Number of messages; for a server, the number of calls.
        bytes: Total size of the payloads; for a server, of the replies.
        last_seq: Sequence number of the newest message.
        last_stamp_ns: Time stamp of the newest message, in nanoseconds since 1970, or None.
        problem: Reason why payloads can't be encoded, or "".
        errors: Number of calls of a server that were answered with an error.
    """

    id: int
    count: int
    bytes: int
    last_seq: int
    last_stamp_ns: int | None = None
    problem: str = ""
    errors: int = 0


class SubscriberCount(Struct, frozen=True, gc=False, omit_defaults=True):
    """Statistics of a subscriber or client.

    Attributes:
        id: Id of the subscriber.
        received: Number of received messages, or of a client's answered calls; None if unknown.
        lost: Number of lost messages, or of a client's calls without a reply; None if unknown.
        problem: Reason why messages can't be decoded, or "".
    """

    id: int
    received: int | None
    lost: int | None
    problem: str = ""


class RemotePublisher(Struct, frozen=True, gc=False, omit_defaults=True):
    """Publisher and its node, with everything that a subscriber needs to connect.

    Attributes:
        publisher: Record of the publisher.
        node_id: Id of the publisher's node.
        node_name: Name of the publisher's node.
        computer: Id of the node's computer, or "" if unknown. See `NodeRecord`.
    """

    publisher: PublisherRecord
    node_id: str
    node_name: str
    computer: str = ""


class ExpectedSubscriber(Struct, frozen=True, gc=False, omit_defaults=True):
    """Registered subscriber that a new publisher waits for."""

    id: int
    node_id: str
    node_name: str


# ---- requests


class Join(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request to register a node and all its records, replacing its previous registration.

    Attributes:
        node: Record of the node.
        epoch: Epoch of the node's previous master, or 0.
        publishers: Records of the node's publishers.
        subscribers: Records of the node's subscribers.
        managed: True for a program of the original NEP. Such a node has neither a connection nor a
            lease; the gateway reports its end.
    """

    node: NodeRecord
    epoch: int = 0
    publishers: tuple[PublisherRecord, ...] = ()
    subscribers: tuple[SubscriberRecord, ...] = ()
    managed: bool = False


class AddPublisher(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request to register a publisher, and its node if unknown. Reply: `AddedReply`."""

    node: NodeRecord
    publisher: PublisherRecord


class AddSubscriber(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request to register a subscriber, and its node if unknown. Reply: `FoundReply`."""

    node: NodeRecord
    subscriber: SubscriberRecord


class RemovePublisher(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request to unregister a publisher.

    Attributes:
        node_id: Id of the node.
        id: Id of the publisher.
        last_seq: Sequence number of the publisher's last message.
    """

    node_id: str
    id: int
    last_seq: int = 0


class RemoveSubscriber(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request to unregister a subscriber."""

    node_id: str
    id: int


class Leave(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request to unregister a node with all its records."""

    node_id: str


class Renew(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request to renew a lease, with statistics. Reply: `RenewedReply`.

    Attributes:
        node_id: Id of the node.
        epoch: Epoch of the master.
        revision: Revision of the last reply.
        publishers: Statistics of the node's publishers.
        subscribers: Statistics of the node's subscribers.
        cpu_ratio: CPU usage of the node's process since the last renewal (1.0 is one core), or None if
            unknown.
        clock: Nanoseconds to add to a time of the node's clock to get a time of the master's clock, and
            the uncertainty. Empty if not measured yet; None if the node doesn't compare clocks.
    """

    node_id: str
    epoch: int
    revision: int
    publishers: tuple[PublisherCount, ...] = ()
    subscribers: tuple[SubscriberCount, ...] = ()
    cpu_ratio: float | None = None
    clock: tuple[int, ...] | None = None


class ReportMissing(Struct, frozen=True, gc=False, omit_defaults=True):
    """Report of subscribers that did not connect to a new publisher in time.

    Attributes:
        node_id: Id of the publisher's node.
        publisher_id: Id of the publisher.
        subscriber_ids: Ids of the subscribers.
    """

    node_id: str
    publisher_id: int
    subscriber_ids: tuple[int, ...]


class ReportAlerts(Struct, frozen=True, gc=False, omit_defaults=True):
    """Report of all current alerts of an attachment, replacing its previous alerts.

    Only for `Master.submit`; has no wire encoding.

    Attributes:
        source: Name of the attachment.
        alerts: Current alerts.
    """

    source: str
    alerts: tuple[Alert, ...]


class Listen(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request to serve other computers. Reply: `DoneReply`. Rejected if sent from another computer.

    Attributes:
        hosts: Addresses of the master's computer; empty to serve only this computer.
    """

    hosts: tuple[str, ...]


class QueryGraph(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request for the whole graph. Reply: `GraphReply`."""


class Ping(Struct, frozen=True, gc=False, omit_defaults=True):
    """Request to check that a master is running. Reply: `DoneReply`."""


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


class _MasterMessage(Struct, frozen=True, gc=False, omit_defaults=True):
    """Base class of replies and pushes.

    Attributes:
        epoch: Number of the master's run, which changes when the master is restarted.
        revision: Revision of the graph.
    """

    epoch: int
    revision: int


class DoneReply(_MasterMessage, frozen=True):
    """Reply to an executed request that has no result, such as a ping."""


class AddedReply(_MasterMessage, frozen=True):
    """Reply to a registered publisher.

    Attributes:
        expected: Subscribers that the publisher waits for.
        hung: Subscribers whose nodes don't respond at present.
        hosts: Addresses at which the master serves other computers. Publishers on the master's computer
            bind to these addresses, too.
    """

    expected: tuple[ExpectedSubscriber, ...] = ()
    hung: tuple[ExpectedSubscriber, ...] = ()
    hosts: tuple[str, ...] = ()


class FoundReply(_MasterMessage, frozen=True):
    """Reply to a registered subscriber or a joined node.

    Attributes:
        publishers: Publishers to connect to.
        hosts: Addresses at which the master serves other computers.
        pattern: True if the master supports patterns; older masters don't.
    """

    publishers: tuple[RemotePublisher, ...] = ()
    hosts: tuple[str, ...] = ()
    pattern: bool = False


class TopicPublishers(Struct, frozen=True, gc=False, omit_defaults=True):
    """All publishers of one topic."""

    topic: str
    publishers: tuple[RemotePublisher, ...]


class RenewedReply(_MasterMessage, frozen=True):
    """Reply to a renewal.

    Attributes:
        again: True if the node must join again, because its registration at the master is missing or
            different.
        topics: Publishers of topics that changed since the node's revision.
        last_seqs: Newest sequence numbers of the publishers that the node subscribes to, by publisher
            id.
        hosts: Addresses at which the master serves other computers.
        next_s: Time until the next renewal in seconds; longer in large graphs.
        times: Receipt and reply of the renewal by the master's clock (ns since 1970); empty for nodes
            with the same clock.
        clocks: Clock differences by id of a node on another computer whose publishers the receiver
            subscribes to: nanoseconds to add to a time of that node to get a time of the receiver, and
            the uncertainty.
    """

    again: bool = False
    topics: tuple[TopicPublishers, ...] = ()
    last_seqs: Mapping[int, int] = field(default_factory=dict)
    hosts: tuple[str, ...] = ()
    next_s: float = RENEW_INTERVAL_S
    times: tuple[int, ...] = ()
    clocks: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


class GraphReply(_MasterMessage, frozen=True):
    """Reply with the whole graph."""

    view: GraphView


class RejectedReply(_MasterMessage, frozen=True):
    """Reply to a rejected request.

    Attributes:
        reason: Sentence in the master's language.
        code: Error code, independent of the language; docs/wire.md lists the codes. "" from older
            masters.
    """

    reason: str
    code: str = ""


Reply = DoneReply | AddedReply | FoundReply | RenewedReply | GraphReply | RejectedReply


# ---- pushes


class PublisherAdded(_MasterMessage, frozen=True):
    """Notification of a new publisher on a subscribed topic, or of a publisher's new endpoints.

    Attributes:
        publisher: The publisher.
        is_new: True if the publisher was just created and has not sent anything; False if it
            rejoined or moved.
    """

    publisher: RemotePublisher
    is_new: bool = False


class PublisherRemoved(_MasterMessage, frozen=True):
    """Notification that a publisher of a subscribed topic is no longer registered.

    Attributes:
        id: Id of the publisher.
        topic: Name of the topic.
        is_closed: True if the publisher unregistered. False if its node doesn't respond; the
            connection is then retained, because the publisher may only be suspended.
        last_seq: Sequence number of the last message of a closed publisher.
    """

    id: int
    topic: str
    is_closed: bool = False
    last_seq: int = 0


class Probe(_MasterMessage, frozen=True):
    """Test of the connection to a node that missed a renewal. Ignored by the receiver."""


Push = PublisherAdded | PublisherRemoved | Probe


def node_id_of(request: Request) -> str | None:
    """Return the id of the node on whose behalf a request is sent, or None if there is none."""
    if isinstance(request, Join | AddPublisher | AddSubscriber):
        return request.node.id
    if isinstance(request, ReportAlerts | Listen | QueryGraph | Ping):
        return None
    return request.node_id
