"""Master: registry of publishers and subscribers. Messages never pass through it.

Attachments, such as the gateway, run in the master's process: they start when the master is bound, close
before the master, change the graph with `Master.submit`, and are notified of every change.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from nep.errors import ClosedError, RequestRefusedError
from nep.masters.graph import Graph
from nep.masters.leases import LEASE_DURATION_S
from nep.masters.process import Owner, is_running, listen, start_process
from nep.masters.server import MasterServer
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import GraphReply, Listen, QueryGraph, RejectedReply, Reply, Request
from nep.system.addresses import master_address
from nep.system.computer import computer_id
from nep.system.forks import current_generation

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Attachment", "Master", "is_running", "listen", "master_address", "start_process"]


class Attachment(Protocol):
    """Component that runs with a master, such as the gateway. Its methods must return quickly."""

    def start(self, master: Master) -> None:
        """Start the component. An exception aborts the start of the master.

        The master already executes `Master.submit`, but doesn't reply to other programs yet.
        """

    def changed(self, view: GraphView) -> None:
        """Handle a change of the graph. Called in the master's thread; must return immediately."""

    def close(self) -> None:
        """Close the component before the master. Called once, in the thread that closes the master."""


class Master:
    """Master at which nodes register and find each other. Usable as a context manager.

        with nep.master() as master:
            print(master.address)

    Args:
        address: Address such as "127.0.0.1:7780"; port 0 chooses a free port. Default: `master_address`.
        attachments: Components that run with the master, such as the gateway.
        learn_s: Time after the start in seconds in which nodes of a previous master rejoin; 0 if there was
            none.
        lease_s: Silence in seconds after which a node is unregistered.
        owner_pid: Stop when this process has ended and no node of another process is registered.
    """

    def __init__(
        self,
        address: str | None = None,
        *,
        attachments: Sequence[Attachment] = (),
        learn_s: float = 1.0,
        lease_s: float = LEASE_DURATION_S,
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
        self._generation = current_generation()

    def start(self) -> Self:
        """Bind the address, start the attachments and serve requests. Return self.

        Raises:
            AddressInUseError: Another program uses the address.
            TooManyFilesError: The process has too many open files.
        """
        graph = Graph(self.epoch, time.monotonic(), self._learn_s, self._lease_s, computer_id())
        listeners = [attachment.changed for attachment in self._attachments]
        server = MasterServer(self.address, graph, listeners, self._owner)
        self._generation, self._lock = current_generation(), threading.Lock()
        self.address = server.address
        self._server = server
        server.start()
        started_attachments: list[Attachment] = []
        try:
            for attachment in self._attachments:
                attachment.start(self)
                started_attachments.append(attachment)
        except BaseException:
            for attachment in reversed(started_attachments):
                attachment.close()
            self._server = None
            server.close()
            raise
        server.open()
        return self

    def close(self) -> None:
        """Close the attachments and stop. Idempotent. Callable from any thread except the master's."""
        if self._generation.is_inherited:
            return
        with self._lock:
            server, self._server = self._server, None
        if server is None:
            return
        for attachment in reversed(self._attachments):
            attachment.close()
        server.close()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the master has stopped; return False after the time limit.

        Args:
            timeout_s: Time limit in seconds; None waits without limit.
        """
        server = self._server
        if server is None or self._generation.is_inherited:
            return True
        if timeout_s is not None:
            return server.ended.wait(timeout_s)
        while not server.ended.wait(0.1):
            pass  # slices: on Windows Ctrl+C does not interrupt a wait
        return True

    def submit(self, request: Request, timeout_s: float = 2.0) -> Reply:
        """Execute a request of this process and return the reply, which may be `RejectedReply`.

        Callable from any thread except the master's.

        Raises:
            ClosedError: The master has stopped.
            WaitTimeoutError: The master did not reply in time.
        """
        server = self._server
        is_forked = self._generation.is_inherited
        if is_forked or server is None or server.ended.is_set():
            raise ClosedError(f"the master at '{self.address}'", is_forked=is_forked)
        return server.submit(request, timeout_s)

    def listen(self, hosts: Sequence[str]) -> None:
        """Serve other computers at these addresses of this computer; if empty, serve only this computer.

        Raises:
            RequestRefusedError: An address can't be bound.
            ClosedError: The master has stopped.
            WaitTimeoutError: The master did not reply in time.
        """
        reply = self.submit(Listen(tuple(hosts)))
        if isinstance(reply, RejectedReply):
            raise RequestRefusedError(reply.reason)

    def view(self) -> GraphView:
        """Return a snapshot of the graph.

        Raises:
            ClosedError: The master has stopped.
            WaitTimeoutError: The master did not reply in time.
        """
        reply = self.submit(QueryGraph())
        if not isinstance(reply, GraphReply):
            raise ClosedError(f"the master at '{self.address}'")
        return reply.view

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_exc: object) -> None:
        self.close()
