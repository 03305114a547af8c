"""Limit in bytes for rospy's queues; rospy limits only the number of messages."""

from __future__ import annotations

from typing import Any

from nep.messages.queue import MAX_BYTES

_MEASURE_INTERVAL_BYTES = 8 * 2**20
"""Number of published bytes between measurements of the queues, which are slow."""


class QueueLimit:
    """Limit in bytes for the queues of one publisher's connections."""

    def __init__(self, max_bytes: int = MAX_BYTES) -> None:
        self._max_bytes = max_bytes
        self._unmeasured_bytes = 0

    def make_room(self, connections: list[Any], size: int) -> int:
        """Make room for a message in the queues; return the number of dropped messages.

        The oldest messages are dropped.

        Args:
            connections: rospy's connections of the publisher.
            size: Size of the new message in bytes.
        """
        self._unmeasured_bytes += size
        should_measure = self._unmeasured_bytes >= min(_MEASURE_INTERVAL_BYTES, self._max_bytes)
        if should_measure:
            self._unmeasured_bytes = 0
        max_queued_bytes = self._max_bytes - size if should_measure else None
        return sum(_drop_oldest(each, max_queued_bytes) for each in connections)


def _drop_oldest(connection: Any, max_bytes: int | None) -> int:  # noqa: ANN401 - rospy is not typed
    # connections of the program's own publishers may have no queue
    queue_size = getattr(connection, "_queue_size", 0)
    if not queue_size:
        return 0
    with connection._lock:  # noqa: SLF001 - rospy has no API for it
        queue: list[bytes] = connection._queue  # noqa: SLF001 - the connection's thread empties it at once
        drop_count = max(0, len(queue) - queue_size + 1)
        if max_bytes is not None and len(queue) > drop_count:
            total_bytes = sum(map(len, queue)) - sum(map(len, queue[:drop_count]))
            while total_bytes > max_bytes and drop_count < len(queue):
                total_bytes -= len(queue[drop_count])
                drop_count += 1
        del queue[:drop_count]
    return drop_count
