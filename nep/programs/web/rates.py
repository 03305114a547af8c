"""`RateMeter`: messages and bytes per second over the last two seconds. Performs no I/O."""

from __future__ import annotations

from collections.abc import Callable

_SLOT_S = 0.5
_SLOT_COUNT = 4
_WINDOW_S = _SLOT_S * _SLOT_COUNT


class RateMeter:
    """Meter of message and byte rates over a sliding window of two seconds.

    Call `count` in one thread. `rates` can be called in any thread; its result may be slightly imprecise
    while `count` is running.

    Args:
        clock: Monotonic clock in seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._started_s = clock()
        self._slots = [(-1, 0, 0)] * (_SLOT_COUNT + 1)
        """Slots (number since the clock's zero, messages, bytes), including the incomplete one."""
        self.total = 0

    def count(self, size_bytes: int) -> None:
        """Count a message of this size."""
        self.total += 1
        number = int(self._clock() / _SLOT_S)
        slot_number, messages, size = self._slots[number % len(self._slots)]
        if slot_number != number:
            messages = size = 0
        self._slots[number % len(self._slots)] = number, messages + 1, size + size_bytes

    def rates(self) -> tuple[float, float]:
        """Return messages and bytes per second; (0, 0) during the first half second."""
        now = self._clock()
        current = int(now / _SLOT_S)
        begin = current - _SLOT_COUNT
        full_slots = [each for each in tuple(self._slots) if begin <= each[0] < current]
        span_s = min(_WINDOW_S, current * _SLOT_S - self._started_s)
        if span_s < _SLOT_S:
            return 0.0, 0.0
        return sum(each[1] for each in full_slots) / span_s, sum(each[2] for each in full_slots) / span_s
