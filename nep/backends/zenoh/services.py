"""Servers and clients over zenoh: a server is a queryable, and a call is a query to its key.

Payloads are sent as is, with the header of `nep.protocol.service_wire` as attachment. When a server
ends, zenoh finishes its queries without a reply, so the client knows that no reply will arrive.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from nep.backends.bases.deadlines import Deadlines
from nep.backends.bases.pending_calls import OutcomeCallback, PendingCall, PendingCalls
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.bases.server import BaseServer
from nep.backends.services import (
    ClientSpec,
    OpenCall,
    ServerSpec,
    size_error_text,
)
from nep.backends.zenoh.keys import service_key
from nep.backends.zenoh.library import load_zenoh
from nep.backends.zenoh.session import ZenohSession
from nep.errors import NepError, ServerGoneError, WireError
from nep.i18n import _
from nep.protocol.requests import (
    PublisherRecord,
    SubscriberRecord,
)
from nep.protocol.service_wire import MAX_PAYLOAD_BYTES, NATIVE, SERVICE_TYPE, Reply, topic_of

_logger = logging.getLogger("nep")
_LATE_REPLY_WINDOW_S = 30.0
"""Time in seconds after a call's timeout in which its reply is still received, and counted as late."""
_MAX_QUERY_TIMEOUT_S = 1e9
_TOKEN_DELAY_S = 0.5
"""Maximum time in seconds from the end of a server's queries to the removal of its liveliness token."""


class ZenohServer(BaseServer):
    """Server with a call queue. Owns the queryable and the queries that have no reply yet."""

    def __init__(
        self, session: ZenohSession, spec: ServerSpec, on_close: Callable[[ZenohServer], object]
    ) -> None:
        super().__init__(spec)
        self._session = session
        self._on_close = on_close
        self._lock = threading.Lock()
        self._queries: set[Any] = set()
        self._key = service_key(spec.service, time.time_ns(), spec.id)
        self.endpoints = (self._key,)
        self.record = PublisherRecord(
            spec.id, topic_of(spec.service), SERVICE_TYPE, SERVICE_TYPE, self.endpoints
        )
        session.check(self.record)
        self._queryable: Any = session.declare_queryable(self._key, self._handle_query)

    def _handle_query(self, query: Any) -> None:  # noqa: ANN401 - zenoh is not typed
        # Runs in a zenoh thread.
        data: bytes = b"" if query.payload is None else query.payload.to_bytes()
        attachment: bytes = b"" if query.attachment is None else query.attachment.to_bytes()
        try:
            call = NATIVE.read_call([attachment, data])
            if len(data) > MAX_PAYLOAD_BYTES:
                raise WireError(size_error_text(len(data)))
        except WireError as error:
            query.drop()
            self._count_malformed(error)
            return
        with self._lock:
            is_closed = self.is_closed
            if not is_closed:
                self._queries.add(query)
        if is_closed:
            query.drop()
            return
        reply = partial(self._reply, query, call.number)
        self._enqueue(self._new_call(call.data, call.codec, call.timeout_s, reply))

    def _reply(self, query: Any, number: int, reply: Reply) -> bool:  # noqa: ANN401 - zenoh is not typed
        reply = self._count_reply(reply)
        with self._lock:
            if query not in self._queries:
                return False
            self._queries.discard(query)
        header, data = (bytes(each) for each in NATIVE.encode_reply(number, reply))
        try:
            with query:
                query.reply(self._key, data, attachment=header)
        except load_zenoh().ZError as error:  # the session was closed meanwhile
            _logger.debug("can't send a reply of '%s': %s", self.spec.service, error)
            return False
        return True

    def begin_close(self) -> None:
        """Unregister; reject queued and new calls."""
        self._session.discard_service(self)
        super().begin_close()

    def close(self, timeout_s: float) -> None:  # noqa: ARG002 - replies are flushed by the session
        """Close the server; calls that have no reply yet fail."""
        self.begin_close()
        with self._lock:
            if self.is_closed:
                return
            self.is_closed = True
            pending_queries, self._queries = tuple(self._queries), set()
        with suppress(load_zenoh().ZError):  # closing the session has undeclared it
            self._queryable.undeclare()
        for query in pending_queries:
            query.drop()
        self._on_close(self)


@dataclass(eq=False)
class _Call(PendingCall):
    # Call in flight at the server `key`; "" while there is no server. After zenoh has finished the query,
    # the server's token should be removed by `token_deadline`.
    key: str = ""
    token_deadline: float = math.inf


class ZenohClient(PendingCalls[_Call]):
    """Client or surveyor, with its calls in flight."""

    def __init__(
        self,
        session: ZenohSession,
        spec: ClientSpec,
        deadlines: Deadlines,
        on_close: Callable[[ZenohClient], object],
    ) -> None:
        super().__init__(spec, _Call)
        self.record = SubscriberRecord(spec.id, topic_of(spec.service), SERVICE_TYPE)
        self._session = session
        self._deadlines = deadlines
        self._on_close = on_close
        self._rejections = RejectionCounter()
        session.check(self.record)

    # ---- calling

    @property
    def _servers(self) -> tuple[str, ...]:
        return self._session.roster.servers_of(self.spec.service)

    @property
    def is_connected(self) -> bool:
        """True if the service has a server."""
        return not self.is_closed and bool(self._servers)

    @property
    def respondents(self) -> int:
        """Number of servers of the service."""
        return len(self._servers)

    def start_call(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> OpenCall:
        """Send a call. See `ClientTransport.start_call`."""
        with self._lock:
            call = self._add_locked(data, timeout_s, callback)
        self._send(call, next(iter(self._servers), ""))
        self._deadlines.add(call.deadline)
        return call

    def start_survey(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> list[OpenCall]:
        """Send a call to each server. See `SurveyTransport.start_survey`."""
        calls: list[OpenCall] = []
        try:
            for key in self._servers:
                with self._lock:
                    call = self._add_locked(data, timeout_s, callback)
                calls.append(call)
                self._send(call, key)
                self._deadlines.add(call.deadline)
        except BaseException:
            self.cancel_all(calls)
            raise
        return calls

    def _send(self, call: _Call, key: str) -> None:
        # Call without the lock. Does nothing if the call was already sent.
        with self._lock:
            if not key or call.key or call.number not in self._calls:
                return
            call.key, call.is_sent = key, True
        remaining_s = call.remaining_s
        parts = NATIVE.encode_call(call.number, self.spec.codec.number, remaining_s, call.data)
        call.data = b""  # the query outlives its timeout: release the payload
        query_timeout_s = (
            _MAX_QUERY_TIMEOUT_S
            if remaining_s is None
            else min(_MAX_QUERY_TIMEOUT_S, remaining_s + _LATE_REPLY_WINDOW_S)
        )
        try:
            self._session.call(
                key,
                parts,
                query_timeout_s,
                lambda reply: self._handle_reply(call, reply),
                lambda: self._handle_query_finished(call),
            )
        except load_zenoh().ZError as error:  # the session was closed meanwhile
            _logger.debug("can't send a call of '%s': %s", self.spec.service, error)
            self._finish(call, self._closed_error())

    def _handle_reply(self, call: _Call, reply: Any) -> None:  # noqa: ANN401 - zenoh is not typed
        # Runs in a zenoh thread, or in the one that sends.
        if reply.ok is None:
            return  # an error of zenoh, such as a timeout
        sample = reply.ok
        attachment = b"" if sample.attachment is None else sample.attachment.to_bytes()
        try:
            number, outcome = NATIVE.read_reply([attachment, sample.payload.to_bytes()])
            if number != call.number:
                raise WireError(_("not a service reply"))
        except WireError as error:
            if self._rejections.add(error.reason):
                log_line = "malformed reply from the server of '%s': %s"
                _logger.warning(log_line, self.spec.service, error)
            return
        if not self._finish(call, outcome):
            with self._lock:
                self.late += 1

    def _handle_query_finished(self, call: _Call) -> None:
        # If no reply has arrived, the server has ended or never received the call.
        if call.key not in self._servers:
            self._finish(call, ServerGoneError(self.spec.service))
            return
        call.token_deadline = time.monotonic() + _TOKEN_DELAY_S
        self._deadlines.add(call.token_deadline)

    def _fail_without_reply(self, call: _Call, now: float) -> None:
        # Handles calls whose query is finished without a reply.
        if call.key not in self._servers:
            self._finish(call, ServerGoneError(self.spec.service))
        elif call.token_deadline <= now:
            template = _(
                "the server of '{service}' is connected but didn't reply; it may be unable to decode the "
                "call, or a router's access control denies '{key}'"
            )
            self._finish(call, NepError(template.format(service=self.spec.service, key=call.key)))

    # ---- events

    def handle_servers_changed(self) -> None:
        """Let the timeout thread send the waiting calls, because the servers of the service have changed."""
        self._deadlines.add(0.0)

    def expire(self, now: float) -> float:
        """Send waiting calls, fail expired ones, return the next deadline. See `ExpiringClient.expire`."""
        key = next(iter(self._servers), "")
        with self._lock:
            waiting_calls = [each for each in self._calls.values() if not each.key and each.deadline > now]
        for call in waiting_calls:
            self._send(call, key)
        with self._lock:
            finished_calls = [each for each in self._calls.values() if each.token_deadline < math.inf]
        for call in finished_calls:
            self._fail_without_reply(call, now)
        return super().expire(now)

    def _next_deadline_locked(self) -> float:
        token_deadlines = (each.token_deadline for each in self._calls.values())
        return min(super()._next_deadline_locked(), *token_deadlines, math.inf)

    def service_names(self, timeout_s: float) -> tuple[str, ...]:  # noqa: ARG002 - immediate
        """Return the names of services that have a server."""
        return tuple(sorted(self._session.roster.service_names))

    # ---- closing

    def close(self) -> None:
        """Unregister the client; calls in flight fail with `ClosedError`."""
        in_flight = self._begin_close()
        if in_flight is None:
            return
        self._session.discard_service(self)
        self._deadlines.remove_client(self)
        self._on_close(self)
        self._fail_closed(in_flight)
