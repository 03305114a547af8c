"""The parts of requests: nodes, publishers and subscribers as they present themselves; statistics."""

from __future__ import annotations

from dataclasses import dataclass, field

COUNT_MAX = 2**63 - 1
"""Counters stop here: every language and every encoding has room for it."""


def as_count(value: int) -> int:
    """A number that somebody told as a counter: 0 to `COUNT_MAX`, whatever it was."""
    return value if 0 <= value <= COUNT_MAX else 0 if value < 0 else COUNT_MAX


@dataclass(frozen=True)
class NodeRecord:
    """A node as it presents itself. `since_ns` is its own clock when it was made.

    `key` is known to the node and its masters only and proves its id: see `nep.protocol.registration`.
    """

    id: str
    name: str
    host: str
    pid: int | None
    language: str = "Python"
    generation: str = "native"
    since_ns: int = 0
    key: str = field(default="", repr=False)


@dataclass(frozen=True)
class PublisherRecord:
    """A publisher as its node presents it. `endpoints` is empty when nobody can connect to it directly.

    `local` says that it is bound to the name of this computer that goes with its loopback endpoint, too.
    `number` proves its id: see `nep.protocol.registration`.
    """

    id: int
    topic: str
    msg_type: str
    codec: str
    endpoints: tuple[str, ...] = ()
    latched: bool = False
    local: bool = False
    number: int = 0


@dataclass(frozen=True)
class SubscriberRecord:
    """A subscriber as its node presents it. `number` proves its id: see `nep.protocol.registration`."""

    id: int
    topic: str
    msg_type: str
    number: int = 0


@dataclass(frozen=True)
class PublisherCount:
    """A publisher's statistics: all messages and bytes so far, and the newest message.

    `problem` is a sentence about payloads that cannot be sent, or empty.
    """

    id: int
    count: int
    bytes: int
    last_seq: int
    last_stamp_ns: int | None = None
    problem: str = ""


@dataclass(frozen=True)
class SubscriberCount:
    """A subscriber's statistics. `problem` is a sentence about messages that it could not read, or empty."""

    id: int
    received: int | None
    lost: int | None
    problem: str = ""


@dataclass(frozen=True)
class RemotePublisher:
    """A publisher with the node that it belongs to: what a subscriber needs to connect."""

    publisher: PublisherRecord
    node_id: str
    node_name: str


@dataclass(frozen=True)
class Expected:
    """A subscriber that a new publisher waits for."""

    id: int
    node_id: str
    node_name: str
