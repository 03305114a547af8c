"""Spinning in an asyncio event loop. See `Node.spin_async`."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from nep.backends.base import SubscriberTransport
from nep.backends.services import CallQueue
from nep.nodes.loop_wait import LoopWait, give_way, loop_wait
from nep.nodes.work import NOTHING, Work
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import asyncio
else:
    asyncio = lazy_module("asyncio")

__all__ = ["spin"]

_TURNS = 64
"""Number of busy turns before other coroutines get a turn."""


async def spin(work: Work, timeout_s: float | None) -> None:
    """Run the work of a node until it is stopped or closed, or for `timeout_s` seconds."""
    loop = asyncio.get_running_loop()
    deadline = math.inf if timeout_s is None else work.clock() + timeout_s
    rests = _Rests(work, loop, loop_wait())
    work.watch(rests)
    turns = 0
    try:
        while work.is_running and work.clock() < deadline:
            if await _turn(work):
                turns = (turns + 1) % _TURNS
                if not turns:
                    await give_way()
                continue
            await rests.rest(min(work.due_s, deadline - work.clock()))
        work.check_not_forked()
    finally:
        work.unwatch(rests)
        rests.end()
        work.begin_anew()


async def _turn(work: Work) -> bool:
    # One turn: every due timer, one call per server, one message per callback. Returns False if idle.
    has_called = work.run_servers()
    for timer in work.timers:
        if timer.take_turn():
            has_called = True
            await _until_done(timer.callback())
        if not work.is_running:
            return True
    for callback in work.callbacks:
        if not work.is_running:
            break
        given = work.given(callback)
        if given is not NOTHING:
            has_called = True
            await _until_done(callback.call(given))
    return has_called


async def _until_done(returned: object) -> None:
    if inspect.isawaitable(returned):
        await returned


class _Rests:
    """Waiter of a node that spins in an event loop: woken by messages, calls and `wake` (a `Wakes`)."""

    def __init__(self, work: Work, loop: asyncio.AbstractEventLoop, waits: LoopWait) -> None:
        self._work = work
        self._loop = loop
        self._waits = waits
        self._rung = asyncio.Event()
        self._watched: dict[SubscriberTransport, Callable[[], None]] = {}
        self._calls: list[CallQueue] = []
        """Queues of servers that wake this waiter until `end`."""

    def wake(self) -> None:
        # Thread-safe.
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._rung.set)

    async def rest(self, timeout_s: float) -> None:
        # Wait until there may be work, at most `timeout_s`.
        for subscriber in self._work.waiting:
            if subscriber not in self._watched:
                call = self._watched[subscriber] = self._caller(subscriber)
                self._waits.watch(subscriber, call)
        for queue in self._work.services.queues:
            if queue not in self._calls:
                if not queue.enter_wait(self.wake):
                    return
                self._calls.append(queue)
        late = None if math.isinf(timeout_s) else self._loop.call_later(max(0.0, timeout_s), self._rung.set)
        try:
            await self._rung.wait()
        finally:
            self._rung.clear()
            if late is not None:
                late.cancel()

    def _caller(self, subscriber: SubscriberTransport) -> Callable[[], None]:
        def call() -> None:
            self._watched.pop(subscriber, None)
            self._rung.set()

        return call

    def end(self) -> None:
        for subscriber, call in self._watched.items():
            self._waits.unwatch(subscriber, call)
        self._watched.clear()
        for queue in self._calls:
            queue.leave_wait(self.wake)
        self._calls.clear()
