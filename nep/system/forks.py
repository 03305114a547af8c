"""Forks: what a child that this process forks is told to forget (Linux, macOS).

A child has a copy of the memory, but no other thread than the one that forked: the threads that serve
sockets are missing, locks stay as they were held, and every descriptor is the parent's too. So nothing that
serves sockets can be used or even closed in a child: one byte to an inherited descriptor would reach the
parent's threads. Objects that own such things are watched here, and told when they are in a child.

A child that lives on would hold its parent's ports and connections: nobody would see that the parent closes
them. libzmq does not tell which descriptors are its own, so they are known by their addresses, and closed.
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

__all__ = ["Inherited", "give_up", "in_child", "watch"]


class Inherited(Protocol):
    """Something that a forked child inherits and cannot use."""

    def forked(self) -> None:
        """This is a child now: be closed, without taking a lock or touching a socket of ZeroMQ's."""


_watched: WeakSet[Inherited] = WeakSet()
_calls: list[Callable[[], None]] = []
_given_up: set[str] = set()
_FOLDER = "/proc/self/fd" if sys.platform == "linux" else "/dev/fd"
_EVERYWHERE = frozenset({"*", "0.0.0.0"})  # noqa: S104 - nothing is bound here


def watch(owner: Inherited) -> None:
    """Tell `owner` in every child; it is not kept alive."""
    _watched.add(owner)


def give_up(*endpoints: str) -> None:
    """For `forked`: the child closes its sockets that are bound there, were accepted there, or lead there.

    Endpoints are ZeroMQ's, `tcp://HOST:PORT` with an address of IPv4 or `ipc://@NAME`; others are left alone.
    """
    _given_up.update(endpoints)


def in_child(call: Callable[[], None]) -> None:
    """Call this in every child, after all owners were told. For modules."""
    _calls.append(call)


def _tell() -> None:
    owners = list(_watched)
    _watched.clear()
    for tell in (*(owner.forked for owner in owners), *_calls):
        with contextlib.suppress(Exception):  # one that fails must not leave the others as they were
            tell()
    if _given_up:
        with contextlib.suppress(OSError):
            _close_sockets(*_addresses(_given_up))
        _given_up.clear()


def _addresses(endpoints: set[str]) -> tuple[set[object], set[object]]:
    """Addresses as the system writes them, and ports that belong to every address of this computer."""
    exact: set[object] = set()
    ports: set[object] = set()
    for endpoint in endpoints:
        scheme, _colon, place = endpoint.partition("://")
        host, _colon, port = place.rpartition(":")
        if scheme == "ipc" and place.startswith("@"):
            exact.add(b"\0" + place[1:].encode())
        elif scheme == "tcp" and port.isdigit():
            exact.add((host, int(port)))
            if host in _EVERYWHERE:
                ports.add(int(port))
    return exact, ports


def _close_sockets(exact: set[object], ports: set[object]) -> None:
    # With a default time-out (rospy sets one) Python would make each socket that is looked at non-blocking,
    # and that is shared with the parent: who waits there in `accept` would get an error.
    usual = socket.getdefaulttimeout()
    socket.setdefaulttimeout(None)
    try:
        _close_those_at(exact, ports)
    finally:
        socket.setdefaulttimeout(usual)


def _close_those_at(exact: set[object], ports: set[object]) -> None:
    for name in os.listdir(_FOLDER):  # noqa: PTH208 - numbers
        with contextlib.suppress(OSError, ValueError):  # the list's own descriptor is gone by now
            number = int(name)
            if stat.S_ISSOCK(os.fstat(number).st_mode) and any(
                address in exact or (isinstance(address, tuple) and address[1] in ports)
                for address in _ends_of(number)
            ):
                os.close(number)


def _ends_of(number: int) -> list[object]:
    """The addresses of both ends of a socket, as far as it has them."""
    ends: list[object] = []
    known = socket.socket(fileno=number)
    try:
        for ask in (known.getsockname, known.getpeername):
            with contextlib.suppress(OSError):
                ends.append(ask())
    finally:
        known.detach()
    return ends


if sys.platform != "win32":
    os.register_at_fork(after_in_child=_tell)
