"""Server: answers the calls of a service. Made by `Node.new_server`."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import TYPE_CHECKING

from nep.backends.services import CallQueue, IncomingCall, ServerTransport
from nep.errors import ClosedError, DecodeError, EncodeError, NepError
from nep.i18n import _
from nep.messages.codecs import codec_numbered
from nep.patterns.services.typed import UNTYPED, CallTypes
from nep.protocol.service_wire import CallKind, Reply, failure
from nep.system.arguments import limit, seconds
from nep.system.log_rarely import is_logged

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Callback", "Server"]

_logger = logging.getLogger("nep.patterns.services")

SLICE_S = 0.1
"""Waits are cut into slices of this length, because Windows does not interrupt a wait for Ctrl+C."""
_END_S = 2.0

Callback = Callable[[object], object]
"""Takes the request and returns the answer, or a `concurrent.futures.Future` with the answer.

None is sent as an empty map.
"""


class Server:
    """Answers calls: by its callback, or by `listen_info` and `send_info`. May be used from any thread.

    A callback runs in the thread that spins its node, or with `threads` in so many threads of the server's
    own. What it raises becomes the client's `ServiceError`, and is logged. A callback that returns a
    `concurrent.futures.Future` does not block the next call: the call is answered when the future is done,
    by the thread that ends it. With types of its own a request that does not fit is refused, which the client
    gets as `RequestRefusedError`, and no callback is called.
    """

    def __init__(
        self,
        transport: ServerTransport,
        service: str,
        callback: Callback | None,
        threads: int,
        on_close: Callable[[Server], object],
        types: CallTypes = UNTYPED,
    ) -> None:
        self._transport = transport
        self._types = types
        self.service = service
        self._callback = callback
        self._on_close = on_close
        self._is_forked = False
        self._asked: IncomingCall | None = None
        self._asked_lock = threading.Lock()
        self._failures = 0
        self._threads = tuple(
            threading.Thread(target=self._work, name=f"nep-server-{service}-{number}", daemon=True)
            for number in range(1, threads + 1)
        )
        for thread in self._threads:
            thread.start()

    @property
    def calls(self) -> int:
        """Calls that were answered, also with an error."""
        return self._transport.tally.calls

    @property
    def errors(self) -> int:
        """Calls that were answered with an error."""
        return self._transport.tally.errors

    @property
    def refused(self) -> int:
        """Calls that were not carried out: there was no room, nobody waited any more, or it closed."""
        return self._transport.tally.refused

    @property
    def unreadable(self) -> int:
        """What came and was no call at all; each reason is logged."""
        return self._transport.tally.unreadable

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Where it is reached."""
        return self._transport.endpoints

    @property
    def is_closed(self) -> bool:
        """Whether it, or its node, was closed."""
        return self._transport.is_closed

    @property
    def spun(self) -> CallQueue | None:
        """The calls that are answered by who spins its node; None when others answer them."""
        return self._transport.calls if self._callback is not None and not self._threads else None

    # ---- with a callback

    def run_one(self) -> bool:
        """Answer the oldest call that waits; whether there was one. For who spins its node."""
        call = self._transport.calls.take()
        if call is not None:
            self._carry_out(call)
        return call is not None

    def _work(self) -> None:
        while not self._transport.calls.is_closed:
            call = self._transport.calls.take(SLICE_S)
            if call is None:
                continue
            try:
                self._carry_out(call)
            except BaseException:  # also SystemExit: its client was told, and the thread goes on
                _logger.exception("a thread of the server of '%s' was to end; it goes on", self.service)

    def _carry_out(self, call: IncomingCall) -> None:
        if call.is_late:
            call.answer(failure(CallKind.REFUSED, "", _("nobody waits for the answer any more")))
            return
        try:
            request = self._decoded(call)
        except DecodeError as error:
            call.answer(failure(CallKind.REFUSED, "", str(error)))
            return
        try:
            answer = self._callback(request) if self._callback is not None else None
            if isinstance(answer, Future):
                answer.add_done_callback(partial(self._answer_later, call))
                return
            reply = self._encoded(answer, call.codec)
        except Exception as error:  # noqa: BLE001 - sent to the client
            reply = self._failure(error)
        except BaseException as error:  # Ctrl+C: who waits is told, and it comes out of `spin`
            call.answer(_failed(error))
            raise
        call.answer(reply)

    def _answer_later(self, call: IncomingCall, done: Future[object]) -> None:
        """Answer a call whose callback returned a future."""
        try:
            reply = self._encoded(done.result(), call.codec)
        except BaseException as error:  # noqa: BLE001 - includes CancelledError
            reply = self._failure(error)
        call.answer(reply)

    def _failure(self, error: BaseException) -> Reply:
        # Logged at increasing intervals.
        self._failures += 1
        if is_logged(self._failures):
            _logger.warning(
                "the callback of '%s' failed (%d so far)", self.service, self._failures, exc_info=error
            )
        return _failed(error)

    def _decoded(self, call: IncomingCall) -> object:
        codec = codec_numbered(call.codec)
        if codec is None:
            reason = _("this version has no such codec; update nep")
            raise DecodeError(str(call.codec), len(call.data), reason)
        return self._types.request.read(codec.decode(call.data, {}), len(call.data))

    def _encoded(self, answer: object, number: int) -> Reply:
        codec = codec_numbered(number)
        if codec is None:
            reason = _("this version has no such codec; update nep")
            raise EncodeError(str(number), type(answer).__name__, reason)
        its = self._types.answer
        given = {} if answer is None and its.is_any else answer
        return Reply(CallKind.ANSWER, its.codec(codec).encode(given).data, number)

    # ---- without one, as the original NEP has it

    def listen_info(self, timeout_s: float | None = None) -> object:
        """The next request; `send_info` answers it. Waits for ever, or `timeout_s` seconds; then None.

        Raises `ClosedError`, and `NepError` when a callback answers, or the last request is not answered.
        """
        seconds("timeout_s", timeout_s)
        if self._callback is not None:
            raise NepError(
                _("the callback of '{service}' answers; make a server without one").format(
                    service=self.service
                )
            )
        if self._asked is not None:
            raise NepError(_("answer the last request first; use 'send_info'"))
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._transport.calls.is_closed:
            left = SLICE_S if deadline is None else min(SLICE_S, deadline - time.monotonic())
            call = self._transport.calls.take(max(0.0, left))
            if call is None:
                if left <= 0.0:
                    return None
                continue
            try:
                request = self._decoded(call)
            except DecodeError as error:
                call.answer(failure(CallKind.REFUSED, "", str(error)))
                continue
            with self._asked_lock:
                self._asked = call
            return request
        raise self._closed_error()

    def send_info(self, answer: object) -> None:
        """Answer the request that `listen_info` gave. Raises `EncodeError`, `ClosedError`, `NepError`."""
        if self._transport.is_closed:
            raise self._closed_error()
        with self._asked_lock:
            call = self._asked
            if call is None:
                raise NepError(_("there is no request to answer; call 'listen_info' first"))
            reply = self._encoded(answer, call.codec)
            self._asked = None
        call.answer(reply)

    # ---- the end

    def close(self, timeout_s: float = _END_S) -> None:
        """Unregister and end; calls that wait are refused. May be called twice.

        A callback that runs in a thread of the server's own is waited for, `timeout_s` at most.
        """
        limit("timeout_s", timeout_s)
        if self._is_forked:
            return
        deadline = time.monotonic() + timeout_s
        self._transport.begin_close()
        self.join(timeout_s)
        self._transport.close(max(0.0, deadline - time.monotonic()))
        self._on_close(self)

    def join(self, timeout_s: float) -> None:
        """Wait for its own threads, whose queue is closed, `timeout_s` at most."""
        deadline = time.monotonic() + timeout_s
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(max(0.0, deadline - time.monotonic()))

    def forked(self) -> None:
        """In a child that was forked. See `nep.system.forks`."""
        self._is_forked = True
        self._asked = None
        self._threads = ()
        self._asked_lock = threading.Lock()
        self._transport.forked()

    def _closed_error(self) -> ClosedError:
        return ClosedError(_("server of '{service}'").format(service=self.service), is_forked=self._is_forked)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Server({self.service!r})"


def _failed(error: BaseException) -> Reply:
    """What its client is told: what it is called, and what it says; never where in the program."""
    try:
        reason = str(error)
    except Exception:  # noqa: BLE001 - an error that cannot even be told must not hold up its client
        reason = ""
    return failure(CallKind.ERROR, type(error).__name__, reason)
