"""Base class of publishers without shared memory: statistics that the graph shows."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager

from nep.backends.base import PublisherSpec
from nep.protocol.requests import PublisherCount
from nep.protocol.wire import EXTENSION, LATCHED, MAX_SIZE, Header


class BasePublisher:
    """Publisher with statistics, guarded by a lock.

    Subclasses call `_count_locked` for each message that they send.

    Args:
        spec: Settings of the publisher.
        lock: Lock that guards the statistics.
    """

    def __init__(self, spec: PublisherSpec, lock: AbstractContextManager[object]) -> None:
        self.spec = spec
        self.count = 0
        self._stats_lock = lock
        self._bytes = 0
        self._last_stamp_ns: int | None = None
        self._problem = ""

    def borrow_memory(self, _size_bytes: int) -> memoryview | None:
        """Return None, because the back end has no shared memory."""
        return None

    def skip(self) -> None:
        """Count a message that is not sent because the topic has no subscribers."""
        with self._stats_lock:
            self._count_locked(0)

    def _count_locked(self, size_bytes: int) -> int:
        # Counts a message and returns its time stamp.
        self.count += 1
        self._bytes += size_bytes
        self._last_stamp_ns = stamp_ns = time.time_ns()
        return stamp_ns

    def _next_header_locked(self, size_bytes: int, *, has_extension: bool) -> Header:
        # Counts a message and returns its header.
        flags = (LATCHED if self.spec.is_latched else 0) | (EXTENSION if has_extension else 0)
        stamp_ns = self._count_locked(size_bytes)
        size = size_bytes if size_bytes <= MAX_SIZE else 0
        return Header(self.spec.codec.number, flags, self.count, stamp_ns, self.spec.id, size)

    def report(self, problem: str) -> None:
        """Set the reason why payloads can't be encoded, which the graph shows; "" clears it."""
        self._problem = problem

    def counts(self) -> PublisherCount:
        """Return the statistics that the graph shows."""
        with self._stats_lock:
            return PublisherCount(
                self.spec.id, self.count, self._bytes, self.count, self._last_stamp_ns, self._problem
            )
