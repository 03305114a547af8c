"""MasterRouter: the master's ROUTER socket: requests in, bodies out. For the master's thread only."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from typing import cast

import zmq

from nep.errors import AddressInUseError
from nep.system.addresses import endpoint_of
from nep.system.descriptors import check_room

__all__ = ["MasterRouter"]

REQUEST_MAX_BYTES = 4 * 2**20
"""Whoever sends more in one part is disconnected."""
UNREAD_MAX_BYTES = 32 * 2**20
"""So much is kept for a program that asks for graphs and does not read them, in bodies of 4 kB and more."""
_LARGE_BYTES = 4096
_RECEIVE_AHEAD = 16
"""So many requests of each connection wait here; more wait where they come from."""
_DONTWAIT, _SNDMORE = int(zmq.DONTWAIT), int(zmq.SNDMORE)
_FILES = 16
_RETURN_S = 0.5
"""A node whose connection ends has so long to be back."""
_SRCFD = int(zmq.SRCFD)
_EVENT = struct.Struct("=HI")
"""What libzmq tells of a connection: the kind of event and the connection's number."""


class MasterRouter:
    """Raises `AddressInUseError` when `address` cannot be bound, `TooManyFilesError`."""

    def __init__(self, address: str) -> None:
        check_room(_FILES, "a master")
        self._monitor: zmq.Socket[bytes] | None = None
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self.socket = self._context.socket(zmq.ROUTER)
        # Without pyzmq's layer for routing ids and groups, which takes half of the time.
        self._send: Callable[..., object] = super(zmq.Socket, self.socket).send
        self.socket.setsockopt(zmq.LINGER, 200)
        self.socket.setsockopt(zmq.ROUTER_MANDATORY, 1)  # an error instead of silence when a peer is gone
        # No ROUTER_HANDOVER: whoever knows the routing id of a connection must not be able to end it.
        self.socket.setsockopt(
            zmq.TCP_KEEPALIVE, 1
        )  # a computer that vanishes does not close its connections
        self.socket.setsockopt(zmq.TCP_KEEPALIVE_IDLE, 4)
        self.socket.setsockopt(zmq.TCP_KEEPALIVE_INTVL, 2)
        self.socket.setsockopt(zmq.TCP_KEEPALIVE_CNT, 4)
        self.socket.setsockopt(zmq.SNDHWM, 10_000)
        self.socket.setsockopt(zmq.RCVHWM, _RECEIVE_AHEAD)
        self.socket.copy_threshold = _LARGE_BYTES
        self.socket.setsockopt(zmq.MAXMSGSIZE, REQUEST_MAX_BYTES)
        try:
            self.socket.bind(endpoint_of(address))
        except zmq.ZMQError as error:
            self.close()
            raise AddressInUseError(address) from error
        self.address = self.socket.getsockopt_string(zmq.LAST_ENDPOINT).removeprefix("tcp://")
        self._monitor = self._monitored()
        self._senders: dict[int, bytes] = {}
        """Who was heard last on which connection, by its number in this process."""
        self._ended: dict[bytes, float] = {}
        """Whose connection has ended, and when."""
        self._newest: zmq.Frame | None = None
        self._unread: dict[bytes, list[tuple[zmq.MessageTracker, int]]] = {}
        """The large bodies on their way to each connection."""

    def receive(self) -> list[bytes]:
        """The parts of a request, who asks first. Raises `zmq.Again` when there is none."""
        recv = self.socket.recv
        frames = [recv(_DONTWAIT, False)]
        while frames[-1].more:
            frames.append(recv(_DONTWAIT, False))
        self._newest = frames[0]
        parts = [frame.bytes for frame in frames]
        self._heard(frames[0], parts[0])
        return parts

    def peer(self) -> str:
        """The address that the request received last came from; empty when that is not known any more."""
        try:
            return "" if self._newest is None else str(self._newest.get("Peer-Address"))
        except zmq.ZMQError:
            return ""

    def _heard(self, frame: zmq.Frame, sender: bytes) -> None:
        try:
            connection = frame.get(_SRCFD)
        except zmq.ZMQError:  # its connection ended as soon as it was there
            return
        before = self._senders.get(connection)
        if before != sender:
            if before is not None:  # so the connection that had this number has ended
                self._ended.setdefault(before, time.monotonic())
            self._senders[connection] = sender

    def ended(self, now: float) -> list[bytes]:
        """Whose connection ended a moment ago, each once; they may have another one by now."""
        sent = [each for each, unread in self._unread.items() if all(one.done for one, _size in unread)]
        for route in sent:
            del self._unread[route]
        while self._monitor is not None:
            try:
                event = self._monitor.recv_multipart(_DONTWAIT)[0]
            except zmq.Again:
                break
            sender = self._senders.pop(_EVENT.unpack(event)[1], None)
            if sender is not None:
                self._ended.setdefault(sender, now)
        ended = [sender for sender, at in self._ended.items() if now - at >= _RETURN_S]
        for sender in ended:
            del self._ended[sender]
        return ended

    def send(self, to: bytes, body: bytes) -> bool:
        """Send a body; False when its node has no connection any more.

        Large ones are left out while `UNREAD_MAX_BYTES` of them have not been read.
        """
        try:
            if len(body) < _LARGE_BYTES:
                self._send(to, _SNDMORE | _DONTWAIT)
                self._send(body, _DONTWAIT)
                return True
            unread = [each for each in self._unread.get(to, ()) if not each[0].done]
            if sum(size for _tracker, size in unread) + len(body) > UNREAD_MAX_BYTES and unread:
                return True
            self._send(to, _SNDMORE | _DONTWAIT)
            tracker = cast("zmq.MessageTracker", self._send(body, _DONTWAIT, False, True))
            self._unread[to] = [*unread, (tracker, len(body))]
        except zmq.Again:
            pass  # it does not read; its next renewal tells it what it missed
        except zmq.ZMQError as error:
            return error.errno != zmq.EHOSTUNREACH
        return True

    def _monitored(self) -> zmq.Socket[bytes]:
        """Where libzmq tells of connections that end."""
        monitor = self._context.socket(zmq.PAIR)
        monitor.setsockopt(zmq.RCVHWM, 0)  # libzmq's thread would wait for us if this were full
        self.socket.monitor("inproc://ended", zmq.EVENT_DISCONNECTED)
        monitor.connect("inproc://ended")
        return monitor

    def close(self) -> None:
        """Close the socket, and wait until what was sent is on its way."""
        if self._monitor is not None:
            self.socket.disable_monitor()
            self._monitor.close(0)
        self.socket.close()
        self._context.term()
