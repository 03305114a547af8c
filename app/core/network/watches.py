"""Watches of topics. A topic is subscribed to while at least one open watch is not suspended."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Protocol, final


class Suspendable(Protocol):
    """Resource that uses CPU time only while it is visible: a watch or a stream of images."""

    def suspend(self) -> None:
        """Suspend the resource while it isn't visible. Idempotent."""

    def resume(self) -> None:
        """Resume after `rest`. Idempotent."""


class WatchHandle(Suspendable, Protocol):
    """Interface of a `Watch` for code that only holds and releases it."""

    def close(self) -> None:
        """Close permanently. Idempotent."""


@final
class Watch:
    """Watch of some topics until `close`. Usable as a context manager."""

    def __init__(self, topics: Iterable[str], watches: Watches) -> None:
        self.topics = tuple(topics)
        self._watches: Watches | None = watches
        self._resting = False

    @property
    def is_suspended(self) -> bool:
        """True if the watch is suspended."""
        return self._resting

    def suspend(self) -> None:
        """Suspend the watch until `wake`."""
        if self._watches is not None and not self._resting:
            self._resting = True
            self._watches.deactivate(self.topics)

    def resume(self) -> None:
        """Resume the watch after `rest`."""
        if self._watches is not None and self._resting:
            self._resting = False
            self._watches.activate(self.topics)

    def close(self) -> None:
        """Close the watch. Idempotent."""
        watches = self._watches
        self.suspend()
        self._watches = None
        if watches is not None:
            watches.release(self.topics)

    def __enter__(self) -> Watch:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Watches:
    """Counts the watches of each topic. Not thread-safe: use it from the window's thread."""

    def __init__(
        self,
        begin: Callable[[str], None],
        end: Callable[[str], None],
        forgotten: Callable[[str], None] = lambda _topic: None,
    ) -> None:
        # `begin` is called at a topic's first active watch, `end` when the last one is suspended or closed,
        # `forgotten` when the last one is closed.
        self._begin, self._end, self._forgotten = begin, end, forgotten
        self._active_counts: Counter[str] = Counter()
        self._open_counts: Counter[str] = Counter()

    def open(self, topics: Iterable[str]) -> Watch:
        """Open a watch of these topics."""
        watch = Watch(topics, self)
        self._open_counts.update(watch.topics)
        self.activate(watch.topics)
        return watch

    def is_watched(self, topic: str) -> bool:
        """Return True if at least one watch of the topic is active."""
        return self._active_counts[topic] > 0

    def activate(self, topics: Iterable[str]) -> None:
        """Add one to the number of active watches. Called by `Watch`."""
        for topic in topics:
            self._active_counts[topic] += 1
            if self._active_counts[topic] == 1:
                self._begin(topic)

    def deactivate(self, topics: Iterable[str]) -> None:
        """Subtract one from the number of active watches. Called by `Watch`."""
        for topic in topics:
            self._active_counts[topic] -= 1
            if self._active_counts[topic] == 0:
                del self._active_counts[topic]
                self._end(topic)

    def release(self, topics: Iterable[str]) -> None:
        """Release a watch that is closed while suspended. Called by `Watch`."""
        for topic in topics:
            self._open_counts[topic] -= 1
            if self._open_counts[topic] == 0:
                del self._open_counts[topic]
                self._forgotten(topic)
