"""Places: the addresses of this computer at which a publisher's socket is bound, one endpoint each.

Where there is one, the name beside the loopback endpoint is bound with it: see `local`.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import zmq

from nep.backends.zeromq.local import bind_beside
from nep.backends.zeromq.sockets import Socket, bind_free_port
from nep.errors import AddressInUseError, TooManyFilesError

__all__ = ["Places"]

_logger = logging.getLogger("nep")


class Places:
    """Belongs to the owner of `socket` and is used under its lock. `may_be_local`: bind the names, too."""

    def __init__(self, socket: Socket, *, may_be_local: bool) -> None:
        self._socket = socket
        self._may_be_local = may_be_local
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
                    self._bound[host] = bind_free_port(self._socket, host)
                    name = bind_beside(self._socket, self._bound[host]) if self._may_be_local else ""
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
