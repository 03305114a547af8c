"""Spinning in an asyncio event loop. See `Node.spin_async`."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from nep.backends.base import SubscriberTransport
from nep.backends.services import CallQueue
from nep.nodes.loop_wait import LoopWait, loop_wait, yield_to_loop
from nep.nodes.work import NO_MESSAGE, Work
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import asyncio
else:
    asyncio = lazy_module("asyncio")


_MAX_BUSY_TURNS = 64
"""Number of consecutive turns with work before other coroutines get a turn."""


async def spin(work: Work, timeout_s: float | None) -> None:
    """Run the work of a node until the node is stopped or closed.

    Returns after `timeout_s` seconds at the latest; None is no limit.
    """
    loop = asyncio.get_running_loop()
    deadline = math.inf if timeout_s is None else work.clock() + timeout_s
    waiter = _LoopWaiter(work, loop, loop_wait())
    work.watch(waiter)
    busy_turns = 0
    try:
        while work.is_running and work.clock() < deadline:
            if await _run_once(work):
                busy_turns = (busy_turns + 1) % _MAX_BUSY_TURNS
                if not busy_turns:
                    await yield_to_loop()
                continue
            await waiter.wait(min(work.next_timer_delay_s, deadline - work.clock()))
        work.check_not_forked()
    finally:
        work.unwatch(waiter)
        waiter.close()
        work.reset_stop()


async def _run_once(work: Work) -> bool:
    # One turn: every due timer, one call per server, one message per callback. Returns False if idle.
    has_worked = work.run_servers()
    for timer in work.timers:
        if timer.claim_tick():
            has_worked = True
            await _await_result(timer.callback())
        if not work.is_running:
            return True
    for callback in work.callbacks:
        if not work.is_running:
            break
        item = work.next_item(callback.subscriber, with_message=callback.with_message)
        if item is not NO_MESSAGE:
            has_worked = True
            await _await_result(callback.call(item))
    return has_worked


async def _await_result(returned: object) -> None:
    if inspect.isawaitable(returned):
        await returned


class _LoopWaiter:
    """Waiter of a node that spins in an event loop. Messages, calls and `wake` end the wait."""

    def __init__(self, work: Work, loop: asyncio.AbstractEventLoop, waiter: LoopWait) -> None:
        self._work = work
        self._loop = loop
        self._loop_wait = waiter
        self._ready = asyncio.Event()
        self._watched: dict[SubscriberTransport, Callable[[], None]] = {}
        self._queues: list[CallQueue] = []
        """Queues of servers that wake this waiter until `close`."""

    def wake(self) -> None:
        # Thread-safe.
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._ready.set)

    async def wait(self, timeout_s: float) -> None:
        # Wait until there may be work, at most `timeout_s`.
        for subscriber in self._work.waiting_subscribers:
            if subscriber not in self._watched:
                call = self._watched[subscriber] = self._ready_callback(subscriber)
                self._loop_wait.watch(subscriber, call)
        for queue in self._work.services.queues:
            if queue not in self._queues:
                if not queue.enter_wait(self.wake):
                    return
                self._queues.append(queue)
        timeout_handle = (
            None if math.isinf(timeout_s) else self._loop.call_later(max(0.0, timeout_s), self._ready.set)
        )
        try:
            await self._ready.wait()
        finally:
            self._ready.clear()
            if timeout_handle is not None:
                timeout_handle.cancel()

    def _ready_callback(self, subscriber: SubscriberTransport) -> Callable[[], None]:
        def call() -> None:
            self._watched.pop(subscriber, None)
            self._ready.set()

        return call

    def close(self) -> None:
        for subscriber, call in self._watched.items():
            self._loop_wait.unwatch(subscriber, call)
        self._watched.clear()
        for queue in self._queues:
            queue.leave_wait(self.wake)
        self._queues.clear()
