"""`ProxyPair`: the two sockets of a line, one for original publishers and one for original subscribers."""

from __future__ import annotations

import contextlib
import socket
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import zmq
from zmq.utils.monitor import parse_monitor_message

from nep.messages.codecs import content_of
from nep.programs.gateway.framing import FrameFormat, escape_for_csharp, escape_for_javascript
from nep.programs.gateway.portmap import TopicLine
from nep.programs.gateway.requests import LOOPBACK, Role

_CONNECT_EVENTS = zmq.EVENT_ACCEPTED | zmq.EVENT_CONNECTED
_DISCONNECT_EVENTS = zmq.EVENT_DISCONNECTED
_QUEUE_LENGTH = 1000
_IMAGE_QUEUE_LENGTH = 20
MAX_BUFFERED_BYTES = 128 * 2**20
"""Approximate limit of the messages buffered for a slow subscriber, in bytes.

libzmq itself limits only their number.
"""
_LINGER_MS = 200
_MAX_FRAME_BYTES = 2**28
_MAX_FILTER_BYTES = 2**16
_MAX_FILTERS = 1000
"""Maximum number of subscription filters per pair. An original program sets one or two."""


@dataclass(frozen=True)
class Endpoint:
    """One of the two ports of a `TopicLine`.

    Attributes:
        role: Role of the programs that connect to the port.
        port: Port number.
        is_bound_by_program: True if the program binds the port, False if the gateway does.
    """

    role: Role
    port: int
    is_bound_by_program: bool


def endpoints_of(line: TopicLine, base: int) -> tuple[Endpoint, Endpoint]:
    """Return the endpoints of a line for publishers and for subscribers.

    Args:
        line: Line of the endpoints.
        base: Base port of the line.
    """
    return (
        Endpoint("publisher", base, is_bound_by_program=line.mode == "one2many"),
        Endpoint("subscriber", base + 1, is_bound_by_program=line.mode == "many2one"),
    )


def reply_port(line: TopicLine, base: int, socket_name: str) -> int:
    """Return the port number to send in the reply to a request.

    Subscribers in the mode `many2many` add one to this number themselves.

    Args:
        line: Requested line.
        base: Base port of the line.
        socket_name: Kind of socket that the program opens.
    """
    if line.is_service or line.mode == "many2many" or socket_name == "publisher":
        return base
    return base + 1


def is_free(port: int) -> bool:
    """Return True if a port of the loopback address can be bound."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        if sys.platform != "win32":  # without it, connections in TIME_WAIT block the port
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
        return True


class ProxyPair:
    """XSUB socket for original publishers, and XPUB socket for original subscribers, of one line.

    Used in the gateway's thread only. `unsupported_versions` contains the incompatible versions of
    programs by role. The constructor raises `zmq.ZMQError` if a port is in use.

    Args:
        context: ZeroMQ context.
        line: Line of the sockets.
        base: Base port of the line.
    """

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], line: TopicLine, base: int) -> None:
        self.line = line
        self.base = base
        self.frame_format = FrameFormat(line.topic, line.framing, line.codec)
        self.ends = endpoints_of(line, base)
        self.filters: set[bytes] = set()
        self.connect_count = 0
        """Number of connections made so far, including closed ones."""
        self.unsupported_versions: dict[Role, str] = {}
        self._open_handles: dict[Role, set[int]] = {"publisher": set(), "subscriber": set()}
        self.monitors: dict[Role, zmq.Socket[bytes]] = {}
        self.languages: frozenset[str] = frozenset()
        self._high_water_mark = self._queue_length = (
            _IMAGE_QUEUE_LENGTH if content_of(line.codec) == "image" else _QUEUE_LENGTH
        )
        with contextlib.ExitStack() as exit_stack:
            self.incoming = self._open(context, zmq.XSUB, self.ends[0], exit_stack, _MAX_FRAME_BYTES)
            self.outgoing = self._open(context, zmq.XPUB, self.ends[1], exit_stack, _MAX_FILTER_BYTES)
            self.incoming.send(b"\x01")  # subscribe to everything
            self._exit_stack = exit_stack.pop_all()

    def _open(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        kind: int,
        end: Endpoint,
        exit_stack: contextlib.ExitStack,
        max_bytes: int,
    ) -> zmq.Socket[bytes]:
        proxy_socket = context.socket(kind)
        exit_stack.callback(proxy_socket.close, _LINGER_MS)
        proxy_socket.setsockopt(zmq.SNDHWM, self._queue_length)
        proxy_socket.setsockopt(zmq.RCVHWM, self._queue_length)
        proxy_socket.setsockopt(zmq.MAXMSGSIZE, max_bytes)  # larger messages disconnect the sender
        if end.is_bound_by_program and not is_free(end.port):
            raise zmq.ZMQError(zmq.EADDRINUSE)
        monitor = proxy_socket.get_monitor_socket(_CONNECT_EVENTS | _DISCONNECT_EVENTS)
        exit_stack.callback(monitor.close, 0)
        exit_stack.callback(proxy_socket.disable_monitor)
        self.monitors[end.role] = monitor
        address = f"tcp://{LOOPBACK}:{end.port}"
        if end.is_bound_by_program:
            proxy_socket.connect(address)
        else:
            proxy_socket.bind(address)
        return proxy_socket

    @property
    def connections(self) -> Mapping[Role, int]:
        """Number of connections by role."""
        return {role: len(handles) for role, handles in self._open_handles.items()}

    @property
    def has_subscribers(self) -> bool:
        """True if an original program has subscribed to this line."""
        return any(self.frame_format.matches_filter(filter_) for filter_ in self.filters)

    @property
    def has_0546_subscriber(self) -> bool:
        """True if a subscriber uses nep 0.5.4.6, according to its subscription filter."""
        return any(self.frame_format.is_from_0546(filter_) for filter_ in self.filters)

    def frames(self, limit: int) -> Iterator[bytes]:
        """Yield at most `limit` pending frames of original publishers."""
        for _ in range(limit):
            try:
                parts = self.incoming.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            yield parts[0]

    def read_filters(self) -> bool:
        """Process pending subscription events; return True if the filters changed."""
        previous_filters = set(self.filters)
        while True:
            try:
                event = self.outgoing.recv(zmq.NOBLOCK)
            except zmq.Again:
                return previous_filters != self.filters
            if event[:1] == b"\x01" and len(self.filters) < _MAX_FILTERS:
                self.filters.add(event[1:])
            elif event[:1] == b"\x00":
                self.filters.discard(event[1:])

    def read_connections(self) -> bool:
        """Process pending connection events; return True if there were any."""
        had_events = False
        for role, monitor in self.monitors.items():
            while monitor.poll(0):
                event = parse_monitor_message(monitor.recv_multipart())
                handles = self._open_handles[role]
                # By handle: connections that don't speak ZeroMQ also cause disconnect events.
                if event["event"] & _CONNECT_EVENTS:
                    handles.add(event["value"])
                    self.connect_count += 1
                else:
                    handles.discard(event["value"])
                had_events = True
        return had_events

    def forward(self, frame: bytes, data: bytes) -> None:
        """Send a frame that was received on this line to the subscribers of the same line.

        The frame is sent unchanged, unless a subscriber's language requires escaping
        (`escape_for_javascript`, `escape_for_csharp`).

        Args:
            frame: Received frame.
            data: Frame converted to the native codec.
        """
        if self.has_subscribers:
            self._send(self.frame_format.encode_frame(self._escape(data)) if self._needs_escaping else frame)

    def deliver(self, data: bytes | memoryview) -> None:
        """Convert data of the native codec to a frame and send it to the subscribers of this line."""
        if self.has_subscribers:
            self._send(
                self.frame_format.encode_frame(self._escape(bytes(data)) if self._needs_escaping else data)
            )

    def close(self) -> None:
        """Close both sockets. Pending frames are sent for up to 0.2 s."""
        self._exit_stack.close()

    @property
    def _needs_escaping(self) -> bool:
        return self.line.codec == "json" and not self.languages.isdisjoint(("javascript", "csharp"))

    def _escape(self, data: bytes) -> bytes:
        if "javascript" in self.languages:
            data = escape_for_javascript(data, self.line.topic)
        if "csharp" in self.languages:
            data = escape_for_csharp(data)
        return data

    def _send(self, frame: bytes) -> None:
        mark = min(self._queue_length, max(1, MAX_BUFFERED_BYTES // max(1, len(frame))))
        if mark != self._high_water_mark:  # libzmq applies it to connected subscribers, too
            self.outgoing.setsockopt(zmq.SNDHWM, mark)
            self._high_water_mark = mark
        with contextlib.suppress(zmq.Again):
            self.outgoing.send(frame, zmq.NOBLOCK)
