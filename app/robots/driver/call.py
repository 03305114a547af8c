"""Arguments of driver functions: the running call, and the link to the network."""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Protocol

_JOIN_TIMEOUT_S = 2.0
_log = logging.getLogger(__name__)


class Clock(Protocol):
    """Source of time, replaceable in tests."""

    def now(self) -> float:
        """Return monotonic time in seconds."""

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait until the event is set (return True) or the timeout has passed (False).

        Args:
            event: Event to wait for.
            timeout_s: Timeout in seconds; None waits forever.
        """


class MonotonicClock:
    """Clock of the computer."""

    def now(self) -> float:
        """Return monotonic time in seconds."""
        return time.monotonic()

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait until the event is set (return True) or the timeout has passed (False)."""
        return event.wait(timeout_s)


class Canceled(Exception):  # noqa: N818 - not an error: the word of the answer's state
    """Raised in an action that must end now. Drivers clean up and let it propagate."""


class Failed(Exception):  # noqa: N818 - the word of the answer's state
    """Raised by an action that can't be done; the sentence is shown to people.

    Example:
        ::

            raise Failed("no ball in sight")
    """


def _call_each(callbacks: Sequence[Callable[[], object]]) -> None:
    for callback in callbacks:
        try:
            callback()
        except BaseException:  # noqa: BLE001 - also SystemExit of a driver's code
            _log.warning("an on_cancel callback failed", exc_info=True)


def _in_event_loop() -> bool:
    asyncio = sys.modules.get("asyncio")  # without the import no loop is running
    if asyncio is None:
        return False
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


class Link(Protocol):
    """Connection of a robot's class to the network. Thread-safe.

    Attributes:
        name: Name of the robot.
    """

    name: str

    def sense(self, sensor: str, value: object) -> None:
        """Publish a sensor's value.

        Args:
            sensor: Name of the sensor.
            value: Its value: a mapping for an object, an array or JPEG bytes for a camera.
        """

    def happen(self, event: str, **data: object) -> None:
        """Publish an event.

        Args:
            event: Name of the event.
            data: Its fields.
        """

    def wrong_in(self, event: str, data: Mapping[str, object]) -> Sequence[str]:
        """Return a sentence for each way in which an event differs from the description; empty if valid."""

    def tell(self, leaf: str, value: object) -> None:
        """Publish a value that the description doesn't name on ``/<name>/<leaf>``, such as ``state``."""

    def watchers(self, leaf: str) -> int:
        """Return the number of subscribers of a sensor's topic, to skip expensive work without any."""

    def on_world(self, changed: Callable[[Mapping[str, object]], None]) -> None:
        """Call `changed` with each message that changes a virtual robot's world, in a thread of its own."""

    def share(
        self, topic: str, changed: Callable[[Mapping[str, object]], None], *, latched: bool = False
    ) -> Callable[[Mapping[str, object]], None]:
        """Join a topic shared by several robots.

        Args:
            topic: Name of the topic.
            changed: Called with each message, in the same thread as for `on_world`.
            latched: Keep the last message for later subscribers.

        Returns:
            A function that publishes a message.
        """

    def run(self, work: Awaitable[object]) -> object:
        """Run a coroutine in the robot's event loop, where its ``async def`` actions run, and wait for it."""


class Call:
    """Running action. Its methods may be called from the action's thread.

    Attributes:
        action: Name of the action.
        clock: Clock used by `wait`.
    """

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
        """True once the action must end."""
        return self._ended.is_set()

    def cancel(self) -> None:
        """Ask the action to end: its next wait raises Canceled. Does not block."""
        with self._lock:
            self._ended.set()
            callbacks, self._on_cancel = self._on_cancel, []
        if callbacks:
            self._canceling = threading.Thread(
                target=_call_each, args=(callbacks,), name=f"cancel {self.action}", daemon=True
            )
            try:
                self._canceling.start()
            except (RuntimeError, MemoryError):  # out of threads
                self._canceling = None
                _call_each(callbacks)

    def close(self) -> None:
        """Wait up to 2 s until the callbacks of `on_cancel` have returned."""
        if self._canceling is not None:
            self._canceling.join(_JOIN_TIMEOUT_S)

    def on_cancel(self, tell: Callable[[], object]) -> None:
        """Call `tell` once, in another thread, when the action must end; at once if it must already.

        For blocking calls of a library that can be aborted.
        """
        with self._lock:
            if not self._ended.is_set():
                self._on_cancel.append(tell)
                return
        tell()

    def wait(self, seconds: float) -> None:
        """Sleep, and raise Canceled as soon as the action must end.

        Args:
            seconds: Time to sleep.

        Raises:
            Canceled: The action must end.
            RuntimeError: Called in an ``async def`` action, whose event loop it would block.
        """
        if _in_event_loop():
            raise RuntimeError("call.wait holds an async function up; use `await asyncio.sleep` there")
        if self.clock.wait(self._ended, seconds):
            raise Canceled

    def until(self, done: Callable[[], bool], *, for_s: float | None = None, every_s: float = 1 / 30) -> bool:
        """Poll `done` until it returns True.

        Args:
            done: Condition.
            for_s: Timeout in seconds; None waits forever.
            every_s: Interval between two polls in seconds.

        Returns:
            True, or False if the timeout passed first.

        Raises:
            Canceled: The action must end.
        """
        limit = None if for_s is None else self.clock.now() + for_s
        while not done():
            if limit is not None and self.clock.now() >= limit:
                return False
            self.wait(every_s)
        return True

    def feedback(self, **values: object) -> None:
        """Publish progress; raises Canceled if the action must end."""
        if self.canceled:
            raise Canceled
        self._report(values)

    def last(self, **values: object) -> None:
        """Publish the final progress even if the action is canceled.

        A resumed program uses it to do the rest.
        """
        self._report(values)
