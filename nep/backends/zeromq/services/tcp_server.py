"""Server over plain TCP, for programs without ZeroMQ."""

from __future__ import annotations

import errno
import logging
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from nep.backends.bases.server import BaseServer
from nep.backends.services import (
    IncomingCall,
    ServerSpec,
)
from nep.backends.zeromq.io_thread import IoThread, PollState
from nep.backends.zeromq.services.tcp_stream import TcpStream, enable_keep_alive
from nep.errors import AddressInUseError, WireError
from nep.protocol.service_wire import NATIVE, Reply
from nep.system.addresses import host_of
from nep.system.descriptors import check_free_descriptors, has_free_descriptors
from nep.system.log_rarely import is_logged
from nep.system.waits import wait_until

_logger = logging.getLogger("nep")

_BACKLOG = 128
"""Maximum number of connections that the system queues until they are accepted."""
_MAX_PEERS = 1000
_MAX_READS_PER_TURN = 100
_MAX_UNREAD_BYTES = 256 * 2**20
"""Maximum number of bytes queued for a client that doesn't read; further replies are dropped."""
_FDS_PER_LISTENER = 2
_ACCEPT_PAUSE_S = 0.5
"""Pause in seconds before accepting connections again after the process ran out of file descriptors."""


class TcpServer(BaseServer):
    """Server on a listening TCP socket.

    The constructor raises `AddressInUseError` if the address can't be bound, and `TooManyFilesError` if
    the process is out of file descriptors.

    Args:
        io: Thread that serves the sockets.
        spec: Settings of the server.
        address: Address as `HOST:PORT`.
        closer: Closes the server; called with the server and a time limit in seconds.
    """

    def __init__(
        self, io: IoThread, spec: ServerSpec, address: str, closer: Callable[[TcpServer, float], None]
    ) -> None:
        super().__init__(spec)
        self._io = io
        self._closer = closer
        self._changed = threading.Condition(threading.Lock())
        self._peers: set[_Peer] = set()
        self._rejected_count = 0
        self._listener = _create_listener(address, spec.service)
        self.fd = self._listener.fileno()
        host, port = self._listener.getsockname()[:2]
        self.endpoints = (f"tcp://{host}:{port}",)

    # ---- in the I/O thread

    def serve(self, now: float) -> PollState:
        """Accept connections. See `Pollable.serve`.

        Connections beyond `_MAX_PEERS`, or without free file descriptors, are closed immediately.
        """
        for _turn in range(_MAX_READS_PER_TURN):
            if self.is_closed:
                return PollState()
            try:
                connection, (host, port) = self._listener.accept()
            except (BlockingIOError, InterruptedError):
                return PollState()
            except OSError as error:  # the client has disconnected, or descriptors have run out
                if error.errno in {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}:
                    return PollState(is_reading_paused=True, due=now + _ACCEPT_PAUSE_S)
                continue
            if len(self._peers) >= _MAX_PEERS or not has_free_descriptors(_FDS_PER_LISTENER):
                self._reject_connection(connection)
                continue
            self._accept(connection, f"{host}:{port}")
        return PollState(due=now)

    def _reject_connection(self, connection: socket.socket) -> None:
        connection.close()
        self._rejected_count += 1
        if is_logged(self._rejected_count):
            _logger.warning(
                "rejected a client of '%s' (%d so far): too many connections",
                self.spec.service,
                self._rejected_count,
            )

    def _accept(self, connection: socket.socket, address: str) -> None:
        connection.setblocking(False)
        with suppress(OSError):  # it may have ended already
            enable_keep_alive(connection, address)
        peer = _Peer(connection, self)
        with self._changed:
            self._peers.add(peer)
        self._io.add(peer)

    def serve_peer(self, peer: _Peer, now: float) -> PollState:
        """Read the calls of one client and send pending replies to this client."""
        calls: list[IncomingCall] = []
        with self._changed:
            if peer not in self._peers:
                return PollState(is_reading_paused=True)
            peer.stream.flush()
            has_more = self._read(peer, calls, now)
            is_finished = peer.stream.has_ended and not has_more
            has_pending_replies = peer.pending_replies > 0 or peer.stream.backlog_bytes > 0
            if is_finished and (peer.stream.is_broken or not has_pending_replies):
                # otherwise the client has only shut down its sending side and still reads replies
                self._disconnect_locked(peer)
            elif peer.is_closing and not peer.stream.backlog_bytes:
                # keep reading until the client closes: closing first could discard data in flight
                peer.stream.shut_down_sending()
                self._changed.notify_all()
        for call in calls:
            self._enqueue(call)
        return PollState(is_finished, now if has_more else None, wants_write=peer.stream.backlog_bytes > 0)

    def _read(self, peer: _Peer, calls: list[IncomingCall], now: float) -> bool:
        # Returns True if there may be more.
        for attempt in range(_MAX_READS_PER_TURN):
            try:
                parts = peer.stream.next()
                if (
                    parts is None and not attempt
                ):  # read once per turn: the level-triggered descriptor signals further input
                    peer.stream.read()
                    parts = peer.stream.next()
                if parts is None:
                    return False
            except WireError as error:
                self._count_malformed(error)
                return False
            call = self._read_call(NATIVE, parts, partial(self._reply, peer), now)
            if call is not None:
                calls.append(call)
                peer.pending_replies += 1
        return True

    def _disconnect_locked(self, peer: _Peer) -> None:
        # Call in the I/O thread, or after it has stopped serving all peers.
        self._peers.discard(peer)
        self._io.remove(peer)
        peer.stream.close()
        self._changed.notify_all()

    # ---- replying, in any thread

    def _reply(self, peer: _Peer, number: int, reply: Reply) -> bool:
        reply = self._count_reply(reply)
        with self._changed:
            stream = peer.stream
            peer.pending_replies -= 1
            if peer not in self._peers or stream.is_broken:
                return False
            if stream.backlog_bytes + len(reply.data) > _MAX_UNREAD_BYTES and stream.backlog_bytes:
                _logger.warning(
                    "dropped a reply of '%s': the client doesn't read its replies", self.spec.service
                )
                return False
            stream.send(NATIVE.encode_reply(number, reply))
            must_serve = stream.backlog_bytes > 0 or stream.has_ended
        if must_serve:
            self._io.serve_soon(peer)
        return True

    # ---- closing

    def close(self, timeout_s: float) -> None:
        """Reject queued calls, flush replies for up to `timeout_s` seconds and close. Idempotent."""
        self._closer(self, timeout_s)

    def release(self, deadline: float) -> None:
        """Stop listening, and wait until all clients have read their replies and disconnected.

        Connections that are still open at `deadline` (`time.monotonic`) are closed.
        """
        self._io.remove(self)
        with self._changed:
            if self.is_closed:
                return
            self.is_closed = True
            self._listener.close()
            peers = tuple(self._peers)
            for peer in peers:
                peer.is_closing = True
        for peer in peers:
            self._io.serve_soon(peer)
        with self._changed:
            wait_until(self._changed, lambda: not self._peers, max(0.0, deadline - time.monotonic()))
            remaining_peers = tuple(self._peers)
            self._peers.clear()
        for peer in remaining_peers:
            self._io.remove(peer)
            peer.stream.close()


class _Peer:
    # Connection of a client. `pending_replies` counts its calls without a reply; `is_closing` is True once
    # the server closes.
    def __init__(self, connection: socket.socket, server: TcpServer) -> None:
        self.stream = TcpStream(connection)
        self.fd = self.stream.fd
        self.pending_replies = 0
        self.is_closing = False
        self._server = server

    def serve(self, now: float) -> PollState:
        return self._server.serve_peer(self, now)


def _create_listener(address: str, service: str) -> socket.socket:
    host, port = host_of(address), int(address.rpartition(":")[2])
    check_free_descriptors(_FDS_PER_LISTENER, f"a server of '{service}'")
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if sys.platform == "win32":  # without it another program could bind the same port
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
        else:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("" if host == "*" else host, port))
        listener.listen(_BACKLOG)
        listener.setblocking(False)
    except OSError as error:
        listener.close()
        is_own = error.errno in {errno.EADDRINUSE, errno.EACCES}
        raise AddressInUseError(address, is_own=is_own) from error
    return listener
