"""Servers, clients and surveyors of one node. Part of `ZenohTransport`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from nep.backends.base import HANDSHAKE_TIMEOUT_S
from nep.backends.connection import Configuration
from nep.backends.deadlines import Deadlines
from nep.backends.services import ClientSpec, ServerSpec
from nep.backends.zenoh.services import ZenohClient, ZenohServer
from nep.backends.zenoh.session import ZenohSession
from nep.errors import ClosedError

SessionProvider = Callable[[Configuration, float | None], ZenohSession]


class ZenohServices:
    """Servers, clients and surveyors of one node.

    Args:
        get_session: Returns the node's session for a configuration; raises `ClosedError` if the node is
            closed.
        node_name: Name of the node.
    """

    def __init__(self, get_session: SessionProvider, node_name: str) -> None:
        self._get_session = get_session
        self._node_name = node_name
        self._lock = threading.Lock()
        self._deadlines = Deadlines(node_name)
        self._servers: tuple[ZenohServer, ...] = ()
        self._clients: tuple[ZenohClient, ...] = ()
        self._is_closed = False

    def create_server(self, spec: ServerSpec) -> ZenohServer:
        """Create a server. See `ServiceTransport.create_server`."""
        session = self._get_session(spec.configuration, spec.wait_s)
        session.join()
        server = ZenohServer(session, spec, self._discard)
        try:
            with self._lock:
                self._check_open_locked()
                self._servers = (*self._servers, server)
            session.add_server(server)
            session.sync_all(HANDSHAKE_TIMEOUT_S)
        except BaseException:  # also Ctrl+C: the caller has no object to close yet
            server.close(0.0)
            raise
        return server

    def create_client(self, spec: ClientSpec) -> ZenohClient:
        """Create a client or surveyor. See `ServiceTransport.create_client`."""
        session = self._get_session(spec.configuration, spec.wait_s)
        session.join()
        client = ZenohClient(session, spec, self._deadlines, self._discard)
        try:
            with self._lock:
                self._check_open_locked()
                self._clients = (*self._clients, client)
                self._deadlines.add_client(client)
            session.add_client(client)
            session.sync_all(HANDSHAKE_TIMEOUT_S)
        except BaseException:
            client.close()
            raise
        return client

    def _check_open_locked(self) -> None:
        if self._is_closed:
            raise ClosedError(f"node '{self._node_name}'")

    def _discard(self, closed: ZenohServer | ZenohClient) -> None:
        with self._lock:
            self._servers = tuple(each for each in self._servers if each is not closed)
            self._clients = tuple(each for each in self._clients if each is not closed)

    def begin_close(self) -> None:
        """Reject queued and new calls."""
        with self._lock:
            self._is_closed = True
            servers = self._servers
        for server in servers:
            server.begin_close()

    def close(self, timeout_s: float) -> None:
        """Close all servers and clients, and stop the timeout thread."""
        deadline = time.monotonic() + timeout_s
        self.begin_close()
        for client in self._clients:
            client.close()
        for server in self._servers:
            server.close(max(0.0, deadline - time.monotonic()))
        self._deadlines.close(max(0.0, deadline - time.monotonic()))

    def forked(self) -> None:
        """Mark all services as closed in a forked child process. See `nep.system.forks`."""
        self._is_closed = True
        self._lock = threading.Lock()
        for server in self._servers:
            server.forked()
        for client in self._clients:
            client.forked()
