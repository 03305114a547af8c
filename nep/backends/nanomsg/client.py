"""Client for calls over a REQ socket, without a master.

Each call has its own pynng context and a thread that waits for the reply. nng's automatic resending of
unanswered requests is disabled: the call fails instead, because the server may already have executed
it.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nep.backends.bases.deadlines import Deadlines
from nep.backends.bases.pending_calls import OutcomeCallback, PendingCall, PendingCalls
from nep.backends.nanomsg.library import Connections, load_pynng
from nep.backends.nanomsg.server import close_context, join_parts, split_parts
from nep.backends.services import ClientSpec, OpenCall, Outcome
from nep.errors import NepError, ServerGoneError, WireError
from nep.i18n import _
from nep.protocol.service_wire import ORIGINAL, Framing

_logger = logging.getLogger("nep")
_JSON_CODEC = 1
_JOIN_TIMEOUT_S = 2.0
_MAX_LATE_CALLS = 100
"""Maximum number of timed-out or cancelled calls whose late replies are still received and counted."""


@dataclass(eq=False)
class _Call(PendingCall):
    context: Any = None
    thread: threading.Thread | None = None


class NanomsgClient(PendingCalls[_Call]):
    """Client on a REQ socket. Implements `ClientTransport`."""

    def __init__(
        self,
        socket: Any,  # noqa: ANN401 - pynng is not typed
        spec: ClientSpec,
        framing: Framing,
        deadlines: Deadlines,
        on_close: Callable[[NanomsgClient], object],
    ) -> None:
        if framing is ORIGINAL and spec.codec.number != _JSON_CODEC:
            raise NepError(_("calls without a master use JSON; omit msg_type, or use wire='native'"))
        super().__init__(spec, _Call)
        self._socket = socket
        self._framing = framing
        self._deadlines = deadlines
        self._on_close = on_close
        self._connections = Connections(socket)
        self._late_calls: dict[int, _Call] = {}
        """Calls that timed out or were cancelled, oldest first, to count their late replies."""
        self._threads: set[threading.Thread] = set()

    @property
    def is_connected(self) -> bool:
        """True if a server is connected."""
        return not self.is_closed and bool(self._connections)

    # ---- calling

    def start_call(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> OpenCall:
        """Send a call. See `ClientTransport.start_call`."""
        with self._lock:
            call = self._add_locked(data, timeout_s, callback)
            call.context = self._socket.new_context()
            call.thread = threading.Thread(
                target=self._run, args=(call,), name=f"nep-call-{self.spec.service}", daemon=True
            )
            self._threads.add(call.thread)
            call.thread.start()
        self._deadlines.add(call.deadline)
        return call

    def _run(self, call: _Call) -> None:
        try:
            outcome = self._send_and_receive(call)
        except Exception as error:
            _logger.exception("call of '%s' failed", self.spec.service)
            outcome = NepError(_("the call failed: {reason}").format(reason=type(error).__name__))
        close_context(call.context)
        if outcome is not None:
            self._finish_or_count_late(call, outcome)
        with self._lock:
            self._threads.discard(threading.current_thread())

    def _send_and_receive(self, call: _Call) -> Outcome | None:
        # Returns None if the context was closed; the call already has its outcome then.
        nng = load_pynng()
        parts = self._framing.encode_call(call.number, self.spec.codec.number, call.remaining_s, call.data)
        try:
            call.context.send(join_parts(self._framing, parts))  # blocks until a server is connected
            call.is_sent, call.data = True, b""  # the context outlives the timeout: release the payload
            parts.clear()
            data = call.context.recv()
        except nng.ConnectionReset:
            return ServerGoneError(self.spec.service)
        except (nng.NNGException, TypeError):
            return None
        try:
            return self._framing.read_reply(split_parts(self._framing, data)).reply
        except WireError as error:
            return error

    def _finish_or_count_late(self, call: _Call, outcome: Outcome) -> None:
        with self._lock:
            is_abandoned = self._late_calls.pop(call.number, None) is not None
            self.late += is_abandoned and not isinstance(outcome, NepError)
        self._finish(call, outcome)

    def cancel(self, call: OpenCall) -> None:
        """Cancel a call; its callback isn't called."""
        with self._lock:
            cancelled = self._remove_locked(call.number)
        if cancelled is not None:
            self._abandon(cancelled)

    def _abandon(self, call: _Call) -> None:
        # Keeps the context of a sent call to count its late reply, within `_MAX_LATE_CALLS`; closes other
        # contexts. Call without the lock.
        with self._lock:
            if call.is_sent:
                self._late_calls[call.number] = call
            has_too_many_late_calls = len(self._late_calls) > _MAX_LATE_CALLS
            call_to_close = (
                self._late_calls.pop(next(iter(self._late_calls)))
                if has_too_many_late_calls
                else None
                if call.is_sent
                else call
            )
        if call_to_close is not None:
            close_context(call_to_close.context)

    def expire(self, now: float) -> float:
        """Fail expired calls and return the next deadline. See `ExpiringClient.expire`."""
        with self._lock:
            expired_calls = self._fail_locked(self._expired_locked(now))
            next_deadline = self._next_deadline_locked()
        for call in expired_calls:
            self._abandon(call)
            self._run_callback(call, self._timeout_error(call))
        return next_deadline

    def service_names(self, timeout_s: float) -> tuple[str, ...]:  # noqa: ARG002 - no master to query
        """Return an empty tuple, because services can't be listed without a master."""
        return ()

    # ---- closing

    def close(self) -> None:
        """Close the client; calls in flight fail with `ClosedError`. Idempotent."""
        in_flight = self._begin_close()
        if in_flight is None:
            return
        with self._lock:
            abandoned_calls, self._late_calls = list(self._late_calls.values()), {}
            threads = tuple(self._threads)
        self._deadlines.remove_client(self)
        self._on_close(self)
        for call in (*abandoned_calls, *in_flight):
            close_context(call.context)
        self._fail_closed(in_flight)
        deadline = time.monotonic() + _JOIN_TIMEOUT_S
        for thread in threads:
            if thread is not threading.current_thread():
                thread.join(max(0.0, deadline - time.monotonic()))
        self._socket.close()
