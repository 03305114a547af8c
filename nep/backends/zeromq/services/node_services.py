"""Servers, clients and surveyors of one node. Part of `ZeromqTransport`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import contextmanager
from typing import TYPE_CHECKING

import zmq

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
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.protocol.requests import PublisherRecord, SubscriberRecord
from nep.protocol.service_wire import NATIVE, ORIGINAL, SERVICE_TYPE, Framing, topic_of
from nep.system.addresses import endpoint_of, is_endpoint, resolve_address
from nep.system.descriptors import check_free_descriptors

if TYPE_CHECKING:
    from collections.abc import Iterator


class ZeromqServices:
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
        self._shared = shared
        self._get_session = get_session
        self._node_name = node_name
        self._lock = threading.Lock()
        self._servers: set[RouterServer | TcpServer] = set()
        self._clients: set[SocketClient] = set()
        self._surveyors: set[SurveyClient] = set()
        self._is_closed = False

    # ---- servers

    def create_server(self, spec: ServerSpec) -> RouterServer | TcpServer:
        """Create a server. See `ServiceTransport.create_server`."""
        if isinstance(spec.configuration, Direct):
            return self._create_direct_server(spec, spec.configuration)
        session = self._get_session(spec.configuration.master)
        session.wait_for_address(spec.wait_s)
        server = self._new_server(spec, NATIVE, lambda: session.remove_publisher(spec.id, server.stats.calls))
        with _release_on_error(server):
            endpoints = server.move(session.hosts)
            self._add(server)
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
        with _release_on_error(server):
            server.fixed_endpoints = (bind(server.socket, f"{direct.ip}:{direct.port}"),)
            self._add(server)
        return server

    def _create_tcp_server(self, spec: ServerSpec, direct: Direct) -> TcpServer:
        def close(server: TcpServer, timeout_s: float) -> None:
            deadline = time.monotonic() + timeout_s
            with self._shared.removed(self._lock, self._servers, server) as is_removed:
                if is_removed:
                    server.begin_close()
                    server.release(deadline)

        server = TcpServer(self._shared.io, spec, f"{direct.ip}:{direct.port}", close)
        with _release_on_error(server):
            self._add(server)
        return server

    def _new_server(self, spec: ServerSpec, framing: Framing, unregister: Callable[[], None]) -> RouterServer:
        def close(server: RouterServer, timeout_s: float) -> None:
            deadline = time.monotonic() + timeout_s
            with self._shared.removed(self._lock, self._servers, server) as is_removed:
                if is_removed:
                    server.begin_close()
                    self._shared.io.remove(server)
                    while server.serve(now := time.monotonic()).due is not None and now < deadline:
                        pass  # calls received in the meantime are rejected, too
                    server.release(deadline)

        socket = self._shared.socket(zmq.ROUTER, f"a server of '{spec.service}'")
        return RouterServer(socket, spec, framing, self._shared.io.serve_soon, unregister, close)

    def _add(self, owner: RouterServer | TcpServer | SocketClient) -> None:
        with self._lock:
            self._check_open_locked()
            if isinstance(owner, SocketClient):
                self._clients.add(owner)
            else:
                self._servers.add(owner)
            self._shared.io.add(owner)  # before `close` can remove the owner, which acquires this lock first

    def _check_open_locked(self) -> None:
        if self._is_closed:
            raise ClosedError(f"node '{self._node_name}'")

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
            with self._shared.removed(self._lock, self._surveyors, surveyor) as is_removed:
                if is_removed:
                    session.remove_subscriber(spec.id)
                    surveyor.release()

        def new_client(endpoint: str) -> SocketClient:
            return self._new_client(spec, NATIVE, lambda: None, None, endpoint)

        surveyor = SurveyClient(spec, new_client, close)
        with self._lock:
            self._check_open_locked()
            self._surveyors.add(surveyor)
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
            with self._shared.removed(self._lock, self._clients, client) as is_removed:
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
        with _release_on_error(client):
            self._add(client)
        return client

    # ---- closing

    def begin_close(self) -> None:
        """Reject queued and new calls, so that waiting clients are notified."""
        with self._lock:
            self._is_closed = True
            servers = tuple(self._servers)
        for server in servers:
            server.begin_close()

    def close(self, timeout_s: float) -> None:
        """Close all servers, clients and surveyors; replies are flushed within `timeout_s` seconds."""
        deadline = time.monotonic() + timeout_s
        with self._lock:
            surveyors, clients, servers = tuple(self._surveyors), tuple(self._clients), tuple(self._servers)
        for surveyor in surveyors:
            surveyor.close()
        for client in clients:
            client.close()
        for server in servers:
            server.close(max(0.0, deadline - time.monotonic()))

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Endpoints of all servers and connections. Acquires no lock."""
        bound = (endpoint for server in self._servers for endpoint in server.endpoints)
        return (*bound, *(client.endpoint for client in self._clients))


def _framing(direct: Direct) -> Framing:
    return ORIGINAL if direct.wire == "original" else NATIVE


@contextmanager
def _release_on_error(owner: RouterServer | TcpServer | SocketClient) -> Iterator[None]:
    # A socket left open would block the end of the program.
    try:
        yield
    except BaseException:
        if isinstance(owner, SocketClient):
            owner.release()
        else:
            owner.release(0.0)
        raise
