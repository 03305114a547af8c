"""The contract of back ends, and choosing one by its name. One contract test runs over all of them.

`nep.backends.memory` is the template. A `Backend` opens one `Transport` for a node; that makes a
`PublisherTransport` for each publisher and a `SubscriberTransport` for each subscriber. All of them may be
used from any thread. Sequence numbers and `count` begin with 1 at the first message published, whether
somebody listens or not.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

from nep.backends.connection import Configuration
from nep.errors import PluginsMissingError, UnknownBackendError
from nep.messages.codecs import Codec, codec_for
from nep.messages.encoded import Encoded
from nep.messages.message import Message
from nep.messages.queue import MAX_BYTES, MAX_MESSAGES, Keep
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import NodeRecord
from nep.system.addresses import master_address
from nep.system.descriptors import check_room
from nep.system.plugins import discover, discover_own

__all__ = [
    "HANDSHAKE_S",
    "Backend",
    "GivesPayloads",
    "PublisherSpec",
    "PublisherTransport",
    "PublishesQuickly",
    "QuickPublish",
    "Sink",
    "SubscriberSpec",
    "SubscriberTransport",
    "Transport",
    "Wakes",
    "backend_named",
]

HANDSHAKE_S = 0.5
"""How long a new publisher or subscriber waits for the other side, at most."""

Sink = Callable[[Sequence[Message]], None]
"""Takes messages in batches, in a thread of the transport's sinks; it returns soon and does not raise."""


@dataclass(frozen=True)
class PublisherSpec:
    """What a publisher shall be. `wait_s`: how long to wait for a master, None without limit.

    `number` proves the id: see `nep.protocol.requests.is_proven`. `may_batch`: a back end may send messages
    that follow each other within microseconds together. `qos`: one of the back end's words, or "".
    `history`: so many messages are kept for subscribers that come late; 1 when it is only latched, else 0.
    """

    id: int
    topic: str
    msg_type: str
    codec: Codec
    is_latched: bool
    configuration: Configuration
    wait_s: float | None
    number: int = 0
    may_batch: bool = True
    qos: str = ""
    history: int = 0


@dataclass(frozen=True)
class SubscriberSpec:
    """What a subscriber shall be. With a `sink` nothing is kept for `SubscriberTransport.poll`.

    `number` proves the id. `qos`: one of the back end's words, or "". With `is_pattern` it hears all topics
    that match its own, as `nep.protocol.topic_pattern` has it.
    """

    id: int
    topic: str
    msg_type: str
    configuration: Configuration
    wait_s: float | None
    keep: Keep = "all"
    max_messages: int = MAX_MESSAGES
    max_bytes: int = MAX_BYTES
    sink: Sink | None = None
    number: int = 0
    qos: str = ""
    is_pattern: bool = False


class Wakes(Protocol):
    """Somebody who waits: a `nep.system.wakeup.Waker`, or what acts as one."""

    def wake(self) -> None:
        """There may be something to do. From any thread, also under locks; does not wait."""


class QuickPublish(NamedTuple):
    """What is asked of a transport that `PublishesQuickly`.

    Payloads of the type `kind` are bytes that are sent as they are, and `ordinary` makes the bytes of others;
    what it raises for, and all that is published while `owner` is closed or nobody listens, is given to
    `slowly`; so is what is published with ``strict=True``. `look` is called first with a payload whose bytes
    have `null` in them, unless it is None.
    """

    owner: Closes
    kind: type | None
    ordinary: Callable[[Any], bytes]
    look: Callable[[Any], object] | None
    slowly: Callable[..., object]


class Closes(Protocol):
    """Somebody who may be closed."""

    is_closed: bool


@runtime_checkable
class PublishesQuickly(Protocol):
    """What a `PublisherTransport` may have besides."""

    def quick_publish(self, asked: QuickPublish) -> Callable[..., None]:
        """A function that publishes, with as few calls on the way as can be. It never blocks."""


class PublisherTransport(Protocol):
    """What a publisher sends through."""

    @property
    def subscribers(self) -> int:
        """How many subscribers are connected now."""

    @property
    def is_heard(self) -> bool:
        """Whether anybody gets what is sent, also those that are not counted in `subscribers`."""

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of nodes whose subscribers are registered and have not connected."""

    @property
    def count(self) -> int:
        """Messages published so far."""

    def skip(self) -> None:
        """Count a message that nobody wants."""

    def report(self, problem: str) -> None:
        """The publisher cannot send what it is given, and why; an empty sentence means that it can again."""

    def lend(self, size_bytes: int) -> memoryview | None:
        """Memory that all who listen share, to write a payload into before it is sent; None without such."""

    def send(self, encoded: Encoded) -> None:
        """Publish. Never blocks: what a subscriber cannot take is lost to it, and it counts that."""

    def close(self, timeout_s: float) -> None:
        """Unregister, and deliver what is on its way within `timeout_s`; what was not is logged."""


@runtime_checkable
class KnowsSubscribers(Protocol):
    """What a `PublisherTransport` may have besides: which subscribers of the graph are connected."""

    @property
    def subscriber_ids(self) -> frozenset[int]:
        """Ids of the subscribers that are connected now."""


@runtime_checkable
class GivesPayloads(Protocol):
    """What a `SubscriberTransport` may have besides: payloads without messages, for who wants no more.

    Whoever takes from `ready` lets `restore` be called before, while there are any.
    """

    payloads: deque[Any]
    """Payloads of messages that come before those in `ready`; to be taken from the left, in any thread."""
    wants_payloads: bool
    """Whether the next ones shall come here as far as that saves anything. Whoever reads says so."""

    def restore(self) -> None:
        """Make messages of the payloads that were not taken: they are the next ones in `ready`."""


class SubscriberTransport(Protocol):
    """What a subscriber receives through."""

    ready: deque[Message]
    """Messages that come next and were read already; whoever reads may take them from its left. May be empty
    while others wait elsewhere."""

    @property
    def fd(self) -> int:
        """What tells of messages between `enter_wait` and `leave_wait` when it can be read; -1: nothing."""

    def enter_wait(self, waker: Wakes) -> bool:
        """Before waiting: False when there is something to read already, or it is closed.

        Else `waker` is woken by what does not show at `fd`, also by closing, until `leave_wait`. Who is woken
        leaves soon: meanwhile it may be that nobody takes messages from the network.
        """

    def leave_wait(self, waker: Wakes) -> None:
        """After waiting."""

    @property
    def received(self) -> int:
        """Messages that arrived."""

    @property
    def lost(self) -> int | None:
        """Messages that did not arrive or were dropped here for lack of room; None when nobody can know."""

    @property
    def refused(self) -> int:
        """What came and was no message at all."""

    @property
    def is_closed(self) -> bool:
        """Whether it was closed, or its transport was."""

    def poll(self) -> Message | None:
        """The next message if one is there. Does not wait."""

    def receive(self, timeout_s: float) -> Message | None:
        """The next message; waits at most `timeout_s` seconds, may return None earlier."""

    def report(self, problem: str) -> None:
        """The reader could not read a message, and why; an empty sentence means that it can again."""

    def close(self) -> None:
        """Unregister and forget what was not read."""

    def forked(self) -> None:
        """In a child that was forked: be closed and empty, without taking a lock or touching a socket."""


class Transport(Protocol):
    """One node's way to the others."""

    def publisher(self, spec: PublisherSpec) -> PublisherTransport:
        """A new publisher: the first message reaches every subscriber that was there before.

        Raises `MasterUnreachable`, `AddressInUseError`, `RequestRefusedError`.
        """

    def subscriber(self, spec: SubscriberSpec) -> SubscriberTransport:
        """A new subscriber: what is published after this arrives. Raises as `publisher` does."""

    def wait(self, subscribers: Sequence[SubscriberTransport], timeout_s: float) -> None:
        """Wait until one of `subscribers` may have a message or `wake` is called, `timeout_s` at most.

        One that has services (`nep.backends.services`) takes a third argument: the queues of calls to wait
        for, too.
        """

    def wake(self) -> None:
        """End all waits that are under way."""

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:
        """Who is there. Raises `MasterUnreachable`."""

    def begin_close(self) -> None:
        """Nothing is sent any more; say so, and wait for nothing. `close` follows, at once or later."""

    def close(self, timeout_s: float) -> None:
        """Close all publishers and subscribers, unregister, end the thread."""


@dataclass(frozen=True)
class Backend:
    """A plug-in that carries bytes. `open` raises `BackendUnavailableError` when `needs` is not installed.

    `master` makes a `Hybrid.master` of what a node is given as `master`, None when that is nothing; it raises
    `NepError` for what is no place where nodes of this back end meet. `codec_for` gives the codec of a
    publisher's message type, `codec_of_calls` that of a client's calls, for a back end that has types of its
    own. `qos`: its words for qualities of
    service. `has_history`: its publishers keep more than the last message for subscribers that come late.
    `has_patterns`: its subscribers take topics with wildcards.
    `has_extensions`: what travels beside a payload arrives. `is_in_process`: only nodes of one process meet.
    """

    name: str
    open: Callable[[NodeRecord], Transport]
    needs: str = ""
    aliases: tuple[str, ...] = ()
    master: Callable[[str | None], str] = master_address
    codec_for: Callable[[str], Codec] = codec_for
    codec_of_calls: Callable[[str], Codec] | None = None
    qos: tuple[str, ...] = ()
    has_history: bool = False
    has_patterns: bool = False
    has_extensions: bool = True
    is_in_process: bool = False


def backend_named(name: str) -> Backend:
    """The back end of this name, or of which it is an alias.

    Entry points are looked for only when it is none of ours: a node is made in less than a millisecond.
    Raises `UnknownBackendError`, `TooManyFilesError`.
    """
    try:
        own = discover_own("nep.backends", "BACKEND", Backend)
    except PluginsMissingError:
        check_room(1, "a node")  # without a file to open a folder seems to be empty
        raise
    backend = _named(name.lower(), own.values())
    if backend is None:
        known = discover("nep.backends", "BACKEND", Backend)
        backend = _named(name.lower(), known.values())
        if backend is None:
            raise UnknownBackendError(name, sorted(known))
    return backend


def _named(name: str, backends: Iterable[Backend]) -> Backend | None:
    return next((each for each in backends if name in {each.name, *each.aliases}), None)
