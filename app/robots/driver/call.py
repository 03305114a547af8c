"""What a driver's function is given: the call it serves, and the link to the people who watch."""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Protocol

_JOIN_S = 2.0
_log = logging.getLogger(__name__)


class Clock(Protocol):
    """Time, so that tests can bring their own."""

    def now(self) -> float:
        """Seconds that never run backwards."""

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait until the event is set (True) or the time is over (False); None waits for ever."""


class MonotonicClock:
    """The computer's own clock."""

    def now(self) -> float:
        """Seconds since some start."""
        return time.monotonic()

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait on the event."""
        return event.wait(timeout_s)


class Canceled(Exception):  # noqa: N818 - not an error: the word of the answer's state
    """The action is to end now; drivers let it pass, after putting away what they hold."""


class Failed(Exception):  # noqa: N818 - the word of the answer's state
    """The action can't be done; its sentence is shown to people: ``Failed("no ball in sight")``."""


def _call_each(callbacks: Sequence[Callable[[], object]]) -> None:
    for callback in callbacks:
        try:
            callback()
        except BaseException:  # noqa: BLE001 - also SystemExit of a driver's code
            _log.warning("an on_cancel callback failed", exc_info=True)


def _in_event_loop() -> bool:
    asyncio = sys.modules.get("asyncio")  # who has not imported it runs no loop
    if asyncio is None:
        return False
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


class Link(Protocol):
    """How a robot tells what it senses and what happens to it; works in any thread."""

    name: str

    def sense(self, sensor: str, value: object) -> None:
        """Publish a sensor's new value; an object sensor takes a mapping, a camera a picture or JPEG."""

    def happen(self, event: str, **data: object) -> None:
        """Publish an event."""

    def wrong_in(self, event: str, data: Mapping[str, object]) -> Sequence[str]:
        """A sentence for each thing in which an event is not as the description says; empty when it is."""

    def tell(self, leaf: str, value: object) -> None:
        """Publish something that the description doesn't name on ``/<name>/<leaf>``, such as ``state``."""

    def watchers(self, leaf: str) -> int:
        """How many subscribers the topic of a sensor has: nobody needs a picture that nobody sees."""

    def on_world(self, changed: Callable[[Mapping[str, object]], None]) -> None:
        """Let people act on a virtual robot's world: `changed` gets each message, in a thread of its own."""

    def share(
        self, topic: str, changed: Callable[[Mapping[str, object]], None], *, latched: bool = False
    ) -> Callable[[Mapping[str, object]], None]:
        """Join a topic that several robots share: `changed` gets each message; what is returned publishes."""

    def run(self, work: Awaitable[object]) -> object:
        """Run a coroutine in the robot's event loop, where its ``async def`` actions run, and wait for it."""


class Call:
    """One run of an action. Everything here may be used from the function's thread."""

    def __init__(self, action: str, clock: Clock, report: Callable[[Mapping[str, object]], None]) -> None:
        self.action = action
        self.clock = clock
        self._report = report
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._on_cancel: list[Callable[[], object]] = []
        self._canceling: threading.Thread | None = None

    @property
    def canceled(self) -> bool:
        """True once the action is to end."""
        return self._ended.is_set()

    def cancel(self) -> None:
        """End the action: the function's next wait raises Canceled. Waits for nothing."""
        with self._lock:
            self._ended.set()
            callbacks, self._on_cancel = self._on_cancel, []
        if callbacks:
            self._canceling = threading.Thread(
                target=_call_each, args=(callbacks,), name=f"cancel {self.action}", daemon=True
            )
            try:
                self._canceling.start()
            except (RuntimeError, MemoryError):  # no room for a thread
                self._canceling = None
                _call_each(callbacks)

    def close(self) -> None:
        """Wait until the callbacks of `on_cancel` have returned, 2 s at most."""
        if self._canceling is not None:
            self._canceling.join(_JOIN_S)

    def on_cancel(self, tell: Callable[[], object]) -> None:
        """Call `tell` once, in another thread, as soon as the action is to end; at once when it is already.

        For what waits in its own way, such as a library's own blocking call that has an abort.
        """
        with self._lock:
            if not self._ended.is_set():
                self._on_cancel.append(tell)
                return
        tell()

    def wait(self, seconds: float) -> None:
        """Let time pass; raises Canceled as soon as the action is to end.

        Not in an ``async def``, which it would hold up with all others: RuntimeError says what to use there.
        """
        if _in_event_loop():
            raise RuntimeError("call.wait holds an async function up; use `await asyncio.sleep` there")
        if self.clock.wait(self._ended, seconds):
            raise Canceled

    def until(self, done: Callable[[], bool], *, for_s: float | None = None, every_s: float = 1 / 30) -> bool:
        """Wait until `done` is true (True) or the time is over (False), looking every so often.

        Raises Canceled.
        """
        limit = None if for_s is None else self.clock.now() + for_s
        while not done():
            if limit is not None and self.clock.now() >= limit:
                return False
            self.wait(every_s)
        return True

    def feedback(self, **values: object) -> None:
        """Tell how far it is; also a good place to notice a cancel."""
        if self.canceled:
            raise Canceled
        self._report(values)

    def last(self, **values: object) -> None:
        """Tell how far it came, also when it is canceled: a pause does the rest of it later."""
        self._report(values)
