"""Servers and clients of one process: calls are appended directly to the queue of their server."""

from __future__ import annotations

import itertools
import logging
import math
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass

from nep.backends.connection import Configuration
from nep.backends.deadlines import Deadlines
from nep.backends.services import (
    CallQueue,
    ClientSpec,
    IncomingCall,
    OpenCall,
    Outcome,
    ServerSpec,
    ServerStats,
    check_call_limits,
    limit_reply_size,
    rejection_reply,
)
from nep.errors import ClosedError, NoServerError, RequestRefusedError, ServerGoneError, ServiceTimeoutError
from nep.i18n import _
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

OutcomeCallback = Callable[[Outcome], None]


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
class _Call:
    # Call in flight. `server` is None until one is available.
    number: int
    client: MemoryClient
    data: bytes
    timeout_s: float | None
    deadline: float
    callback: OutcomeCallback
    server: MemoryServer | None = None

    def run_callback(self, outcome: Outcome) -> None:
        # Call without locks.
        try:
            self.callback(outcome)
        except Exception:  # a failing callback must not affect other calls
            _logger.exception("result callback for '%s' raised", self.client.spec.service)


class MemoryServer:
    """Server with a call queue."""

    def __init__(self, node_id: str, hub: ServiceHub, spec: ServerSpec) -> None:
        self._node_id = node_id
        self.hub = hub
        self.spec = spec
        self.calls = CallQueue()
        self.stats = ServerStats()
        self.endpoints = ("memory",)
        self.is_closed = False

    def enqueue(self, call: _Call) -> None:
        """Queue a call, or reject it if the queue is full or closed. Call with the hub's lock held."""
        call.server = self
        incoming = IncomingCall(
            call.data,
            call.client.spec.codec.number,
            None if call.deadline == math.inf else call.deadline,
            lambda reply: self._reply(call, reply),
        )
        if not self.calls.put(incoming):
            incoming.reply(rejection_reply(self.spec.service, is_closed=self.calls.is_closed))

    def _reply(self, call: _Call, reply: Reply) -> bool:
        reply = limit_reply_size(reply)
        self.stats.add(reply)
        with self.hub.lock:
            is_pending = call.client.remove_locked(call)
            call.client.replied += is_pending
            call.client.late += not is_pending
        if is_pending:
            data = reply.data if isinstance(reply.data, bytes) else bytes(reply.data)
            call.run_callback(reply._replace(data=data))
        return is_pending

    def counts(self) -> PublisherCount:
        """Return the statistics that a renewal reports."""
        stats = self.stats
        return PublisherCount(self.spec.id, stats.calls, stats.bytes, stats.calls, errors=stats.errors)

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
        for call in self.calls.close():
            call.reply(rejection_reply(self.spec.service, is_closed=True))

    def close(self, timeout_s: float) -> None:  # noqa: ARG002 - replies need no flushing
        """Close the server; calls in flight fail with `ServerGoneError`."""
        self.begin_close()
        with self.hub.lock:
            self.is_closed = True
            in_flight = [
                call
                for client in self.hub.clients.get(self.spec.service, ())
                for call in client.calls
                if call.server is self and client.remove_locked(call)
            ]
            for call in in_flight:
                call.client.failed += 1
        for call in in_flight:
            call.run_callback(ServerGoneError(self.spec.service))

    def forked(self) -> None:
        """Mark the server as closed in a forked child process."""
        self.is_closed = True
        self.calls.forked()


class MemoryClient:
    """Client with its calls in flight. The hub's lock guards its statistics."""

    def __init__(self, node_id: str, hub: ServiceHub, spec: ClientSpec, deadlines: Deadlines) -> None:
        self._node_id = node_id
        self._deadlines = deadlines
        self.hub = hub
        self.spec = spec
        self.replied = self.failed = self.late = 0
        self.is_closed = False
        self._calls: dict[int, _Call] = {}
        self._bytes = 0
        self._numbers = itertools.count(1)

    @property
    def is_connected(self) -> bool:
        """True if the service has a server."""
        return not self.is_closed and self.spec.service in self.hub.servers

    @property
    def calls(self) -> list[_Call]:
        """Calls in flight. Call with the hub's lock held."""
        return list(self._calls.values())

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
        deadline = math.inf if timeout_s is None else time.monotonic() + timeout_s
        request = data if isinstance(data, bytes) else bytes(data)
        with self.hub.lock:
            if self.is_closed:
                raise self._closed_error()
            check_call_limits(self.spec.service, len(self._calls), self._bytes, len(request))
            call = _Call(next(self._numbers), self, request, timeout_s, deadline, callback)
            self._calls[call.number] = call
            self._bytes += len(request)
            server = server or next(iter(self.hub.servers.get(self.spec.service, ())), None)
            if server is not None:
                server.enqueue(call)
        self._deadlines.add(deadline)
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

    def cancel_all(self, calls: Sequence[OpenCall]) -> None:
        """Cancel several calls; their callbacks aren't called."""
        for call in calls:
            self.cancel(call)

    def remove_locked(self, call: _Call) -> bool:
        """Remove a call from the calls in flight; return False if it has already ended.

        Call with the hub's lock held.
        """
        if self._calls.pop(call.number, None) is None:
            return False
        self._bytes -= len(call.data)
        return True

    def cancel(self, call: OpenCall) -> None:
        """Cancel a call; its callback isn't called."""
        with self.hub.lock:
            existing = self._calls.get(call.number)
            if existing is not None:
                self.remove_locked(existing)

    def send_waiting_calls(self, server: MemoryServer) -> None:
        """Send the calls that are waiting for a server to `server`. Call with the hub's lock held."""
        for call in self.calls:
            if call.server is None:
                server.enqueue(call)

    def expire(self, now: float) -> float:
        """Fail expired calls and return the next deadline. See `ExpiringClient.expire`."""
        with self.hub.lock:
            expired = [each for each in self.calls if each.deadline <= now and self.remove_locked(each)]
            self.failed += len(expired)
            next_deadline = min((each.deadline for each in self._calls.values()), default=math.inf)
        for call in expired:
            error_class = NoServerError if call.server is None else ServiceTimeoutError
            call.run_callback(error_class(self.spec.service, call.timeout_s or 0.0))
        return next_deadline

    def service_names(self, timeout_s: float) -> tuple[str, ...]:  # noqa: ARG002 - immediate
        """Return the names of services that have a server."""
        with self.hub.lock:
            return tuple(sorted(self.hub.servers))

    def counts(self) -> SubscriberCount:
        """Return the statistics that a renewal reports."""
        return SubscriberCount(self.spec.id, self.replied, self.failed)

    def close(self) -> None:
        """Unregister the client; calls in flight fail with `ClosedError`."""
        with self.hub.lock:
            if self.is_closed:
                return
            self.is_closed = True
            remaining = tuple(each for each in self.hub.clients[self.spec.service] if each is not self)
            self.hub.clients[self.spec.service] = remaining
            if not remaining:
                del self.hub.clients[self.spec.service]
            self._deadlines.remove_client(self)
            in_flight, self._calls = self.calls, {}
            self.hub.apply(requests.RemoveSubscriber(self._node_id, self.spec.id))
        for call in in_flight:
            call.run_callback(self._closed_error())

    def forked(self) -> None:
        """Mark the client as closed in a forked child process."""
        self.is_closed = True
        self._calls = {}

    def _closed_error(self) -> ClosedError:
        return ClosedError(_("client of '{service}'").format(service=self.spec.service))


class MemoryServices:
    """Servers and clients of one node. Part of `MemoryTransport`.

    Args:
        node: Record of the node.
        joined_hub: Returns a context manager that yields the hub for a configuration with its lock held.
    """

    def __init__(
        self, node: NodeRecord, joined_hub: Callable[[Configuration], AbstractContextManager[ServiceHub]]
    ) -> None:
        self._node = node
        self._joined_hub = joined_hub
        self._deadlines = Deadlines(node.name)
        self._servers: tuple[MemoryServer, ...] = ()
        self._clients: tuple[MemoryClient, ...] = ()

    def create_server(self, spec: ServerSpec) -> MemoryServer:
        """Register a server and send it the calls that are waiting for one."""
        with self._joined_hub(spec.configuration) as hub:
            record = PublisherRecord(
                spec.id, topic_of(spec.service), SERVICE_TYPE, SERVICE_TYPE, ("memory",), number=spec.number
            )
            hub.apply(requests.AddPublisher(self._node, record))
            server = MemoryServer(self._node.id, hub, spec)
            hub.servers[spec.service] = (*hub.servers.get(spec.service, ()), server)
            self._servers = (*(each for each in self._servers if not each.is_closed), server)
            for client in hub.clients.get(spec.service, ()):
                client.send_waiting_calls(server)
        return server

    def create_client(self, spec: ClientSpec) -> MemoryClient:
        """Register a client."""
        with self._joined_hub(spec.configuration) as hub:
            record = SubscriberRecord(spec.id, topic_of(spec.service), SERVICE_TYPE, spec.number)
            hub.apply(requests.AddSubscriber(self._node, record))
            client = MemoryClient(self._node.id, hub, spec, self._deadlines)
            hub.clients[spec.service] = (*hub.clients.get(spec.service, ()), client)
            self._clients = (*(each for each in self._clients if not each.is_closed), client)
            self._deadlines.add_client(client)
        return client

    def server_counts(self, hub: ServiceHub) -> Iterable[PublisherCount]:
        """Return the statistics of this node's servers at `hub`. Call with the hub's lock held."""
        return [
            each.counts()
            for each in self._servers
            if each.hub is hub and each in hub.servers.get(each.spec.service, ())
        ]

    def client_counts(self, hub: ServiceHub) -> Iterable[SubscriberCount]:
        """Return the statistics of this node's clients at `hub`. Call with the hub's lock held."""
        return [each.counts() for each in self._clients if each.hub is hub and not each.is_closed]

    def begin_close(self) -> None:
        """Reject queued and new calls."""
        for server in self._servers:
            server.begin_close()

    def close(self, timeout_s: float) -> None:
        """Close all servers and clients and stop the timeout thread."""
        for client in self._clients:
            client.close()
        for server in self._servers:
            server.close(timeout_s)
        self._deadlines.close(timeout_s)
