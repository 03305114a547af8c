"""The addresses of this computer at which publishers' sockets are bound, and at which they are reached.

`Bindings` binds one endpoint at each address, and beside the loopback endpoint a local name where there is
one. Programs of one computer exchange small messages quicker through a Unix socket than through TCP, see
docs/adr/0011-local-sockets.md; messages of hundreds of kilobytes wait for its small buffer. Only Linux has
names for them that are no files, which somebody would have to clean up after a crash. A name holds the
publisher's loopback port, and that belongs to no other program.
With `NEP_LOCAL=0` publishers leave this out, for whoever wants to see the traffic with a network tool.
"""

from __future__ import annotations

import logging
import os
import socket
import sys
from collections.abc import Sequence
from dataclasses import replace

import zmq

from nep.backends.zeromq.sockets import LOOPBACK, Socket, bind_free_port, keep_alive
from nep.errors import AddressInUseError, TooManyFilesError
from nep.protocol.requests import RemotePublisher
from nep.system.addresses import endpoint_of, is_loopback, nearest
from nep.system.descriptors import has_room

__all__ = ["SMALL", "Bindings", "has_local_names", "in_reach", "local_of", "may_stay"]

_logger = logging.getLogger("nep")
SMALL = frozenset({"json", "string", "msgpack"})
"""Codecs of what is small as a rule: commands, answers, states."""
_TCP = f"tcp://{LOOPBACK}:"
_LOCAL = "ipc://@nep-"
_ROOM_TO_BIND = 384
_ROOM_TO_STAY = 192
"""So many connections at once come to nobody within the second in which room is looked for again."""
_reached: set[bool] = set()
"""Holds True once a program was reached in this way: then none is tried out any more."""


def has_local_names() -> bool:
    """Whether this computer has such names."""
    return sys.platform == "linux" and zmq.has("ipc")


def may_stay() -> bool:
    """Whether this process has room for those who come by such a name.

    libzmq 4.3 ends the program when it has no descriptor for them; who comes by TCP just waits.
    """
    return has_room(_ROOM_TO_STAY)


def local_of(endpoint: str) -> str:
    """The name beside a loopback endpoint; "" for any other."""
    return f"{_LOCAL}{endpoint.removeprefix(_TCP)}" if endpoint.startswith(_TCP) else ""


def _bind_beside(owner: Socket, endpoint: str) -> str:
    """Bind to the name beside a loopback endpoint; "" when it cannot be: then there is TCP."""
    name = (
        local_of(endpoint)
        if has_local_names() and has_room(_ROOM_TO_BIND) and os.environ.get("NEP_LOCAL", "") != "0"
        else ""
    )
    if name:
        try:
            owner.bind(name)
        except zmq.ZMQError as error:
            _logger.debug("'%s' could not be bound: %s", name, error)
            return ""
    return name


def _is_reached(name: str) -> bool:
    """Whether a program can be reached by this name: a sandbox may forbid it. Asked in earnest only once."""
    if not _reached:
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
                probe.connect("\0" + name.removeprefix("ipc://@"))
        except OSError as error:
            _logger.debug("'%s' could not be reached: %s", name, error)
            return False
        _reached.add(True)
    return True


def in_reach(remote: RemotePublisher, master: str) -> RemotePublisher:
    """A publisher with the one endpoint at which a program reaches it that knows its master as `master`.

    On the master's computer that is the publisher's name, where it has one.
    """
    publisher = remote.publisher
    if not publisher.endpoints:
        return remote
    chosen = nearest(publisher.endpoints, master)
    if publisher.local and has_local_names() and is_loopback(master):
        name = local_of(chosen)
        chosen = name if name and _is_reached(name) else chosen
    return replace(remote, publisher=replace(publisher, endpoints=(chosen,) if chosen else ()))


class Bindings:
    """Belongs to the owner of `socket` and is used under its lock. `may_be_local`: bind the names, too.

    `is_watched`: the owner looks after silent connections, see `keep_alive`.
    """

    def __init__(self, socket: Socket, *, may_be_local: bool, is_watched: bool = False) -> None:
        self._socket = socket
        self._may_be_local = may_be_local
        self._is_watched = is_watched
        self._bound: dict[str, str] = {}
        self._local: dict[str, str] = {}
        """The names beside them, by host."""

    @property
    def is_local(self) -> bool:
        """Whether it is also bound to the name beside its loopback endpoint."""
        return bool(self._local)

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All that it is bound to."""
        return (*self._bound.values(), *self._local.values())

    def move(self, hosts: Sequence[str]) -> tuple[str, ...]:
        """Bind at these hosts and no others, each with a port of its own; the endpoints, in their order.

        A host at which nothing can be bound is left out; raises `AddressInUseError` or
        `TooManyFilesError` when none is left.
        """
        for host in [known for known in self._bound if known not in hosts]:
            self._leave(host)
        problem: AddressInUseError | TooManyFilesError | None = None
        for host in hosts:
            if host not in self._bound:
                try:
                    keep_alive(self._socket, endpoint_of(f"{host}:*"), is_watched=self._is_watched)
                    self._bound[host] = bind_free_port(self._socket, host)
                    name = _bind_beside(self._socket, self._bound[host]) if self._may_be_local else ""
                    if name:
                        self._local[host] = name
                except (AddressInUseError, TooManyFilesError) as error:
                    problem = error
        if problem is not None and not self._bound:
            raise problem
        return tuple(self._bound[host] for host in hosts if host in self._bound)

    def leave_local(self) -> None:
        """Be reached by TCP only from now on. Connections that are there stay."""
        for name in self._local.values():
            self._unbind(name)
        self._local.clear()

    def _leave(self, host: str) -> None:
        for endpoint in filter(None, (self._bound.pop(host), self._local.pop(host, ""))):
            self._unbind(endpoint)

    def _unbind(self, endpoint: str) -> None:
        try:
            self._socket.unbind(endpoint)
        except zmq.ZMQError as error:  # the address is gone: there was nothing to give back
            _logger.debug("'%s' could not be unbound: %s", endpoint, error)
