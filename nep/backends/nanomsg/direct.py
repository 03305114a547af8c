"""Direct connections: frames of the original NEP over PUB and SUB sockets, compatible with libnanomsg."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any

from nep.backends.base import PublisherSpec, SubscriberSpec
from nep.backends.bases.publisher import BasePublisher
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.connection import Direct
from nep.backends.nanomsg.library import Connections, listen, load_pynng, new_socket, queue_length
from nep.backends.nanomsg.sub_socket import PollableSocket
from nep.backends.zeromq.io_thread import PollState
from nep.backends.zeromq.legacy import from_frame, to_frame
from nep.backends.zeromq.subscriber import UnbatchedReader
from nep.backends.zeromq.transport import close_on_error
from nep.errors import ClosedError, NepError, WireError
from nep.i18n import _
from nep.messages.codecs import codec_for
from nep.messages.encoded import Encoded
from nep.messages.message import Message
from nep.system.addresses import resolve_address

_logger = logging.getLogger("nep")
_LINGER_S = 0.2
"""Time in seconds to flush the last message before closing.

pynng discards the queue of a closed socket and doesn't report when the queue is empty.
"""
_MAX_LIBNANOMSG_BYTES = 2**20
"""Default size limit of libnanomsg in bytes. The receiver silently discards larger messages."""


def check_direct(direct: Direct) -> None:
    """Raise `NepError` for a mode or wire that this back end doesn't support."""
    if direct.mode == "many2many":
        raise NepError(
            _("the back end 'nanomsg' doesn't support direct connections of mode 'many2many'; use 'one2many'")
        )
    if direct.wire != "original":
        raise NepError(
            _(
                "direct connections of 'nanomsg' use the format of the original NEP; omit wire='{wire}'"
            ).format(wire=direct.wire)
        )


def attach(socket: Any, direct: Direct, *, is_publisher: bool, owner: str) -> str:  # noqa: ANN401 - pynng is not typed
    """Listen or dial, depending on the mode, and return the endpoint.

    Args:
        socket: Socket of pynng.
        direct: Address and mode.
        is_publisher: True for a publisher's socket, False for a subscriber's.
        owner: Owner of the socket, for error messages.

    Raises:
        AddressInUseError: The address can't be bound.
        NepError: The address to dial is invalid.
    """
    address = f"{direct.ip}:{direct.port}"
    if is_publisher == (direct.mode == "one2many"):
        listen(socket, address, owner)
        return f"tcp://{address}"
    return dial(socket, address)


def dial(socket: Any, address: str) -> str:  # noqa: ANN401 - pynng is not typed
    """Connect to `HOST:PORT` and return the endpoint. Raises `NepError` for an invalid address.

    The peer may start listening later.
    """
    try:
        address = resolve_address(address)
        socket.dial(f"tcp://{address}", block=False)
    except load_pynng().NNGException as error:
        raise NepError(
            _("can't connect to '{address}'; use a computer's address and a port up to 65535").format(
                address=address
            )
        ) from error
    return f"tcp://{address}"


class DirectPublisher(BasePublisher):
    """Publisher on a PUB socket. Each connection counts as a subscriber, because nng hides subscriptions."""

    def __init__(
        self, spec: PublisherSpec, direct: Direct, on_close: Callable[[DirectPublisher, float], None]
    ) -> None:
        check_direct(direct)
        self._lock = threading.Lock()
        super().__init__(spec, self._lock)
        self.missing: tuple[str, ...] = ()
        self._on_close = on_close
        self._generation = direct.generation
        self._is_closed = False
        self._has_warned = False
        self._sent_at = 0.0
        self.fd = -1
        """-1, because the socket receives nothing."""
        self._socket: Any = new_socket("Pub0", send_buffer_size=queue_length(spec.codec))
        self._connections = Connections(self._socket)
        with close_on_error(self.release):
            self.endpoint = attach(
                self._socket, direct, is_publisher=True, owner=f"a publisher of '{spec.topic}'"
            )

    @property
    def subscribers(self) -> int:
        """Number of connections, with or without a subscription to the topic."""
        return len(self._connections)

    @property
    def has_subscribers(self) -> bool:
        """True if there is at least one connection."""
        return bool(self._connections)

    def wait_for_any(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for a connection."""
        self._connections.wait_for_any(timeout_s)

    def send(self, encoded: Encoded) -> None:
        """Publish one frame. Drops in full queues can't be detected; a large message is logged once."""
        frame = to_frame(
            self.spec.topic, self._generation, self.spec.msg_type, self.spec.codec.name, encoded.data
        )
        with self._lock:
            if self._is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            self._count_locked(len(frame))
            should_warn = len(frame) > _MAX_LIBNANOMSG_BYTES and not self._has_warned
            self._has_warned = self._has_warned or should_warn
            self._sent_at = time.monotonic()
            self._socket.send(frame, block=False)
        if should_warn:
            _logger.warning(
                _(
                    "a message on '{topic}' is {size} bytes; programs that use libnanomsg silently drop "
                    "messages of more than {most} bytes, so send smaller messages"
                ).format(topic=self.spec.topic, size=len(frame), most=_MAX_LIBNANOMSG_BYTES)
            )

    def serve(self, now: float) -> PollState:  # noqa: ARG002 - no input
        """Return a state that pauses reading, because the socket receives nothing."""
        return PollState(is_reading_paused=True)

    def close(self, timeout_s: float) -> None:
        """Flush for up to `timeout_s` seconds and close the publisher. Must be called only once."""
        self._on_close(self, timeout_s)

    def send_bye(self) -> None:
        """Stop accepting messages."""
        with self._lock:
            self._is_closed = True

    def finish(self, deadline: float) -> None:
        """Give pynng up to `_LINGER_S` seconds after the last message to send its queue.

        Returns earlier at `deadline` (`time.monotonic`) or when all connections have closed. pynng doesn't
        report how much of the queue it has sent.
        """
        flush_deadline = min(deadline, self._sent_at + _LINGER_S)
        self._connections.wait_for_none(flush_deadline - time.monotonic())

    def release(self) -> None:
        """Close the socket."""
        self.send_bye()
        self._socket.close()


class DirectSubSocket(UnbatchedReader):
    """SUB socket for frames of both generations, which have no sequence numbers, so losses are unknown."""

    def __init__(self, spec: SubscriberSpec, direct: Direct) -> None:
        check_direct(direct)
        self.rejections = RejectionCounter()
        self.received = 0
        self.lost: int | None = None
        self.problem = ""
        self._spec = spec
        self._codec = codec_for(spec.msg_type).name
        self._sub = PollableSocket("Sub0", codec_for(self._codec))
        self.fd = self._sub.fd
        self._sub.socket.subscribe(b"")  # frames of generation B don't start with the topic
        with close_on_error(self.close):
            self.endpoint = attach(
                self._sub.socket, direct, is_publisher=False, owner=f"a subscriber of '{spec.topic}'"
            )

    @property
    def has_input(self) -> bool:
        """True if a message can be read."""
        return self._sub.has_input

    def read(self, *, may_wait: bool = False) -> Message | None:
        """Return the next message of the topic, or None if there is none. See `UnbatchedReader.read`."""
        while (frame := self._sub.recv(may_wait=may_wait)) is not None:
            try:
                data = from_frame(self._spec.topic, self._spec.msg_type, self._codec, frame)
            except WireError as error:
                self.rejections.add(error.reason)
                continue
            if data is not None:
                self.received += 1
                return Message(self._spec.topic, data, self._codec, self._spec.msg_type)
        return None

    def count_dropped(self, count: int) -> None:
        """Add messages dropped from the full queue to the losses. Other losses can't be detected."""
        self.received -= count
        self.lost = (self.lost or 0) + count

    def close(self) -> None:
        """Close the socket."""
        self._sub.close()
