"""Base class of servers: call queue, statistics, and counting of malformed calls."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from functools import partial

from nep.backends.bases.rejections import RejectionCounter
from nep.backends.services import (
    CallQueue,
    IncomingCall,
    ServerSpec,
    ServerStats,
    limit_reply_size,
    rejection_reply,
)
from nep.errors import NepError, WireError
from nep.protocol.requests import PublisherCount, clamp_count
from nep.protocol.service_wire import Framing, Reply

_logger = logging.getLogger("nep")


class BaseServer:
    """Server with a call queue.

    Subclasses queue each call with `_enqueue`, and pass each reply through `_count_reply` before sending it.

    Args:
        spec: Settings of the server.
    """

    def __init__(self, spec: ServerSpec) -> None:
        self.spec = spec
        self.calls = CallQueue()
        self.stats = ServerStats()
        self.is_closed = False
        self._rejections = RejectionCounter()

    def _read_call(
        self,
        framing: Framing,
        parts: Sequence[bytes | memoryview],
        reply: Callable[[int, Reply], bool],
        now: float | None = None,
    ) -> IncomingCall | None:
        # Returns None for a malformed call. `reply` gets the number of the call, too.
        try:
            call = framing.read_call(parts)
        except WireError as error:
            self._count_malformed(error)
            return None
        return self._new_call(call.data, call.codec, call.timeout_s, partial(reply, call.number), now)

    def _new_call(
        self,
        data: bytes | memoryview,
        codec: int,
        timeout_s: float | None,
        reply: Callable[[Reply], bool],
        now: float | None = None,
    ) -> IncomingCall:
        # `now` is the time (`time.monotonic`) at which the call was received, by default the current time.
        deadline = None
        if timeout_s is not None:
            deadline = (time.monotonic() if now is None else now) + timeout_s
        return IncomingCall(data, codec, deadline, reply)

    def _enqueue(self, call: IncomingCall) -> None:
        # Queues a call, or rejects it if the queue is full or closed.
        if not self.calls.put(call):
            self._reject(call)

    def _reject(self, call: IncomingCall) -> None:
        call.reply(rejection_reply(self.spec.service, is_closed=self.calls.is_closed))

    def _count_reply(self, reply: Reply) -> Reply:
        # Returns the reply to send, which is an error if `reply` is too large.
        limited_reply = limit_reply_size(reply)
        self.stats.add(limited_reply)
        return limited_reply

    def _count_malformed(self, error: NepError) -> None:
        self.stats.add_unreadable()
        if self._rejections.add(error.reason if isinstance(error, WireError) else str(error)):
            _logger.warning(
                "malformed call to '%s' (%d so far): %s", self.spec.service, self._rejections.count, error
            )

    def counts(self) -> PublisherCount:
        """Return the statistics that the graph shows."""
        stats = self.stats
        calls, problem = clamp_count(stats.calls), self._rejections.recent_message()
        return PublisherCount(
            self.spec.id, calls, clamp_count(stats.bytes), calls, None, problem, stats.errors
        )

    def begin_close(self) -> None:
        """Reject queued and new calls."""
        for call in self.calls.close():
            self._reject(call)
