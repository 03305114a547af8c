"""ROUTER socket of the master. Not thread-safe; used only by the master's thread."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from typing import cast

import zmq

from nep.errors import AddressInUseError
from nep.system.addresses import endpoint_of
from nep.system.descriptors import check_free_descriptors

MAX_REQUEST_BYTES = 4 * 2**20
"""Maximum size of a part in bytes; a peer that sends more is disconnected."""
MAX_UNREAD_BYTES = 32 * 2**20
"""Maximum number of unread bytes per connection in large bodies (4 kB and more)."""
_LARGE_BODY_BYTES = 4096
_RECEIVE_QUEUE_LENGTH = 16
"""Receive queue length per connection; further requests wait at the sender."""
_DONTWAIT, _SNDMORE = int(zmq.DONTWAIT), int(zmq.SNDMORE)
_DESCRIPTORS_NEEDED = 16
_RECONNECT_TIMEOUT_S = 0.5
"""Time in seconds in which a disconnected node may reconnect before it is probed."""
_SRCFD = int(zmq.SRCFD)
_MONITOR_EVENT = struct.Struct("=HI")
"""Layout of a monitor event of libzmq: kind of event, and number of the connection."""


class MasterRouter:
    """ROUTER socket that receives requests, sends replies and pushes, and detects closed connections.

    Raises:
        AddressInUseError: The address can't be bound.
        TooManyFilesError: The process has too many open files.
    """

    def __init__(self, address: str) -> None:
        check_free_descriptors(_DESCRIPTORS_NEEDED, "a master")
        self._monitor: zmq.Socket[bytes] | None = None
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self.socket = self._context.socket(zmq.ROUTER)
        # bypasses pyzmq's handling of routing ids and groups, which takes half of the time
        self._send: Callable[..., object] = super(zmq.Socket, self.socket).send
        self.socket.setsockopt(zmq.LINGER, 200)
        self.socket.setsockopt(zmq.ROUTER_MANDATORY, 1)  # an error instead of silence when a peer is gone
        # no ROUTER_HANDOVER: knowing a routing id must not be enough to take over a connection
        self.socket.setsockopt(
            zmq.TCP_KEEPALIVE, 1
        )  # a computer that disappears does not close its connections
        self.socket.setsockopt(zmq.TCP_KEEPALIVE_IDLE, 4)
        self.socket.setsockopt(zmq.TCP_KEEPALIVE_INTVL, 2)
        self.socket.setsockopt(zmq.TCP_KEEPALIVE_CNT, 4)
        self.socket.setsockopt(zmq.SNDHWM, 10_000)
        self.socket.setsockopt(zmq.RCVHWM, _RECEIVE_QUEUE_LENGTH)
        self.socket.copy_threshold = _LARGE_BODY_BYTES
        self.socket.setsockopt(zmq.MAXMSGSIZE, MAX_REQUEST_BYTES)
        try:
            self.socket.bind(endpoint_of(address))
        except zmq.ZMQError as error:
            self.close()
            raise AddressInUseError(address) from error
        self.address = self.socket.getsockopt_string(zmq.LAST_ENDPOINT).removeprefix("tcp://")
        self._monitor = self._open_monitor()
        self._senders: dict[int, bytes] = {}
        """Last sender of each connection, by the number of the connection."""
        self._ended_at: dict[bytes, float] = {}
        """Time at which each sender's connection ended."""
        self._last_frame: zmq.Frame | None = None
        self._unread: dict[bytes, list[tuple[zmq.MessageTracker, int]]] = {}
        """Large bodies in flight by sender."""

    def receive(self) -> list[bytes]:
        """Return the frames of the next request, the sender's id first.

        Raises `zmq.Again` if there is none.
        """
        recv = self.socket.recv
        frames = [recv(_DONTWAIT, False)]
        while frames[-1].more:
            frames.append(recv(_DONTWAIT, False))
        self._last_frame = frames[0]
        parts = [frame.bytes for frame in frames]
        self._record_connection(frames[0], parts[0])
        return parts

    def peer_address(self) -> str:
        """Return the address from which the last request came, or "" if it is unknown."""
        try:
            return "" if self._last_frame is None else str(self._last_frame.get("Peer-Address"))
        except zmq.ZMQError:
            return ""

    def _record_connection(self, frame: zmq.Frame, sender: bytes) -> None:
        try:
            connection = frame.get(_SRCFD)
        except zmq.ZMQError:  # the connection has already ended
            return
        previous_sender = self._senders.get(connection)
        if previous_sender != sender:
            if previous_sender is not None:  # the number was reused: its previous connection has ended
                self._ended_at.setdefault(previous_sender, time.monotonic())
            self._senders[connection] = sender

    def take_ended_senders(self, now: float) -> list[bytes]:
        """Return the ids of senders whose connection has closed, each once.

        A sender may have reconnected since.
        """
        drained_routes = [
            each for each, unread in self._unread.items() if all(tracker.done for tracker, _size in unread)
        ]
        for route in drained_routes:
            del self._unread[route]
        while self._monitor is not None:
            try:
                event = self._monitor.recv_multipart(_DONTWAIT)[0]
            except zmq.Again:
                break
            sender = self._senders.pop(_MONITOR_EVENT.unpack(event)[1], None)
            if sender is not None:
                self._ended_at.setdefault(sender, now)
        ended = [
            sender for sender, ended_at in self._ended_at.items() if now - ended_at >= _RECONNECT_TIMEOUT_S
        ]
        for sender in ended:
            del self._ended_at[sender]
        return ended

    def send(self, to: bytes, body: bytes) -> bool:
        """Send a body; return False if the receiver has no connection.

        A body is dropped, with the result True, if the receiver's queue is full. A large body is also
        dropped while the receiver has more than `MAX_UNREAD_BYTES` of unread large bodies.
        """
        try:
            if len(body) < _LARGE_BODY_BYTES:
                self._send(to, _SNDMORE | _DONTWAIT)
                self._send(body, _DONTWAIT)
                return True
            unread = [each for each in self._unread.get(to, ()) if not each[0].done]
            if sum(size for _tracker, size in unread) + len(body) > MAX_UNREAD_BYTES and unread:
                return True
            self._send(to, _SNDMORE | _DONTWAIT)
            tracker = cast("zmq.MessageTracker", self._send(body, _DONTWAIT, False, True))
            self._unread[to] = [*unread, (tracker, len(body))]
        except zmq.Again:
            pass  # a slow reader: the reply to its next renewal contains what was dropped
        except zmq.ZMQError as error:
            return error.errno != zmq.EHOSTUNREACH
        return True

    def _open_monitor(self) -> zmq.Socket[bytes]:
        # Monitor socket for disconnections.
        monitor = self._context.socket(zmq.PAIR)
        monitor.setsockopt(zmq.RCVHWM, 0)  # unlimited: libzmq's I/O thread would block on a full queue
        self.socket.monitor("inproc://ended", zmq.EVENT_DISCONNECTED)
        monitor.connect("inproc://ended")
        return monitor

    def close(self) -> None:
        """Close the socket. Queued bodies are still sent, for at most 0.2 s."""
        if self._monitor is not None:
            self.socket.disable_monitor()
            self._monitor.close(0)
        self.socket.close()
        self._context.term()
