"""Master: the program that knows who publishes and who subscribes. Data never pass through it.

What is attached to a master (the gateway) lives in the same process: it is started when the master is bound
and closed before the master is, changes the graph with `Master.submit`, and is told of every change.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from nep.errors import ClosedError, RequestRefusedError
from nep.masters.graph import Graph
from nep.masters.leases import LEASE_S
from nep.masters.process import Owner, is_running, listen, start_process
from nep.masters.server import MasterServer
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import Listen, Look, Refused, Reply, Request, Seen
from nep.system.addresses import master_address
from nep.system.computer import computer_id
from nep.system.forks import give_up, watch

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Attachment", "Master", "is_running", "listen", "master_address", "start_process"]


class Attachment(Protocol):
    """Something that lives with a master. Its methods return soon."""

    def start(self, master: Master) -> None:
        """The master is bound and answers nobody yet but `submit`. An error here ends the start."""

    def changed(self, view: GraphView) -> None:
        """Who is there has changed. Called in the master's thread: take the view and return at once."""

    def close(self) -> None:
        """The master ends after this. Called once, in the thread that closes the master."""


class Master:
    """A master at `address` ("127.0.0.1:7780"; port 0 takes a free one). A context manager.

    `start()` raises `AddressInUseError` when something is there already. `address`: as `master_address` has
    it. `attachments`: what lives with it, such as the gateway. `lease_s`: a node that was silent for so long
    is unlisted, in seconds. `learn_s`: how long a master that
    has just started waits for nodes that an earlier one knew; 0 when there cannot have been one.
    `owner_pid`: end by itself when that process is gone and no node of another process is registered.
    """

    def __init__(
        self,
        address: str | None = None,
        *,
        attachments: Sequence[Attachment] = (),
        learn_s: float = 1.0,
        lease_s: float = LEASE_S,
        owner_pid: int | None = None,
    ) -> None:
        self.address = master_address(address)
        self.epoch = secrets.randbits(63) | 1
        self._attachments = tuple(attachments)
        self._learn_s = learn_s
        self._lease_s = lease_s
        self._owner = None if owner_pid is None else Owner(owner_pid)
        self._server: MasterServer | None = None
        self._lock = threading.Lock()
        self._is_forked = False
        watch(self)

    def start(self) -> Self:
        """Bind, start what is attached, answer. Returns itself."""
        graph = Graph(self.epoch, time.monotonic(), self._learn_s, self._lease_s, computer_id())
        listeners = [attachment.changed for attachment in self._attachments]
        server = MasterServer(self.address, graph, listeners, self._owner)
        self.address = server.address
        self._server = server
        server.start()
        started: list[Attachment] = []
        try:
            for attachment in self._attachments:
                attachment.start(self)
                started.append(attachment)
        except BaseException:
            for attachment in reversed(started):
                attachment.close()
            self._server = None
            server.close()
            raise
        server.open()
        return self

    def close(self) -> None:
        """Close what is attached, then end. May be called twice and from any thread but the master's."""
        with self._lock:
            server, self._server = self._server, None
        if server is None:
            return
        for attachment in reversed(self._attachments):
            attachment.close()
        server.close()

    def forked(self) -> None:
        """In a child that was forked: the master stays with the parent. See `nep.system.forks`."""
        if self._server is not None:
            give_up(*self._server.endpoints)
        self._server = None
        self._lock = threading.Lock()
        self._is_forked = True

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the master has ended, by itself (`owner_pid`) or by `close`; True when it has."""
        server = self._server
        if server is None:
            return True
        if timeout_s is not None:
            return server.ended.wait(timeout_s)
        while not server.ended.wait(0.1):
            pass  # in slices: Windows does not interrupt a wait for Ctrl+C
        return True

    def submit(self, request: Request, timeout_s: float = 2.0) -> Reply:
        """Carry out a request from inside this process; its reply may be `Refused`. From any other thread.

        Raises `ClosedError` when the master has ended, `WaitTimeoutError` when it does not get to it in time.
        """
        server = self._server
        if server is None or server.ended.is_set():
            raise ClosedError(f"the master at '{self.address}'", is_forked=self._is_forked)
        return server.submit(request, timeout_s)

    def listen(self, hosts: Sequence[str]) -> None:
        """Serve other computers at these addresses of this one, none: no more.

        Raises `RequestRefusedError` when it cannot be bound there, and as `view`.
        """
        reply = self.submit(Listen(tuple(hosts)))
        if isinstance(reply, Refused):
            raise RequestRefusedError(reply.reason)

    def view(self) -> GraphView:
        """The graph now.

        Raises `ClosedError` when it has ended, `WaitTimeoutError` when it does not get to it in time.
        """
        reply = self.submit(Look())
        if not isinstance(reply, Seen):
            raise ClosedError(f"the master at '{self.address}'")
        return reply.view

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_exc: object) -> None:
        self.close()
