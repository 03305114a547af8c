"""MasterPort: the master's ROUTER socket: requests in, bodies out. For the master's thread only."""

from __future__ import annotations

from collections.abc import Callable

import zmq

from nep.addresses import endpoint_of
from nep.errors import AddressInUseError

__all__ = ["MasterPort"]

REQUEST_MAX_BYTES = 64 * 2**20
"""Whoever sends more in one part is disconnected."""
_DONTWAIT, _SNDMORE = int(zmq.DONTWAIT), int(zmq.SNDMORE)


class MasterPort:
    """Raises `AddressInUseError` when `address` cannot be bound."""

    def __init__(self, address: str) -> None:
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self.socket = self._context.socket(zmq.ROUTER)
        # Without pyzmq's layer for routing ids and groups, which takes half of the time.
        self._send: Callable[..., object] = super(zmq.Socket, self.socket).send
        self.socket.setsockopt(zmq.LINGER, 200)
        self.socket.setsockopt(zmq.ROUTER_MANDATORY, 1)  # an error instead of silence when a peer is gone
        self.socket.setsockopt(zmq.ROUTER_HANDOVER, 1)  # a node that reconnects takes its name over
        self.socket.setsockopt(zmq.SNDHWM, 10_000)
        self.socket.setsockopt(zmq.MAXMSGSIZE, REQUEST_MAX_BYTES)
        try:
            self.socket.bind(endpoint_of(address))
        except zmq.ZMQError as error:
            self.close()
            raise AddressInUseError(address) from error
        self.address = self.socket.getsockopt_string(zmq.LAST_ENDPOINT).removeprefix("tcp://")

    def receive(self, *, with_address: bool) -> tuple[list[bytes], str]:
        """The parts of a request, who asks first, and the address it came from if that is wanted.

        Raises `zmq.Again` when there is none.
        """
        recv = self.socket.recv
        frames = [recv(_DONTWAIT, False)]
        while frames[-1].more:
            frames.append(recv(_DONTWAIT, False))
        address = str(frames[0].get("Peer-Address")) if with_address else ""
        return [frame.bytes for frame in frames], address

    def send(self, to: bytes, body: bytes) -> bool:
        """Send a body; False when its node has no connection any more."""
        try:
            self._send(to, _SNDMORE | _DONTWAIT)
            self._send(body, _DONTWAIT)
        except zmq.Again:
            pass  # it does not read; its next renewal tells it what it missed
        except zmq.ZMQError as error:
            return error.errno != zmq.EHOSTUNREACH
        return True

    def close(self) -> None:
        """Close the socket, and wait until what was sent is on its way."""
        self.socket.close()
        self._context.term()
