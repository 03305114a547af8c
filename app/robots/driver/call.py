"""Interfaces that driver functions use: the running call, and the connection to the network."""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from typing import Protocol

from app.clock import ThreadClock

_JOIN_TIMEOUT_S = 2.0
_log = logging.getLogger(__name__)


class Canceled(Exception):  # noqa: N818 - not an error; named like the state in the reply
    """Raised in an action that has been cancelled. Drivers clean up and let the exception propagate."""


class Failed(Exception):  # noqa: N818 - named like the state in the reply
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


def _is_in_event_loop() -> bool:
    asyncio = sys.modules.get("asyncio")  # without the import no loop is running
    if asyncio is None:
        return False
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


class Link(Protocol):
    """Connection of a robot's class to the network; implemented by `app.robots.driver.driver.Driver`.

    Thread-safe.

    Attributes:
        name: Name of the robot.
        clock: Clock of the robot's waits and threads. A virtual robot that uses no other clock can be
            rehearsed in virtual time.
    """

    name: str
    clock: ThreadClock

    def sense(self, sensor: str, value: object) -> None:
        """Publish the value of a sensor.

        Args:
            sensor: Name of the sensor.
            value: Value of the declared type: a mapping for an object, an array or JPEG bytes for a camera.
        """

    def happen(self, event: str, **data: object) -> None:
        """Publish an event.

        Args:
            event: Name of the event.
            data: Fields of the event.
        """

    def event_problems(self, event: str, data: Mapping[str, object]) -> Sequence[str]:
        """Validate the data of an event; return one sentence per problem, empty if the data are valid.

        Args:
            event: Name of the event.
            data: Fields of the event.
        """

    def publish_value(self, leaf: str, value: object) -> None:
        """Publish a value on a topic that is not in the description, such as ``state``.

        Args:
            leaf: Last level of the topic ``/<name>/<leaf>``.
            value: Payload.
        """

    def subscriber_count(self, leaf: str) -> int:
        """Return the number of subscribers of a topic of the robot; 0 if the topic isn't open.

        Use this method to skip expensive work while there are no subscribers.

        Args:
            leaf: Last level of the topic, such as the name of a sensor.
        """

    def on_world(self, changed: Callable[[Mapping[str, object]], None]) -> None:
        """Set a callback for messages that change the world of a virtual robot.

        Args:
            changed: Called in a background thread with the payload of each message.
        """

    def open_shared_topic(
        self, topic: str, changed: Callable[[Mapping[str, object]], None], *, latched: bool = False
    ) -> Callable[[Mapping[str, object]], None]:
        """Publish and subscribe to a topic that several robots share.

        Args:
            topic: Name of the topic.
            changed: Called with the payload of each message, in the same thread as for `on_world`.
            latched: True to keep the last message for later subscribers.

        Returns:
            Function that publishes a message.
        """

    def run(self, awaitable: Awaitable[object]) -> object:
        """Run an awaitable in the robot's event loop and wait for the result.

        The robot's ``async def`` actions run in the same event loop. Exceptions of the awaitable are
        raised.

        Raises:
            RuntimeError: Called in an ``async def`` action, whose event loop would be blocked.
        """


class Call:
    """Running action. All methods can be called from the action's thread.

    Attributes:
        action: Name of the action.
        clock: Clock used by `wait`.

    Args:
        action: Name of the action.
        clock: Clock used by `wait`.
        report: Publishes the progress of the action.
    """

    def __init__(
        self, action: str, clock: ThreadClock, report: Callable[[Mapping[str, object]], None]
    ) -> None:
        self.action = action
        self.clock = clock
        self._report = report
        self._canceled = clock.event()
        self._lock = threading.Lock()
        self._cancel_callbacks: list[Callable[[], object]] = []
        self._cancel_thread: threading.Thread | None = None

    @property
    def canceled(self) -> bool:
        """True after `cancel` was called."""
        return self._canceled.is_set()

    def cancel(self) -> None:
        """Cancel the action: its next wait raises Canceled. Does not block."""
        with self._lock:
            self._canceled.set()
            callbacks, self._cancel_callbacks = self._cancel_callbacks, []
        if callbacks:
            try:
                self._cancel_thread = self.clock.start_thread(
                    partial(_run_callbacks, callbacks), f"cancel {self.action}"
                )
            except (RuntimeError, MemoryError):  # out of threads
                _run_callbacks(callbacks)

    def close(self) -> None:
        """Wait at most 2 s for callbacks of `on_cancel` that are still running."""
        if self._cancel_thread is not None:
            self._cancel_thread.join(_JOIN_TIMEOUT_S)

    def on_cancel(self, callback: Callable[[], object]) -> None:
        """Register a callback for cancellation, such as one that aborts a blocking library call.

        Args:
            callback: Called once, in another thread; called immediately in this thread if the action is
                already cancelled.
        """
        with self._lock:
            if not self._canceled.is_set():
                self._cancel_callbacks.append(callback)
                return
        callback()

    def wait(self, seconds: float) -> None:
        """Wait for a number of seconds, or until the action is cancelled.

        Args:
            seconds: Duration in seconds.

        Raises:
            Canceled: The action was cancelled.
            RuntimeError: Called in an ``async def`` action, whose event loop would be blocked.
        """
        if _is_in_event_loop():
            raise RuntimeError("call.wait blocks the event loop; use `await asyncio.sleep` there")
        if self.clock.wait(self._canceled, seconds):
            raise Canceled

    def until(
        self, condition: Callable[[], bool], *, for_s: float | None = None, every_s: float = 1 / 30
    ) -> bool:
        """Poll a condition until it is true.

        Args:
            condition: Condition.
            for_s: Timeout in seconds; None for no limit.
            every_s: Interval in seconds between two polls.

        Returns:
            True, or False on timeout.

        Raises:
            Canceled: The action was cancelled.
        """
        deadline = None if for_s is None else self.clock.now() + for_s
        while not condition():
            if deadline is not None and self.clock.now() >= deadline:
                return False
            self.wait(every_s)
        return True

    def feedback(self, **values: object) -> None:
        """Publish the progress of the action.

        Args:
            values: Fields of the feedback.

        Raises:
            Canceled: The action was cancelled.
        """
        if self.canceled:
            raise Canceled
        self._report(values)

    def last(self, **values: object) -> None:
        """Publish the final progress, even if the action was cancelled.

        A paused program uses this feedback to execute the remaining part of the action.

        Args:
            values: Fields of the feedback.
        """
        self._report(values)
