"""Fork support: objects that must be discarded in a forked child process (Linux, macOS).

A child process gets a copy of the memory, but only the thread that called fork: I/O threads are missing,
locks stay held, and descriptors are shared with the parent. Objects with sockets can't be used or even closed
in a child, because one byte written to an inherited descriptor would wake the parent's threads. Owners of
such objects are registered here and notified in a child.

A long-lived child would keep the parent's ports and connections open, and peers would not notice when the
parent closes them. libzmq doesn't expose its descriptors, so they are found by their addresses and closed.
"""

from __future__ import annotations

import contextlib
import os
import socket
import stat
import sys
from collections.abc import Callable
from typing import Protocol
from weakref import WeakSet


class ForkAware(Protocol):
    """Object that must not be used in a forked child process."""

    def forked(self) -> None:
        """Mark the object as closed in a child process, without taking a lock or touching a ZeroMQ socket."""


_fork_aware_objects: WeakSet[ForkAware] = WeakSet()
_handlers: list[Callable[[], None]] = []
_inherited_endpoints: set[str] = set()
_DESCRIPTOR_FOLDER = "/proc/self/fd" if sys.platform == "linux" else "/dev/fd"
_ANY_HOSTS = frozenset({"*", "0.0.0.0"})  # noqa: S104 - nothing is bound


def notify_after_fork(owner: ForkAware) -> None:
    """Register an object whose `forked` is called in every child process. Only a weak reference is stored."""
    _fork_aware_objects.add(owner)


def close_in_child(*endpoints: str) -> None:
    """Close the sockets in this child process that are bound to, accepted at or connected to these endpoints.

    Call this in `forked`; the sockets are closed after all owners were notified. Endpoints have the form
    `tcp://IPV4:PORT` or `ipc://@NAME`; others are ignored.
    """
    _inherited_endpoints.update(endpoints)


def call_in_child(call: Callable[[], None]) -> None:
    """Register a function to be called in every child process, after the `forked` of all objects.

    For the global state of modules; use `notify_after_fork` for objects.
    """
    _handlers.append(call)


def _notify_owners() -> None:
    owners = list(_fork_aware_objects)
    _fork_aware_objects.clear()
    for callback in (*(owner.forked for owner in owners), *_handlers):
        with contextlib.suppress(Exception):  # a failure must not prevent the others
            callback()
    if _inherited_endpoints:
        with contextlib.suppress(OSError):
            _close_sockets(*_addresses(_inherited_endpoints))
        _inherited_endpoints.clear()


def _addresses(endpoints: set[str]) -> tuple[set[object], set[object]]:
    # Addresses as the socket module represents them, and ports bound to all addresses.
    exact: set[object] = set()
    ports: set[object] = set()
    for endpoint in endpoints:
        scheme, _colon, address = endpoint.partition("://")
        host, _colon, port = address.rpartition(":")
        if scheme == "ipc" and address.startswith("@"):
            exact.add(b"\0" + address[1:].encode())
        elif scheme == "tcp" and port.isdigit():
            exact.add((host, int(port)))
            if host in _ANY_HOSTS:
                ports.add(int(port))
    return exact, ports


def _close_sockets(exact: set[object], ports: set[object]) -> None:
    # With a default timeout (rospy sets one) Python makes each inspected socket non-blocking, which the
    # parent shares: its blocking `accept` would fail.
    default_timeout_s = socket.getdefaulttimeout()
    socket.setdefaulttimeout(None)
    try:
        _close_matching(exact, ports)
    finally:
        socket.setdefaulttimeout(default_timeout_s)


def _close_matching(exact: set[object], ports: set[object]) -> None:
    for name in os.listdir(_DESCRIPTOR_FOLDER):  # noqa: PTH208 - plain numbers
        with contextlib.suppress(OSError, ValueError):  # the listing's own descriptor is closed already
            number = int(name)
            if stat.S_ISSOCK(os.fstat(number).st_mode) and any(
                address in exact or (isinstance(address, tuple) and address[1] in ports)
                for address in _socket_addresses(number)
            ):
                os.close(number)


def _socket_addresses(number: int) -> list[object]:
    addresses: list[object] = []
    sock = socket.socket(fileno=number)
    try:
        for get_address in (sock.getsockname, sock.getpeername):
            with contextlib.suppress(OSError):
                addresses.append(get_address())
    finally:
        sock.detach()
    return addresses


if sys.platform != "win32":
    os.register_at_fork(after_in_child=_notify_owners)
