"""Open servers, clients and surveyors of one node."""

from __future__ import annotations

import threading
import time
from typing import Generic, TypeVar

from nep.backends.bases.deadlines import Deadlines
from nep.backends.services import ClientTransport, ServerTransport, SurveyTransport
from nep.errors import ClosedError

S = TypeVar("S", bound=ServerTransport)
C = TypeVar("C", bound=ClientTransport | SurveyTransport)


class OpenServices(Generic[S, C]):
    """Open servers, clients and surveyors of one node, and the timeout thread of the clients. Thread-safe.

    Args:
        node_name: Name of the node.
    """

    def __init__(self, node_name: str) -> None:
        self.deadlines = Deadlines(node_name)
        """Timeout thread for clients that need one."""
        self.servers: tuple[S, ...] = ()
        """Open servers. Read-only for other modules."""
        self.clients: tuple[C, ...] = ()
        """Open clients and surveyors. Read-only for other modules."""
        self._node_name = node_name
        self._lock = threading.Lock()
        self._is_closed = False

    def check_open(self) -> None:
        """Raise `ClosedError` if the node was closed."""
        if self._is_closed:
            raise ClosedError(f"node '{self._node_name}'")

    def add_server(self, server: S) -> None:
        """Add a server. Raises `ClosedError` if the node was closed; the caller then closes the server."""
        with self._lock:
            self.check_open()
            self.servers = (*self.servers, server)

    def add_client(self, client: C) -> None:
        """Add a client or surveyor. Raises `ClosedError` as `add_server` does."""
        with self._lock:
            self.check_open()
            self.clients = (*self.clients, client)

    def discard(self, closed: S | C) -> bool:
        """Remove a closed server, client or surveyor; return False if it was removed already."""
        with self._lock:
            count = len(self.servers) + len(self.clients)
            self.servers = tuple(each for each in self.servers if each is not closed)
            self.clients = tuple(each for each in self.clients if each is not closed)
            return len(self.servers) + len(self.clients) < count

    def begin_close(self) -> None:
        """Reject queued and new calls."""
        with self._lock:
            self._is_closed = True
            servers = self.servers
        for server in servers:
            server.begin_close()

    def close(self, timeout_s: float) -> None:
        """Close everything within `timeout_s` seconds, and stop the timeout thread."""
        deadline = time.monotonic() + timeout_s
        self.begin_close()
        for client in self.clients:
            client.close()
        for server in self.servers:
            server.close(max(0.0, deadline - time.monotonic()))
        self.deadlines.close(max(0.0, deadline - time.monotonic()))
