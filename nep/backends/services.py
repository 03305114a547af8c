"""The contract of back ends that have services: what a server and a client need of them."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from nep.backends.connection import Configuration
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.messages.codecs import Codec
from nep.protocol.service_wire import PAYLOAD_MAX_BYTES, CallKind, Reply, failure

__all__ = [
    "CALLS_MAX",
    "CALLS_MAX_BYTES",
    "CallQueue",
    "ClientCalls",
    "ClientSpec",
    "ClientTransport",
    "IncomingCall",
    "OpenCall",
    "Outcome",
    "ServerSpec",
    "ServerTransport",
    "ServiceTransport",
    "SurveyTransport",
    "Tally",
    "check_calls",
    "fitting",
    "refusal",
    "too_large",
    "woken_by",
]

_logger = logging.getLogger("nep")
CALLS_MAX = 1000
"""So many calls wait in a server, or are under way in a client,"""
CALLS_MAX_BYTES = 256 * 2**20
"""and so many bytes of them."""


@dataclass(frozen=True)
class ServerSpec:
    """What a server shall be. `number` proves the id, as that of a publisher.

    `msg_type` is the type of its service, for back ends whose services have types.
    """

    id: int
    service: str
    configuration: Configuration
    wait_s: float | None
    number: int = 0
    msg_type: str = "json"


@dataclass(frozen=True)
class ClientSpec:
    """What a client shall be. `codec` is that of its calls and their answers.

    `msg_type` is what it was asked for, for back ends whose services have types.
    """

    id: int
    service: str
    codec: Codec
    configuration: Configuration
    wait_s: float | None
    number: int = 0
    msg_type: str = "json"


class Tally:
    """What a server did. Written in one thread at a time, read in any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.calls = self.errors = self.refused = self.bytes = self.unreadable = 0

    def add(self, reply: Reply) -> None:
        """One more call was answered so."""
        with self._lock:
            if reply.kind == CallKind.REFUSED:
                self.refused += 1
                return
            self.calls += 1
            self.bytes += len(reply.data)
            self.errors += reply.kind == CallKind.ERROR

    def add_unreadable(self) -> None:
        """Something came that was no call at all."""
        with self._lock:
            self.unreadable += 1


@dataclass(frozen=True)
class IncomingCall:
    """A call that waits in a server. `answer` sends what it is given; whether it could.

    `deadline` (of `time.monotonic`): afterwards nobody waits for the answer; None: for ever.
    """

    data: bytes | memoryview
    codec: int
    deadline: float | None
    answer: Callable[[Reply], bool]

    @property
    def is_late(self) -> bool:
        """Whether nobody waits for the answer any more."""
        return self.deadline is not None and time.monotonic() >= self.deadline


class CallQueue:
    """Calls that wait for a server's callback, oldest first, up to a bound. May be used from any thread."""

    def __init__(self) -> None:
        self._changed = threading.Condition(threading.Lock())
        self._calls: deque[IncomingCall] = deque()
        self._bytes = 0
        self._wakes: list[Callable[[], None]] = []
        self._is_closed = False

    @property
    def is_closed(self) -> bool:
        """Whether nothing is taken any more."""
        return self._is_closed

    def put(self, call: IncomingCall) -> bool:
        """Append a call and wake who waits; False when there is no room, or it is closed."""
        size = len(call.data)
        with self._changed:
            if self._is_closed or len(self._calls) >= CALLS_MAX or self._bytes + size > CALLS_MAX_BYTES:
                return False
            self._calls.append(call)
            self._bytes += size
            self._changed.notify()
            wakes = tuple(self._wakes)
        for wake in wakes:
            wake()
        return True

    def take(self, timeout_s: float = 0.0) -> IncomingCall | None:
        """The oldest call; waits for it at most `timeout_s` seconds, and not when closed."""
        with self._changed:
            if timeout_s > 0.0:
                self._changed.wait_for(lambda: self._calls or self._is_closed, timeout_s)
            if not self._calls:
                return None
            call = self._calls.popleft()
            self._bytes -= len(call.data)
            return call

    def enter_wait(self, wake: Callable[[], None]) -> bool:
        """From now on `wake` is called for every call; False when there is one already."""
        with self._changed:
            if self._calls:
                return False
            self._wakes.append(wake)
            return True

    def leave_wait(self, wake: Callable[[], None]) -> None:
        """It is called no more."""
        with self._changed:
            if wake in self._wakes:  # else this is a child that was forked
                self._wakes.remove(wake)

    def close(self) -> tuple[IncomingCall, ...]:
        """Take nothing any more and wake all threads; the calls that nobody took."""
        with self._changed:
            self._is_closed = True
            left = tuple(self._calls)
            self._calls.clear()
            self._bytes = 0
            self._changed.notify_all()
            return left

    def forked(self) -> None:
        """In a child that was forked: be closed and empty, without taking a lock."""
        self._changed = threading.Condition(threading.Lock())
        self._calls = deque()
        self._wakes = []
        self._is_closed = True


Outcome = Reply | NepError
"""How a call ended: with what the server gave back, or without it."""


@contextmanager
def woken_by(calls: Sequence[CallQueue], wake: Callable[[], None]) -> Iterator[bool]:
    """Inside of it `wake` is called for every call in one of `calls`; False when there is one already."""
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
    """A call that is under way."""

    @property
    def number(self) -> int:
        """Its number in its client."""


class CallUnderWay(OpenCall, Protocol):
    """One that a client keeps until it has ended."""

    @property
    def then(self) -> Callable[[Outcome], None]:
        """Is told how it ended."""

    @property
    def size(self) -> int:
        """Bytes of what was asked."""


C = TypeVar("C", bound=CallUnderWay)


class ClientCalls(Generic[C]):
    """The calls of a client that are under way, guarded by `_lock`: what clients of all back ends share."""

    def __init__(self, spec: ClientSpec) -> None:
        self.spec = spec
        self.is_closed = False
        self.late = 0
        """Answers that came when nobody waited for them any more."""
        self._lock = threading.Lock()
        self._calls: dict[int, C] = {}
        self._bytes = 0
        self._numbers = itertools.count(1)
        self._answered = self._failed = 0

    def _tell(self, call: C, outcome: Outcome) -> None:
        """Without the lock."""
        try:
            call.then(outcome)
        except Exception:  # the others get theirs
            _logger.exception("the end of a call of '%s' could not be told", self.spec.service)

    def _take(self, call: C) -> bool:
        """It is not under way any more; whether it was. With the lock held."""
        if self._calls.pop(call.number, None) is None:
            return False
        self._bytes -= call.size
        return True

    def forget(self, call: OpenCall) -> None:
        """Nobody waits for it any more."""
        with self._lock:
            known = self._calls.get(call.number)
            if known is not None:
                self._take(known)

    def forked(self) -> None:
        """In a child. See `ClientTransport.forked`."""
        self.is_closed = True
        self._lock = threading.Lock()
        self._calls = {}

    def _closed_error(self) -> ClosedError:
        return ClosedError(_("client of '{service}'").format(service=self.spec.service))


class ServerTransport(Protocol):
    """What a server answers through."""

    calls: CallQueue
    tally: Tally

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Where it is reached."""

    @property
    def is_closed(self) -> bool:
        """Whether it was closed, or its transport was."""

    def begin_close(self) -> None:
        """Unregister, and refuse the calls that wait and those that still come. Does not wait."""

    def close(self, timeout_s: float) -> None:
        """The same, and end; answers are delivered within `timeout_s`. May be called twice."""

    def forked(self) -> None:
        """In a child that was forked: be closed, without taking a lock or touching a socket."""


class ClientTransport(Protocol):
    """What a client calls through."""

    @property
    def is_connected(self) -> bool:
        """Whether a server was there a moment ago."""

    @property
    def late(self) -> int:
        """Answers that came when nobody waited for them any more."""

    @property
    def is_closed(self) -> bool:
        """Whether it was closed, or its transport was."""

    def begin(
        self, data: bytes | memoryview, timeout_s: float | None, then: Callable[[Outcome], None]
    ) -> OpenCall:
        """Send a call as soon as there is a server. `then` gets the outcome, once; it must return soon.

        It may be called in the thread that serves all sockets. Raises `ClosedError`, and `NepError` when too
        much is under way.
        """

    def forget(self, call: OpenCall) -> None:
        """Nobody waits for it any more; `then` is not called."""

    def known(self, timeout_s: float) -> tuple[str, ...]:
        """The services that have a server now; none when that cannot be told."""

    def close(self) -> None:
        """Unregister; calls that are under way end with `ClosedError`."""

    def forked(self) -> None:
        """In a child that was forked: be closed, without taking a lock or touching a socket."""


class SurveyTransport(Protocol):
    """What a surveyor asks through."""

    @property
    def respondents(self) -> int:
        """How many there are now."""

    @property
    def late(self) -> int:
        """Answers that came when nobody waited for them any more."""

    @property
    def is_closed(self) -> bool:
        """Whether it was closed, or its transport was."""

    def begin_all(
        self, data: bytes | memoryview, timeout_s: float | None, then: Callable[[Outcome], None]
    ) -> Sequence[OpenCall]:
        """Ask all respondents that are there. `then` gets the outcome of each; otherwise as `begin`."""

    def forget_all(self, calls: Sequence[OpenCall]) -> None:
        """Nobody waits for these any more; `then` is not called."""

    def close(self) -> None:
        """Unregister; calls that are under way end with `ClosedError`."""

    def forked(self) -> None:
        """In a child that was forked: be closed, without taking a lock or touching a socket."""


class ServiceTransport(Protocol):
    """A node's transport that has services."""

    def server(self, spec: ServerSpec) -> ServerTransport:
        """A new server. Raises as `Transport.publisher` does."""

    def client(self, spec: ClientSpec) -> ClientTransport:
        """A new client. Raises as `Transport.subscriber` does."""

    def survey(self, spec: ClientSpec) -> SurveyTransport:
        """A new surveyor of the respondents that are servers of `spec.service`. Raises as `client` does."""


def check_calls(service: str, count: int, used: int, size: int) -> None:
    """Whether a client that has so many calls and bytes under way may send one more. Raises `NepError`."""
    if size > PAYLOAD_MAX_BYTES:
        raise NepError(_("the call cannot be sent: {reason}").format(reason=too_large(size)))
    if count >= CALLS_MAX or (used and used + size > CALLS_MAX_BYTES):
        raise NepError(
            _("{count} calls of '{service}' are under way; wait for their answers first").format(
                count=count, service=service
            )
        )


def fitting(reply: Reply) -> Reply:
    """`reply` itself when it can travel, else the error that says why not."""
    if len(reply.data) <= PAYLOAD_MAX_BYTES:
        return reply
    return failure(CallKind.ERROR, "EncodeError", too_large(len(reply.data)))


def refusal(service: str, *, is_closed: bool) -> Reply:
    """Why a server does not take a call."""
    reason = _("'{service}' closes") if is_closed else _("'{service}' has too many calls that wait")
    return failure(CallKind.REFUSED, "", reason.format(service=service))


def too_large(size: int) -> str:
    """Why so many bytes cannot travel at once."""
    return _("it has {size} bytes, {most} are allowed; send large data as messages").format(
        size=size, most=PAYLOAD_MAX_BYTES
    )
