"""Fork support: what a forked child process must not use or keep (Linux, macOS).

A child process gets a copy of the memory, but only the thread that called fork: I/O threads are missing,
locks stay held, and descriptors are shared with the parent. Objects with threads or sockets can't be used or
even closed in a child, because one byte written to an inherited descriptor would wake the parent's threads.
Such objects remember the `Generation` in which they were created, and check it before they acquire a lock.

A long-lived child would keep the parent's ports and connections open, and peers would not notice when the
parent closes them. libzmq doesn't expose its descriptors, so they are found by their addresses and closed.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import socket
import stat
import sys
from collections.abc import Callable
from types import MethodType
from weakref import WeakKeyDictionary


class Generation:
    """Life of a process up to the next fork, in which objects were created.

    A shared object instead of a number: checking its attribute costs a publisher 2 ns per message.
    """

    def __init__(self) -> None:
        self.is_inherited = False
        """True in a forked child process: objects of this generation belong to the parent process."""


_generation = Generation()
_methods: WeakKeyDictionary[object, Callable[..., object]] = WeakKeyDictionary()
_functions: list[Callable[[], object]] = []
_inherited_endpoints: set[str] = set()
_DESCRIPTOR_FOLDER = "/proc/self/fd" if sys.platform == "linux" else "/dev/fd"
_ANY_HOSTS = frozenset({"*", "0.0.0.0"})  # noqa: S104 - nothing is bound


def current_generation() -> Generation:
    """Return the generation of this process."""
    return _generation


def call_in_child(call: Callable[[], object]) -> None:
    """Register a function to be called in every child process, or a method for the next child process.

    Methods are called first. They must not acquire a lock or touch a ZeroMQ socket, and their objects are
    referenced only weakly. An object can have one method.
    """
    if isinstance(call, MethodType):
        _methods[call.__self__] = call.__func__
    else:
        _functions.append(call)


def close_in_child(*endpoints: str) -> None:
    """Close the sockets in this child process that are bound to, accepted at or connected to these endpoints.

    Call this in a method of `call_in_child`; the sockets are closed after all methods and functions were
    called. Endpoints have the form `tcp://IPV4:PORT` or `ipc://@NAME`; others are ignored.
    """
    _inherited_endpoints.update(endpoints)


def prevent_finalization(*instances: object) -> None:
    """Prevent objects, and everything that they reference, from ever being finalized, even at exit.

    In a forked child process, finalizing an object of a library could block, or notify the network.
    """
    for instance in instances:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(instance))


def _begin_generation() -> None:
    # Called in the child process.
    global _generation  # noqa: PLW0603 - one per process
    _generation.is_inherited = True
    _generation = Generation()
    calls: list[Callable[[], object]] = [MethodType(function, owner) for owner, function in _methods.items()]
    _methods.clear()
    for call in (*calls, *_functions):
        with contextlib.suppress(Exception):  # a failure must not prevent the others
            call()
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
    os.register_at_fork(after_in_child=_begin_generation)
