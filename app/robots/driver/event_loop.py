"""asyncio's event loop of one robot: ``async def`` actions run in it, and what they connect lives in it."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Awaitable, Callable
from functools import partial

from app.robots.driver.call import Call, Canceled

_JOIN_S = 2.0
_log = logging.getLogger(__name__)


class EventLoop:
    """One event loop in a thread of its own, which begins with the first coroutine. Works in any thread.

    All of a robot's coroutines share it, so that a connection which one action made serves the next one.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._closed = False

    def run(
        self, work: Awaitable[object], call: Call | None = None, *, within_s: float | None = None
    ) -> object:
        """Run it and wait for its end: what it returns, or what it raises.

        A `call` that is canceled cancels it (its next ``await`` raises CancelledError); Canceled is raised
        when it has ended so. TimeoutError when it has not ended `within_s`; then it is canceled, too.
        """
        loop, waited = self._begun(work), _Waited(work)
        self._soon(partial(waited.begin, loop, f"{self._name}: {call.action if call else 'run'}"))
        if call is not None:
            call.on_cancel(partial(self._soon, waited.cancel))
        if not waited.ended.wait(within_s):
            self._soon(waited.cancel)
            raise TimeoutError(f"it has not ended within {within_s:g} s")
        if waited.error is not None:
            raise waited.error
        return waited.result

    def close(self) -> None:
        """Cancel what runs, end the thread. A coroutine that holds the loop up is left behind, and said."""
        with self._lock:
            self._closed = True
            loop, thread = self._loop, self._thread
        if loop is None or thread is None:
            return
        self._soon(loop.stop)
        thread.join(_JOIN_S)
        if thread.is_alive():
            _log.warning("%s: an async function holds the event loop up; it was left behind", self._name)

    def _begun(self, work: Awaitable[object]) -> asyncio.AbstractEventLoop:
        with self._lock:
            if self._closed or threading.current_thread() is self._thread:
                if asyncio.iscoroutine(work):
                    work.close()
                why = "the robot has ended" if self._closed else "use await: this is the event loop itself"
                raise RuntimeError(f"a coroutine can't be run here; {why}")
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                name = f"{self._name} asyncio"
                self._thread = threading.Thread(target=_serve, args=(self._loop,), name=name, daemon=True)
                self._thread.start()
            return self._loop

    def _soon(self, what: Callable[[], object]) -> None:
        loop = self._loop
        try:
            if loop is not None:
                loop.call_soon_threadsafe(what)
        except RuntimeError:  # it has ended meanwhile
            return


class _Waited:
    """One awaitable that another thread waits for; all but `ended` is for the loop's thread until then."""

    def __init__(self, work: Awaitable[object]) -> None:
        self.ended = threading.Event()
        self.result: object = None
        self.error: BaseException | None = Canceled()
        self._work = work
        self._task: asyncio.Task[None] | None = None

    def begin(self, loop: asyncio.AbstractEventLoop, name: str) -> None:
        self._task = loop.create_task(self._run(), name=name)
        self._task.add_done_callback(self._end)

    def cancel(self) -> None:
        if self._task is not None:
            self._task.cancel()

    async def _run(self) -> None:
        # What it raises is kept here: SystemExit that leaves a task would end the whole loop.
        try:
            self.result = await self._work
            self.error = None
        except asyncio.CancelledError:
            return
        except BaseException as error:  # noqa: BLE001 - raised again for who waits
            self.error = error

    def _end(self, _task: object) -> None:
        if asyncio.iscoroutine(self._work):
            self._work.close()  # one that was canceled before its first step was never awaited
        self.ended.set()


def _serve(loop: asyncio.AbstractEventLoop) -> None:
    asyncio.set_event_loop(loop)
    try:
        loop.run_forever()
        left = asyncio.all_tasks(loop)
        for task in left:
            task.cancel()
        if left:
            loop.run_until_complete(asyncio.wait(left, timeout=_JOIN_S / 2))
        loop.run_until_complete(loop.shutdown_asyncgens())
    finally:
        asyncio.set_event_loop(None)
        loop.close()
