"""Direct connections: no master, one address that one side binds; the frames of the original NEP.

Such a frame says one datum in one part. Up to 0.5.4.5 (generation A) the topic stands in front
(`topic {"a":1}`), from 0.5.4.8 on (B) it does not, but for `dictionary`; `image` always has it, `images`,
`bytes` and `msgpack` never. Pictures are base64.
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
from nep.backends.connection import Direct
from nep.backends.zeromq.byte_window import BACKLOG_STEP_BYTES, Backlog
from nep.backends.zeromq.io_thread import Rest
from nep.backends.zeromq.sockets import (
    Refusals,
    Socket,
    bind,
    connect,
    receive_mark,
    wait_shortly,
    wait_until,
)
from nep.backends.zeromq.sub_socket import Into
from nep.backends.zeromq.subscriber import ReadOneByOne, SocketSubscriber
from nep.errors import ClosedError, WireError
from nep.i18n import _
from nep.messages.codecs import codec_for
from nep.messages.encoded import Encoded
from nep.messages.message import Message

__all__ = [
    "OriginalPublisher",
    "OriginalSubSocket",
    "OriginalSubscriber",
    "attach",
    "from_frame",
    "has_prefix",
    "to_frame",
]

_ALWAYS = frozenset({"dictionary", "image"})
_NEVER = frozenset({"bytes", "msgpack", "images"})
_JSON_BEGINS = frozenset(b'{["-0123456789tfnNI')

_MARKS = {"image": 64, "bytes": 1000}
_MARK = 10_000
"""How many messages libzmq queues for each connection. For what is small these are fewer bytes than it may
hold for all of them together, so that one subscriber that reads nothing takes nothing from the others."""
_logger = logging.getLogger("nep")
_TOLD_MS = 100
"""How soon after its linger libzmq says that a socket is closed."""


def has_prefix(generation: str, msg_type: str) -> bool:
    """Whether a program of this generation writes the topic in front."""
    return msg_type in _ALWAYS or (generation == "A" and msg_type not in _NEVER)


def to_frame(topic: str, generation: str, msg_type: str, codec: str, data: bytes | memoryview) -> bytes:
    """The frame that says `data`, which are bytes of the native codec."""
    body = base64.b64encode(data) if codec == "image" else bytes(data)
    return topic.encode() + b" " + body if has_prefix(generation, msg_type) else body


def from_frame(topic: str, msg_type: str, codec: str, frame: bytes) -> bytes | None:
    """The datum in `frame`, of either generation; None when it belongs to another topic of the same port.

    Raises `WireError` for a picture that is not base64.
    """
    prefix = topic.encode() + b" "
    if msg_type in _NEVER and codec != "image":
        return frame
    if frame.startswith(prefix):
        frame = frame[len(prefix) :]
    elif (codec == "json" and frame[:1] and frame[0] not in _JSON_BEGINS) or (
        codec == "image" and b" " in frame[:300]
    ):
        return None
    if codec != "image":
        return frame
    try:
        return base64.b64decode(frame, validate=True)
    except binascii.Error as error:
        raise WireError(_("a picture is not base64"), len(frame)) from error


def attach(socket: Socket, direct: Direct, *, is_publisher: bool) -> str:
    """Bind or connect as the mode says; the endpoint. Raises `AddressInUseError`."""
    if direct.mode == "many2many":
        # Both connect, to the two ports of a proxy of the original NEP.
        return connect(socket, f"{direct.ip}:{direct.port + (0 if is_publisher else 1)}")
    binds = is_publisher == (direct.mode == "one2many")
    address = f"{direct.ip}:{direct.port}"
    return bind(socket, address) if binds else connect(socket, address)


class OriginalPublisher:
    """Owns `socket`, an XPUB that looks to the originals like their PUB."""

    def __init__(
        self,
        socket: Socket,
        spec: PublisherSpec,
        direct: Direct,
        on_close: Callable[[OriginalPublisher, float], None],
    ) -> None:
        self.spec = spec
        self.count = 0
        self._on_close = on_close
        self.missing: tuple[str, ...] = ()
        self._socket = socket
        self._generation = direct.generation
        self._filters = 0
        self._is_closed = False
        self._backlog = Backlog()
        self._untracked_bytes = 0
        socket.setsockopt(zmq.SNDHWM, _MARKS.get(spec.codec.name, _MARK))
        self._deadline = 0.0
        self._changed = threading.Condition(threading.Lock())
        socket.setsockopt(zmq.XPUB_VERBOSER, 1)  # so that filters can be counted: one a subscriber
        self.fd = int(socket.getsockopt(zmq.FD))
        # libzmq tells there when it has sent everything and has let go of the socket.
        place = f"inproc://ended-{spec.id:x}"
        socket.monitor(place, zmq.EVENT_MONITOR_STOPPED)
        self._end: Socket = socket.context.socket(zmq.PAIR)
        self._end.setsockopt(zmq.LINGER, 0)
        self._end.connect(place)

    @property
    def is_heard(self) -> bool:
        """Whether there are any filters."""
        return self._filters > 0

    @property
    def subscribers(self) -> int:
        """How many filters there are now; a proxy in between counts as one."""
        return self._filters

    def wait_for_any(self, timeout_s: float) -> None:
        """Wait until somebody listens."""
        with self._changed:
            wait_until(self._changed, lambda: self._filters > 0, timeout_s)

    def report(self, problem: str) -> None:
        """There is no graph that could show it."""

    def lend(self, _size_bytes: int) -> memoryview | None:
        """See `PublisherTransport.lend`: none here."""
        return None

    def skip(self) -> None:
        """Count a message that nobody wants."""
        with self._changed:
            self.count += 1

    def send(self, encoded: Encoded) -> None:
        """Publish one frame."""
        frame = to_frame(
            self.spec.topic, self._generation, self.spec.msg_type, self.spec.codec.name, encoded.data
        )
        with self._changed:
            if self._is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            self.count += 1
            if self._backlog.has_room(len(frame)):
                self._send(frame)
            self._read_filters()

    def _send(self, frame: bytes) -> None:
        self._untracked_bytes += len(frame)
        if self._untracked_bytes < BACKLOG_STEP_BYTES:
            self._socket.send(frame, zmq.DONTWAIT)
            return
        tracked = zmq.Frame(frame, track=True, copy=False, copy_threshold=0)
        self._socket.send(tracked, zmq.DONTWAIT)
        self._backlog.sent(tracked.tracker, self._untracked_bytes)
        self._untracked_bytes = 0

    def serve(self, now: float) -> Rest:  # noqa: ARG002 - it has nothing to do later
        """Read filters."""
        with self._changed:
            self._read_filters()
        return Rest()

    def close(self, timeout_s: float) -> None:
        """Unregister, deliver what is on its way, and close the socket. Once; called by its publisher."""
        self._on_close(self, timeout_s)

    def say_bye(self) -> None:
        """Nothing is published any more."""
        with self._changed:
            self._is_closed = True

    def finish(self, deadline: float) -> None:
        """The original wire has no way to ask: closing lingers until `deadline`, see `release`."""
        self._deadline = deadline

    def flush(self, deadline: float) -> None:
        """Close the socket; libzmq goes on sending until `deadline`. The node's thread has let go of it."""
        with self._changed:
            self._is_closed = True
            self._deadline = deadline
            self._socket.close(self._left_ms())

    def release(self) -> None:
        """Close the socket and wait until libzmq has sent everything; log it when it could not in time."""
        if not self._socket.closed:
            self.flush(self._deadline)
        with self._changed:
            if self._end.closed:
                return
            self._end.poll(self._left_ms() + _TOLD_MS)
            if self.count and self._filters and not self._left_ms():
                _logger.warning(
                    "'%s' is closed before %d subscriber(s) took everything: up to %d messages not delivered",
                    self.spec.topic,
                    self._filters,
                    self.count,
                )
            self._end.close(0)

    def _left_ms(self) -> int:
        return max(0, int((self._deadline - time.monotonic()) * 1000))

    def _read_filters(self) -> None:
        while not self._socket.closed and int(self._socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN:
            event = self._socket.recv_multipart(zmq.DONTWAIT)[0]
            self._filters += {b"\x01": 1, b"\x00": -1}.get(event[:1], 0)
            self._changed.notify_all()


class OriginalSubSocket(ReadOneByOne):
    """A SUB that takes the frames of both generations. Nobody numbers them: `lost` is not known."""

    def __init__(self, socket: Socket, spec: SubscriberSpec) -> None:
        self.fd = int(socket.getsockopt(zmq.FD))
        self.refusals = Refusals()
        self.received = 0
        self.lost: int | None = None
        self.problem = ""
        self._socket = socket
        self._spec = spec
        self._codec = codec_for(spec.msg_type)
        wait_shortly(socket)
        socket.setsockopt(zmq.RCVHWM, receive_mark(self._codec.name))
        socket.setsockopt(zmq.SUBSCRIBE, b"")

    @property
    def has_input(self) -> bool:
        """Whether something can be read."""
        return bool(int(self._socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN)

    def read(self, rest: Into, *, may_wait: bool = False) -> Message | None:  # noqa: ARG002 - each comes alone
        """The next message of this topic."""
        while True:
            try:
                parts = self._socket.recv_multipart(0 if may_wait else zmq.DONTWAIT)
            except zmq.Again:
                return None
            if len(parts) != 1:
                self.refusals.add(
                    _("a message of the original NEP has one part, this one has {count}").format(
                        count=len(parts)
                    )
                )
                continue
            try:
                data = from_frame(self._spec.topic, self._spec.msg_type, self._codec.name, parts[0])
            except WireError as error:
                self.refusals.add(error.reason)
                continue
            if data is not None:
                self.received += 1
                return Message(self._spec.topic, data, self._codec.name, self._spec.msg_type)

    def dropped(self, count: int) -> None:
        """Dropped here for lack of room: the only losses that can be known."""
        self.received -= count
        self.lost = (self.lost or 0) + count

    def close(self) -> None:
        """Close the socket."""
        self._socket.close(0)


OriginalSubscriber = SocketSubscriber[OriginalSubSocket]
