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

import zmq
from msgspec.structs import replace

from nep.backends.zeromq.sockets import Socket, bind_free_port, enable_keep_alive
from nep.errors import AddressInUseError, TooManyFilesError
from nep.protocol.requests import RemotePublisher
from nep.system.addresses import LOOPBACK, endpoint_of, is_loopback, reachable_endpoint
from nep.system.descriptors import has_free_descriptors

_logger = logging.getLogger("nep")
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


def _bind_unix_socket(zmq_socket: Socket, endpoint: str) -> str:
    name = (
        unix_socket_name(endpoint)
        if has_unix_sockets()
        and has_free_descriptors(_MIN_FREE_FDS_TO_BIND)
        and os.environ.get("NEP_LOCAL", "") != "0"
        else ""
    )
    if name:
        try:
            zmq_socket.bind(name)
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
        may_bind_unix_sockets: True to bind Unix sockets as well.
        has_silence_check: True if the owner itself closes connections that don't respond; see
            `enable_keep_alive`.
    """

    def __init__(
        self, socket: Socket, *, may_bind_unix_sockets: bool, has_silence_check: bool = False
    ) -> None:
        self._socket = socket
        self._may_bind_unix_sockets = may_bind_unix_sockets
        self._has_silence_check = has_silence_check
        self._endpoints_by_host: dict[str, str] = {}
        self._unix_sockets_by_host: dict[str, str] = {}
        """Names of the bound Unix sockets, by host."""

    @property
    def is_local(self) -> bool:
        """True if a Unix socket is bound in addition to the loopback endpoint."""
        return bool(self._unix_sockets_by_host)

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All bound endpoints."""
        return (*self._endpoints_by_host.values(), *self._unix_sockets_by_host.values())

    def move(self, hosts: Sequence[str]) -> tuple[str, ...]:
        """Bind these hosts and unbind all others; return the endpoints in the order of `hosts`.

        Each host gets its own port. Hosts that can't be bound are skipped. If none of them can be
        bound, raises `AddressInUseError` or `TooManyFilesError`.
        """
        for host in [bound_host for bound_host in self._endpoints_by_host if bound_host not in hosts]:
            self._unbind_host(host)
        last_error: AddressInUseError | TooManyFilesError | None = None
        for host in hosts:
            if host not in self._endpoints_by_host:
                try:
                    enable_keep_alive(
                        self._socket, endpoint_of(f"{host}:*"), has_silence_check=self._has_silence_check
                    )
                    self._endpoints_by_host[host] = endpoint = bind_free_port(self._socket, host)
                    name = _bind_unix_socket(self._socket, endpoint) if self._may_bind_unix_sockets else ""
                    if name:
                        self._unix_sockets_by_host[host] = name
                except (AddressInUseError, TooManyFilesError) as error:
                    last_error = error
        if last_error is not None and not self._endpoints_by_host:
            raise last_error
        return tuple(self._endpoints_by_host[host] for host in hosts if host in self._endpoints_by_host)

    def unbind_local(self) -> None:
        """Unbind the Unix sockets; existing connections stay open."""
        for name in self._unix_sockets_by_host.values():
            self._unbind(name)
        self._unix_sockets_by_host.clear()

    def _unbind_host(self, host: str) -> None:
        endpoints = self._endpoints_by_host.pop(host), self._unix_sockets_by_host.pop(host, "")
        for endpoint in filter(None, endpoints):
            self._unbind(endpoint)

    def _unbind(self, endpoint: str) -> None:
        try:
            self._socket.unbind(endpoint)
        except zmq.ZMQError as error:  # the address has disappeared, and with it the binding
            _logger.debug("can't unbind '%s': %s", endpoint, error)
