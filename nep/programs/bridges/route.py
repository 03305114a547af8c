"""`Route`: forwarding of one topic in one direction, with counts of the outcomes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

from nep.backends.base import Backend
from nep.errors import ClosedError, EncodeError, NepError
from nep.messages.encoded import Encoded
from nep.messages.message import Message
from nep.messages.queue import Inbox
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher
from nep.nodes.subscriber import Subscriber
from nep.programs.bridges.configuration import SideName
from nep.programs.bridges.pacer import Pacer, RateLimit
from nep.programs.bridges.topic_types import TopicFormat, default_type, published_type, type_for
from nep.programs.bridges.trail import TRAIL_KEY, LoopGuard, Trail, read_trail
from nep.programs.robots.guard import MotionGuard
from nep.protocol.graph_view import GraphView
from nep.text import escaped, shortened

MAX_BACKLOG_MESSAGES = 10_000
"""Maximum number of messages buffered for the other side, with at most 64 MB in total.

When a limit is exceeded, the oldest messages are dropped and counted.
"""
_MAX_BACKLOG_BYTES = 64 * 2**20
_MAX_LATCHED_PUBLISHERS = 256
"""Maximum number of a topic's publishers whose latched messages are forwarded by separate publishers."""
_PUBLISHER_EXPIRY_S = 10.0
"""Time in seconds without an entry in the graph after which a publisher counts as closed.

All publishers register again at a restarted master in less time.
"""
_MAX_PROBLEM_LENGTH = 300


@dataclass(frozen=True)
class RouteEnd:
    """End of a route: a topic on one side.

    Attributes:
        side: Name of the side.
        network: Id of the side's network.
        backend: Back end of the side.
        topic: Name of the topic on the side.
        msg_type: Message type; "" to detect the type.
        qos: Name of a QoS profile; "" for the default.
        loop_guard: Loop guard of the topic for networks that don't identify publishers.
        guard: Motion guard of the side; None to publish every message.
    """

    side: SideName
    network: str
    backend: Backend
    topic: str
    msg_type: str = ""
    qos: str = ""
    loop_guard: LoopGuard = field(default_factory=LoopGuard)
    guard: MotionGuard | None = field(default=None, compare=False)


@dataclass(frozen=True)
class RouteCounts:
    """Outcomes of a route's messages.

    `received` is the sum of `sent`, `thinned`, `failed`, `dropped` and `waiting`.

    Attributes:
        received: Number of messages received from the origin.
        sent: Number of messages published at the end.
        bytes: Total size of the sent messages.
        lost: Number of messages that did not reach the bridge, not included in `received`; None if unknown.
        thinned: Number of messages replaced with a newer one because of `max_rate_hz`.
        failed: Number of messages that could not be decoded, converted or published; see `problem`.
        dropped: Number of messages discarded because the other side was unavailable and the buffer was
            full.
        waiting: Number of messages in the buffer.
        returned: Number of messages ignored because a bridge has, or may have, forwarded them from the
            destination; not included in `received`.
        problem: Reason for the last failure; "" if there was none.
    """

    received: int = 0
    sent: int = 0
    bytes: int = 0
    lost: int | None = 0
    thinned: int = 0
    failed: int = 0
    dropped: int = 0
    waiting: int = 0
    returned: int = 0
    problem: str = ""


class _BufferedSink:
    """Sink of a subscriber that buffers messages until `open` is called, and then forwards them."""

    def __init__(self, on_messages: Callable[[Sequence[Message]], None], *, is_open: bool) -> None:
        self.is_open = is_open
        self.is_muted = False
        self._on_messages = on_messages
        self._buffered_messages: list[Message] = []
        self._lock = threading.Lock()

    def receive(self, messages: Sequence[Message]) -> None:
        with self._lock:
            if self.is_muted:
                return
            if not self.is_open:
                self._buffered_messages.extend(messages)
                return
        self._on_messages(messages)

    def open(self) -> None:
        with self._lock:
            self._on_messages(self._buffered_messages)
            self._buffered_messages = []
            self.is_open = True

    def mute(self) -> None:
        self.is_muted = True


class Route:
    """Route that forwards messages from `origin` to `end`.

    Messages are received in threads of the origin's node. The threads of the sides call `subscribe` and
    `open_publishers`.

    Args:
        origin: Topic from which messages are received.
        end: Topic on which messages are published.
        bridge: Id of the bridge.
        own_publishers: Ids of all publishers of the bridge.
        wake: Called when `open_publishers` needs to be called.
        pacer: Timer for messages that the rate limit delays.
        max_rate_hz: Maximum number of messages per second; 0 for no limit.
        clock: Monotonic clock in seconds.
    """

    def __init__(
        self,
        origin: RouteEnd,
        end: RouteEnd,
        *,
        bridge: str,
        own_publishers: set[int],
        wake: Callable[[], None],
        pacer: Pacer,
        max_rate_hz: float = 0.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.origin = origin
        self.end = end
        self.is_from_pattern = False
        """True if the route was created by a pattern."""
        self.idle_since: float | None = None
        """Time (monotonic, s) since which the topic has no publisher except bridges; None if it has one."""
        self.connection_problems: dict[SideName, str] = {}
        """Current reasons why the route can't subscribe or publish, by side."""
        self.rival = ""
        """Name of another bridge that forwards the topic in the opposite direction; "" if there is none.

        While there is one, this route is inactive, because messages would loop.
        """
        self._bridge = bridge
        self._own_publisher_ids = own_publishers
        self._wake = wake
        self._clock = clock
        self._pacer = pacer
        self._subscriber_counts: dict[Publisher, int] = {}
        self._rate_limit = RateLimit(max_rate_hz) if max_rate_hz else None
        self._pending: Message | None = None
        self._lock = threading.RLock()
        self._backlog = Inbox("all", MAX_BACKLOG_MESSAGES, _MAX_BACKLOG_BYTES)
        self._subscriber: Subscriber | None = None
        self._sink: _BufferedSink | None = None
        self._is_waiting_for_type = False
        self._is_closed = False
        self._previously_lost: int | None = 0
        self._publishers: dict[tuple[bool, int | None], Publisher] = {}
        self._absent_since: dict[tuple[bool, int | None], float] = {}
        self._format: TopicFormat | None = None
        self._supports_extension = end.backend.has_extensions
        self._received = self._sent = self._bytes = 0
        self._thinned = self._failed = self._dropped = self._returned = 0
        self._problem = ""

    def counts(self) -> RouteCounts:
        """Return the counts of the messages so far, by outcome."""
        lost = self._lost_count()  # outside of our lock: the back end may take its own
        with self._lock:
            return RouteCounts(
                self._received,
                self._sent,
                self._bytes,
                lost,
                self._thinned,
                self._failed,
                self._dropped,
                len(self._backlog) + (self._pending is not None),
                self._returned,
                self._problem,
            )

    def _lost_count(self) -> int | None:
        lost = 0 if self._subscriber is None else self._subscriber.lost
        return None if lost is None or self._previously_lost is None else lost + self._previously_lost

    @property
    def connection_problem(self) -> str:
        """Current reason why the route can't subscribe or publish; "" if it can."""
        return next(iter(self.connection_problems.copy().values()), "")

    @property
    def is_subscribed(self) -> bool:
        """True if the route has subscribed to its topic."""
        return self._subscriber is not None

    @property
    def is_ready(self) -> bool:
        """True if the route has subscribed, or will as soon as its topic has a publisher with a type."""
        return self._subscriber is not None or self._is_waiting_for_type

    @property
    def needs_publisher(self) -> bool:
        """True if messages are waiting for a publisher on the other side."""
        return len(self._backlog) > 0

    @property
    def needs_type(self) -> bool:
        """True if messages are waiting and the message type for publishing them is not decided yet."""
        return self._format is None and not self.end.msg_type and self.needs_publisher

    @property
    def denial_reason(self) -> str:
        """Reason why the motion guard denies publishing; "" if publishing is allowed."""
        if self.end.guard is None:
            return ""
        msg_type = self.end.msg_type if self._format is None else self._format.msg_type
        return self.end.guard.denial_reason(self.end.topic, msg_type)

    # ---- called in the thread of the origin's side

    def subscribe(self, node: Node, view: GraphView, own_nodes: Collection[str]) -> None:
        """Subscribe to the topic, or subscribe again if the topic turns out to have another type.

        If the back end needs the actual message type, the subscription waits for a publisher of the topic.

        Args:
            node: Node of the origin's side.
            view: Graph of the origin's side.
            own_nodes: Ids of the bridge's nodes.

        Raises:
            NepError: The subscription failed.
        """
        known_type = published_type(view, self.origin.topic, own_nodes)
        if self._subscriber is None:
            msg_type = self.origin.msg_type or known_type or default_type(self.origin.backend)
            self._is_waiting_for_type = not msg_type
            if not msg_type:
                return
            sink = _BufferedSink(self._on_messages, is_open=True)
            subscriber = self._new_sub(node, msg_type, sink)
            with self._lock:
                self._subscriber, self._sink = subscriber, sink
        elif not self.origin.msg_type and known_type not in {"", self._subscriber.msg_type}:
            self._resubscribe(node, known_type)

    def _resubscribe(self, node: Node, msg_type: str) -> None:
        # Keeps a subscription that receives messages: not every back end insists on the type.
        old_subscriber, old_sink = self._subscriber, self._sink
        if old_subscriber is None or old_sink is None or _has_received(old_subscriber):
            return
        sink = _BufferedSink(self._on_messages, is_open=False)
        new_subscriber = self._new_sub(node, msg_type, sink)
        if _has_received(old_subscriber):  # a message arrived meanwhile
            sink.mute()
            new_subscriber.close()
            return
        old_sink.mute()
        lost = old_subscriber.lost
        with self._lock:
            self._previously_lost = (
                None if lost is None or self._previously_lost is None else self._previously_lost + lost
            )
            self._subscriber, self._sink = new_subscriber, sink
        old_subscriber.close()
        sink.open()

    def _new_sub(self, node: Node, msg_type: str, sink: _BufferedSink) -> Subscriber:
        return node.new_sub(
            self.origin.topic, msg_type, sink=sink.receive, qos=self.origin.qos, wildcards=False
        )

    def unsubscribe(self) -> None:
        """Unsubscribe, and forward the message that the rate limit delays, if any."""
        with self._lock:
            subscriber, self._rate_limit = self._subscriber, None
        if subscriber is not None:
            subscriber.close()
        self._forward_pending()

    def close(self) -> None:
        """Close the route's subscriber and publishers while the bridge keeps running."""
        self.unsubscribe()
        with self._lock:
            self._is_closed = True
            publishers, self._publishers = list(self._publishers.values()), {}
        for publisher in publishers:
            publisher.close()

    # ---- receiving

    def _on_messages(self, messages: Sequence[Message]) -> None:
        for message in messages:
            now = self._clock()
            with self._lock:
                if message.publisher in self._own_publisher_ids:
                    self.origin.loop_guard.disable()
                elif self._has_looped(message, now):
                    self._returned += 1
                else:
                    self._received += 1
                    self._limit_rate(message, now)

    def _has_looped(self, message: Message, now: float) -> bool:
        if self.rival:
            return True
        if message.publisher is not None:
            self.origin.loop_guard.disable()
        trail = read_trail(message.extension)
        if not trail.may_forward(self.end.network, self._bridge):
            return True
        is_unidentified = message.publisher is None and not trail.bridges
        return is_unidentified and self.origin.loop_guard.is_echo(message.raw, now)

    def _limit_rate(self, message: Message, now: float) -> None:
        if self._rate_limit is None:
            self._forward(message)
        elif self._pending is not None:
            self._thinned += 1
            self._pending = message
        elif self._rate_limit.try_acquire(now):
            self._forward(message)
        else:
            self._pending = message
            self._pacer.call_at(self._rate_limit.next_at, self._forward_pending)

    def _forward_pending(self) -> None:
        with self._lock:
            message, self._pending = self._pending, None
            if message is not None:
                if self._rate_limit is not None:
                    self._rate_limit.try_acquire(max(self._clock(), self._rate_limit.next_at))
                self._forward(message)

    def _forward(self, message: Message) -> None:
        if len(self._backlog):
            self._send_backlog()
        publisher = self._publishers.get(self._publisher_key(message))
        if publisher is None or len(self._backlog):
            self._dropped += self._backlog.put(message)
            self._wake()
        else:
            self._send(publisher, message)

    def _send_backlog(self) -> Message | None:
        while self._backlog.messages:
            message = self._backlog.messages[0]
            publisher = self._publishers.get(self._publisher_key(message))
            if publisher is None:
                return message
            self._backlog.pop()
            self._send(publisher, message)
        return None

    def _publisher_key(self, message: Message) -> tuple[bool, int | None]:
        if not message.is_latched:
            return False, None
        key = (True, message.publisher)
        return (
            key
            if key in self._publishers or len(self._publishers) < _MAX_LATCHED_PUBLISHERS
            else (True, None)
        )

    # ---- called in the thread of the end's side

    def open_publishers(self, node: Node, view: GraphView, own_nodes: Collection[str]) -> None:
        """Create the publishers for which messages are waiting, and send these messages.

        Args:
            node: Node of the end's side.
            view: Graph of the end's side.
            own_nodes: Ids of the bridge's nodes.

        Raises:
            NepError: A publisher can't be created.
        """
        while True:
            with self._lock:
                message = self._send_backlog()
                if message is None:
                    return
                key = self._publisher_key(message)
            topic_format = self._format_for(message, view, own_nodes)
            publisher = node.new_pub(self.end.topic, topic_format.msg_type, latched=key[0], qos=self.end.qos)
            with self._lock:
                self._own_publisher_ids.add(publisher.id)
                is_closed = self._is_closed
                if not is_closed:
                    self._publishers[key] = publisher
            if is_closed:
                publisher.close()
                return

    def _format_for(self, message: Message, view: GraphView, own_nodes: Collection[str]) -> TopicFormat:
        if self._format is None:
            msg_type = self.end.msg_type or type_for(
                message, self.end.backend, view.topics.get(self.end.topic), own_nodes
            )
            self._format = TopicFormat(msg_type, self.end.backend.codec_for(msg_type), self.end.topic)
        return self._format

    def close_stale_publishers(self, origin: GraphView, now: float) -> None:
        """Close the publishers of latched messages whose original publisher has left the graph.

        Args:
            origin: Graph of the origin's side.
            now: Monotonic time in seconds.
        """
        topic_info = origin.topics.get(self.origin.topic)
        publisher_ids = {each.id for each in topic_info.publishers} if topic_info is not None else set()
        stale_publishers = []
        with self._lock:
            for key in list(self._publishers):
                if not key[0] or key[1] is None or key[1] in publisher_ids:
                    self._absent_since.pop(key, None)
                elif now - self._absent_since.setdefault(key, now) >= _PUBLISHER_EXPIRY_S:
                    del self._absent_since[key]
                    stale_publishers.append(self._publishers.pop(key))
                    self._subscriber_counts.pop(stale_publishers[-1], None)
        for publisher in stale_publishers:
            publisher.close()

    # ---- sending

    def _send(self, publisher: Publisher, message: Message) -> None:
        topic_format = self._format
        if topic_format is None:  # set by `open_publishers` before the first publisher
            return
        if self.end.guard is not None:
            subscriber_count = publisher.subscribers
            if subscriber_count != self._subscriber_counts.get(publisher):  # a robot may have connected
                self._subscriber_counts[publisher] = subscriber_count
                self.end.guard.poll()
            reason = self.denial_reason
            if reason:
                self._fail(reason)
                return
        try:
            if topic_format.matches(message):
                try:
                    self._publish(publisher, message, Encoded(message.raw, message.extension))
                except EncodeError:  # the other side's codec is stricter: decode and encode again
                    self._publish(publisher, message, topic_format.codec.encode(message.payload))
            else:
                self._publish(publisher, message, self._convert(publisher, message, topic_format))
        except ClosedError:
            self._dropped += 1
        except Exception as error:  # noqa: BLE001 - payloads and third-party back ends may raise anything
            self._fail(str(error) if isinstance(error, NepError) else f"{type(error).__name__}: {error}")

    def _convert(self, publisher: Publisher, message: Message, topic_format: TopicFormat) -> Encoded:
        subscriber = self._subscriber
        payload = message.payload if subscriber is None else subscriber.decoded(message)
        try:
            return topic_format.encode(payload)
        except Exception as error:
            publisher.refuse(payload, error)
            raise

    def _publish(self, publisher: Publisher, message: Message, encoded: Encoded) -> None:
        extension = {key: value for key, value in (encoded.extension or {}).items() if key != TRAIL_KEY}
        self.end.loop_guard.record_sent(encoded.data, self._clock())
        refused_before = publisher.refused
        if self._supports_extension:
            publisher.publish_bytes(encoded.data, {**extension, TRAIL_KEY: self._trail(message).to_plain()})
            if publisher.refused == refused_before:
                self._count_sent(message)
                return
            self._supports_extension = False  # a back end that wrongly claims to support extensions
            refused_before = publisher.refused
        publisher.publish_bytes(encoded.data, extension or None)
        if publisher.refused == refused_before:
            self._count_sent(message)
        else:
            self._fail(publisher.problem)

    def _trail(self, message: Message) -> Trail:
        return read_trail(message.extension).with_hop(self.origin.network, self.end.network, self._bridge)

    def _count_sent(self, message: Message) -> None:
        self._sent += 1
        self._bytes += message.size_bytes

    def _fail(self, reason: str) -> None:
        self._failed += 1
        self._problem = escaped(shortened(reason, _MAX_PROBLEM_LENGTH))


def _has_received(subscriber: Subscriber) -> bool:
    return subscriber.received > 0
