"""LoopWait: coroutines of a loop of asyncio wait for messages, in one thread for all of them.

The thread waits for every subscriber that a coroutine waits for, and tells the loop when one may have
something; the message itself is read in the loop. So a message costs no thread, and a coroutine that is
cancelled has not taken one. No descriptor is given to the loop: that works with Windows' loop as well.
"""

from __future__ import annotations

import threading
import weakref
from collections import deque
from collections.abc import AsyncGenerator, Callable, Coroutine, Generator
from contextlib import suppress
from types import coroutine
from typing import TYPE_CHECKING

from nep.backends.base import SubscriberTransport
from nep.nodes.shared_wait import SharedWait
from nep.system import forks
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import asyncio
else:
    asyncio = lazy_module("asyncio")

__all__ = ["LoopWait", "give_way", "loop_wait"]

_LOOK_S = 1.0
"""How often the thread looks whether its loop was closed without `asyncio.run`'s farewell."""
_JOIN_S = 5.0

Call = Callable[[], None]

_waits: dict[int, LoopWait] = {}
"""By the loop's id; the loop itself must not be kept alive."""
_inherited: list[LoopWait] = []
"""Those of the process that forked this one: kept, because nothing of them may be touched."""
_lock = threading.Lock()


def _forked() -> None:
    """In a child: there is no thread, and no loop goes on."""
    global _lock  # noqa: PLW0603 - there is one a process
    _lock = threading.Lock()
    _inherited.extend(_waits.values())
    _waits.clear()


forks.in_child(_forked)


def loop_wait() -> LoopWait:
    """The one of the running loop, made when there is none. Raises `TooManyFilesError`."""
    loop = asyncio.get_running_loop()
    with _lock:
        known = _waits.get(id(loop))
        if known is None or not known.serves(loop):
            known = LoopWait(loop)
            known.start()
            _waits[id(loop)] = known
        return known


@coroutine
def give_way() -> Generator[None, None, None]:
    """Await it, and the other coroutines of the loop have their turn."""
    yield


class LoopWait:
    """See the module. Everything but `close` is to be called in the loop's thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = weakref.ref(loop)
        self._id = id(loop)
        self._wait = SharedWait()
        self._calls: dict[SubscriberTransport, list[Call]] = {}
        self._orders: deque[tuple[bool, SubscriberTransport]] = deque()
        self._is_over = False
        self._thread = threading.Thread(target=self._run, name="nep-async", daemon=True)
        self._farewell = self._until_shutdown()

    def start(self) -> None:
        """Start the thread, and let the loop end it when `asyncio.run` is over."""
        try:
            self._thread.start()
        except BaseException:
            self._wait.close()
            raise
        _step(self._farewell.asend(None))

    def serves(self, loop: asyncio.AbstractEventLoop) -> bool:
        """Whether it is this loop's, and has not ended."""
        return self._loop() is loop and not self._is_over

    def watch(self, subscriber: SubscriberTransport, call: Call) -> None:
        """Call this once, when the subscriber may have something or is closed; unless `unwatch` is called."""
        calls = self._calls.setdefault(subscriber, [])
        calls.append(call)
        if len(calls) == 1:
            self._order(True, subscriber)

    def unwatch(self, subscriber: SubscriberTransport, call: Call) -> None:
        """Do not call it any more. May be called when it was called already."""
        calls = self._calls.get(subscriber)
        if calls is not None and call in calls:
            calls.remove(call)
            if not calls:
                del self._calls[subscriber]
                self._order(False, subscriber)

    def close(self) -> None:
        """End the thread."""
        self._is_over = True
        self._wait.wake()
        if threading.current_thread() is not self._thread:
            self._thread.join(_JOIN_S)

    async def _until_shutdown(self) -> AsyncGenerator[None, None]:
        """The loop closes its asynchronous generators before it ends, this one among them."""
        try:
            yield
        finally:
            self.close()

    def _order(self, is_armed: bool, subscriber: SubscriberTransport) -> None:
        self._orders.append((is_armed, subscriber))
        self._wait.wake()

    def _ring(self, subscribers: list[SubscriberTransport]) -> None:
        """In the loop: these may have something."""
        for subscriber in subscribers:
            for call in self._calls.pop(subscriber, ()):
                call()

    # ---- in the thread

    def _run(self) -> None:
        try:
            while not self._is_over:
                rung = self._wait.wait(_LOOK_S)
                rung += self._obeyed()
                if not self._has_told(rung):
                    return
        finally:
            self._is_over = True
            self._wait.close()
            with _lock:
                if _waits.get(self._id) is self:
                    del _waits[self._id]

    def _obeyed(self) -> list[SubscriberTransport]:
        """Arm and disarm what was ordered; those that may have something already."""
        rung = []
        while self._orders:
            is_armed, subscriber = self._orders.popleft()
            if not is_armed:
                self._wait.disarm(subscriber)
            elif not self._wait.arm(subscriber):
                rung.append(subscriber)
        return rung

    def _has_told(self, rung: list[SubscriberTransport]) -> bool:
        """Tell the loop who may have something; False when it is not there any more."""
        loop = self._loop()
        if loop is None or loop.is_closed():
            return False
        if rung:
            try:
                loop.call_soon_threadsafe(self._ring, rung)
            except RuntimeError:  # it was closed just now
                return False
        return True


def _step(awaitable: Coroutine[None, None, None]) -> None:
    """Go on to where it yields: it awaits nothing before."""
    with suppress(StopIteration):
        awaitable.send(None)
