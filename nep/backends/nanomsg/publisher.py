"""Publisher that subscribers find through the master.

It listens with a BUS socket, because a PUB socket can't receive: a subscriber sends its hello over the
connection over which it receives. The publisher replies with the history and an echo, as on the native
wire. Messages are sent in the publishing thread; hellos are read in the I/O thread.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nep.backends.base import PublisherSpec
from nep.backends.bases.publisher import BasePublisher
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.nanomsg.endpoints import format_endpoint, parse_endpoint, subscriber_topic_part
from nep.backends.nanomsg.library import listen, load_pynng, new_socket, queue_length
from nep.backends.zeromq.io_thread import Pollable, PollState
from nep.backends.zeromq.publisher import HandshakePublisher
from nep.backends.zeromq.sockets import RemoteConnection
from nep.errors import AddressInUseError, ClosedError, TooManyFilesError
from nep.messages.encoded import Encoded
from nep.messages.history import History
from nep.protocol.requests import PublisherCount
from nep.protocol.wire import BYE, MAX_SUBSCRIPTION_BYTES, Header, extension_part, parse_hello, topic_part
from nep.system.lazy_import import lazy_module
from nep.system.waits import wait_until

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")

_logger = logging.getLogger("nep")
_HELLO_QUEUE_LENGTH = 1000
_MAX_HELLOS_AT_ONCE = 1000
"""Maximum number of hellos read at once, so that other sockets are served during a flood of hellos."""
_BYE_RETRY_S = 0.05


@dataclass(eq=False)
class _Connection:
    pipe: Any
    address: str
    subscriber: int | None = None
    """Id of the subscriber, None before its hello."""
    tcp: RemoteConnection | None = None
    """Connection in the system, if the peer is on another computer."""


class NanomsgPublisher(HandshakePublisher, BasePublisher):
    """Publisher with a BUS socket that listens at each address of this computer that the session serves.

    pynng calls back with a lock of the socket held. The callbacks therefore don't acquire the publisher's
    lock; they only queue the event.
    """

    def __init__(
        self,
        spec: PublisherSpec,
        on_close: Callable[[NanomsgPublisher, float], None],
        serve_soon: Callable[[Pollable], None],
    ) -> None:
        self._nng_error = load_pynng().NNGException
        self.is_local = False
        self._on_close = on_close
        self._serve_soon = serve_soon
        self._socket: Any = new_socket(
            "Bus0",
            send_buffer_size=max(queue_length(spec.codec), 2 * spec.history),  # history is sent in one burst
            recv_buffer_size=_HELLO_QUEUE_LENGTH,
            recv_max_size=MAX_SUBSCRIPTION_BYTES,
        )
        self.fd = int(self._socket.recv_fd)
        self._listeners: dict[str, tuple[Any, str]] = {}
        """Listener and its endpoint by host."""
        self._history: History[bytes] = History(spec.history)
        self._topic = topic_part(spec.topic)
        self.is_closed = False
        self._is_released = False
        self._connections: dict[int, _Connection] = {}
        """Connections by the id of their pipe."""
        self._events: deque[tuple[int, _Connection | None]] = deque()
        """Pipes that were opened, and pipes that were closed (None)."""
        self.rejections = RejectionCounter()
        """Counter of rejected hellos."""
        changed = threading.Condition(threading.Lock())
        BasePublisher.__init__(self, spec, changed)
        HandshakePublisher.__init__(self, changed, {})
        self._socket.add_pre_pipe_connect_cb(self._handle_pipe_added)  # before its hello can arrive
        self._socket.add_post_pipe_remove_cb(self._handle_pipe_removed)

    # ---- subscribers

    @property
    def subscribers(self) -> int:
        """Number of subscribers that have sent a hello and are still connected."""
        return len(self._counts_at_hello)

    @property
    def has_subscribers(self) -> bool:
        """True if any subscriber is connected, with or without a hello."""
        return bool(self._connections)

    @property
    def endpoints(self) -> tuple[str, ...]:
        """TCP endpoints at which the publisher listens."""
        return tuple(parse_endpoint(endpoint) for _listener, endpoint in self._listeners.values())

    def move(self, hosts: Sequence[str]) -> tuple[str, ...]:
        """Listen at these addresses of this computer only; return the endpoints in the order of `hosts`.

        Each address gets its own port. Addresses at which listening fails are skipped; if it fails at all
        of them, raises `AddressInUseError` or `TooManyFilesError`.
        """
        last_error: AddressInUseError | TooManyFilesError | None = None
        with self._changed:
            if self._is_released:
                return ()
            for host in [each for each in self._listeners if each not in hosts]:
                self._listeners.pop(host)[0].close()
            for host in [each for each in hosts if each not in self._listeners]:
                try:
                    listener = listen(self._socket, f"{host}:0", f"a publisher of '{self.spec.topic}'")
                except (AddressInUseError, TooManyFilesError) as error:
                    last_error = error
                else:
                    self._listeners[host] = listener, format_endpoint(str(listener.local_address))
            if last_error is not None and not self._listeners:
                raise last_error
            return tuple(self._listeners[each][1] for each in hosts if each in self._listeners)

    def unbind_local(self) -> None:
        """Do nothing, because this back end has no Unix sockets."""

    # ---- sending

    def send(self, encoded: Encoded) -> None:
        """Publish one message.

        Raises `ClosedError`, and `WireError` for an extension that can't be encoded.
        """
        data, extension_fields = encoded
        extension = extension_part(extension_fields) if extension_fields else b""
        size = len(data) if isinstance(data, bytes) else data.nbytes
        with self._changed:
            if self.is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            header = self._next_header_locked(size, has_extension=bool(extension))
            tail = b"".join((header.pack(), data, extension))
            self._history.add(tail, size)
            self._socket.send(self._topic + tail, block=False)

    # ---- connections, in the I/O thread

    def serve(self, now: float) -> PollState:
        """Process hellos, connections and disconnections."""
        with self._changed:
            for _number in range(_MAX_HELLOS_AT_ONCE):
                try:
                    message = self._socket.recv_msg(block=False)
                except self._nng_error:  # no more input, or closed
                    self._update_connections_locked()
                    return PollState()
                self._update_connections_locked()
                connection = None if message.pipe is None else self._connections.get(message.pipe.id)
                if connection is not None:  # otherwise closed already
                    self._process_hello_locked(connection, message.bytes)
        return PollState(due=now)

    def _handle_pipe_added(self, pipe: Any) -> None:  # noqa: ANN401 - pynng is not typed
        self._events.append((pipe.id, _Connection(pipe, str(pipe.remote_address))))
        self._serve_soon(self)

    def _handle_pipe_removed(self, pipe: Any) -> None:  # noqa: ANN401 - pynng is not typed
        self._events.append((pipe.id, None))
        self._serve_soon(self)

    def _update_connections_locked(self) -> None:
        # a connected subscriber may leave without being reported as missing
        self._expected_ids.difference_update(self._counts_at_hello)
        while self._events:
            pipe_id, connection = self._events.popleft()
            if connection is not None:
                self._connections[pipe_id] = connection
                continue
            removed = self._connections.pop(pipe_id, None)
            subscriber = None if removed is None else removed.subscriber
            if subscriber is not None and not self._find(subscriber):
                self._counts_at_hello.pop(subscriber, None)
                self._changed.notify_all()

    def _find(self, subscriber: int) -> list[_Connection]:
        return [each for each in self._connections.values() if each.subscriber == subscriber]

    def _process_hello_locked(self, connection: _Connection, frame: bytes) -> None:
        hello = parse_hello(frame)
        if hello is None or hello.topic != self.spec.topic:
            if self.rejections.add(f"an invalid hello of {len(frame)} bytes"):
                _logger.info("'%s' received %s", self.spec.topic, self.rejections.recent_message())
            self._close_connections([connection])
            return
        if connection.subscriber is not None:
            return  # repeated: a subscriber sends each hello to all its publishers
        # a connection from an old address of the subscriber's computer would stay open for minutes
        self._close_connections(self._find(hello.subscriber))
        connection.subscriber = hello.subscriber
        self._counts_at_hello[hello.subscriber] = self.count
        # The history, then the echo: from here on the subscriber counts losses.
        prefix = subscriber_topic_part(hello.subscriber, self.spec.topic)
        for message in self._history:
            self._socket.send(prefix + message, block=False)
        self._send_notice_locked(hello.subscriber, 0)
        self._changed.notify_all()

    def _close_connections(self, connections: Iterable[_Connection]) -> None:
        for connection in connections:
            with contextlib.suppress(self._nng_error):  # closed already
                connection.pipe.close()

    def counts(self) -> PublisherCount:
        """Return the statistics that a renewal reports.

        Because it is called once per second, this method also closes connections that don't respond.
        """
        with self._changed:
            remote_connections = [
                each for each in self._connections.values() if not each.address.startswith("127.")
            ]
            if RemoteConnection.can_detect_silence and any(each.tcp is None for each in remote_connections):
                tcp_by_address = _tcp_connections()
                for each in remote_connections:
                    each.tcp = tcp_by_address.get(each.address)
            self._close_connections(
                each for each in remote_connections if each.tcp is not None and each.tcp.is_silent()
            )
        return super().counts()

    def _send_notice_locked(self, subscriber: int, flags: int) -> None:
        header = Header(self.spec.codec.number, flags, self.count, time.time_ns(), self.spec.id)
        self._socket.send(subscriber_topic_part(subscriber, self.spec.topic) + header.pack(), block=False)

    # ---- closing

    def close(self, timeout_s: float) -> None:
        """Unregister, flush for up to `timeout_s` seconds and close the socket. Must be called only once."""
        self._on_close(self, timeout_s)

    def send_bye(self) -> None:
        """Send the bye, after which subscribers read the remaining messages and disconnect."""
        with self._changed:
            self.is_closed = True
            self._send_bye_locked()

    def finish(self, deadline: float) -> None:
        """Wait until all subscribers have disconnected; log undelivered messages at `deadline`.

        `deadline` is a time of `time.monotonic`.
        """
        with self._changed:
            while self._counts_at_hello and (remaining_s := deadline - time.monotonic()) > 0.0:
                if not wait_until(
                    self._changed, lambda: not self._counts_at_hello, min(remaining_s, _BYE_RETRY_S)
                ):
                    self._send_bye_locked()  # a full queue drops the bye like any other message
            undelivered_counts = [
                max(self.count - seen_count, len(self._history))
                for seen_count in self._counts_at_hello.values()
            ]
            if any(undelivered_counts):
                _logger.warning(
                    "'%s' was closed before %d subscriber(s) received everything: "
                    "up to %d messages not delivered",
                    self.spec.topic,
                    sum(map(bool, undelivered_counts)),
                    max(undelivered_counts),
                )
            self._counts_at_hello.clear()

    def release(self) -> None:
        """Close the socket. The I/O thread must have stopped serving it."""
        with self._changed:
            if self._is_released:
                return
            self.is_closed = self._is_released = True
        self._socket.close()

    def _send_bye_locked(self) -> None:
        for subscriber in () if self._is_released else self._counts_at_hello:
            self._send_notice_locked(subscriber, BYE)


def _tcp_connections() -> dict[str, RemoteConnection]:
    # Connections of this process by the peer's address. pynng doesn't expose their descriptors.
    try:
        return {
            f"{each.raddr.ip}:{each.raddr.port}": RemoteConnection(each.fd, (each.raddr.ip, each.raddr.port))
            for each in psutil.Process().net_connections("tcp4")
            if each.status == psutil.CONN_ESTABLISHED
        }
    except (psutil.Error, OSError) as error:
        _logger.debug("can't list the connections of this process: %s", error)
        return {}
