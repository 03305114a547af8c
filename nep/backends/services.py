"""Interface of back ends with services: transports of servers, clients and surveyors."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from nep.backends.connection import Configuration
from nep.errors import NepError
from nep.i18n import _
from nep.messages.codecs import Codec
from nep.protocol.service_wire import MAX_PAYLOAD_BYTES, CallKind, Reply, error_reply
from nep.system.forks import Generation, current_generation

_logger = logging.getLogger("nep")
MAX_CALLS = 1000
"""Maximum number of calls that a server queues, or that a client has in flight."""
MAX_CALL_BYTES = 256 * 2**20
"""Maximum total size in bytes of the calls that a server queues, or that a client has in flight."""


@dataclass(frozen=True)
class ServerSpec:
    """Settings of a new server.

    Attributes:
        id: Random id of the server.
        service: Name of the service.
        configuration: Connection through a master or to a fixed address.
        wait_s: Seconds to wait for the master; None waits forever.
        number: Secret that proves ownership of the id, see `nep.protocol.requests.is_proven`.
        msg_type: Service type, for back ends with typed services.
    """

    id: int
    service: str
    configuration: Configuration
    wait_s: float | None
    number: int = 0
    msg_type: str = "json"


@dataclass(frozen=True)
class ClientSpec:
    """Settings of a new client.

    Attributes:
        id: Random id of the client.
        service: Name of the service.
        codec: Codec of requests and replies.
        configuration: Connection through a master or to a fixed address.
        wait_s: Seconds to wait for the master; None waits forever.
        number: Secret that proves ownership of the id, see `nep.protocol.requests.is_proven`.
        msg_type: Requested service type, for back ends with typed services.
    """

    id: int
    service: str
    codec: Codec
    configuration: Configuration
    wait_s: float | None
    number: int = 0
    msg_type: str = "json"


class ServerStats:
    """Statistics of a server. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.calls = self.errors = self.refused = self.bytes = self.unreadable = 0

    def add(self, reply: Reply) -> None:
        """Count a call by the kind of its reply: answered, failed or rejected."""
        with self._lock:
            if reply.kind == CallKind.REJECTED:
                self.refused += 1
                return
            self.calls += 1
            self.bytes += len(reply.data)
            self.errors += reply.kind == CallKind.ERROR

    def add_unreadable(self) -> None:
        """Count a malformed request."""
        with self._lock:
            self.unreadable += 1


@dataclass(frozen=True)
class IncomingCall:
    """Request in a server's queue.

    Attributes:
        data: Encoded request.
        codec: Number of the codec of `data`.
        deadline: Time (`time.monotonic`) at which the client stops waiting; None if it waits forever.
        send_reply: Sends a reply; returns False if the reply can't be delivered.
    """

    data: bytes | memoryview
    codec: int
    deadline: float | None
    send_reply: Callable[[Reply], bool]
    _generation: Generation = field(default_factory=current_generation, init=False, repr=False)

    def reply(self, reply: Reply) -> bool:
        """Send a reply; return False if it can't be delivered, or if this is a forked child process."""
        return not self._generation.is_inherited and self.send_reply(reply)

    @property
    def is_late(self) -> bool:
        """True if the client has stopped waiting for the reply."""
        return self.deadline is not None and time.monotonic() >= self.deadline


class CallQueue:
    """Bounded FIFO queue of calls for a server's callback. Thread-safe."""

    def __init__(self) -> None:
        self._changed = threading.Condition(threading.Lock())
        self._calls: deque[IncomingCall] = deque()
        self._bytes = 0
        self._wake_callbacks: list[Callable[[], None]] = []
        self._is_closed = False
        self._generation = current_generation()

    @property
    def is_closed(self) -> bool:
        """True after `close`, when new calls are rejected, or if this is a forked child process."""
        return self._is_closed or self._generation.is_inherited

    def put(self, call: IncomingCall) -> bool:
        """Append a call and wake a waiting thread; return False if the queue is full or closed."""
        size = len(call.data)
        with self._changed:
            if self._is_closed or len(self._calls) >= MAX_CALLS or self._bytes + size > MAX_CALL_BYTES:
                return False
            self._calls.append(call)
            self._bytes += size
            self._changed.notify()
            wake_callbacks = tuple(self._wake_callbacks)
        for wake in wake_callbacks:
            wake()
        return True

    def pop(self, timeout_s: float = 0.0) -> IncomingCall | None:
        """Remove and return the oldest call; wait up to `timeout_s` seconds for one.

        Returns None on timeout or if the queue is closed and empty.
        """
        if self._generation.is_inherited:
            return None
        with self._changed:
            if timeout_s > 0.0:
                self._changed.wait_for(lambda: self._calls or self._is_closed, timeout_s)
            if not self._calls:
                return None
            call = self._calls.popleft()
            self._bytes -= len(call.data)
            return call

    def enter_wait(self, wake: Callable[[], None]) -> bool:
        """Register a function that is called for each new call; return False if a call is already queued."""
        with self._changed:
            if self._calls:
                return False
            self._wake_callbacks.append(wake)
            return True

    def leave_wait(self, wake: Callable[[], None]) -> None:
        """Unregister a function registered by `enter_wait`."""
        if self._generation.is_inherited:
            return
        with self._changed:
            self._wake_callbacks.remove(wake)

    def close(self) -> tuple[IncomingCall, ...]:
        """Reject new calls, wake all waiting threads, and return the calls that are still queued."""
        with self._changed:
            self._is_closed = True
            remaining = tuple(self._calls)
            self._calls.clear()
            self._bytes = 0
            self._changed.notify_all()
            return remaining


Outcome = Reply | NepError
"""Result of a call: the server's reply, or an error."""


@contextmanager
def wake_on_call(calls: Sequence[CallQueue], wake: Callable[[], None]) -> Iterator[bool]:
    """Call `wake` for each new call in `calls` while in the context.

    Yields False if a call is already queued.
    """
    entered: list[CallQueue] = []
    try:
        for queue in calls:
            if not queue.enter_wait(wake):
                break
            entered.append(queue)
        yield len(entered) == len(calls)
    finally:
        for queue in entered:
            queue.leave_wait(wake)


class OpenCall(Protocol):
    """Interface of a call in flight."""

    @property
    def number(self) -> int:
        """Number of the call, unique within its client."""


class ServerTransport(Protocol):
    """Interface of the servers of a back end."""

    calls: CallQueue
    stats: ServerStats

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Endpoints at which clients can reach the server."""

    @property
    def is_closed(self) -> bool:
        """True after `close`, or after the transport was closed."""

    def begin_close(self) -> None:
        """Unregister; reject queued and new calls. Doesn't wait."""

    def close(self, timeout_s: float) -> None:
        """Unregister and close the server; replies are flushed for up to `timeout_s` seconds. Idempotent."""


class ClientTransport(Protocol):
    """Interface of the clients of a back end."""

    @property
    def is_connected(self) -> bool:
        """True if a server is connected."""

    @property
    def late(self) -> int:
        """Number of replies that arrived after their call had timed out or was cancelled."""

    @property
    def is_closed(self) -> bool:
        """True after `close`, or after the transport was closed."""

    def start_call(
        self, data: bytes | memoryview, timeout_s: float | None, callback: Callable[[Outcome], None]
    ) -> OpenCall:
        """Send a call as soon as a server is connected, without waiting.

        Args:
            data: Encoded request.
            timeout_s: Seconds until the call fails; None waits forever.
            callback: Called once with the outcome. May run in the I/O thread; must return soon.

        Returns:
            The call in flight, for `cancel`.

        Raises:
            ClosedError: The client is closed.
            NepError: The request is too large, or too many calls or bytes are in flight.
        """

    def cancel(self, call: OpenCall) -> None:
        """Cancel a call; its callback isn't called."""

    def service_names(self, timeout_s: float) -> tuple[str, ...]:
        """Return the names of services that have a server; empty if the back end can't list services."""

    def close(self) -> None:
        """Unregister the client; calls in flight fail with `ClosedError`."""


class SurveyTransport(Protocol):
    """Interface of the surveyors of a back end."""

    @property
    def respondents(self) -> int:
        """Number of connected respondents."""

    @property
    def late(self) -> int:
        """Number of replies that arrived after their call had timed out or was cancelled."""

    @property
    def is_closed(self) -> bool:
        """True after `close`, or after the transport was closed."""

    def start_survey(
        self, data: bytes | memoryview, timeout_s: float | None, callback: Callable[[Outcome], None]
    ) -> Sequence[OpenCall]:
        """Send a request to all connected respondents, without waiting; return one call per respondent.

        `callback` is called with the outcome of each call. For the arguments and errors see
        `ClientTransport.start_call`.
        """

    def cancel_all(self, calls: Sequence[OpenCall]) -> None:
        """Cancel several calls; their callbacks aren't called."""

    def close(self) -> None:
        """Unregister the surveyor; calls in flight fail with `ClosedError`."""


class ServiceTransport(Protocol):
    """Interface of the transports of back ends with services."""

    def create_server(self, spec: ServerSpec) -> ServerTransport:
        """Create a server. Raises the same errors as `Transport.create_publisher`."""

    def create_client(self, spec: ClientSpec) -> ClientTransport:
        """Create a client. Raises the same errors as `Transport.create_subscriber`."""

    def create_surveyor(self, spec: ClientSpec) -> SurveyTransport:
        """Create a surveyor, whose respondents are all servers of `spec.service`.

        Raises the same errors as `create_client`.
        """


def check_call_limits(service: str, count: int, total_bytes: int, size: int) -> None:
    """Raise `NepError` if a call is too large, or if its client has too many calls or bytes in flight.

    Args:
        service: Name of the service.
        count: Number of calls in flight.
        total_bytes: Total size of the calls in flight in bytes.
        size: Size of the new call in bytes.
    """
    if size > MAX_PAYLOAD_BYTES:
        raise NepError(_("the call can't be sent: {reason}").format(reason=size_error_text(size)))
    if count >= MAX_CALLS or (total_bytes and total_bytes + size > MAX_CALL_BYTES):
        raise NepError(
            _("{count} calls of '{service}' are in flight; wait for their replies first").format(
                count=count, service=service
            )
        )


def limit_reply_size(reply: Reply) -> Reply:
    """Return `reply`, or an error reply if `reply` exceeds the size limit."""
    if len(reply.data) <= MAX_PAYLOAD_BYTES:
        return reply
    return error_reply(CallKind.ERROR, "EncodeError", size_error_text(len(reply.data)))


def rejection_reply(service: str, *, is_closed: bool) -> Reply:
    """Return the reply that rejects a call.

    Args:
        service: Name of the service.
        is_closed: True if the server is closed, False if its queue is full.
    """
    reason = (
        _("'{service}' is closing")
        if is_closed
        else _("'{service}' has too many pending calls; try again later")
    )
    return error_reply(CallKind.REJECTED, "", reason.format(service=service))


def size_error_text(size: int) -> str:
    """Return the error message for a payload of `size` bytes, which exceeds the limit."""
    return _(
        "the payload is {size} bytes, but calls allow at most {most}; publish large data on a topic"
    ).format(size=size, most=MAX_PAYLOAD_BYTES)
