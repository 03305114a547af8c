"""Servers, clients and surveyors of one node. Part of `ZeromqTransport`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import zmq

from nep.backends.bases.open_services import OpenServices
from nep.backends.connection import Direct
from nep.backends.services import ClientSpec, ServerSpec
from nep.backends.zeromq.io_thread import PollState, SharedContext
from nep.backends.zeromq.master_session import MasterSession
from nep.backends.zeromq.services.client import Connection, SocketClient
from nep.backends.zeromq.services.connection import FDS_PER_CONNECTION, ServerConnection
from nep.backends.zeromq.services.server import RouterServer
from nep.backends.zeromq.services.survey import SurveyClient
from nep.backends.zeromq.services.tcp_server import TcpServer
from nep.backends.zeromq.services.tcp_stream import TcpConnection
from nep.backends.zeromq.sockets import bind
from nep.errors import NepError
from nep.i18n import _
from nep.protocol.requests import PublisherRecord, SubscriberRecord
from nep.protocol.service_wire import NATIVE, ORIGINAL, SERVICE_TYPE, Framing, topic_of
from nep.system.addresses import endpoint_of, is_endpoint, resolve_address
from nep.system.descriptors import check_free_descriptors


class ZeromqServices(OpenServices[RouterServer | TcpServer, SocketClient | SurveyClient]):
    """Servers, clients and surveyors of one node.

    Args:
        shared: ZeroMQ context of the process.
        get_session: Returns the node's session with the master at an address; raises `ClosedError` if the
            node is closed.
        node_name: Name of the node.
    """

    def __init__(
        self, shared: SharedContext, get_session: Callable[[str], MasterSession], node_name: str
    ) -> None:
        super().__init__(node_name)
        self._shared = shared
        self._get_session = get_session

    # ---- servers

    def create_server(self, spec: ServerSpec) -> RouterServer | TcpServer:
        """Create a server. See `ServiceTransport.create_server`."""
        if isinstance(spec.configuration, Direct):
            return self._create_direct_server(spec, spec.configuration)
        session = self._get_session(spec.configuration.master)
        session.wait_for_address(spec.wait_s)
        server = self._new_server(spec, NATIVE, lambda: session.remove_publisher(spec.id, server.stats.calls))
        with self._released_on_error(server):
            endpoints = server.move(session.hosts)
            self._serve(server)
        record = PublisherRecord(
            spec.id, topic_of(spec.service), SERVICE_TYPE, SERVICE_TYPE, endpoints, number=spec.number
        )
        try:
            session.add_publisher(record, server, spec.wait_s)
        except BaseException:  # also Ctrl+C: the caller has no object to close yet
            server.close(0.0)
            raise
        return server

    def _create_direct_server(self, spec: ServerSpec, direct: Direct) -> RouterServer | TcpServer:
        if direct.wire == "tcp":
            return self._create_tcp_server(spec, direct)
        server = self._new_server(spec, _framing(direct), lambda: None)
        with self._released_on_error(server):
            server.fixed_endpoints = (bind(server.socket, f"{direct.ip}:{direct.port}"),)
            self._serve(server)
        return server

    def _create_tcp_server(self, spec: ServerSpec, direct: Direct) -> TcpServer:
        def close(server: TcpServer, timeout_s: float) -> None:
            deadline = time.monotonic() + timeout_s
            with self._shared.removed(server, self.discard) as is_removed:
                if is_removed:
                    server.begin_close()
                    server.release(deadline)

        server = TcpServer(self._shared.io, spec, f"{direct.ip}:{direct.port}", close)
        with self._released_on_error(server):
            self._serve(server)
        return server

    def _new_server(self, spec: ServerSpec, framing: Framing, unregister: Callable[[], None]) -> RouterServer:
        def close(server: RouterServer, timeout_s: float) -> None:
            deadline = time.monotonic() + timeout_s
            with self._shared.removed(server, self.discard) as is_removed:
                if is_removed:
                    server.begin_close()
                    self._shared.io.remove(server)
                    while server.serve(now := time.monotonic()).due is not None and now < deadline:
                        pass  # calls received in the meantime are rejected, too
                    server.release(deadline)

        socket = self._shared.socket(zmq.ROUTER, f"a server of '{spec.service}'")
        return RouterServer(socket, spec, framing, self._shared.io.serve_soon, unregister, close)

    def _serve(self, owner: RouterServer | TcpServer | SocketClient) -> None:
        # In this order: `close` may remove the owner as soon as it was added. Call in `_released_on_error`.
        self.check_open()
        self._shared.io.add(owner)
        if isinstance(owner, SocketClient):
            self.add_client(owner)
        else:
            self.add_server(owner)

    @contextmanager
    def _released_on_error(self, owner: RouterServer | TcpServer | SocketClient) -> Iterator[None]:
        # A socket left open would block the end of the program.
        try:
            yield
        except BaseException:
            self._shared.io.remove(owner)
            if isinstance(owner, SocketClient):
                owner.release()
            else:
                owner.release(0.0)
            raise

    # ---- clients

    def create_client(self, spec: ClientSpec) -> SocketClient:
        """Create a client. See `ServiceTransport.create_client`."""
        if isinstance(spec.configuration, Direct):
            return self._create_direct_client(spec, spec.configuration)
        session = self._get_session(spec.configuration.master)
        session.wait_for_address(spec.wait_s)

        def query_services(timeout_s: float) -> tuple[str, ...]:
            services = session.query_graph(timeout_s).services
            return tuple(sorted(name for name, each in services.items() if each.servers))

        client = self._new_client(spec, NATIVE, lambda: session.remove_subscriber(spec.id), query_services)
        try:
            record = SubscriberRecord(spec.id, topic_of(spec.service), SERVICE_TYPE, spec.number)
            client.connect(session.add_subscriber(record, client, spec.wait_s).publishers)
        except BaseException:
            client.close()
            raise
        return client

    def create_surveyor(self, spec: ClientSpec) -> SurveyClient:
        """Create a surveyor. See `ServiceTransport.create_surveyor`."""
        if isinstance(spec.configuration, Direct):
            raise NepError(_("surveys of 'zeromq' need a master; omit the configuration, or use 'nanomsg'"))
        session = self._get_session(spec.configuration.master)
        session.wait_for_address(spec.wait_s)

        def close(surveyor: SurveyClient) -> None:
            with self._shared.removed(surveyor, self.discard) as is_removed:
                if is_removed:
                    session.remove_subscriber(spec.id)
                    surveyor.release()

        def new_client(endpoint: str) -> SocketClient:
            return self._new_client(spec, NATIVE, lambda: None, None, endpoint)

        surveyor = SurveyClient(spec, new_client, close)
        self.add_client(surveyor)
        try:
            record = SubscriberRecord(spec.id, topic_of(spec.service), SERVICE_TYPE, spec.number)
            surveyor.connect(session.add_subscriber(record, surveyor, spec.wait_s).publishers)
        except BaseException:
            surveyor.close()
            raise
        return surveyor

    def _create_direct_client(self, spec: ClientSpec, direct: Direct) -> SocketClient:
        address = f"{direct.ip}:{direct.port}"
        if not is_endpoint(endpoint_of(address)):
            raise NepError(
                _("can't call '{address}'; use a computer's address and a port").format(address=address)
            )
        endpoint = endpoint_of(resolve_address(address))
        return self._new_client(
            spec, _framing(direct), lambda: None, None, endpoint, is_tcp=direct.wire == "tcp"
        )

    def _new_client(
        self,
        spec: ClientSpec,
        framing: Framing,
        unregister: Callable[[], None],
        query_services: Callable[[float], tuple[str, ...]] | None,
        endpoint: str = "",
        *,
        is_tcp: bool = False,
    ) -> SocketClient:
        def close(client: SocketClient) -> None:
            with self._shared.removed(client, self.discard) as is_removed:
                if is_removed:
                    unregister()
                    self._shared.io.remove(client)
                    client.release()

        def connect_to(endpoint: str, serve: Callable[[float], PollState]) -> Connection:
            if is_tcp:
                return TcpConnection(self._shared.io, endpoint.removeprefix("tcp://"), serve)
            return ServerConnection(self._shared, spec.service, endpoint, serve)

        check_free_descriptors(FDS_PER_CONNECTION, f"a client of '{spec.service}'")
        client = SocketClient(
            connect_to,
            spec,
            framing,
            self._shared.io.serve_soon,
            close,
            query_services=query_services,
            endpoint=endpoint,
        )
        with self._released_on_error(client):
            self._serve(client)
        return client

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Endpoints of all servers and connections. Acquires no lock."""
        bound = (endpoint for server in self.servers for endpoint in server.endpoints)
        return (*bound, *(each.endpoint for each in self.clients if isinstance(each, SocketClient)))


def _framing(direct: Direct) -> Framing:
    return ORIGINAL if direct.wire == "original" else NATIVE
