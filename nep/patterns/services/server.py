"""Server of a service. Created by `Node.new_server`."""

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
from nep.messages.codecs import codec_by_number
from nep.patterns.services.typed import UNTYPED, CallTypes
from nep.protocol.service_wire import CallKind, Reply, error_reply
from nep.system.arguments import check_optional_time_limit, check_time_limit
from nep.system.forks import current_generation
from nep.system.log_rarely import is_logged

if TYPE_CHECKING:
    from typing_extensions import Self


_logger = logging.getLogger("nep.patterns.services")

WAIT_SLICE_S = 0.1
"""Maximum duration of a single wait in seconds, because on Windows Ctrl+C doesn't interrupt a wait."""
_CLOSE_TIMEOUT_S = 2.0

Callback = Callable[[object], object]
"""Function that receives the request and returns the reply, or a `concurrent.futures.Future` of it.

A reply of None is sent as an empty map.
"""


class Server:
    """Server of a service, with a callback or with `listen_info` and `send_info`. Thread-safe.

    The callback runs in the thread that spins the node, or in the server's own threads. An exception is
    logged and raised at the client as `ServiceError`. A callback that returns a `concurrent.futures.Future`
    does not block the next call: the reply is sent when the future is done, by the thread that completes it.
    A request that doesn't match the declared type is rejected (`RequestRefusedError` at the client) without
    calling the callback.

        node.new_server("add", lambda request: {"sum": request["a"] + request["b"]})
        node.spin()

    Attributes:
        service: Name of the service.
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
        self._generation = current_generation()
        self._open_request: IncomingCall | None = None
        self._open_request_lock = threading.Lock()
        self._failure_count = 0
        self._threads = tuple(
            threading.Thread(target=self._run_thread, name=f"nep-server-{service}-{number}", daemon=True)
            for number in range(1, threads + 1)
        )
        for thread in self._threads:
            thread.start()

    @property
    def calls(self) -> int:
        """Number of answered calls, including calls answered with an error."""
        return self._transport.stats.calls

    @property
    def errors(self) -> int:
        """Number of calls answered with an error."""
        return self._transport.stats.errors

    @property
    def refused(self) -> int:
        """Number of rejected calls (queue full, time limit passed, or server closing)."""
        return self._transport.stats.refused

    @property
    def unreadable(self) -> int:
        """Number of received frames that were not valid calls; the reasons are logged."""
        return self._transport.stats.unreadable

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Addresses at which clients reach the server."""
        return self._transport.endpoints

    @property
    def is_closed(self) -> bool:
        """True if the server or its node was closed."""
        return self._generation.is_inherited or self._transport.is_closed

    @property
    def spin_queue(self) -> CallQueue | None:
        """Queue of the calls that the spinning thread serves; None without a callback or with own threads."""
        return self._transport.calls if self._callback is not None and not self._threads else None

    def run_one(self) -> bool:
        """Serve the oldest queued call; return False if the queue is empty. Called by the spinning thread."""
        call = self._transport.calls.pop()
        if call is not None:
            self._execute(call)
        return call is not None

    def _run_thread(self) -> None:
        while not self._transport.calls.is_closed:
            call = self._transport.calls.pop(WAIT_SLICE_S)
            if call is None:
                continue
            try:
                self._execute(call)
            except BaseException:  # also SystemExit: the client has its reply, and the thread must go on
                _logger.exception(
                    "a callback of the server of '%s' tried to end its thread; the thread continues",
                    self.service,
                )

    def _execute(self, call: IncomingCall) -> None:
        if call.is_late:
            call.reply(error_reply(CallKind.REJECTED, "", _("the client no longer waits for the reply")))
            return
        try:
            request = self._decode_request(call)
        except DecodeError as error:
            call.reply(error_reply(CallKind.REJECTED, "", str(error)))
            return
        try:
            result = self._callback(request) if self._callback is not None else None
            if isinstance(result, Future):
                result.add_done_callback(partial(self._reply_when_done, call))
                return
            reply = self._encode_reply(result, call.codec)
        except Exception as error:  # noqa: BLE001 - sent to the client
            reply = self._log_failure(error)
        except BaseException as error:  # KeyboardInterrupt: reply, then let it propagate out of `spin`
            call.reply(_error_reply(error))
            raise
        call.reply(reply)

    def _reply_when_done(self, call: IncomingCall, future: Future[object]) -> None:
        try:
            reply = self._encode_reply(future.result(), call.codec)
        except BaseException as error:  # noqa: BLE001 - includes CancelledError
            reply = self._log_failure(error)
        call.reply(reply)

    def _log_failure(self, error: BaseException) -> Reply:
        # Logged at increasing intervals.
        self._failure_count += 1
        if is_logged(self._failure_count):
            _logger.warning(
                "the callback of '%s' failed (%d so far)", self.service, self._failure_count, exc_info=error
            )
        return _error_reply(error)

    def _decode_request(self, call: IncomingCall) -> object:
        codec = codec_by_number(call.codec)
        if codec is None:
            reason = _("this version doesn't know the codec of the request; update nep")
            raise DecodeError(str(call.codec), len(call.data), reason)
        return self._types.request.read(codec.decode(call.data, {}), len(call.data))

    def _encode_reply(self, result: object, number: int) -> Reply:
        codec = codec_by_number(number)
        if codec is None:
            reason = _("this version doesn't know the codec of the reply; update nep")
            raise EncodeError(str(number), type(result).__name__, reason)
        answer_type = self._types.reply
        value = {} if result is None and answer_type.is_any else result
        return Reply(CallKind.REPLY, answer_type.codec(codec).encode(value).data, number)

    # ---- without a callback: API of the original NEP

    def listen_info(self, timeout_s: float | None = None) -> object:
        """Return the next request, or None after the time limit. Reply to it with `send_info`.

        Args:
            timeout_s: Time limit in seconds; None waits without limit.

        Raises:
            ClosedError: The server is closed.
            NepError: The server has a callback, or the last request is not answered yet.
        """
        check_optional_time_limit("timeout_s", timeout_s)
        if self._callback is not None:
            raise NepError(
                _(
                    "the callback of '{service}' sends the replies; to use this function, create a server "
                    "without a callback"
                ).format(service=self.service)
            )
        if self._generation.is_inherited:
            raise self._closed_error()
        if self._open_request is not None:
            raise NepError(_("the previous request has no reply yet; call 'send_info' first"))
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._transport.calls.is_closed:
            remaining_s = WAIT_SLICE_S if deadline is None else min(WAIT_SLICE_S, deadline - time.monotonic())
            call = self._transport.calls.pop(max(0.0, remaining_s))
            if call is None:
                if remaining_s <= 0.0:
                    return None
                continue
            try:
                request = self._decode_request(call)
            except DecodeError as error:
                call.reply(error_reply(CallKind.REJECTED, "", str(error)))
                continue
            with self._open_request_lock:
                self._open_request = call
            return request
        raise self._closed_error()

    def send_info(self, answer: object) -> None:
        """Reply to the request that `listen_info` returned.

        Raises:
            EncodeError: The reply can't be encoded.
            ClosedError: The server is closed.
            NepError: No request is open.
        """
        if self.is_closed:
            raise self._closed_error()
        with self._open_request_lock:
            call = self._open_request
            if call is None:
                raise NepError(_("no request to reply to; call 'listen_info' first"))
            reply = self._encode_reply(answer, call.codec)
            self._open_request = None
        call.reply(reply)

    # ---- closing

    def close(self, timeout_s: float = _CLOSE_TIMEOUT_S) -> None:
        """Unregister and close the server; waiting calls are rejected. Idempotent.

        Args:
            timeout_s: Time limit in seconds for callbacks running in the server's own threads.
        """
        check_time_limit("timeout_s", timeout_s)
        if self._generation.is_inherited:
            return
        deadline = time.monotonic() + timeout_s
        self._transport.begin_close()
        self.join(timeout_s)
        self._transport.close(max(0.0, deadline - time.monotonic()))
        self._on_close(self)

    def join(self, timeout_s: float) -> None:
        """Wait at most `timeout_s` seconds for the server's own threads to end.

        Call this after the server's queue was closed.
        """
        deadline = time.monotonic() + timeout_s
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(max(0.0, deadline - time.monotonic()))

    def _closed_error(self) -> ClosedError:
        return ClosedError(
            _("server of '{service}'").format(service=self.service), is_forked=self._generation.is_inherited
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Server({self.service!r})"


def _error_reply(error: BaseException) -> Reply:
    # The client gets the class and the message, but no traceback.
    try:
        reason = str(error)
    except Exception:  # noqa: BLE001 - `str` of an exception may raise, and the client must still get a reply
        reason = ""
    return error_reply(CallKind.ERROR, type(error).__name__, reason)
