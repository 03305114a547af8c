"""Client for ROS services. Each call has its own connection and thread."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from nep.backends.bases.pending_calls import OutcomeCallback, PendingCall, PendingCalls
from nep.backends.ros.master import RosMasterUnreachable
from nep.backends.ros.process import RosProcess
from nep.backends.ros.service_connection import ServiceConnection
from nep.backends.ros.service_types import NEP_CALL, ServiceType, installed_service
from nep.backends.ros.type_mapping import version_error
from nep.backends.services import ClientSpec, OpenCall, Outcome
from nep.errors import NepError, NoServerError, ServerGoneError, ServiceTimeoutError
from nep.i18n import _
from nep.protocol.service_wire import CallKind, error_reply

_logger = logging.getLogger("nep")
_REQUEST_TIMEOUT_S = 0.5
_RETRY_S = 0.1
_LOOKUP_TIMEOUT_S = 0.2


@dataclass(eq=False)
class _Call(PendingCall):
    connection: ServiceConnection | None = None


class RosClient(PendingCalls[_Call]):
    """Client with its calls in flight."""

    def __init__(
        self, process: RosProcess, spec: ClientSpec, on_close: Callable[[RosClient], object]
    ) -> None:
        super().__init__(spec, _Call)
        self.process = process
        self.service = process.resolve_name(spec.service)
        self._on_close = on_close
        self._waiting_calls: list[_Call] = []
        self._is_discovering = False
        self._closed = threading.Event()
        self._threads: set[threading.Thread] = set()

    @property
    def is_connected(self) -> bool:
        """True if the master lists a server."""
        return not self.is_closed and bool(self.process.master.service_uri(self.service, _LOOKUP_TIMEOUT_S))

    def start_call(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> OpenCall:
        """Send a call. See `ClientTransport.start_call`."""
        with self._lock:
            call = self._add_locked(bytes(data), timeout_s, callback)
            self._queue_for_discovery_locked(call)
        return call

    # ---- server discovery, in one thread for all waiting calls

    def _queue_for_discovery_locked(self, call: _Call) -> None:
        # Call with the lock held.
        self._waiting_calls.append(call)
        if not self._is_discovering:
            self._is_discovering = True
            self._start_thread_locked(self._discover)

    def _start_thread_locked(self, target: Callable[..., None], *arguments: object) -> None:
        # Call with the lock held.
        name = f"nep-call-{self.spec.service}"
        thread = threading.Thread(target=target, args=arguments, name=name, daemon=True)
        self._threads = {each for each in self._threads if each.is_alive()} | {thread}
        thread.start()

    def _discover(self) -> None:
        # Runs until each waiting call has a server or has expired.
        while True:
            uri = self.process.master.service_uri(self.service, _REQUEST_TIMEOUT_S)
            now = time.monotonic()
            with self._lock:
                waiting_calls = [each for each in self._waiting_calls if each.number in self._calls]
                expired_calls = [] if uri else [each for each in waiting_calls if each.deadline <= now]
                ready_calls = waiting_calls if uri else []
                self._waiting_calls = [] if uri else [each for each in waiting_calls if each.deadline > now]
                for call in ready_calls[1:]:
                    self._start_thread_locked(self._run, call, uri)
                is_done = not self._waiting_calls or self.is_closed
                if is_done:
                    self._is_discovering = False
                next_deadline = min((each.deadline for each in self._waiting_calls), default=math.inf)
            for call in expired_calls:
                self._finish(call, NoServerError(self.spec.service, call.timeout_s or 0.0))
            if ready_calls:
                self._run(ready_calls[0], uri)
            if is_done:
                return
            self._closed.wait(max(0.0, min(_RETRY_S, next_deadline - time.monotonic())))

    # ---- calling, in one thread per call

    def _run(self, call: _Call, uri: str) -> None:
        try:
            with self.process.handshakes.acquire(uri, lambda: call.number not in self._calls, call.deadline):
                connection = ServiceConnection(uri, self.service, self.process.name, call.deadline)
        except OSError:  # no longer registered, or just closed
            self._retry_discovery(call)
            return
        try:
            outcome = self._call_server(call, connection)
        except NepError as error:
            outcome = error
        except Exception as error:
            _logger.exception("call of '%s' failed", self.spec.service)
            outcome = NepError(_("the call failed: {reason}").format(reason=type(error).__name__))
        finally:
            connection.close()
        self._finish(call, outcome)

    def _retry_discovery(self, call: _Call) -> None:
        # Waits first, so that a registered but unreachable server isn't retried in a tight loop.
        remaining_s = call.deadline - time.monotonic()
        self._closed.wait(max(0.0, min(_RETRY_S, remaining_s)))
        if remaining_s <= 0.0:
            self._finish(call, NoServerError(self.spec.service, call.timeout_s or 0.0))
            return
        with self._lock:
            if call.number in self._calls:
                self._queue_for_discovery_locked(call)

    def _call_server(self, call: _Call, connection: ServiceConnection) -> Outcome:
        service_type = self._type_of(connection)
        with self._lock:
            if call.number not in self._calls:
                return self._closed_error()  # cancelled or closed
            call.connection = connection
        try:
            has_succeeded, response = connection.call(
                service_type.encode_call(self.spec.codec, call.data, call.timeout_s)
            )
        except TimeoutError:
            return ServiceTimeoutError(self.spec.service, call.timeout_s or 0.0)
        except OSError:
            return ServerGoneError(self.spec.service)
        if has_succeeded:
            return service_type.decode_reply(response, self.spec.codec)
        if service_type is NEP_CALL:  # servers of this type report errors differently
            return ServerGoneError(self.spec.service)
        return error_reply(CallKind.ERROR, "ServiceException", response.decode("utf-8", "replace"))

    def _type_of(self, connection: ServiceConnection) -> ServiceType:
        service_type = installed_service(connection.header["type"])
        if connection.header.get("md5sum", "*") not in {"*", service_type.md5sum}:
            raise version_error(service_type.name)
        return service_type

    def cancel(self, call: OpenCall) -> None:
        """Cancel a call; its callback isn't called."""
        with self._lock:
            cancelled = self._remove_locked(call.number)
            if cancelled is not None:
                self._interrupt_locked(cancelled)

    def _interrupt_locked(self, call: _Call) -> None:
        # Ends the call's thread. Call with the lock held.
        if call.connection is not None:
            call.connection.interrupt()

    def service_names(self, timeout_s: float) -> tuple[str, ...]:
        """Return the names of services that have a server; empty if the master doesn't reply."""
        try:
            return tuple(sorted(self.process.master.services(timeout_s)))
        except RosMasterUnreachable:
            return ()

    def close(self, timeout_s: float = _REQUEST_TIMEOUT_S) -> None:
        """Unregister the client; calls in flight fail with `ClosedError`. Waits up to `timeout_s` seconds."""
        in_flight = self._begin_close()
        if in_flight is None:
            return
        with self._lock:
            for call in in_flight:
                self._interrupt_locked(call)
            threads = tuple(self._threads)
        self._closed.set()
        self._on_close(self)
        self._fail_closed(in_flight)
        deadline = time.monotonic() + timeout_s
        for thread in threads:
            if thread is not threading.current_thread():
                thread.join(max(0.0, deadline - time.monotonic()))
