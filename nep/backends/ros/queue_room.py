"""What rospy's queues may hold. rospy bounds them by number only, and drops the oldest without a word."""

from __future__ import annotations

from typing import Any

from nep.messages.queue import MAX_BYTES

__all__ = ["QueueRoom"]

_STEP_BYTES = 8 * 2**20
"""Queues are measured after so much was published: each time would be slow for many small messages."""


class QueueRoom:
    """The room for what one publisher sends, in the queue of each of its connections."""

    def __init__(self, max_bytes: int = MAX_BYTES) -> None:
        self._max_bytes = max_bytes
        self._unmeasured = 0

    def make(self, connections: list[Any], size: int) -> int:
        """Drop the oldest where `size` more bytes have no room; how many were dropped."""
        self._unmeasured += size
        is_measured = self._unmeasured >= min(_STEP_BYTES, self._max_bytes)
        if is_measured:
            self._unmeasured = 0
        most = self._max_bytes - size if is_measured else None
        return sum(_shorten(each, most) for each in connections)


def _shorten(connection: Any, max_bytes: int | None) -> int:  # noqa: ANN401 - rospy has no types
    queue_size = getattr(connection, "_queue_size", 0)  # the program's own may have no queue
    if not queue_size:
        return 0
    with connection._lock:  # noqa: SLF001 - rospy has no other way
        queue: list[bytes] = connection._queue  # noqa: SLF001 - its thread takes all of it at once
        surplus = max(0, len(queue) - queue_size + 1)
        if max_bytes is not None and len(queue) > surplus:
            left = sum(map(len, queue)) - sum(map(len, queue[:surplus]))
            while left > max_bytes and surplus < len(queue):
                left -= len(queue[surplus])
                surplus += 1
        del queue[:surplus]
    return surplus
