"""Manual service calls, one at a time, each with its reply or the reason for its failure."""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, replace
from typing import Literal

from app.core.faults import error_text
from app.core.network.source import Job
from app.core.run.acting.arming import Arming, Target
from app.core.run.acting.json_text import format_json
from nep.errors import NepError, NoServerError, ServiceError, WaitTimeoutError
from nep.i18n import _, number
from nep.nodes.node import Node
from nep.patterns.services.client import Client

TIMEOUT_S = 2.0
MIN_TIMEOUT_S, MAX_TIMEOUT_S = 0.1, 120.0
MAX_RECORDS = 200
MAX_REPLIES = 20
"""Number of the newest calls whose replies are stored."""
MAX_REPLY_LENGTH = 1_000_000
MAX_CLIENTS = 20

State = Literal["waiting", "answered", "failed", "canceled"]


@dataclass(frozen=True, slots=True)
class CallRecord:
    """One call of a service.

    Attributes:
        started_s: Time of the start in seconds since 1970.
        duration_s: Duration in seconds.
        error: Reason for a failure, or "".
        reply: Value of the reply.
        text: Reply as JSON; shortened if `is_truncated` is True.
        is_retained: False if `reply` and `text` were discarded in favour of newer calls.
    """

    number: int
    service: str
    request: str
    started_s: float
    timeout_s: float
    state: State = "waiting"
    duration_s: float = 0.0
    error: str = ""
    reply: object = None
    text: str = ""
    is_truncated: bool = False
    is_retained: bool = True
    was_sent: bool = False
    """True if the request was sent."""


@dataclass(slots=True, eq=False)
class _CallInFlight:
    """Call in flight. Any thread may set the result; only the first result counts."""

    number: int
    turn: int
    requested_s: float
    future: Future[object] | None = None
    is_over: bool = False


@dataclass(frozen=True, slots=True)
class _CallResult:
    number: int
    state: State
    duration_s: float
    error: str = ""
    reply: object = None
    text: str = ""
    is_truncated: bool = False


class ServiceCalls:
    """Manual service calls, one at a time; they are allowed only while sending is armed.

    Not thread-safe; use it from the main thread.
    """

    def __init__(
        self,
        arming: Arming,
        submit: Callable[[str, Job], None],
        clock: Callable[[], float] = time.monotonic,
        clock_s: Callable[[], float] = time.time,
    ) -> None:
        # `submit` runs a job with Studio's node (`app.core.network.source.Source.submit`).
        self._arming, self._submit, self._clock, self._clock_s = arming, submit, clock, clock_s
        self._numbers = itertools.count(1)
        self._records: deque[CallRecord] = deque(maxlen=MAX_RECORDS)
        self._lock = threading.Lock()
        self._results: deque[_CallResult] = deque(maxlen=MAX_RECORDS)
        self._in_flight: _CallInFlight | None = None
        self._finished_calls: list[CallRecord] = []
        self._clients: dict[str, Client] = {}
        self.revision = 0

    @property
    def records(self) -> Sequence[CallRecord]:
        """Calls, oldest first. The last one may be in flight."""
        return self._records

    @property
    def in_flight(self) -> CallRecord | None:
        """Call in flight, or None."""
        last = self._records[-1] if self._records else None
        return last if last is not None and last.state == "waiting" else None

    @property
    def elapsed_s(self) -> float:
        """Seconds since the start of the call in flight; 0 if there is none."""
        return self._clock() - self._in_flight.requested_s if self._in_flight is not None else 0.0

    def call(self, service: str, request: object, request_text: str, timeout_s: float) -> CallRecord:
        """Call a service and return the record of the call.

        Args:
            service: Name of the service.
            request: Request as a value.
            request_text: Request as shown to the user.
            timeout_s: Timeout in seconds, limited to `MIN_TIMEOUT_S` to `MAX_TIMEOUT_S`.

        Raises:
            NepError: Another call is in flight.
        """
        if self.in_flight is not None:
            raise NepError(_("Wait for the reply of {service} first.").format(service=self.in_flight.service))
        timeout_s = min(MAX_TIMEOUT_S, max(MIN_TIMEOUT_S, timeout_s))
        record = CallRecord(next(self._numbers), service, request_text, self._clock_s(), timeout_s)
        call = _CallInFlight(record.number, self._arming.turn, self._clock())
        self._in_flight = call
        self._add_record(record)
        self._submit("", lambda node: self._start(node, call, record, request))
        return record

    def cancel(self) -> None:
        """Stop waiting for the reply. The server may still execute the call."""
        self._cancel("canceled", _("cancelled; the server may still execute the call"))

    def tick(self) -> list[CallRecord]:
        """Apply results; return the calls that ended since the last tick, including cancelled ones."""
        while self._results:
            result = self._results.popleft()
            index = next((i for i, each in enumerate(self._records) if each.number == result.number), None)
            if index is None or self._records[index].state != "waiting":
                continue
            self._apply(index, result)
        pending_record, call = self.in_flight, self._in_flight
        has_started = call is None or call.future is not None  # from then on, the client measures the timeout
        if pending_record is not None and not has_started and self.elapsed_s > pending_record.timeout_s:
            error = _("no master was found within {time} s").format(time=number(pending_record.timeout_s))
            self._cancel("failed", error)
        finished, self._finished_calls = self._finished_calls, []
        return finished

    def clear(self) -> None:
        """Remove all past calls."""
        pending_record = self.in_flight
        self._records.clear()
        if pending_record is not None:
            self._records.append(pending_record)
        self.revision += 1

    def close(self) -> None:
        """Cancel the call in flight. The node closes the clients."""
        self._cancel("canceled", _("cancelled; the server may still execute the call"))
        self._clients.clear()

    # ---- private

    def _add_record(self, record: CallRecord) -> None:
        self._records.append(record)
        for index in range(len(self._records) - MAX_REPLIES):
            if self._records[index].is_retained:
                self._records[index] = replace(self._records[index], reply=None, text="", is_retained=False)
        self.revision += 1

    def _apply(self, index: int, result: _CallResult) -> None:
        updated = replace(
            self._records[index],
            state=result.state,
            duration_s=result.duration_s,
            error=result.error,
            reply=result.reply,
            text=result.text,
            is_truncated=result.is_truncated,
            was_sent=self._in_flight is not None and self._in_flight.future is not None,
        )
        self._records[index] = updated
        self._finished_calls.append(updated)
        self._in_flight = None
        self.revision += 1

    def _cancel(self, state: State, error: str) -> None:
        call, pending_record = self._in_flight, self.in_flight
        if call is None or pending_record is None:
            return
        with self._lock:
            call.is_over = True
            future = call.future
        if future is not None:
            future.cancel()
        self._apply(len(self._records) - 1, _CallResult(call.number, state, self.elapsed_s, error))

    def _start(self, node: Node, call: _CallInFlight, record: CallRecord, request: object) -> None:
        # Runs in the network thread.
        start_s = time.monotonic()
        try:
            client = self._open_client(node, record.service)
            target = Target("service", record.service)

            def start_call() -> None:
                with self._lock:
                    if call.is_over:
                        return
                    call.future = client.call_async(request, record.timeout_s)

            if not self._arming.run_if_armed(call.turn, target, start_call):
                raise NepError(_("not called: no longer armed"))
        except Exception as error:  # noqa: BLE001 - reported as the result of this call
            text = str(error) if isinstance(error, NepError) else error_text(error)
            self._results.append(_CallResult(record.number, "failed", 0.0, text))
            return
        if call.future is not None:
            call.future.add_done_callback(lambda future: self._on_reply(record, start_s, future))

    def _open_client(self, node: Node, service: str) -> Client:
        client = self._clients.get(service)
        if client is None or client.is_closed:
            if len(self._clients) >= MAX_CLIENTS:
                self._clients.pop(next(iter(self._clients))).close()
            client = self._clients[service] = node.new_client(service)
        return client

    def _on_reply(self, record: CallRecord, start_s: float, future: Future[object]) -> None:
        # Runs in the client's thread.
        duration_s = time.monotonic() - start_s
        try:
            reply = future.result()
            text = format_json(reply)
        except CancelledError:
            return
        except Exception as error:  # noqa: BLE001 - the server's callback may raise anything
            self._results.append(
                _CallResult(record.number, "failed", duration_s, failure_reason(error, record.timeout_s))
            )
            return
        is_truncated = len(text) > MAX_REPLY_LENGTH
        retained_reply = None if is_truncated else reply
        self._results.append(
            _CallResult(
                record.number,
                "answered",
                duration_s,
                reply=retained_reply,
                text=text[:MAX_REPLY_LENGTH],
                is_truncated=is_truncated,
            )
        )


def failure_reason(error: Exception, timeout_s: float) -> str:
    """Return the reason why a call has no reply, such as a timeout or an error reported by the server.

    Args:
        error: Exception of the call.
        timeout_s: Timeout of the call in seconds.
    """
    if isinstance(error, NoServerError):
        return _("no server")
    if isinstance(error, WaitTimeoutError):
        return _("no reply within {time} s").format(time=number(timeout_s))
    if isinstance(error, ServiceError):
        return _("rejected: {reason}").format(reason=error.reason)
    return str(error) if isinstance(error, NepError) else error_text(error)
