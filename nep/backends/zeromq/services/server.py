"""Server over a ROUTER socket. The I/O thread reads calls; any thread can reply.

Clients of the original NEP connect to the ROUTER socket as well: for their REQ sockets, a ROUTER is
equivalent to a REP, and a ROUTER can reply to several clients at the same time.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

import zmq

from nep.backends.bases.server import BaseServer
from nep.backends.services import (
    IncomingCall,
    ServerSpec,
)
from nep.backends.zeromq.bindings import Bindings
from nep.backends.zeromq.io_thread import PollState
from nep.backends.zeromq.sockets import Socket
from nep.protocol.service_wire import MAX_PAYLOAD_BYTES, Framing, Reply

_logger = logging.getLogger("nep")

_MAX_READS_PER_TURN = 100
"""Maximum number of calls read before other sockets are served."""
_LARGE_BYTES = 65_536
"""Minimum size in bytes of replies that are sent without a copy, and tracked until libzmq has sent them."""
_MAX_UNREAD_BYTES = 256 * 2**20
_REPLY_HIGH_WATER_MARK = 1000
"""High-water mark: maximum number of replies queued for a client that doesn't read."""


class RouterServer(BaseServer):
    """Server over a ROUTER socket.

    Args:
        socket: ROUTER socket.
        spec: Settings of the server.
        framing: Wire format.
        serve_soon: Asks the I/O thread to serve the server.
        unregister: Unregisters the server; may be called twice.
        closer: Closes the server; called with the server and a time limit in seconds.
    """

    is_local = False

    def __init__(
        self,
        socket: Socket,
        spec: ServerSpec,
        framing: Framing,
        serve_soon: Callable[[RouterServer], None],
        unregister: Callable[[], object],
        closer: Callable[[RouterServer, float], None],
    ) -> None:
        super().__init__(spec)
        self.fixed_endpoints: tuple[str, ...] = ()
        """Endpoints of a server without a master."""
        self.socket = socket
        self._framing = framing
        self._serve_soon = serve_soon
        self._unregister = unregister
        self._closer = closer
        self._lock = threading.Lock()
        self._unread_replies: deque[tuple[zmq.MessageTracker, int]] = deque()
        socket.setsockopt(zmq.ROUTER_MANDATORY, 1)  # raise an error when a client has disconnected
        socket.setsockopt(zmq.MAXMSGSIZE, MAX_PAYLOAD_BYTES)
        socket.setsockopt(zmq.SNDHWM, _REPLY_HIGH_WATER_MARK)
        socket.setsockopt(zmq.TCP_KEEPALIVE, 1)
        socket.copy_threshold = _LARGE_BYTES
        self._bindings = Bindings(socket, may_bind_unix_sockets=False)
        self.fd = int(socket.getsockopt(zmq.FD))

    # ---- for the session

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All bound endpoints."""
        return self._bindings.endpoints or self.fixed_endpoints

    def move(self, hosts: Sequence[str]) -> tuple[str, ...]:
        """Bind these addresses of this computer and unbind all others; return the endpoints."""
        with self._lock:
            return () if self.is_closed else self._bindings.move(hosts)

    def unbind_local(self) -> None:
        """Do nothing, because servers have no Unix sockets."""

    # ---- in the I/O thread

    def serve(self, now: float) -> PollState:
        """Read and queue calls; reject calls while the queue is full. See `Pollable.serve`."""
        calls: list[IncomingCall] = []
        with self._lock:
            if self.is_closed:
                return PollState()
            has_more = self._read_locked(calls, now)
        for call in calls:
            self._enqueue(call)
        return PollState(due=now if has_more else None)

    def _read_locked(self, calls: list[IncomingCall], now: float) -> bool:
        # Returns True if there may be more: ZMQ_FD is edge-triggered.
        for _turn in range(_MAX_READS_PER_TURN):
            try:
                route, *parts = self.socket.recv_multipart(zmq.DONTWAIT)
            except zmq.Again:
                return False
            call = self._read_call(self._framing, parts, partial(self._reply, route), now)
            if call is not None:
                calls.append(call)
        return True

    # ---- replying, in any thread

    def _reply(self, route: bytes, number: int, reply: Reply) -> bool:
        reply = self._count_reply(reply)
        with self._lock:
            if self.is_closed:
                return False
            if len(reply.data) >= _LARGE_BYTES and not self._has_room(len(reply.data)):
                _logger.warning(
                    "dropped a reply of '%s': the client doesn't read its replies", self.spec.service
                )
                return False
            is_sent = self._send_locked(route, self._framing.encode_reply(number, reply))
            has_input = bool(int(self.socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN)
        if has_input:
            self._serve_soon(self)
        return is_sent

    def _send_locked(self, route: bytes, parts: Sequence[bytes | memoryview]) -> bool:
        # Returns False if the client has disconnected or doesn't read.
        try:
            self.socket.send(route, zmq.DONTWAIT | zmq.SNDMORE)
            self.socket.send(parts[0], zmq.DONTWAIT | zmq.SNDMORE)
            if len(parts[1]) < _LARGE_BYTES:
                self.socket.send(parts[1], zmq.DONTWAIT)
            else:
                tracker = self.socket.send(parts[1], zmq.DONTWAIT, copy=False, track=True)
                self._unread_replies.append((tracker, len(parts[1])))
        except zmq.ZMQError:  # the client has disconnected, or its queue is full
            return False
        return True

    def _has_room(self, size: int) -> bool:
        while self._unread_replies and self._unread_replies[0][0].done:
            self._unread_replies.popleft()
        unread_bytes = sum(each for _tracker, each in self._unread_replies)
        return not unread_bytes or unread_bytes + size <= _MAX_UNREAD_BYTES

    # ---- closing

    def close(self, timeout_s: float) -> None:
        """Unregister, reject queued calls and flush replies for up to `timeout_s` seconds. Idempotent."""
        self._closer(self, timeout_s)

    def begin_close(self) -> None:
        """Unregister; reject queued and new calls. Idempotent."""
        self._unregister()
        super().begin_close()

    def release(self, deadline: float) -> None:
        """Close the socket, which continues to send replies until `deadline` (`time.monotonic`).

        The I/O thread must have stopped serving the socket.
        """
        with self._lock:
            if not self.is_closed:
                self.is_closed = True
                self.socket.close(max(0, round((deadline - time.monotonic()) * 1000)))
