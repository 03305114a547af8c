"""Direct connections on the wire of the original NEP: a fixed address without a master.

A frame has one part with one payload. In generation A (up to 0.5.4.5), the topic precedes the payload
(`topic {"a":1}`). In generation B (from 0.5.4.8 on), the topic precedes only payloads of the type
`dictionary`. In both generations, `image` always has this prefix, and `images`, `bytes` and `msgpack`
never have it. Images are base64.
"""

from __future__ import annotations

import base64
import binascii
import logging
import threading
import time
from collections.abc import Callable

import zmq

from nep.backends.base import PublisherSpec, SubscriberSpec
from nep.backends.bases.publisher import BasePublisher
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.connection import Direct
from nep.backends.zeromq.byte_window import TRACKING_INTERVAL_BYTES, Backlog
from nep.backends.zeromq.io_thread import PollState
from nep.backends.zeromq.sockets import Socket, bind, connect, receive_high_water_mark, set_receive_timeout
from nep.backends.zeromq.subscriber import SocketSubscriber, UnbatchedReader
from nep.errors import ClosedError, WireError
from nep.i18n import _
from nep.messages.codecs import codec_for, content_of
from nep.messages.encoded import Encoded
from nep.messages.message import Message
from nep.system.waits import wait_until

_PREFIXED_TYPES = frozenset({"dictionary", "image"})
_UNPREFIXED_TYPES = frozenset({"bytes", "msgpack", "images"})
_JSON_FIRST_BYTES = frozenset(b'{["-0123456789tfnNI')

_DEFAULT_HIGH_WATER_MARK = 10_000
"""High-water mark in messages per connection.

Full queues of small messages stay below the byte limit that all connections share, so that one
subscriber that doesn't read can't block the others.
"""
_logger = logging.getLogger("nep")
_CLOSE_EVENT_MS = 100
"""Time in milliseconds after the linger period within which libzmq reports that a socket is closed."""


def has_prefix(generation: str, msg_type: str) -> bool:
    """Return True if programs of a generation send the topic before the payload.

    Args:
        generation: "A" or "B".
        msg_type: Message type of the topic.
    """
    return msg_type in _PREFIXED_TYPES or (generation == "A" and msg_type not in _UNPREFIXED_TYPES)


def to_frame(topic: str, generation: str, msg_type: str, codec: str, data: bytes | memoryview) -> bytes:
    """Convert a payload from its native encoding to a frame.

    Args:
        topic: Name of the topic.
        generation: "A" or "B".
        msg_type: Message type of the topic.
        codec: Name of the codec of `data`.
        data: Encoded payload.
    """
    body = base64.b64encode(data) if content_of(codec) == "image" else bytes(data)
    return topic.encode() + b" " + body if has_prefix(generation, msg_type) else body


def from_frame(topic: str, msg_type: str, codec: str, frame: bytes) -> bytes | None:
    """Convert a frame of either generation to the native encoding of its payload.

    Returns None if the frame belongs to another topic on the same port. Raises `WireError` for an image
    that is not valid base64.
    """
    prefix = topic.encode() + b" "
    is_image = content_of(codec) == "image"
    if msg_type in _UNPREFIXED_TYPES and not is_image:
        return frame
    if frame.startswith(prefix):
        frame = frame[len(prefix) :]
    elif (codec == "json" and frame[:1] and frame[0] not in _JSON_FIRST_BYTES) or (
        is_image and b" " in frame[:300]
    ):
        return None
    if not is_image:
        return frame
    try:
        return base64.b64decode(frame, validate=True)
    except binascii.Error as error:
        raise WireError(_("an image isn't base64-encoded"), len(frame)) from error


def attach(socket: Socket, direct: Direct, *, is_publisher: bool) -> str:
    """Bind or connect, depending on the mode, and return the endpoint.

    Args:
        socket: Socket of zmq.
        direct: Address and mode.
        is_publisher: True for a publisher's socket, False for a subscriber's.

    Raises:
        AddressInUseError: The address can't be bound.
        NepError: The address to connect to is invalid.
    """
    if direct.mode == "many2many":
        # both sides connect, to the two ports of the original NEP's proxy
        return connect(socket, f"{direct.ip}:{direct.port + (0 if is_publisher else 1)}")
    should_bind = is_publisher == (direct.mode == "one2many")
    address = f"{direct.ip}:{direct.port}"
    return bind(socket, address) if should_bind else connect(socket, address)


class OriginalPublisher(BasePublisher):
    """Publisher on the wire of the original NEP.

    Owns its socket, an XPUB, which programs of the original NEP can't distinguish from a PUB.
    """

    def __init__(
        self,
        socket: Socket,
        spec: PublisherSpec,
        direct: Direct,
        on_close: Callable[[OriginalPublisher, float], None],
    ) -> None:
        self._changed = threading.Condition(threading.Lock())
        super().__init__(spec, self._changed)
        self.missing: tuple[str, ...] = ()
        self._on_close = on_close
        self._socket = socket
        self._generation = direct.generation
        self._subscription_count = 0
        self._is_closed = False
        self._backlog = Backlog()
        self._untracked_bytes = 0
        socket.setsockopt(zmq.SNDHWM, spec.codec.queue_length or _DEFAULT_HIGH_WATER_MARK)
        self._deadline = 0.0
        # report every unsubscribe, so that filters can be counted: one per subscriber
        socket.setsockopt(zmq.XPUB_VERBOSER, 1)
        self.fd = int(socket.getsockopt(zmq.FD))
        # libzmq reports here when everything is sent and the socket is closed
        monitor_endpoint = f"inproc://ended-{spec.id:x}"
        socket.monitor(monitor_endpoint, zmq.EVENT_MONITOR_STOPPED)
        self._close_monitor: Socket = socket.context.socket(zmq.PAIR)
        self._close_monitor.setsockopt(zmq.LINGER, 0)
        self._close_monitor.connect(monitor_endpoint)

    @property
    def has_subscribers(self) -> bool:
        """True if there is at least one subscription."""
        return self._subscription_count > 0

    @property
    def subscribers(self) -> int:
        """Number of subscriptions. A proxy counts as one subscriber."""
        return self._subscription_count

    def wait_for_any(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for a subscriber to connect."""
        with self._changed:
            wait_until(self._changed, lambda: self._subscription_count > 0, timeout_s)

    def send(self, encoded: Encoded) -> None:
        """Publish one frame; drop the frame if the backlog is full.

        Raises `ClosedError` if the publisher is closed.
        """
        frame = to_frame(
            self.spec.topic, self._generation, self.spec.msg_type, self.spec.codec.name, encoded.data
        )
        with self._changed:
            if self._is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            self._count_locked(len(frame))
            if self._backlog.has_room(len(frame)):
                self._send(frame)
            self._read_subscriptions()

    def _send(self, frame: bytes) -> None:
        self._untracked_bytes += len(frame)
        if self._untracked_bytes < TRACKING_INTERVAL_BYTES:
            self._socket.send(frame, zmq.DONTWAIT)
            return
        tracked_frame = zmq.Frame(frame, track=True, copy=False, copy_threshold=0)
        self._socket.send(tracked_frame, zmq.DONTWAIT)
        self._backlog.add_sent(tracked_frame.tracker, self._untracked_bytes)
        self._untracked_bytes = 0

    def serve(self, now: float) -> PollState:  # noqa: ARG002 - nothing to schedule
        """Process subscriptions."""
        with self._changed:
            self._read_subscriptions()
        return PollState()

    def close(self, timeout_s: float) -> None:
        """Unregister, flush for up to `timeout_s` seconds and close the socket. Must be called only once."""
        self._on_close(self, timeout_s)

    def send_bye(self) -> None:
        """Stop accepting messages. Sends nothing, because the original wire has no bye."""
        with self._changed:
            self._is_closed = True

    def finish(self, deadline: float) -> None:
        """Set the deadline (`time.monotonic`) for flushing, until which `release` waits.

        The wire of the original NEP has no acknowledgements to wait for.
        """
        self._deadline = deadline

    def flush(self, deadline: float) -> None:
        """Close the socket, while libzmq continues to send until `deadline` (`time.monotonic`).

        The I/O thread must have stopped serving the socket.
        """
        with self._changed:
            self._is_closed = True
            self._deadline = deadline
            self._socket.close(self._remaining_ms())

    def release(self) -> None:
        """Wait until libzmq has sent all messages and closed the socket.

        If the deadline set by `finish` passes, log a warning.
        """
        if not self._socket.closed:
            self.flush(self._deadline)
        with self._changed:
            if self._close_monitor.closed:
                return
            self._close_monitor.poll(self._remaining_ms() + _CLOSE_EVENT_MS)
            if self.count and self._subscription_count and not self._remaining_ms():
                _logger.warning(
                    "'%s' was closed before %d subscriber(s) received everything: "
                    "up to %d messages not delivered",
                    self.spec.topic,
                    self._subscription_count,
                    self.count,
                )
            self._close_monitor.close(0)

    def _remaining_ms(self) -> int:
        return max(0, int((self._deadline - time.monotonic()) * 1000))

    def _read_subscriptions(self) -> None:
        while not self._socket.closed and int(self._socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN:
            event = self._socket.recv_multipart(zmq.DONTWAIT)[0]
            self._subscription_count += {b"\x01": 1, b"\x00": -1}.get(event[:1], 0)
            self._changed.notify_all()


class OriginalSubSocket(UnbatchedReader):
    """SUB socket for frames of both generations, which have no sequence numbers, so losses are unknown."""

    def __init__(self, socket: Socket, spec: SubscriberSpec) -> None:
        self.fd = int(socket.getsockopt(zmq.FD))
        self.rejections = RejectionCounter()
        self.received = 0
        self.lost: int | None = None
        self.problem = ""
        self._socket = socket
        self._spec = spec
        self._codec = codec_for(spec.msg_type)
        set_receive_timeout(socket)
        socket.setsockopt(zmq.RCVHWM, receive_high_water_mark(self._codec))
        socket.setsockopt(zmq.SUBSCRIBE, b"")

    @property
    def has_input(self) -> bool:
        """True if a message can be read."""
        return bool(int(self._socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN)

    def read(self, *, may_wait: bool = False) -> Message | None:
        """Return the next message of the topic, or None if there is none. See `UnbatchedReader.read`."""
        while True:
            try:
                parts = self._socket.recv_multipart(0 if may_wait else zmq.DONTWAIT)
            except zmq.Again:
                return None
            if len(parts) != 1:
                self.rejections.add(
                    _("a message of the original NEP must have one part, but this one has {count}").format(
                        count=len(parts)
                    )
                )
                continue
            try:
                data = from_frame(self._spec.topic, self._spec.msg_type, self._codec.name, parts[0])
            except WireError as error:
                self.rejections.add(error.reason)
                continue
            if data is not None:
                self.received += 1
                return Message(self._spec.topic, data, self._codec.name, self._spec.msg_type)

    def count_dropped(self, count: int) -> None:
        """Add messages dropped from the full queue to the losses. Other losses can't be detected."""
        self.received -= count
        self.lost = (self.lost or 0) + count

    def close(self) -> None:
        """Close the socket."""
        self._socket.close(0)


OriginalSubscriber = SocketSubscriber[OriginalSubSocket]
