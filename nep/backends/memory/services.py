"""Servers and clients of one process: calls are appended directly to the queue of their server."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass

from nep.backends.bases.deadlines import Deadlines
from nep.backends.bases.open_services import OpenServices
from nep.backends.bases.pending_calls import OutcomeCallback, PendingCall, PendingCalls
from nep.backends.bases.server import BaseServer
from nep.backends.connection import Configuration
from nep.backends.services import (
    ClientSpec,
    IncomingCall,
    OpenCall,
    ServerSpec,
)
from nep.errors import RequestRefusedError
from nep.masters.graph import Graph
from nep.protocol import requests
from nep.protocol.requests import (
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    SubscriberCount,
    SubscriberRecord,
)
from nep.protocol.service_wire import SERVICE_TYPE, Reply, topic_of

_logger = logging.getLogger("nep")


class ServiceHub:
    """Registry of servers and clients. Its lock guards the state of all of them except the call queues."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.graph = Graph(epoch=1, now=time.monotonic(), learn_s=0.0)
        self.servers: dict[str, tuple[MemoryServer, ...]] = {}
        self.clients: dict[str, tuple[MemoryClient, ...]] = {}

    def apply(self, request: requests.Request) -> None:
        """Apply a request to the graph. Raises `RequestRefusedError` if it is rejected."""
        with self.lock:
            for outgoing in self.graph.apply(request, 0, time.monotonic(), ""):
                if isinstance(outgoing.body, requests.RejectedReply):
                    raise RequestRefusedError(outgoing.body.reason)


@dataclass(eq=False)
class _Call(PendingCall):
    # Call in flight. `server` is None until one is available.
    server: MemoryServer | None = None


class MemoryServer(BaseServer):
    """Server whose calls clients append to its queue."""

    def __init__(
        self, node_id: str, hub: ServiceHub, spec: ServerSpec, on_close: Callable[[MemoryServer], object]
    ) -> None:
        super().__init__(spec)
        self._node_id = node_id
        self._on_close = on_close
        self.hub = hub
        self.endpoints = ("memory",)

    def enqueue(self, call: _Call, client: MemoryClient) -> None:
        """Queue a call, or reject it if the queue is full or closed. Call with the hub's lock held."""
        call.server, call.is_sent = self, True
        incoming = IncomingCall(
            call.data,
            client.spec.codec.number,
            None if call.deadline == math.inf else call.deadline,
            lambda reply: self._reply(call, client, reply),
        )
        self._enqueue(incoming)

    def _reply(self, call: _Call, client: MemoryClient, reply: Reply) -> bool:
        reply = self._count_reply(reply)
        return client.handle_reply(call, reply._replace(data=bytes(reply.data)))

    def begin_close(self) -> None:
        """Unregister the server and reject its queued calls."""
        with self.hub.lock:
            remaining = tuple(
                each for each in self.hub.servers.get(self.spec.service, ()) if each is not self
            )
            is_listed = self in self.hub.servers.get(self.spec.service, ())
            self.hub.servers[self.spec.service] = remaining
            if not remaining:
                del self.hub.servers[self.spec.service]
            if is_listed:
                self.hub.apply(requests.RemovePublisher(self._node_id, self.spec.id, self.stats.calls))
        super().begin_close()

    def close(self, timeout_s: float) -> None:  # noqa: ARG002 - replies need no flushing
        """Close the server; calls in flight fail with `ServerGoneError`."""
        self.begin_close()
        with self.hub.lock:
            self.is_closed = True
            clients = self.hub.clients.get(self.spec.service, ())
        for client in clients:
            client.handle_server_closed(self)
        self._on_close(self)


class MemoryClient(PendingCalls[_Call]):
    """Client with its calls in flight, which the hub's lock guards."""

    def __init__(
        self,
        node_id: str,
        hub: ServiceHub,
        spec: ClientSpec,
        deadlines: Deadlines,
        on_close: Callable[[MemoryClient], object],
    ) -> None:
        super().__init__(spec, _Call, hub.lock)
        self._on_close = on_close
        self._node_id = node_id
        self._deadlines = deadlines
        self.hub = hub

    @property
    def is_connected(self) -> bool:
        """True if the service has a server."""
        return not self.is_closed and self.spec.service in self.hub.servers

    def start_call(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> OpenCall:
        """Send a call. See `ClientTransport.start_call`."""
        return self._start_call(data, timeout_s, callback, None)

    def _start_call(
        self,
        data: bytes | memoryview,
        timeout_s: float | None,
        callback: OutcomeCallback,
        server: MemoryServer | None,
    ) -> OpenCall:
        with self.hub.lock:
            call = self._add_locked(bytes(data), timeout_s, callback)
            server = server or next(iter(self.hub.servers.get(self.spec.service, ())), None)
            if server is not None:
                server.enqueue(call, self)
        self._deadlines.add(call.deadline)
        return call

    @property
    def respondents(self) -> int:
        """Number of servers of the service."""
        return len(self.hub.servers.get(self.spec.service, ()))

    def start_survey(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> list[OpenCall]:
        """Send a call to each server. See `SurveyTransport.start_survey`."""
        with self.hub.lock:
            servers = self.hub.servers.get(self.spec.service, ())
            return [self._start_call(data, timeout_s, callback, server) for server in servers]

    def send_waiting_calls(self, server: MemoryServer) -> None:
        """Send the calls that are waiting for a server to `server`. Call with the hub's lock held."""
        for call in list(self._calls.values()):
            if call.server is None:
                server.enqueue(call, self)

    def handle_reply(self, call: _Call, reply: Reply) -> bool:
        """Handle a server's reply; return False if the call is no longer in flight."""
        is_pending = self._finish(call, reply)
        with self.hub.lock:
            self.late += not is_pending
        return is_pending

    def handle_server_closed(self, server: MemoryServer) -> None:
        """Fail the calls that a closed server hasn't answered."""
        self._fail_orphaned(lambda call: call.server is server)

    def service_names(self, timeout_s: float) -> tuple[str, ...]:  # noqa: ARG002 - immediate
        """Return the names of services that have a server."""
        with self.hub.lock:
            return tuple(sorted(self.hub.servers))

    def close(self) -> None:
        """Unregister the client; calls in flight fail with `ClosedError`."""
        in_flight = self._begin_close()
        if in_flight is None:
            return
        with self.hub.lock:
            remaining = tuple(each for each in self.hub.clients[self.spec.service] if each is not self)
            self.hub.clients[self.spec.service] = remaining
            if not remaining:
                del self.hub.clients[self.spec.service]
            self._deadlines.remove_client(self)
            self._on_close(self)
            self.hub.apply(requests.RemoveSubscriber(self._node_id, self.spec.id))
        self._fail_closed(in_flight)


class MemoryServices(OpenServices[MemoryServer, MemoryClient]):
    """Servers and clients of one node. Part of `MemoryTransport`.

    Args:
        node: Record of the node.
        joined_hub: Returns a context manager that yields the hub for a configuration with its lock held.
    """

    def __init__(
        self, node: NodeRecord, joined_hub: Callable[[Configuration], AbstractContextManager[ServiceHub]]
    ) -> None:
        super().__init__(node.name)
        self._node = node
        self._joined_hub = joined_hub

    def create_server(self, spec: ServerSpec) -> MemoryServer:
        """Register a server and send it the calls that are waiting for one."""
        with self._joined_hub(spec.configuration) as hub:
            record = PublisherRecord(
                spec.id, topic_of(spec.service), SERVICE_TYPE, SERVICE_TYPE, ("memory",), number=spec.number
            )
            hub.apply(requests.AddPublisher(self._node, record))
            server = MemoryServer(self._node.id, hub, spec, self.discard)
            hub.servers[spec.service] = (*hub.servers.get(spec.service, ()), server)
            self.add_server(server)
            for client in hub.clients.get(spec.service, ()):
                client.send_waiting_calls(server)
        return server

    def create_client(self, spec: ClientSpec) -> MemoryClient:
        """Register a client."""
        with self._joined_hub(spec.configuration) as hub:
            record = SubscriberRecord(spec.id, topic_of(spec.service), SERVICE_TYPE, spec.number)
            hub.apply(requests.AddSubscriber(self._node, record))
            client = MemoryClient(self._node.id, hub, spec, self.deadlines, self.discard)
            hub.clients[spec.service] = (*hub.clients.get(spec.service, ()), client)
            self.add_client(client)
            self.deadlines.add_client(client)
        return client

    def server_counts(self, hub: ServiceHub) -> Iterable[PublisherCount]:
        """Return the statistics of this node's servers at `hub`. Call with the hub's lock held."""
        return [
            each.counts()
            for each in self.servers
            if each.hub is hub and each in hub.servers.get(each.spec.service, ())
        ]

    def client_counts(self, hub: ServiceHub) -> Iterable[SubscriberCount]:
        """Return the statistics of this node's clients at `hub`. Call with the hub's lock held."""
        return [each.counts() for each in self.clients if each.hub is hub and not each.is_closed]
