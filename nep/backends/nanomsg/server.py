"""Server for calls (REP socket) and surveys (RESPONDENT socket) without a master.

Each call holds its own pynng context until its reply is sent, so that any number of calls can be
queued.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from typing import Any

from nep.backends.bases.server import BaseServer
from nep.backends.nanomsg.library import Connections, load_pynng
from nep.backends.services import ServerSpec
from nep.errors import WireError
from nep.protocol.service_wire import NATIVE, Framing, Reply, split_frame

_logger = logging.getLogger("nep")
REPLY_TIMEOUT_S = 2.0
"""Time limit in seconds for sending a reply to a client that doesn't read."""
_JOIN_TIMEOUT_S = 2.0
_LINGER_S = 0.2
"""Time in seconds to flush the last reply before closing. Skipped if all clients have disconnected.

Needed because pynng discards the queue of a closed socket.
"""


def join_parts(framing: Framing, parts: list[bytes | memoryview]) -> bytes:
    """Join the parts of a call or reply into one message.

    With the native framing, the message is the header and the payload; otherwise it is the payload alone.
    """
    return b"".join(parts) if framing is NATIVE else bytes(parts[-1])


def split_parts(framing: Framing, message: bytes) -> list[bytes]:
    """Split a message into the parts that `framing` parses; the reverse of `join_parts`."""
    return split_frame(message) if framing is NATIVE else [b"", message]


def receive(context: Any) -> bytes | None:  # noqa: ANN401 - pynng is not typed
    """Return the next message of a pynng context; None on timeout or if the context is closed."""
    try:
        data: bytes = context.recv()
    except (
        load_pynng().NNGException,
        TypeError,
    ):  # pynng raises TypeError for a context that is already closed
        return None
    return data


def close_context(context: Any) -> None:  # noqa: ANN401 - pynng is not typed
    """Close a pynng context. Idempotent."""
    with contextlib.suppress(load_pynng().NNGException, TypeError):
        context.close()


class NanomsgServer(BaseServer):
    """Server on a socket, with a thread that receives calls. Implements `ServerTransport`."""

    def __init__(
        self,
        socket: Any,  # noqa: ANN401 - pynng is not typed
        attach: Callable[[object], str],
        spec: ServerSpec,
        framing: Framing,
        on_close: Callable[[NanomsgServer], object],
    ) -> None:
        """Initialize the server.

        Args:
            socket: Socket of pynng.
            attach: Binds or connects the socket and returns its endpoint.
            spec: Settings of the server.
            framing: Format of calls and replies.
            on_close: Called when the server is closed.
        """
        super().__init__(spec)
        self._connections = Connections(socket)
        self.endpoints: tuple[str, ...] = (attach(socket),)
        self._socket = socket
        self._framing = framing
        self._on_close = on_close
        self._lock = threading.Lock()
        self._replied_at = 0.0
        self._contexts: set[Any] = set()
        """Contexts that wait for a call, or whose call is not answered yet."""
        self._thread = threading.Thread(target=self._receive_calls, name=f"nep-{spec.service}", daemon=True)
        self._thread.start()

    def _receive_calls(self) -> None:
        while (context := self._new_context()) is not None and (data := receive(context)) is not None:
            try:
                call = self._framing.read_call(split_parts(self._framing, data))
            except WireError as error:
                self._reject_context(context, error)
                continue
            reply = self._reply_function(context, call.number)
            self._enqueue(self._new_call(call.data, call.codec, call.timeout_s, reply))

    def _reject_context(self, context: Any, error: WireError) -> None:  # noqa: ANN401 - pynng is not typed
        with self._lock:
            self._contexts.discard(context)
        close_context(context)
        self._count_malformed(error)

    def _new_context(self) -> Any:  # noqa: ANN401 - pynng is not typed
        # Returns None when closed.
        with self._lock:
            if self.is_closed:
                return None
            context = self._socket.new_context()
            self._contexts.add(context)
            return context

    def _reply_function(self, context: Any, number: int) -> Callable[[Reply], bool]:  # noqa: ANN401 - see above
        def reply_to_call(reply: Reply) -> bool:
            limited_reply = self._count_reply(reply)
            with self._lock:
                if self.is_closed:
                    return False
                self._replied_at = time.monotonic()
            try:
                context.send(join_parts(self._framing, self._framing.encode_reply(number, limited_reply)))
            except (load_pynng().NNGException, TypeError) as error:  # the client has stopped waiting
                _logger.debug("can't send a reply of '%s': %s", self.spec.service, error)
                return False
            finally:
                with self._lock:
                    self._replied_at = time.monotonic()
                    is_open = context in self._contexts
                    self._contexts.discard(context)
                if is_open:
                    close_context(context)
            return True

        return reply_to_call

    def close(self, timeout_s: float) -> None:
        """Close the server; replies are flushed for up to `timeout_s` seconds. Idempotent."""
        self.begin_close()
        with self._lock:
            if self.is_closed:
                return
            self.is_closed = True
        self._on_close(self)
        self._connections.wait_for_none(min(timeout_s, self._replied_at + _LINGER_S - time.monotonic()))
        with self._lock:
            contexts, self._contexts = tuple(self._contexts), set()
        for context in contexts:  # before the socket: pynng can't close contexts of a closed socket
            close_context(context)
        self._socket.close()
        self._thread.join(_JOIN_TIMEOUT_S)
