"""What nodes and the master say to each other, as values. Their form on the wire: `nep.protocol.encoding`.

Every reply and push carries the master's `epoch`, which changes when the master is restarted, and the graph's
`revision`.

A node has a *key*, which only it and its masters know, and its id comes from the key: nobody else can
register that id, whether the node is there, is unlisted or comes back to a master that was started again.
Ids of publishers and subscribers come from the key and a number. See docs/adr/0014-who-speaks-for-a-node.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256

from nep.protocol.graph_view import Alert, GraphView

COUNT_MAX = 2**63 - 1
"""Counters stop here: every language and every encoding has room for it."""

RENEW_S = 1.0
"""How often a node renews, unless the master says otherwise."""


def as_count(value: int) -> int:
    """A number that somebody told as a counter: 0 to `COUNT_MAX`, whatever it was."""
    return value if 0 <= value <= COUNT_MAX else 0 if value < 0 else COUNT_MAX


@dataclass(frozen=True)
class NodeRecord:
    """A node as it presents itself. `since_ns` is its own clock when it was made.

    `key` is known to the node and its masters only and proves its id: see `is_proven`. Nodes with the same
    `computer` read the same clock; "" if that is not known.
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
    """A publisher as its node presents it. `endpoints` is empty when nobody can connect to it directly.

    `local` says that it is bound to the name of this computer that goes with its loopback endpoint, too.
    `number` proves its id: see `is_proven`. `history`: so many messages it keeps for subscribers that come
    late, when these may be more than the last one.
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
    """A subscriber as its node presents it. `number` proves its id: see `is_proven`.

    With `pattern` it hears all topics that match its own: see `nep.protocol.topic_pattern`.
    """

    id: int
    topic: str
    msg_type: str
    number: int = 0
    pattern: bool = False


def node_id_from(key: str) -> str:
    """The id of the node that has this key: 16 hexadecimal digits."""
    return sha256(key.encode("utf-8", "replace")).hexdigest()[:16]


def id_from(key: str, number: int) -> int:
    """The id of the publisher or subscriber with this number (from 1) of the node that has this key."""
    digest = sha256(f"{key}/{number}".encode("utf-8", "replace")).digest()
    return int.from_bytes(digest[:8], "little") >> 1 or 1


def is_proven(node: NodeRecord, record: PublisherRecord | SubscriberRecord | None = None) -> bool:
    """Whether the node's id comes from its key; with a record, whether that one's id does, too."""
    if not node.key or node_id_from(node.key) != node.id:
        return False
    return record is None or (record.number > 0 and id_from(node.key, record.number) == record.id)


@dataclass(frozen=True)
class PublisherCount:
    """A publisher's statistics: all messages and bytes so far, and the newest message.

    `problem` is a sentence about payloads that cannot be sent, or empty. A server counts its calls and the
    bytes of its answers, and those calls that ended with `errors`.
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
    """A subscriber's statistics. `problem` is a sentence about messages that it could not read, or empty."""

    id: int
    received: int | None
    lost: int | None
    problem: str = ""


@dataclass(frozen=True)
class RemotePublisher:
    """A publisher with the node that it belongs to: what a subscriber needs to connect.

    `computer` is the node's: see `NodeRecord`.
    """

    publisher: PublisherRecord
    node_id: str
    node_name: str
    computer: str = ""


@dataclass(frozen=True)
class Expected:
    """A subscriber that a new publisher waits for."""

    id: int
    node_id: str
    node_name: str


# ---- requests


@dataclass(frozen=True)
class Join:
    """Register a node with all that it has, replacing what the master knew of it.

    `epoch` is that of the master the node was registered with before, 0 if there was none. A `managed` node
    (an original program) has no connection of its own and no lease: who registered it says when it leaves.
    """

    node: NodeRecord
    epoch: int = 0
    publishers: tuple[PublisherRecord, ...] = ()
    subscribers: tuple[SubscriberRecord, ...] = ()
    managed: bool = False


@dataclass(frozen=True)
class AddPublisher:
    """Register one publisher (and its node, if the master does not know it). Answered by `Added`."""

    node: NodeRecord
    publisher: PublisherRecord


@dataclass(frozen=True)
class AddSubscriber:
    """Register one subscriber (and its node, if the master does not know it). Answered by `Found`."""

    node: NodeRecord
    subscriber: SubscriberRecord


@dataclass(frozen=True)
class RemovePublisher:
    """A publisher closes; its last message was `last_seq`."""

    node_id: str
    id: int
    last_seq: int = 0


@dataclass(frozen=True)
class RemoveSubscriber:
    """A subscriber closes."""

    node_id: str
    id: int


@dataclass(frozen=True)
class Leave:
    """A node closes, with all that it has."""

    node_id: str


@dataclass(frozen=True)
class Renew:
    """A node lives; its statistics. `revision` is the one of the last `Renewed` or `Joined` that it got.

    `cpu_ratio`: the share of one core that its program used since the last renewal; None if it is not known.
    `clock`: what to add to its clock for the master's and how surely (ns), empty as long as it does not know;
    None from nodes that do not compare clocks.
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
    """These subscribers did not answer a new publisher in time."""

    node_id: str
    publisher_id: int
    subscriber_ids: tuple[int, ...]


@dataclass(frozen=True)
class ReportAlerts:
    """All alerts of something attached to the master (`source`) that are present now; earlier ones are cured.

    Only for `Master.submit`: it has no form on the wire.
    """

    source: str
    alerts: tuple[Alert, ...]


@dataclass(frozen=True)
class Listen:
    """Serve other computers at these addresses of this one; none: serve this computer only.

    Answered by `Done`. Refused when it comes from another computer.
    """

    hosts: tuple[str, ...]


@dataclass(frozen=True)
class Look:
    """Ask for the whole graph. Answered by `Seen`."""


@dataclass(frozen=True)
class Ping:
    """Ask whether a master is there. Answered by `Done`."""


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
    """A reply or push: `epoch` is another one after the master was started again, `revision` its graph's."""

    epoch: int
    revision: int


@dataclass(frozen=True)
class Done(_FromMaster):
    """It is done; also the answer to a ping."""


@dataclass(frozen=True)
class Added(_FromMaster):
    """A publisher is registered. It waits for `expected`; `hung` are known not to answer at present.

    `hosts` (here and below) are the addresses at which the master serves other computers: publishers on the
    master's own computer serve there, too.
    """

    expected: tuple[Expected, ...] = ()
    hung: tuple[Expected, ...] = ()
    hosts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Found(_FromMaster):
    """A subscriber is registered, or a node has joined: the publishers to connect to.

    `pattern`: the master knows that the subscriber hears all topics that match; an older one does not.
    """

    publishers: tuple[RemotePublisher, ...] = ()
    hosts: tuple[str, ...] = ()
    pattern: bool = False


@dataclass(frozen=True)
class TopicPublishers:
    """All publishers of one topic, now."""

    topic: str
    publishers: tuple[RemotePublisher, ...]


@dataclass(frozen=True)
class Renewed(_FromMaster):
    """A lease is renewed. `again`: the master does not know this node as it is, it shall join again.

    `topics` are those of the node's subscribers that changed since its revision; `last_seqs` are the newest
    messages of the publishers it subscribes to, as of their last renewal. The next renewal is due in `next_s`
    seconds: the master lets the nodes of a large graph renew less often.

    `times` are when the renewal was received and answered, by the master's clock (ns since 1970); nothing
    for nodes with the same clock. `clocks`: by the id of a node on another computer that the node hears,
    what to add to its times for the node's own clock, and how surely that is known (ns).
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
    """Refusal of a request; `reason` is a sentence in the master's language.

    `code` is language-independent: see the table of codes in docs/wire.md. Empty from older masters.
    """

    reason: str
    code: str = ""


Reply = Done | Added | Found | Renewed | Seen | Refused


# ---- pushes


@dataclass(frozen=True)
class PublisherCame(_FromMaster):
    """A topic that the node subscribes to has one more publisher, or one with other endpoints.

    `is_new`: it has just been created, so it has sent nothing before; it did not rejoin or move.
    """

    publisher: RemotePublisher
    is_new: bool = False


@dataclass(frozen=True)
class PublisherGone(_FromMaster):
    """A publisher of such a topic is no longer listed.

    `is_closed`: it said so itself, and `last_seq` was its last message; else its node is silent or dead, and
    the connection stays, because the publisher may only be suspended.
    """

    id: int
    topic: str
    is_closed: bool = False
    last_seq: int = 0


@dataclass(frozen=True)
class Probe(_FromMaster):
    """Sent to a node that has been silent, to find out whether its connection is still there. Ignored."""


Push = PublisherCame | PublisherGone | Probe


def node_of(request: Request) -> str | None:
    """The id of the node that a request speaks for; None when it speaks for nobody."""
    if isinstance(request, Join | AddPublisher | AddSubscriber):
        return request.node.id
    if isinstance(request, ReportAlerts | Listen | Look | Ping):
        return None
    return request.node_id
