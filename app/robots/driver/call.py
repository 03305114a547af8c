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
        """Wait until the event is set; return False on timeout.

        Args:
            event: Event to wait for.
            timeout_s: Timeout in seconds; None for no limit.
        """


class MonotonicClock:
    """Monotonic clock of the computer."""

    def now(self) -> float:
        """Return monotonic time in seconds."""
        return time.monotonic()

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait until the event is set; return False on timeout."""
        return event.wait(timeout_s)


class Canceled(Exception):  # noqa: N818 - not an error: the word of the answer's state
    """Raised in an action that must end now. Drivers clean up and let the exception propagate."""


class Failed(Exception):  # noqa: N818 - the word of the answer's state
    """Raised by an action that can't be executed. The message is shown to the user.

    Example::

        raise Failed("no ball in sight")
    """


def _run_callbacks(callbacks: Sequence[Callable[[], object]]) -> None:
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
        """Publish the value of a sensor.

        Args:
            sensor: Name of the sensor.
            value: A mapping for an object; an array or JPEG bytes for a camera.
        """

    def happen(self, event: str, **data: object) -> None:
        """Publish an event.

        Args:
            event: Name of the event.
            data: Fields of the event.
        """

    def wrong_in(self, event: str, data: Mapping[str, object]) -> Sequence[str]:
        """Return a message for each way in which an event differs from the description.

        Empty if it is valid.
        """

    def tell(self, leaf: str, value: object) -> None:
        """Publish a value that is not in the description on ``/<name>/<leaf>``, such as ``state``."""

    def watchers(self, leaf: str) -> int:
        """Return the number of subscribers of a sensor's topic.

        Use this to skip expensive work while nobody is subscribed.
        """

    def on_world(self, changed: Callable[[Mapping[str, object]], None]) -> None:
        """Call ``changed`` in a background thread with each message that changes a virtual robot's world."""

    def share(
        self, topic: str, changed: Callable[[Mapping[str, object]], None], *, latched: bool = False
    ) -> Callable[[Mapping[str, object]], None]:
        """Join a topic shared by several robots.

        Args:
            topic: Name of the topic.
            changed: Called with each message, in the same thread as for `on_world`.
            latched: True to keep the last message for later subscribers.

        Returns:
            A function that publishes a message.
        """

    def run(self, work: Awaitable[object]) -> object:
        """Run a coroutine in the robot's event loop and wait for the result.

        The robot's ``async def`` actions run in the same event loop.
        """


class Call:
    """Running action. All methods may be called from the action's thread.

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
        """True after `cancel` was called."""
        return self._ended.is_set()

    def cancel(self) -> None:
        """Ask the action to end: its next wait raises Canceled. Does not block."""
        with self._lock:
            self._ended.set()
            callbacks, self._on_cancel = self._on_cancel, []
        if callbacks:
            self._canceling = threading.Thread(
                target=_run_callbacks, args=(callbacks,), name=f"cancel {self.action}", daemon=True
            )
            try:
                self._canceling.start()
            except (RuntimeError, MemoryError):  # out of threads
                self._canceling = None
                _run_callbacks(callbacks)

    def close(self) -> None:
        """Wait at most 2 s until the callbacks of `on_cancel` have returned."""
        if self._canceling is not None:
            self._canceling.join(_JOIN_TIMEOUT_S)

    def on_cancel(self, tell: Callable[[], object]) -> None:
        """Call ``tell`` once, in another thread, when the action is cancelled; immediately if it already is.

        Use it to abort a blocking call of a library.
        """
        with self._lock:
            if not self._ended.is_set():
                self._on_cancel.append(tell)
                return
        tell()

    def wait(self, seconds: float) -> None:
        """Sleep. Raises Canceled as soon as the action is cancelled.

        Args:
            seconds: Duration in seconds.

        Raises:
            Canceled: The action must end.
            RuntimeError: Called in an ``async def`` action, whose event loop would be blocked.
        """
        if _in_event_loop():
            raise RuntimeError("call.wait holds an async function up; use `await asyncio.sleep` there")
        if self.clock.wait(self._ended, seconds):
            raise Canceled

    def until(self, done: Callable[[], bool], *, for_s: float | None = None, every_s: float = 1 / 30) -> bool:
        """Poll ``done`` until it returns True.

        Args:
            done: Condition.
            for_s: Timeout in seconds; None for no limit.
            every_s: Interval between two polls in seconds.

        Returns:
            True, or False on timeout.

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
        """Publish the progress of the action. Raises Canceled if the action must end."""
        if self.canceled:
            raise Canceled
        self._report(values)

    def last(self, **values: object) -> None:
        """Publish the final progress, even if the action is cancelled.

        A program that was paused uses it to execute the remaining part.
        """
        self._report(values)
