"""Reading messages in an asyncio event loop. See `Subscriber.receive_async`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from nep.backends.base import SubscriberTransport
from nep.errors import ClosedError
from nep.messages.message import Message
from nep.nodes.loop_wait import loop_wait, yield_to_loop
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import asyncio

    from typing_extensions import Self
else:
    asyncio = lazy_module("asyncio")


_MAX_READS_PER_TURN = 64
"""Number of messages read without waiting before other coroutines get a turn."""


class AsyncReader:
    """Reader of one subscriber's messages in an asyncio event loop.

    Args:
        transport: Transport of the subscriber.
        poll: Returns the next message without waiting, or None. Raises `ClosedError` if the subscriber
            is closed.
    """

    def __init__(self, transport: SubscriberTransport, poll: Callable[[], Message | None]) -> None:
        self._transport = transport
        self._poll = poll
        self._reads_in_turn = 0

    async def receive(self, timeout_s: float | None) -> Message | None:
        """Return the next message; None after `timeout_s` seconds. Cancelling loses no message.

        If `timeout_s` is None, it waits without limit. Raises `ClosedError` if the subscriber is
        closed.
        """
        self._reads_in_turn += 1
        if self._reads_in_turn >= _MAX_READS_PER_TURN:
            self._reads_in_turn = 0
            await yield_to_loop()
        message = self._poll()
        if message is not None or timeout_s == 0.0:
            return message
        self._reads_in_turn = 0
        loop = asyncio.get_running_loop()
        deadline = None if timeout_s is None else loop.time() + timeout_s
        while deadline is None or loop.time() < deadline:
            await self._wait_until_ready(loop, deadline)
            message = self._poll()
            if message is not None:
                return message
        return None

    async def _wait_until_ready(self, loop: asyncio.AbstractEventLoop, deadline: float | None) -> None:
        # Wait until there may be a message, at most until `deadline`.
        ready = loop.create_future()

        def set_ready() -> None:
            if not ready.done():
                ready.set_result(None)

        watcher = loop_wait()
        timeout = None if deadline is None else loop.call_at(deadline, set_ready)
        watcher.watch(self._transport, set_ready)
        try:
            await ready
        finally:
            watcher.unwatch(self._transport, set_ready)
            if timeout is not None:
                timeout.cancel()


class AsyncMessages:
    """Asynchronous iterator over the messages of a subscriber. Ends when the subscriber is closed."""

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
