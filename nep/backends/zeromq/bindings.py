"""Endpoints that a publisher's socket binds, and selection of the endpoint that a subscriber connects to.

`Bindings` binds one endpoint per address and, on Linux, an abstract Unix socket in addition to the
loopback endpoint. For small messages between programs of one computer, Unix sockets are faster than TCP
(docs/adr/0011-local-sockets.md), but messages of hundreds of kilobytes stall on the small socket
buffer. Only Linux has abstract names, which need no clean-up after a crash. The name contains the
publisher's loopback port, which makes it unique.

Set `NEP_LOCAL=0` to disable Unix sockets, for example to capture the traffic with a network tool.
"""

from __future__ import annotations

import logging
import os
import socket
import sys
from collections.abc import Sequence
from dataclasses import replace

import zmq

from nep.backends.zeromq.sockets import LOOPBACK, Socket, bind_free_port, enable_keep_alive
from nep.errors import AddressInUseError, TooManyFilesError
from nep.protocol.requests import RemotePublisher
from nep.system.addresses import endpoint_of, is_loopback, reachable_endpoint
from nep.system.descriptors import has_free_descriptors

_logger = logging.getLogger("nep")
SMALL_CODECS = frozenset({"json", "string", "msgpack"})
"""Codecs whose messages are usually small, such as commands, replies and states."""
_TCP_PREFIX = f"tcp://{LOOPBACK}:"
_UNIX_SOCKET_PREFIX = "ipc://@nep-"
_MIN_FREE_FDS_TO_BIND = 384
_MIN_FREE_FDS_TO_ACCEPT = 192
"""Minimum number of free file descriptors for using Unix sockets.

Enough for all connections that can arrive between two checks.
"""
_probe_results: set[bool] = set()
"""Set that contains True after the first successful probe; later probes are then skipped."""


def has_unix_sockets() -> bool:
    """Return True if abstract Unix sockets can be used on this system."""
    return sys.platform == "linux" and zmq.has("ipc")


def has_room_for_unix_sockets() -> bool:
    """Return True if this process has enough free descriptors to accept connections on a Unix socket.

    Without a free descriptor, libzmq 4.3 aborts the process when a connection arrives on a Unix socket; TCP
    connections wait in the kernel instead.
    """
    return has_free_descriptors(_MIN_FREE_FDS_TO_ACCEPT)


def unix_socket_name(endpoint: str) -> str:
    """Return the Unix socket name for a loopback endpoint; "" for other endpoints."""
    return (
        f"{_UNIX_SOCKET_PREFIX}{endpoint.removeprefix(_TCP_PREFIX)}"
        if endpoint.startswith(_TCP_PREFIX)
        else ""
    )


def _bind_unix_socket(owner: Socket, endpoint: str) -> str:
    name = (
        unix_socket_name(endpoint)
        if has_unix_sockets()
        and has_free_descriptors(_MIN_FREE_FDS_TO_BIND)
        and os.environ.get("NEP_LOCAL", "") != "0"
        else ""
    )
    if name:
        try:
            owner.bind(name)
        except zmq.ZMQError as error:
            _logger.debug("can't bind '%s': %s", name, error)
            return ""
    return name


def _is_reachable(name: str) -> bool:
    # A sandbox may block Unix sockets. The first success is cached.
    if not _probe_results:
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
                probe.connect("\0" + name.removeprefix("ipc://@"))
        except OSError as error:
            _logger.debug("can't connect to '%s': %s", name, error)
            return False
        _probe_results.add(True)
    return True


def select_endpoint(remote: RemotePublisher, master: str) -> RemotePublisher:
    """Return a publisher's record with only the endpoint that this node should connect to.

    If the master is on this computer and the publisher has a Unix socket, this is the Unix socket.

    Args:
        remote: Publisher with all its endpoints.
        master: Address at which this node reaches its master.
    """
    publisher = remote.publisher
    if not publisher.endpoints:
        return remote
    endpoint = reachable_endpoint(publisher.endpoints, master)
    if publisher.local and has_unix_sockets() and is_loopback(master):
        name = unix_socket_name(endpoint)
        endpoint = name if name and _is_reachable(name) else endpoint
    return replace(remote, publisher=replace(publisher, endpoints=(endpoint,) if endpoint else ()))


class Bindings:
    """Endpoints to which a socket is bound. Guarded by the lock of the socket's owner.

    Args:
        socket: Socket to bind.
        may_be_local: True to bind Unix sockets as well.
        is_watched: True if the owner itself closes connections that don't respond; see `enable_keep_alive`.
    """

    def __init__(self, socket: Socket, *, may_be_local: bool, is_watched: bool = False) -> None:
        self._socket = socket
        self._may_be_local = may_be_local
        self._is_watched = is_watched
        self._bound: dict[str, str] = {}
        self._local: dict[str, str] = {}
        """Names of the bound Unix sockets, by host."""

    @property
    def is_local(self) -> bool:
        """True if a Unix socket is bound in addition to the loopback endpoint."""
        return bool(self._local)

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All bound endpoints."""
        return (*self._bound.values(), *self._local.values())

    def move(self, hosts: Sequence[str]) -> tuple[str, ...]:
        """Bind these hosts and unbind all others; return the endpoints in the order of `hosts`.

        Each host gets its own port. Hosts that can't be bound are skipped. If none of them can be
        bound, raises `AddressInUseError` or `TooManyFilesError`.
        """
        for host in [bound_host for bound_host in self._bound if bound_host not in hosts]:
            self._unbind_host(host)
        problem: AddressInUseError | TooManyFilesError | None = None
        for host in hosts:
            if host not in self._bound:
                try:
                    enable_keep_alive(self._socket, endpoint_of(f"{host}:*"), is_watched=self._is_watched)
                    self._bound[host] = bind_free_port(self._socket, host)
                    name = _bind_unix_socket(self._socket, self._bound[host]) if self._may_be_local else ""
                    if name:
                        self._local[host] = name
                except (AddressInUseError, TooManyFilesError) as error:
                    problem = error
        if problem is not None and not self._bound:
            raise problem
        return tuple(self._bound[host] for host in hosts if host in self._bound)

    def unbind_local(self) -> None:
        """Unbind the Unix sockets; existing connections stay open."""
        for name in self._local.values():
            self._unbind(name)
        self._local.clear()

    def _unbind_host(self, host: str) -> None:
        for endpoint in filter(None, (self._bound.pop(host), self._local.pop(host, ""))):
            self._unbind(endpoint)

    def _unbind(self, endpoint: str) -> None:
        try:
            self._socket.unbind(endpoint)
        except zmq.ZMQError as error:  # the address has disappeared, and with it the binding
            _logger.debug("can't unbind '%s': %s", endpoint, error)
