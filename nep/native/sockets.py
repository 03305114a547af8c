"""What all native sockets need: bounds in bytes, free ports, waits in slices."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable

import zmq

from nep.addresses import endpoint_of, host_of, is_loopback
from nep.errors import AddressInUseError

__all__ = ["Budget", "bind", "bind_free_port", "connect", "host_towards", "wait_until"]

Socket = zmq.Socket[bytes]

_SLICE_S = 0.1
_ORIGINAL_PORTS = frozenset({7000, 7777, 7780, 12345, 50000, *range(9000, 10000)})
"""Ports that programs of the original NEP expect to find something else on."""


class Budget:
    """Keeps a ZeroMQ queue within a number of bytes: libzmq only counts messages.

    The high-water mark `option` is lowered when messages turn out large; it acts on open connections too.
    """

    def __init__(self, option: int, max_bytes: int, most: int, least: int) -> None:
        self._option = option
        self._max_bytes = max_bytes
        self._most = most
        self._least = least
        self._fits = 0
        """Messages up to this size are within the budget already."""

    def begin(self, owner: Socket) -> None:
        """Set the mark for small messages."""
        owner.setsockopt(self._option, self._most)
        self._fits = max(1024, self._max_bytes // self._most)

    def note(self, owner: Socket, size_bytes: int) -> None:
        """A message of this size is about to be queued, or was."""
        if size_bytes > self._fits:
            self._fits = 1 << (size_bytes - 1).bit_length()
            mark = min(self._most, max(self._least, self._max_bytes // self._fits))
            owner.setsockopt(self._option, mark)


def bind_free_port(owner: Socket, host: str) -> str:
    """Bind to a free port of `host`, none of the original NEP's; the endpoint. Raises `AddressInUseError`."""
    for _ in range(100):
        endpoint = bind(owner, f"{host}:*")
        if int(endpoint.rpartition(":")[2]) not in _ORIGINAL_PORTS:
            return endpoint
        owner.unbind(endpoint)
    raise AddressInUseError(f"{host}:*")


def bind(owner: Socket, address: str) -> str:
    """Bind to an address; the endpoint. Raises `AddressInUseError`."""
    try:
        owner.bind(endpoint_of(address))
    except zmq.ZMQError as error:
        raise AddressInUseError(address) from error
    return owner.getsockopt_string(zmq.LAST_ENDPOINT)


def connect(owner: Socket, address: str) -> str:
    """Connect to an address, whether something is there yet or not; the endpoint."""
    endpoint = endpoint_of(address)
    owner.connect(endpoint)
    return endpoint


def host_towards(address: str) -> str:
    """The address of this computer under which a master at `address` sees it."""
    if is_loopback(address):
        return "127.0.0.1"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((host_of(address), 9))  # sends nothing: it only chooses the way
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])


def wait_until(changed: threading.Condition, is_met: Callable[[], bool], timeout_s: float) -> bool:
    """Wait, holding `changed`, until `is_met()`; whether it is. In slices, for Ctrl+C on Windows."""
    deadline = time.monotonic() + timeout_s
    while not is_met():
        left = deadline - time.monotonic()
        if left <= 0.0:
            return False
        changed.wait(min(left, _SLICE_S))
    return True
