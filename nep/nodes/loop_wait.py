"""Waiting for messages in asyncio event loops, with one thread per loop.

The thread waits for all subscribers that coroutines wait for, and notifies the loop when one of them
may have a message; the message itself is read in the loop. Reading a message therefore needs no thread
switch, and cancelling a coroutine loses no message. No descriptor is registered with the loop, so this
also works with the proactor loop of Windows.
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


_LOOP_CHECK_INTERVAL_S = 1.0
"""Interval in seconds for detecting a loop that was closed without the shutdown of `asyncio.run`."""
_JOIN_TIMEOUT_S = 5.0

ReadyCallback = Callable[[], None]

_waits: dict[int, LoopWait] = {}
"""`LoopWait` of each event loop by the loop's id; a reference to the loop would keep it alive."""
_lock = threading.Lock()


def _reset_after_fork() -> None:
    # In a forked child there is no thread, and no loop runs.
    global _lock  # noqa: PLW0603 - one per process
    _lock = threading.Lock()
    forks.prevent_finalization(*_waits.values())
    _waits.clear()


forks.call_in_child(_reset_after_fork)


def loop_wait() -> LoopWait:
    """Return the `LoopWait` of the running loop; create it if needed.

    Raises `RuntimeError` if no loop is running, and `TooManyFilesError` if the process has too many
    open files.
    """
    loop = asyncio.get_running_loop()
    with _lock:
        watcher = _waits.get(id(loop))
        if watcher is None or not watcher.serves(loop):
            watcher = LoopWait(loop)
            watcher.start()
            _waits[id(loop)] = watcher
        return watcher


@coroutine
def yield_to_loop() -> Generator[None, None, None]:
    """Let other coroutines of the loop run."""
    yield


class LoopWait:
    """Thread that waits for the subscribers of all coroutines in an event loop.

    All methods except `close` must be called in the loop.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = weakref.ref(loop)
        self._id = id(loop)
        self._shared_wait = SharedWait()
        self._callbacks: dict[SubscriberTransport, list[ReadyCallback]] = {}
        self._requests: deque[tuple[bool, SubscriberTransport]] = deque()
        self._is_stopped = False
        self._thread = threading.Thread(target=self._run, name="nep-async", daemon=True)
        self._shutdown_hook = self._close_at_shutdown()

    def start(self) -> None:
        """Start the thread. `asyncio.run` stops the thread when the loop shuts down."""
        try:
            self._thread.start()
        except BaseException:
            self._shared_wait.close()
            raise
        _run_to_first_yield(self._shutdown_hook.asend(None))

    def serves(self, loop: asyncio.AbstractEventLoop) -> bool:
        """Return True if this object belongs to `loop` and its thread is running."""
        return self._loop() is loop and not self._is_stopped

    def watch(self, subscriber: SubscriberTransport, callback: ReadyCallback) -> None:
        """Call `callback` once when the subscriber may have a message or is closed."""
        callbacks = self._callbacks.setdefault(subscriber, [])
        callbacks.append(callback)
        if len(callbacks) == 1:
            self._request(True, subscriber)

    def unwatch(self, subscriber: SubscriberTransport, callback: ReadyCallback) -> None:
        """Cancel a `watch`. Has no effect if `callback` was already called."""
        callbacks = self._callbacks.get(subscriber)
        if callbacks is not None and callback in callbacks:
            callbacks.remove(callback)
            if not callbacks:
                del self._callbacks[subscriber]
                self._request(False, subscriber)

    def close(self) -> None:
        """Stop the thread."""
        self._is_stopped = True
        self._shared_wait.wake()
        if threading.current_thread() is not self._thread:
            self._thread.join(_JOIN_TIMEOUT_S)

    async def _close_at_shutdown(self) -> AsyncGenerator[None, None]:
        # asyncio.run closes asynchronous generators at shutdown, this one among them.
        try:
            yield
        finally:
            self.close()

    def _request(self, should_arm: bool, subscriber: SubscriberTransport) -> None:
        self._requests.append((should_arm, subscriber))
        self._shared_wait.wake()

    def _call_ready(self, subscribers: list[SubscriberTransport]) -> None:
        # Runs in the loop.
        for subscriber in subscribers:
            for callback in self._callbacks.pop(subscriber, ()):
                callback()

    # ---- thread

    def _run(self) -> None:
        try:
            while not self._is_stopped:
                ready = self._shared_wait.wait(_LOOP_CHECK_INTERVAL_S)
                ready += self._apply_requests()
                if not self._notify_loop(ready):
                    return
        finally:
            self._is_stopped = True
            self._shared_wait.close()
            with _lock:
                if _waits.get(self._id) is self:
                    del _waits[self._id]

    def _apply_requests(self) -> list[SubscriberTransport]:
        # Returns subscribers that may already have a message.
        ready = []
        while self._requests:
            should_arm, subscriber = self._requests.popleft()
            if not should_arm:
                self._shared_wait.disarm(subscriber)
            elif not self._shared_wait.arm(subscriber):
                ready.append(subscriber)
        return ready

    def _notify_loop(self, ready: list[SubscriberTransport]) -> bool:
        # Returns False when the loop is gone.
        loop = self._loop()
        if loop is None or loop.is_closed():
            return False
        if ready:
            try:
                loop.call_soon_threadsafe(self._call_ready, ready)
            except RuntimeError:  # closed in the meantime
                return False
        return True


def _run_to_first_yield(awaitable: Coroutine[None, None, None]) -> None:
    # Runs the generator to its first yield; it awaits nothing before that.
    with suppress(StopIteration):
        awaitable.send(None)
