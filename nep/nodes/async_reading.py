"""Reading messages in an asyncio event loop. See `Subscriber.receive_async`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from nep.backends.base import SubscriberTransport
from nep.errors import ClosedError
from nep.messages.message import Message
from nep.nodes.loop_wait import give_way, loop_wait
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import asyncio

    from typing_extensions import Self
else:
    asyncio = lazy_module("asyncio")

__all__ = ["AsyncMessages", "AsyncReader"]

_TURN = 64
"""Number of messages read without waiting before other coroutines get a turn."""


class AsyncReader:
    """Reader of one subscriber's messages in an event loop.

    `poll` returns the next message without waiting.
    """

    def __init__(self, transport: SubscriberTransport, poll: Callable[[], Message | None]) -> None:
        self._transport = transport
        self._poll = poll
        self._at_once = 0

    async def receive(self, timeout_s: float | None) -> Message | None:
        """Return the next message, or None after `timeout_s` seconds. Cancelling it loses no message."""
        self._at_once += 1
        if self._at_once >= _TURN:
            self._at_once = 0
            await give_way()
        message = self._poll()
        if message is not None or timeout_s == 0.0:
            return message
        self._at_once = 0
        loop = asyncio.get_running_loop()
        deadline = None if timeout_s is None else loop.time() + timeout_s
        while deadline is None or loop.time() < deadline:
            await self._rung(loop, deadline)
            message = self._poll()
            if message is not None:
                return message
        return None

    async def _rung(self, loop: asyncio.AbstractEventLoop, deadline: float | None) -> None:
        # Wait until there may be a message, at most until `deadline`.
        rung = loop.create_future()

        def call() -> None:
            if not rung.done():
                rung.set_result(None)

        waits = loop_wait()
        late = None if deadline is None else loop.call_at(deadline, call)
        waits.watch(self._transport, call)
        try:
            await rung
        finally:
            waits.unwatch(self._transport, call)
            if late is not None:
                late.cancel()


class AsyncMessages:
    """Asynchronous iterator over the messages of a subscriber; ends when it is closed."""

    def __init__(self, reader: AsyncReader) -> None:
        self._reader = reader

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Message:
        try:
            message = await self._reader.receive(None)
        except ClosedError:
            raise StopAsyncIteration from None
        if message is None:  # unreachable: receive(None) waits without limit
            raise StopAsyncIteration
        return message
