"""Client that sends calls, receives replies, and detects when its server disappears.

A client is connected to one server at a time. When a connection has ended and its last reply was read,
all remaining calls that were sent over this connection fail.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

import zmq
from msgspec.structs import replace

from nep.backends.bases.pending_calls import OutcomeCallback, PendingCall, PendingCalls
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.services import ClientSpec, Outcome
from nep.backends.zeromq.io_thread import PollState
from nep.backends.zeromq.sockets import is_remote
from nep.errors import (
    NepError,
    NoServerError,
    ServerGoneError,
    WireError,
)
from nep.protocol.requests import RemotePublisher, SubscriberCount
from nep.protocol.service_wire import ORIGINAL, ORIGINAL_CODEC, Framing

_logger = logging.getLogger("nep")

_MAX_READS_PER_TURN = 100
_MIN_RETRY_S, _MAX_RETRY_S = 0.1, 2.0
_PENDING_RETRY_S = 0.8
"""Maximum interval in seconds between connection attempts while calls are waiting."""
_HANDOVER_TIMEOUT_S = 2.0
"""Maximum time in seconds that new calls wait for the last replies of a closing server."""

_Outcomes = list[tuple[PendingCall, Outcome]]


class Connection(Protocol):
    """Interface of a connection to a server. Guarded by the client's lock."""

    endpoint: str
    is_open: bool
    reconnect_delay_s: float
    """Delay in seconds before reconnecting after the connection has ended."""

    @property
    def has_ended(self) -> bool:
        """True if the connection was open and has ended. Earlier replies can still be read."""

    @property
    def has_input(self) -> bool:
        """True if a reply is available that the file descriptor doesn't signal any more."""

    def update(self) -> None:
        """Update `is_open` and `has_ended`."""

    def send(self, parts: Sequence[bytes | memoryview]) -> None:
        """Send a call."""

    def receive(self) -> Sequence[bytes] | None:
        """Return the parts of the next reply, or None if no complete reply is available.

        Raises `WireError` if the received data is malformed.
        """

    def close(self) -> None:
        """Close the connection and discard unread replies."""


class SocketClient(PendingCalls[PendingCall]):
    """Client for services over sockets.

    Args:
        connect_to: Creates a connection; called with the endpoint and the function that serves the
            connection.
        spec: Settings of the client.
        framing: Wire format.
        serve_soon: Asks the I/O thread to serve the client.
        closer: Closes the client.
        query_services: Queries the master for the names of services within a timeout in seconds; None
            without a master.
        endpoint: Endpoint of the server without a master, or "".
    """

    def __init__(
        self,
        connect_to: Callable[[str, Callable[[float], PollState]], Connection],
        spec: ClientSpec,
        framing: Framing,
        serve_soon: Callable[[SocketClient], None],
        closer: Callable[[SocketClient], None],
        *,
        query_services: Callable[[float], tuple[str, ...]] | None = None,
        endpoint: str = "",
    ) -> None:
        super().__init__(spec, PendingCall)
        self._connect_to = connect_to
        self._connection: Connection | None = None
        self._framing = self._default_framing = framing
        self._original_ids: set[int] = set()
        """Ids of servers that are programs of the original NEP."""
        self._serve_soon = serve_soon
        self._closer = closer
        self._query_services = query_services
        self._unanswered_sizes: dict[int, int] = {}
        """Sizes of the calls sent over this connection by number, oldest first, including cancelled ones.

        Needed because replies without a number arrive in this order, and to limit the bytes sent to a server
        that hangs.
        """
        self._unanswered_bytes = 0
        self.fixed_endpoint = endpoint
        """Endpoint of the server without a master, or ""."""
        self._servers: dict[int, str] = {0: endpoint} if endpoint else {}
        self._current_id: int | None = None
        self._unlisted_id: int | None = None
        """Id of the connected server if the master doesn't list it any more, else None.

        It is kept while there is no other server, because it may only be suspended.
        """
        self._connected_endpoint = ""
        """Endpoint of the current connection; cleared to force a reconnection."""
        self._switch_at = math.inf
        """Time at which the connection to an unlisted server is closed if new calls wait."""
        self._attempts = 0
        self._retry_at = 0.0
        self._rejections = RejectionCounter()

    # ---- calling, in any thread

    @property
    def is_connected(self) -> bool:
        """True if a server is connected."""
        connection = self._connection
        return connection is not None and connection.is_open

    @property
    def fd(self) -> int:
        """-1, because the connections are polled instead of the client.

        The client itself is served when the deadline of a call has passed.
        """
        return -1

    @property
    def is_busy(self) -> bool:
        """True if calls are in flight."""
        return bool(self._calls)

    @property
    def endpoint(self) -> str:
        """Endpoint of the current connection or connection attempt; "" if no server is known."""
        connection = self._connection
        return "" if connection is None else connection.endpoint

    def start_call(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> PendingCall:
        """Send a call. See `ClientTransport.start_call`."""
        with self._lock:
            call = self._add_locked(data, timeout_s, callback)
            if self._connection is not None:
                self._connection.update()
                self._send_locked(call)
        self._serve_soon(self)  # schedules the deadline, and the socket was used
        return call

    def _load_locked(self) -> tuple[int, int]:
        count, size = super()._load_locked()
        return max(count, len(self._unanswered_sizes)), max(size, self._unanswered_bytes)

    def service_names(self, timeout_s: float) -> tuple[str, ...]:
        """Return the names of services that have a server; empty without a master or if it doesn't reply."""
        if self._query_services is None:
            return ()
        try:
            return self._query_services(timeout_s)
        except NepError:
            return ()

    def _send_locked(self, call: PendingCall) -> None:
        # Calls go only to a connected server that hasn't announced its end.
        connection = self._connection
        if connection is None or not connection.is_open or self._current_id not in self._servers:
            return
        codec = self.spec.codec.number
        connection.send(self._framing.encode_call(call.number, codec, call.timeout_s, call.data))
        call.is_sent = True
        self._unanswered_sizes[call.number] = call.size
        self._unanswered_bytes += call.size

    # ---- in the I/O thread: updates from the session

    def connect(self, remotes: Iterable[RemotePublisher]) -> None:
        """Add servers that the master lists."""
        with self._lock:
            for remote in remotes:
                if self._can_call_locked(remote):
                    self._servers[remote.publisher.id] = remote.publisher.endpoints[0]
                    if remote.publisher.id == self._unlisted_id:
                        self._unlisted_id = None
            if self._unlisted_id is not None and len(self._servers) > 1:
                self._servers.pop(self._unlisted_id, None)
                self._unlisted_id = None
            self._retry_at = 0.0
        self._serve_soon(self)

    def _can_call_locked(self, remote: RemotePublisher) -> bool:
        if remote.publisher.codec == ORIGINAL_CODEC:
            self._original_ids.add(remote.publisher.id)
            return bool(remote.publisher.endpoints) and self.spec.codec.name == "json"
        return bool(remote.publisher.endpoints)

    def handle_publisher_removed(self, server: int, last_seq: int, *, is_closed: bool) -> None:  # noqa: ARG002 - a message count
        """Handle the removal of a server.

        Args:
            server: Id of the server.
            last_seq: Number of calls that the server has received. Ignored.
            is_closed: True if the server unregistered, False if its node doesn't respond and may be
                suspended.
        """
        with self._lock:
            if is_closed or server != self._current_id or not self.is_connected or len(self._servers) > 1:
                self._servers.pop(server, None)
                self._original_ids.discard(server)
            else:
                self._unlisted_id = server
        self._serve_soon(self)

    def reconnect_remote(self) -> None:
        """Reconnect to a server on another computer, because the address of this computer has changed."""
        with self._lock:
            if is_remote(self._connected_endpoint):
                self._connected_endpoint = ""
        self._serve_soon(self)

    def reconcile(self, remotes: Iterable[RemotePublisher], topic: str = "") -> None:  # noqa: ARG002 - a service has one
        """Replace the list of servers. If no server is left, an existing connection is kept."""
        with self._lock:
            self._original_ids = {each for each in self._original_ids if each == self._current_id}
            servers = {
                each.publisher.id: each.publisher.endpoints[0]
                for each in remotes
                if self._can_call_locked(each)
            }
            current_id, self._unlisted_id = self._current_id, None
            if not servers and current_id in self._servers and self.is_connected:
                servers, self._unlisted_id = {current_id: self._servers[current_id]}, current_id
            self._servers = servers
            self._retry_at = 0.0
        self._serve_soon(self)

    def handle_renewal(self, now: float, last_seqs: Mapping[int, int]) -> None:
        """Do nothing, because replies have no sequence numbers."""

    def counts(self) -> SubscriberCount:
        """Return the statistics that a renewal reports."""
        return replace(super().counts(), problem=self._rejections.recent_message())

    # ---- in the I/O thread: the socket

    def serve(self, now: float) -> PollState:
        """Process replies, the state of the connection, and expired calls. See `Pollable.serve`."""
        return PollState(is_reading_paused=True, due=self._serve(now))

    def _serve_connection(self, now: float) -> PollState:
        return PollState(due=self._serve(now))

    def _serve(self, now: float) -> float | None:
        # Returns the time at which the client must be served again, or None.
        outcomes: _Outcomes = []
        with self._lock:
            if self.is_closed:
                return None
            if self._connection is not None:
                self._connection.update()
            has_more = self._read(outcomes)
            if not has_more:  # replies received before its end are delivered
                self._check_connection(now, outcomes)
            for call in [each for each in self._calls.values() if not each.is_sent]:
                self._send_locked(call)
            expired_calls = self._fail_locked(self._expired_locked(now))
            outcomes += [(call, self._timeout_error(call)) for call in expired_calls]
            due = self._next_deadline_locked()
            # zmq_send may consume input, and ZMQ_FD is edge-triggered: check again
            has_more = has_more or (self._connection is not None and self._connection.has_input)
        self._run_callbacks(outcomes)
        return now if has_more else due if due < math.inf else None

    def _read(self, outcomes: _Outcomes) -> bool:
        # Returns True if there may be more replies.
        if self._connection is None:
            return False
        for _turn in range(_MAX_READS_PER_TURN):
            number: int | None = None
            outcome: Outcome
            try:
                parts = self._connection.receive()
                if parts is None:
                    return False
                number, outcome = self._framing.read_reply(parts)
            except WireError as error:
                if self._rejections.add(error.reason):
                    _logger.warning("malformed reply from the server of '%s': %s", self._name, error)
                if not self._framing.is_in_order:
                    continue
                outcome = error
            if self._framing.is_in_order:
                number = next(iter(self._unanswered_sizes), None)
            self._unanswered_bytes -= self._unanswered_sizes.pop(number or 0, 0)
            call = self._remove_locked(number or 0)
            if call is None:
                self.late += 1
                continue
            self._answered += 1
            outcomes.append((call, outcome))
        return True

    def _check_connection(self, now: float, outcomes: _Outcomes) -> None:
        # Call when all replies are read.
        connection = self._connection
        if connection is not None and connection.has_ended:
            self._fail_sent_calls(outcomes)
            self._attempts, self._retry_at = 0, now + connection.reconnect_delay_s
        elif connection is not None and self._has_endpoint_changed():
            self._switch_server(outcomes)  # the old connection would stay silent for long
        elif connection is not None and connection.is_open:
            self._attempts = 0
            if self._current_id not in self._servers:
                self._switch_after_replies(now, outcomes)
            else:
                self._switch_at = math.inf
        if not self.is_connected and now >= self._retry_at:
            self._connect_next(now)

    def _has_endpoint_changed(self) -> bool:
        # True if the endpoint of the current server has changed.
        endpoint = None if self._current_id is None else self._servers.get(self._current_id)
        return endpoint not in {None, self._connected_endpoint} and (
            not self._connected_endpoint or is_remote(self._connected_endpoint)
        )

    def _switch_after_replies(self, now: float, outcomes: _Outcomes) -> None:
        # The server closed or was replaced: wait for its last replies, then connect to another one.
        has_sent_calls = any(each.is_sent for each in self._calls.values())
        if has_sent_calls and self._switch_at == math.inf:
            self._switch_at = now + _HANDOVER_TIMEOUT_S
        is_next_due = now >= self._switch_at and any(not each.is_sent for each in self._calls.values())
        if not has_sent_calls or is_next_due:
            self._switch_server(outcomes)

    def _fail_sent_calls(self, outcomes: _Outcomes) -> None:
        # The connection has ended: all calls sent over it fail.
        self._disconnect()
        self._switch_at = math.inf
        self._unanswered_sizes.clear()
        self._unanswered_bytes = 0
        for call in self._fail_locked([each for each in self._calls.values() if each.is_sent]):
            outcomes.append((call, ServerGoneError(self._name)))

    def _switch_server(self, outcomes: _Outcomes) -> None:
        self._fail_sent_calls(outcomes)
        self._current_id = None
        self._attempts, self._retry_at = 0, 0.0

    def _connect_next(self, now: float) -> None:
        # Connects to the next server in turn.
        self._disconnect()
        servers = list(self._servers)
        if not servers:
            self._current_id, self._retry_at = None, math.inf
            return
        index = 0
        if self._current_id in self._servers and self._attempts:
            index = servers.index(self._current_id) + 1
        self._current_id = servers[index % len(servers)]
        endpoint = self._connected_endpoint = self._servers[self._current_id]
        self._framing = ORIGINAL if self._current_id in self._original_ids else self._default_framing
        self._attempts += 1
        try:
            self._connection = self._connect_to(endpoint, self._serve_connection)
        except (OSError, zmq.ZMQError, NepError) as error:
            _logger.warning("can't connect to a server of '%s' at '%s': %s", self._name, endpoint, error)
        self._retry_at = now + min(_MIN_RETRY_S * 2 ** min(self._attempts, 10), _MAX_RETRY_S)

    def _disconnect(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()
            self._serve_soon(self)  # cancels scheduled calls for the closed sockets

    def _timeout_error(self, call: PendingCall) -> NepError:
        if call.is_sent:
            return super()._timeout_error(call)
        address = self.fixed_endpoint.removeprefix("tcp://")
        return NoServerError(self._name, call.timeout_s or 0.0, address=address)

    def _next_deadline_locked(self) -> float:
        next_deadline = super()._next_deadline_locked()
        if self.is_connected and any(not each.is_sent for each in self._calls.values()):
            next_deadline = min(next_deadline, self._switch_at)
        if self.is_connected or not self._servers:
            return next_deadline
        if self._calls:
            self._retry_at = min(self._retry_at, time.monotonic() + _PENDING_RETRY_S)
        return min(next_deadline, self._retry_at)

    @property
    def _name(self) -> str:
        return self.spec.service

    def _run_callbacks(self, outcomes: _Outcomes) -> None:
        for call, outcome in outcomes:
            self._run_callback(call, outcome)

    # ---- closing

    def close(self) -> None:
        """Unregister and close the client; calls in flight fail with `ClosedError`. Idempotent."""
        self._closer(self)

    def release(self) -> None:
        """Fail the calls in flight and close the connection. Idempotent. Called by the closer."""
        in_flight = self._begin_close()
        with self._lock:
            connection, self._connection = self._connection, None
        if connection is not None:  # without the lock: the thread that polls it may wait for the lock
            connection.close()
        self._fail_closed(in_flight or ())
