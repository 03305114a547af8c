"""Calls in flight of a client: limits, deadlines, outcomes and callbacks. Base class of all clients."""

from __future__ import annotations

import itertools
import logging
import math
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Generic, TypeVar

from nep.backends.services import ClientSpec, OpenCall, Outcome, check_call_limits
from nep.errors import ClosedError, NepError, NoServerError, ServerGoneError, ServiceTimeoutError
from nep.i18n import _
from nep.protocol.requests import SubscriberCount, clamp_count

_logger = logging.getLogger("nep")

OutcomeCallback = Callable[[Outcome], None]


@dataclass(eq=False)
class PendingCall:
    """Call in flight.

    Attributes:
        number: Number of the call, unique within its client.
        data: Encoded request.
        timeout_s: Seconds after which the call fails, or None.
        deadline: Time of the failure (`time.monotonic`), or infinity.
        callback: Function that receives the outcome.
        is_sent: True if the call was sent to a server.
    """

    number: int
    data: bytes | memoryview
    timeout_s: float | None
    deadline: float
    callback: OutcomeCallback
    is_sent: bool = False

    def __post_init__(self) -> None:
        self.size = len(self.data)
        """Size of the request in bytes, also after `data` was released."""

    @property
    def remaining_s(self) -> float | None:
        """Seconds until the deadline, at least 0; None without a deadline."""
        return None if self.deadline == math.inf else max(0.0, self.deadline - time.monotonic())


C = TypeVar("C", bound=PendingCall)


class PendingCalls(Generic[C]):
    """Base class of clients that stores the calls in flight, guarded by `_lock`.

    Args:
        spec: Settings of the client.
        new_call: Class of the calls.
        lock: Lock that guards the calls; None creates one.
    """

    def __init__(
        self, spec: ClientSpec, new_call: type[C], lock: AbstractContextManager[object] | None = None
    ) -> None:
        self.spec = spec
        self.is_closed = False
        self.late = 0
        """Number of replies that arrived after their call had timed out or was cancelled."""
        self._new_call = new_call
        self._lock = threading.Lock() if lock is None else lock
        self._calls: dict[int, C] = {}
        self._bytes = 0
        self._numbers = itertools.count(1)
        self._answered = self._failed = 0

    # ---- with the lock held

    def _add_locked(self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback) -> C:
        # Raises `ClosedError`, and `NepError` if a limit is exceeded.
        if self.is_closed:
            raise self._closed_error()
        check_call_limits(self.spec.service, *self._load_locked(), len(data))
        deadline = math.inf if timeout_s is None else time.monotonic() + timeout_s
        call = self._new_call(next(self._numbers), data, timeout_s, deadline, callback)
        self._calls[call.number] = call
        self._bytes += call.size
        return call

    def _load_locked(self) -> tuple[int, int]:
        # Number and total size in bytes of the calls that count towards the limits.
        return len(self._calls), self._bytes

    def _remove_locked(self, number: int) -> C | None:
        # Returns None if the call is no longer in flight.
        call = self._calls.pop(number, None)
        if call is not None:
            self._bytes -= call.size
        return call

    def _fail_locked(self, calls: Iterable[C]) -> list[C]:
        # Removes calls and counts them as failed; returns those that were still in flight.
        failed = [each for each in calls if self._remove_locked(each.number) is not None]
        self._failed += len(failed)
        return failed

    def _expired_locked(self, now: float) -> list[C]:
        return [each for each in self._calls.values() if each.deadline <= now]

    def _next_deadline_locked(self) -> float:
        return min((each.deadline for each in self._calls.values()), default=math.inf)

    # ---- without the lock

    def cancel(self, call: OpenCall) -> None:
        """Cancel a call; its callback isn't called."""
        with self._lock:
            self._remove_locked(call.number)

    def cancel_all(self, calls: Sequence[OpenCall]) -> None:
        """Cancel several calls; their callbacks aren't called."""
        for call in calls:
            self.cancel(call)

    def _finish(self, call: C, outcome: Outcome) -> bool:
        # Returns False if the call is no longer in flight.
        is_error = isinstance(outcome, NepError)
        with self._lock:
            if self._remove_locked(call.number) is None:
                return False
            self._answered += not is_error
            self._failed += is_error
        self._run_callback(call, outcome)
        return True

    def _fail_orphaned(self, is_orphaned: Callable[[C], bool]) -> None:
        # Fails the calls whose server has closed or was killed.
        with self._lock:
            failed = self._fail_locked([each for each in self._calls.values() if is_orphaned(each)])
        for call in failed:
            self._run_callback(call, ServerGoneError(self.spec.service))

    def _run_callback(self, call: C, outcome: Outcome) -> None:
        # The callback may use the client.
        try:
            call.callback(outcome)
        except Exception:  # a failing callback must not affect other calls
            _logger.exception("result callback for '%s' raised", self.spec.service)

    def _timeout_error(self, call: C) -> NepError:
        error_class = ServiceTimeoutError if call.is_sent else NoServerError
        return error_class(self.spec.service, call.timeout_s or 0.0)

    def expire(self, now: float) -> float:
        """Fail expired calls and return the next deadline. See `ExpiringClient.expire`."""
        with self._lock:
            expired_calls = self._fail_locked(self._expired_locked(now))
            next_deadline = self._next_deadline_locked()
        for call in expired_calls:
            self._run_callback(call, self._timeout_error(call))
        return next_deadline

    def counts(self) -> SubscriberCount:
        """Return the statistics shown in the graph."""
        return SubscriberCount(self.spec.id, clamp_count(self._answered), clamp_count(self._failed))

    def _begin_close(self) -> list[C] | None:
        # Rejects new calls; returns those in flight, for `_fail_closed`, or None if already closed.
        with self._lock:
            if self.is_closed:
                return None
            self.is_closed = True
            in_flight, self._calls = list(self._calls.values()), {}
            return in_flight

    def _fail_closed(self, calls: Iterable[C]) -> None:
        for call in calls:
            self._run_callback(call, self._closed_error())

    def _closed_error(self) -> ClosedError:
        return ClosedError(_("client of '{service}'").format(service=self.spec.service))
