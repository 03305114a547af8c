"""Client of a service. Created by `Node.new_client`."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, Literal

from nep.backends.services import ClientTransport, OpenCall, Outcome
from nep.errors import (
    ClosedError,
    DecodeError,
    NepError,
    NoServerError,
    RequestRefusedError,
    ServiceError,
)
from nep.i18n import _
from nep.messages.codecs import Codec, codec_by_number
from nep.patterns.services.typed import UNTYPED, CallTypes
from nep.protocol.service_wire import CallKind, read_error_reply
from nep.system.arguments import check_optional_time_limit
from nep.system.forks import current_generation
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import asyncio

    from typing_extensions import Self
else:
    asyncio = lazy_module("asyncio")


TimeLimit = float | Literal["default"] | None
"""Time limit of a call in seconds; None for no limit, "default" for the client's time limit."""

WAIT_SLICE_S = 0.1
"""Maximum duration of a single wait in seconds, because on Windows Ctrl+C doesn't interrupt a wait."""
_SERVICE_QUERY_TIMEOUT_S = 0.5
"""Time limit in seconds for querying the names of existing services after a service was not found."""
_JOIN_TIMEOUT_S = 2.0


class Client:
    """Client of a service. Thread-safe; calls may run concurrently. Usable as a context manager.

    A call waits for a server and its reply. Created by `Node.new_client`.

        with node.new_client("add", timeout_s=2.0) as add:
            print(add.call({"a": 1, "b": 2}))

    Attributes:
        service: Name of the service.
        timeout_s: Default time limit of calls in seconds; None for no limit.
    """

    def __init__(
        self,
        transport: ClientTransport,
        service: str,
        codec: Codec,
        timeout_s: float | None,
        on_close: Callable[[Client], object],
        types: CallTypes = UNTYPED,
    ) -> None:
        self._transport = transport
        self._types = types
        self.service = service
        self.timeout_s = timeout_s
        self._codec = types.request.codec(codec)
        self._on_close = on_close
        self._generation = current_generation()
        self._lock = threading.Lock()
        self._future_thread: _FutureThread | None = None
        self._sent_call: Future[object] | None = None

    @property
    def is_connected(self) -> bool:
        """True if a server was connected at the last check; this can be outdated."""
        return not self._generation.is_inherited and self._transport.is_connected

    @property
    def late(self) -> int:
        """Number of replies that were dropped because they arrived after the time limit."""
        return self._transport.late

    @property
    def is_closed(self) -> bool:
        """True if the client or its node was closed."""
        return self._generation.is_inherited or self._transport.is_closed

    # ---- calling

    def call(self, request: object, timeout_s: TimeLimit = "default") -> object:
        """Call the service and return its reply.

        Args:
            request: Value of the request.
            timeout_s: Time limit in seconds, for the server to appear and reply; None for no limit. Default:
                the client's.

        Raises:
            NoServerError: No server was found in time.
            ServiceTimeoutError: The server did not reply in time.
            ServerGoneError: The server stopped during the call.
            ServiceError: The server's callback raised an exception.
            RequestRefusedError: The server rejected the request.
            ClosedError: The client is closed.
            EncodeError: The request can't be encoded.
            DecodeError: The reply can't be decoded.
        """
        outcomes: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
        call = self._start_call(request, self._resolve_timeout(timeout_s), outcomes.put)
        try:
            while True:
                with contextlib.suppress(queue.Empty):
                    outcome = outcomes.get(timeout=WAIT_SLICE_S)
                    break
                if self._generation.is_inherited:
                    raise self._closed_error()
        except BaseException:  # also KeyboardInterrupt
            self._cancel(call)
            raise
        try:
            return self._result(outcome)
        except NoServerError as error:
            raise self._with_known_services(error) from None

    def call_async(self, request: object, timeout_s: TimeLimit = "default") -> Future[object]:
        """Call the service and return a future of the reply.

        The future can be cancelled. Its callbacks run in a thread of the client. `EncodeError` and
        `ClosedError` are raised by this method; the other errors of `call` are set on the future.

        Args:
            request: Value of the request.
            timeout_s: Time limit in seconds, as for `call`.
        """
        if self.is_closed:
            raise self._closed_error()
        with self._lock:
            if self._future_thread is None:
                self._future_thread = _FutureThread(f"nep-client-{self.service}")
            future_thread = self._future_thread
        future: Future[object] = Future()
        call = self._start_call(
            request,
            self._resolve_timeout(timeout_s),
            lambda outcome: future_thread.add(lambda: self._complete_future(future, outcome)),
        )
        future.add_done_callback(lambda done_future: self._cancel(call) if done_future.cancelled() else None)
        return future

    async def acall(self, request: object, timeout_s: TimeLimit = "default") -> object:
        """Call the service from a coroutine and return its reply.

        Args:
            request: Value of the request.
            timeout_s: Time limit in seconds, as for `call`.

        Raises:
            NepError: As `call` does.
        """
        loop = asyncio.get_running_loop()
        future: asyncio.Future[Outcome] = loop.create_future()

        def on_outcome(outcome: Outcome) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed
                loop.call_soon_threadsafe(_set_result, future, outcome)

        call = self._start_call(request, self._resolve_timeout(timeout_s), on_outcome)
        try:
            outcome = await future
        except BaseException:  # cancelled
            self._cancel(call)
            raise
        try:
            return self._result(outcome)
        except NoServerError as error:
            raise await loop.run_in_executor(None, self._with_known_services, error) from None

    # ---- API of the original NEP

    def send_info(self, request: object) -> None:
        """Send a request; `listen_info` returns the reply.

        Raises `NepError` if the reply to the previous request has not been read.
        """
        if self._sent_call is not None:
            raise NepError(_("the previous reply hasn't been read; call 'listen_info' first"))
        self._sent_call = self.call_async(request)

    def listen_info(self) -> object:
        """Return the reply to `send_info`.

        Raises the exceptions of `call`, and `NepError` if no request was sent.
        """
        sent_call, self._sent_call = self._sent_call, None
        if sent_call is None:
            raise NepError(_("no request was sent; call 'send_info' first"))
        done = threading.Event()
        sent_call.add_done_callback(lambda _future: done.set())
        while not done.wait(WAIT_SLICE_S):
            if self._generation.is_inherited:
                raise self._closed_error()
        return sent_call.result()

    # ---- outcome

    def _start_call(
        self, request: object, timeout_s: float | None, callback: Callable[[Outcome], None]
    ) -> OpenCall:
        if self.is_closed:
            raise self._closed_error()
        return self._transport.start_call(self._codec.encode(request).data, timeout_s, callback)

    def _cancel(self, call: OpenCall) -> None:
        if not self._generation.is_inherited:
            self._transport.cancel(call)

    def _resolve_timeout(self, timeout_s: TimeLimit) -> float | None:
        return self.timeout_s if timeout_s == "default" else check_optional_time_limit("timeout_s", timeout_s)

    def _result(self, outcome: Outcome) -> object:
        if isinstance(outcome, NepError):
            raise outcome
        if outcome.kind == CallKind.REPLY:
            codec = codec_by_number(outcome.codec)
            if codec is None:
                reason = _("this version doesn't know the codec of the reply; update nep")
                raise DecodeError(str(outcome.codec), len(outcome.data), reason)
            return self._types.reply.read(codec.decode(outcome.data, {}), len(outcome.data))
        name, reason = read_error_reply(outcome.data)
        if outcome.kind == CallKind.ERROR:
            raise ServiceError(self.service, name, reason)
        raise RequestRefusedError(
            _("the server of '{service}' rejected the call: {reason}").format(
                service=self.service, reason=reason
            )
        )

    def _with_known_services(self, error: NoServerError) -> NoServerError:
        # Adds the existing services to the error.
        if error.address:
            return error
        return NoServerError(
            error.service, error.timeout_s, self._transport.service_names(_SERVICE_QUERY_TIMEOUT_S)
        )

    def _complete_future(self, future: Future[object], outcome: Outcome) -> None:
        if not future.set_running_or_notify_cancel():
            return
        try:
            result = self._result(outcome)
        except Exception as error:  # noqa: BLE001 - raised when the result is read
            future.set_exception(error)
        else:
            future.set_result(result)

    # ---- closing

    def close(self) -> None:
        """Unregister and close the client. Running calls raise `ClosedError`. Idempotent."""
        if self._generation.is_inherited:
            return
        self._transport.close()
        self.join()
        self._on_close(self)

    def join(self) -> None:
        """Complete the futures of the calls that have ended and stop their thread, within two seconds.

        Call this after the transport has closed, which ends all calls.
        """
        with self._lock:
            future_thread, self._future_thread = self._future_thread, None
        if future_thread is not None:
            future_thread.close()

    def _closed_error(self) -> ClosedError:
        return ClosedError(
            _("client of '{service}'").format(service=self.service), is_forked=self._generation.is_inherited
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Client({self.service!r})"


class _FutureThread:
    """Thread that completes futures, so that slow done-callbacks don't block a socket."""

    def __init__(self, name: str) -> None:
        self._jobs: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def add(self, job: Callable[[], None]) -> None:
        self._jobs.put(job)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()

    def close(self) -> None:
        self._jobs.put(None)
        if self._thread is not threading.current_thread():
            self._thread.join(_JOIN_TIMEOUT_S)


def _set_result(future: asyncio.Future[Outcome], outcome: Outcome) -> None:
    if not future.done():
        future.set_result(outcome)
