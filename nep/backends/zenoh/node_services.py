"""Servers, clients and surveyors of one node. Part of `ZenohTransport`."""

from __future__ import annotations

from collections.abc import Callable

from nep.backends.base import HANDSHAKE_TIMEOUT_S
from nep.backends.bases.open_services import OpenServices
from nep.backends.connection import Configuration
from nep.backends.services import ClientSpec, ServerSpec
from nep.backends.zenoh.services import ZenohClient, ZenohServer
from nep.backends.zenoh.session import ZenohSession

SessionProvider = Callable[[Configuration, float | None], ZenohSession]


class ZenohServices(OpenServices[ZenohServer, ZenohClient]):
    """Servers, clients and surveyors of one node.

    Args:
        get_session: Returns the node's session for a configuration; raises `ClosedError` if the node is
            closed.
        node_name: Name of the node.
    """

    def __init__(self, get_session: SessionProvider, node_name: str) -> None:
        super().__init__(node_name)
        self._get_session = get_session

    def create_server(self, spec: ServerSpec) -> ZenohServer:
        """Create a server. See `ServiceTransport.create_server`."""
        session = self._get_session(spec.configuration, spec.wait_s)
        session.join()
        server = ZenohServer(session, spec, self.discard)
        try:
            self.add_server(server)
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
        client = ZenohClient(session, spec, self.deadlines, self.discard)
        try:
            self.add_client(client)
            self.deadlines.add_client(client)
            session.add_client(client)
            session.sync_all(HANDSHAKE_TIMEOUT_S)
        except BaseException:
            client.close()
            raise
        return client
