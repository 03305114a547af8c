"""Interface of back ends, and their lookup by name.

A `Backend` opens one `Transport` per node. The transport creates a `PublisherTransport` for each publisher
and a `SubscriberTransport` for each subscriber. All of them are thread-safe. Sequence numbers and `count`
start at 1 with the first published message, with or without subscribers.

`nep.backends.memory` is the reference implementation. One contract test runs against all back ends.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from nep.backends.connection import Configuration
from nep.errors import PluginsMissingError, UnknownBackendError
from nep.messages.codecs import Codec, codec_for
from nep.messages.encoded import Encoded
from nep.messages.message import Message
from nep.messages.queue import MAX_BYTES, MAX_MESSAGES, QueuePolicy
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import NodeRecord
from nep.system.addresses import master_address
from nep.system.descriptors import check_free_descriptors
from nep.system.plugins import discover, discover_own, find_own

HANDSHAKE_TIMEOUT_S = 0.5
"""Maximum time in seconds that a new publisher or subscriber waits for the handshake with its peers."""

Sink = Callable[[Sequence[Message]], None]
"""Callback for batches of messages, called in the transport's sink thread. Must return soon and not raise."""


@dataclass(frozen=True)
class PublisherSpec:
    """Settings of a new publisher.

    Attributes:
        id: Random id of the publisher.
        topic: Name of the topic.
        msg_type: Message type as registered at the master.
        codec: Encoder of the payloads.
        is_latched: True to deliver the newest message to late subscribers.
        configuration: Connection through a master or to a fixed address.
        wait_s: Seconds to wait for the master; None waits forever.
        number: Secret that proves ownership of the id, see `nep.protocol.requests.is_proven`.
        may_batch: True if messages published within microseconds of each other may be sent in one batch.
        qos: Name of a QoS profile of the back end; "" selects the default.
        history: Number of messages stored for late subscribers: 1 if only latched, 0 for none.
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
    """Settings of a new subscriber.

    Attributes:
        id: Random id of the subscriber.
        topic: Name of the topic, or a pattern.
        msg_type: Expected message type.
        configuration: Connection through a master or to a fixed address.
        wait_s: Seconds to wait for the master; None waits forever.
        keep: Queue policy: "all" for all messages, "latest" for only the newest.
        max_messages: Queue bound in messages.
        max_bytes: Queue bound in bytes.
        sink: Callback that receives the messages; `SubscriberTransport.poll` then returns nothing.
        number: Secret that proves ownership of the id, see `nep.protocol.requests.is_proven`.
        qos: Name of a QoS profile of the back end; "" selects the default.
        is_pattern: True to subscribe to all topics that match `topic`, see `nep.protocol.topic_pattern`.
    """

    id: int
    topic: str
    msg_type: str
    configuration: Configuration
    wait_s: float | None
    keep: QueuePolicy = "all"
    max_messages: int = MAX_MESSAGES
    max_bytes: int = MAX_BYTES
    sink: Sink | None = None
    number: int = 0
    qos: str = ""
    is_pattern: bool = False


class Wakeable(Protocol):
    """Object that can be woken, such as a `nep.system.wakeup.Waker`."""

    def wake(self) -> None:
        """Wake the waiting thread. Thread-safe and non-blocking, even while the caller holds locks."""


@runtime_checkable
class SupportsSendBytes(Protocol):
    """Optional interface of a `PublisherTransport`: a fast path for payloads without an extension."""

    is_closed: bool
    """True after the publisher was closed."""
    has_subscribers: bool
    """True if any subscriber is connected."""
    problem: str
    """Reason why the newest payload was rejected; "" if it was encoded."""

    def send_bytes(self, data: bytes) -> None:
        """Send an encoded payload to all subscribers. Never blocks."""


class PublisherTransport(Protocol):
    """Sending end of a publisher."""

    @property
    def subscribers(self) -> int:
        """Number of connected subscribers."""

    @property
    def has_subscribers(self) -> bool:
        """True if any subscriber is connected, including those that `subscribers` can't count."""

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of nodes whose subscribers are registered but not connected."""

    @property
    def count(self) -> int:
        """Number of messages published so far."""

    def skip(self) -> None:
        """Count a message that is not sent because the topic has no subscribers."""

    def report(self, problem: str) -> None:
        """Report the reason why payloads can't be encoded, as an alert in the graph; "" clears the alert."""

    def borrow_memory(self, size_bytes: int) -> memoryview | None:
        """Return writable shared memory for a payload; None if no subscriber shares memory."""

    def send(self, encoded: Encoded) -> None:
        """Send an encoded message to all subscribers. Never blocks: full queues drop the message."""

    def close(self, timeout_s: float) -> None:
        """Unregister and flush for up to `timeout_s` seconds; log a warning if messages aren't delivered."""


@runtime_checkable
class SupportsSubscriberIds(Protocol):
    """Optional interface of a `PublisherTransport` that can identify its subscribers."""

    @property
    def subscriber_ids(self) -> frozenset[int]:
        """Ids of the connected subscribers, the same as in the graph."""


class SubscriberTransport(Protocol):
    """Receiving end of a subscriber."""

    ready: deque[Message]
    """Messages that can be taken without calling `poll`. Pop from the left, in any thread.

    May be empty while more messages are queued; `poll` returns those.
    """

    @property
    def fd(self) -> int:
        """File descriptor that becomes readable when a message arrives during a wait; -1 if there is none.

        A wait begins with `enter_wait` and ends with `leave_wait`. Without a descriptor, only the waker
        reports new messages.
        """

    def enter_wait(self, waker: Wakeable) -> bool:
        """Prepare to wait; return False if input is available or the subscriber is closed.

        Until `leave_wait`, events that `fd` doesn't signal wake `waker`; `close` is one of them. Call
        `leave_wait` soon after waking, because messages may not be read from the network until then.
        """

    def leave_wait(self, waker: Wakeable) -> None:
        """End the wait that `enter_wait` prepared."""

    @property
    def received(self) -> int:
        """Number of messages received."""

    @property
    def lost(self) -> int | None:
        """Number of messages lost in transit or dropped from a full queue; None if unknown."""

    @property
    def refused(self) -> int:
        """Number of received frames that were rejected because they are not valid messages."""

    @property
    def is_closed(self) -> bool:
        """True after `close`, or after the transport was closed."""

    def poll(self) -> Message | None:
        """Return the next message, or None if none is available. Never waits."""

    def receive(self, timeout_s: float) -> Message | None:
        """Wait up to `timeout_s` seconds for the next message and return it; may return None earlier."""

    def report(self, problem: str) -> None:
        """Report the reason why messages can't be decoded, as an alert in the graph; "" clears the alert."""

    def close(self) -> None:
        """Unregister the subscriber and discard its unread messages."""


class Transport(Protocol):
    """Connection of one node to the other nodes."""

    def create_publisher(self, spec: PublisherSpec) -> PublisherTransport:
        """Create a publisher, whose first message reaches every subscriber that is already registered.

        Raises:
            MasterUnreachable: No master replied within `PublisherSpec.wait_s`.
            AddressInUseError: The address can't be bound.
            RequestRefusedError: The master rejected the registration.
        """

    def create_subscriber(self, spec: SubscriberSpec) -> SubscriberTransport:
        """Create a subscriber, which receives all messages published after this call returns.

        Raises the same errors as `create_publisher`.
        """

    def wait(self, subscribers: Sequence[SubscriberTransport], timeout_s: float) -> None:
        """Wait until one of `subscribers` may have a message, `wake` is called or the timeout expires.

        Transports with services (`nep.backends.services`) accept a third argument: call queues to wait for.

        Args:
            subscribers: Subscribers to wait for.
            timeout_s: Maximum time to wait in seconds.
        """

    def wake(self) -> None:
        """End all waits in progress."""

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:
        """Return the current graph. Raises `MasterUnreachable` after `timeout_s` seconds without a reply."""

    def begin_close(self) -> None:
        """Notify all peers that the node is closing, and stop sending. Doesn't wait; `close` must follow."""

    def close(self, timeout_s: float) -> None:
        """Close all publishers and subscribers, unregister the node and join the threads."""


@dataclass(frozen=True)
class Backend:
    """Back-end plug-in.

    Attributes:
        name: Name that `Node` accepts.
        open: Opens the transport of a node. Raises `BackendUnavailableError` if `needs` is not installed.
        needs: Package to install, or "".
        aliases: Other names that `Node` accepts.
        master: Converts a node's `master` argument (None for the default) to `Hybrid.master`. Raises
            `NepError` for an invalid address.
        codec_for: Returns the codec for a publisher's message type.
        call_codec_for: Returns the codec for a client's calls. Only for back ends with typed services.
        qos: Names of the QoS profiles.
        has_history: True if publishers can store more than the newest message for late subscribers.
        has_patterns: True if subscribers accept topics with wildcards.
        has_extensions: True if extensions of messages are transferred.
        is_in_process: True if only nodes of the same process can connect.
    """

    name: str
    open: Callable[[NodeRecord], Transport]
    needs: str = ""
    aliases: tuple[str, ...] = ()
    master: Callable[[str | None], str] = master_address
    codec_for: Callable[[str], Codec] = codec_for
    call_codec_for: Callable[[str], Codec] | None = None
    qos: tuple[str, ...] = ()
    has_history: bool = False
    has_patterns: bool = False
    has_extensions: bool = True
    is_in_process: bool = False


def find_backend(name: str) -> Backend:
    """Return the back end with this name or alias.

    Third-party entry points are searched only if no built-in back end matches, because the search takes
    longer than the millisecond in which a node is created.

    Raises:
        UnknownBackendError: No back end has this name.
        TooManyFilesError: The process is out of file descriptors.
    """
    try:
        found = find_own("nep.backends", name.lower(), "BACKEND", Backend)
        if found is not None:  # without importing the others, which takes longer than the rest of nep
            return found
        own_backends = discover_own("nep.backends", "BACKEND", Backend)
    except (PluginsMissingError, OSError):
        check_free_descriptors(1, "a node")  # without a free descriptor, no file can be found or opened
        raise
    backend = _find_by_name(name.lower(), own_backends.values())
    if backend is None:
        backends = discover("nep.backends", "BACKEND", Backend)
        backend = _find_by_name(name.lower(), backends.values())
        if backend is None:
            raise UnknownBackendError(name, sorted(backends))
    return backend


def _find_by_name(name: str, backends: Iterable[Backend]) -> Backend | None:
    return next((each for each in backends if name in {each.name, *each.aliases}), None)
