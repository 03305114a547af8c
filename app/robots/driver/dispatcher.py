"""Supervised thread that runs callbacks one at a time, urgent ones first.

Exceptions of callbacks don't end the thread: they are counted and logged at increasing intervals. If the loop
itself ends (out of memory, an exception injected into the thread), it is restarted.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from app.clock import ThreadClock
from nep.system.log_rarely import SuppressedErrors

_MAX_CALLS_PER_TICK = 100  # a flood of callbacks must not keep timers waiting
_RESTART_DELAY_S = 0.05
_JOIN_TIMEOUT_S = 2.0
_log = logging.getLogger(__name__)


def _do_nothing() -> None:
    return


class Dispatcher:
    """Queue of callbacks that are run in a separate thread. Thread-safe.

    Args:
        name: Name of the thread.
        clock: Clock of the thread.
        tick: Called in the thread after callbacks, and when the time of ``next_due_s`` has elapsed.
        next_due_s: Returns the seconds until ``tick`` is needed, or None.
        on_restart: Called in the thread before a loop that ended is started again.
    """

    def __init__(
        self,
        name: str,
        clock: ThreadClock,
        *,
        tick: Callable[[], object] = _do_nothing,
        next_due_s: Callable[[], float | None] = lambda: None,
        on_restart: Callable[[], object] = _do_nothing,
    ) -> None:
        self.errors = SuppressedErrors(_log, name)
        """Exceptions raised by callbacks, ticks or the loop."""
        self._name, self._clock = name, clock
        self._tick, self._next_due_s, self._on_restart = tick, next_due_s, on_restart
        self._urgent: deque[Callable[[], object]] = deque()
        self._callbacks: deque[Callable[[], object]] = deque()
        self._wake = clock.event()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread."""
        self._start_thread()

    def post(self, callback: Callable[[], object]) -> None:
        """Run a callback in the thread, after the callbacks that were posted before."""
        self._callbacks.append(callback)
        self._wake.set()

    def post_urgent(self, callback: Callable[[], object]) -> None:
        """Run a callback in the thread, before all non-urgent ones."""
        self._urgent.append(callback)
        self._wake.set()

    @property
    def backlog(self) -> int:
        """Number of pending callbacks."""
        return len(self._callbacks) + len(self._urgent)

    @property
    def urgent_backlog(self) -> int:
        """Number of pending urgent callbacks."""
        return len(self._urgent)

    @property
    def is_current(self) -> bool:
        """True if the calling thread is the thread of this dispatcher."""
        return threading.current_thread() is self._thread

    def call(self, function: Callable[[], object]) -> None:
        """Call a function in the current thread; its exceptions are counted and logged instead of raised.

        To be used in the dispatcher's thread. MemoryError, and exceptions such as SystemExit that
        aren't subclasses of Exception, end the loop, which is restarted.
        """
        try:
            function()
        except MemoryError:
            raise
        except Exception as error:  # noqa: BLE001 - a failing callback must not stop the others
            self.errors.add(error)

    def close(self) -> None:
        """Stop the thread and wait at most 2 s for it; pending callbacks are dropped."""
        self._closing.set()
        self._wake.set()
        if self._thread is not None and not self.is_current:
            self._thread.join(_JOIN_TIMEOUT_S)

    def _start_thread(self, *, is_restart: bool = False) -> None:
        supervise = partial(self._supervise, is_restart=is_restart)
        self._thread = self._clock.start_thread(supervise, self._name)

    def _supervise(self, *, is_restart: bool = False) -> None:
        try:
            self._thread = threading.current_thread()  # for callbacks that run before `_start_thread` returns
            while not self._closing.is_set():
                try:
                    if is_restart:
                        self._on_restart()
                        self._closing.wait(_RESTART_DELAY_S)
                    is_restart = True
                    self._loop()
                except BaseException as error:  # noqa: BLE001 - the loop restarts after any exception
                    self.errors.add(error)
        finally:
            if not self._closing.is_set():  # an exception hit the handler above
                self._start_thread(is_restart=True)

    def _loop(self) -> None:
        while not self._closing.is_set():
            if not self.backlog:
                self._clock.wait(self._wake, self._next_due_s())
            self._wake.clear()
            for _count in range(_MAX_CALLS_PER_TICK):
                callback = self._next_callback()
                if callback is None:
                    break
                self.call(callback)
            self.call(self._tick)

    def _next_callback(self) -> Callable[[], object] | None:
        for queue in (self._urgent, self._callbacks):
            with suppress(IndexError):
                return queue.popleft()
        return None
