"""Triggers that start scripts: queued events, conditions, and changes of sensor values."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

from app.blocks.runtime.scheduler import POLL_INTERVAL_S, Scheduler
from app.robots.description.description import Event


class ScriptTrigger:
    """Trigger of one script: a bounded queue of events, or a condition that becomes true.

    Events arrive in the network's thread. If the queue is full, the oldest event is dropped.

    Attributes:
        title: Title of the event block, for messages.
        dropped_count: Number of dropped events (only if the queue can hold more than one).

    Args:
        title: Title of the event block.
        max_queued: Maximum number of queued events.
        condition: Condition; None for a queue of events.
    """

    def __init__(
        self, title: str, *, max_queued: int = 1, condition: Callable[[], bool] | None = None
    ) -> None:
        self.title = title
        self.dropped_count = 0
        self._queue: deque[tuple[object, ...]] = deque(maxlen=max_queued)
        self._condition = condition
        self._was_true: bool | None = None

    def enqueue(self, arguments: tuple[object, ...]) -> None:
        """Queue an event; call `Scheduler.wake_scripts` afterwards.

        Args:
            arguments: Arguments for the script.
        """
        if len(self._queue) == self._queue.maxlen and self._queue.maxlen > 1:
            self.dropped_count += 1
        self._queue.append(arguments)

    def next(self, scheduler: Scheduler) -> tuple[object, ...]:
        """Wait until an event arrives or the condition becomes true, and return the script's arguments."""
        if self._condition is None:
            scheduler.wait_for(lambda: bool(self._queue), idle=True)
            return self._queue.popleft()
        while not self._has_become_true(scheduler):
            scheduler.wait_for(lambda: False, POLL_INTERVAL_S, idle=True)
        return ()

    def _has_become_true(self, scheduler: Scheduler) -> bool:
        if self._condition is None:
            return False
        scheduler.acquire_turn()
        try:
            is_true = self._condition()
        finally:
            scheduler.finish_run()
        # A condition that is true from the start is not a change.
        has_become_true = is_true and self._was_true is False
        self._was_true = is_true
        return has_become_true


class ThresholdTrigger:
    """Trigger that calls ``on_pass`` when a number passes a limit.

    A first value beyond the limit doesn't count.

    Args:
        side: "below" or "above".
        limit: Limit of the number.
        on_pass: Called each time the number gets below or above the limit.
    """

    def __init__(self, side: str, limit: float, on_pass: Callable[[], None]) -> None:
        self._side = side
        self._limit = limit
        self._on_pass = on_pass
        self._was_beyond: bool | None = None

    def __call__(self, value: object) -> None:
        """Process a new value; values that aren't numbers are ignored."""
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return
        is_beyond = value < self._limit if self._side == "below" else value > self._limit
        if is_beyond and self._was_beyond is False:
            self._on_pass()
        self._was_beyond = is_beyond


def change_detector(on_change: Callable[[], None]) -> Callable[[object], None]:
    """Return a function that calls ``on_change`` when its argument differs from that of the last call."""
    previous: list[object] = []

    def on_value(value: object) -> None:
        if previous and previous[0] != value:
            on_change()
        previous[:] = [value]

    return on_value


def event_matches(
    data: object,
    filters: Mapping[str, object],
    event: Event | None,
    source: Mapping[str, object],
) -> bool:
    """Return True if an event starts a script with these filters.

    Texts are compared ignoring case. An event that is also sent when it ends (``rb:level`` with a boolean
    field, such as "down" of a touch) matches only when it starts.

    Args:
        data: Data of the event.
        filters: Required values of fields, by name.
        event: Description of the event, if known.
        source: Thing Description of the robot.
    """
    fields: Mapping[str, object] = data if isinstance(data, Mapping) else {}
    for name, expected in filters.items():
        if not _values_match(expected, fields.get(name)):
            return False
    if event is None or not _has_level(event.name, source):
        return True
    return all(fields.get(field.name) is not False for field in event.fields if field.kind == "boolean")


def _values_match(expected: object, actual: object) -> bool:
    if isinstance(expected, str) and isinstance(actual, str):
        return expected.strip().casefold() == actual.strip().casefold()
    return expected == actual


def _has_level(name: str, source: Mapping[str, object]) -> bool:
    events = source.get("events")
    event = events.get(name) if isinstance(events, Mapping) else None
    return isinstance(event, Mapping) and event.get("rb:level") is True
