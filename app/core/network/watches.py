"""Watches of topics. A topic is subscribed to while at least one open watch of it is not suspended."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Protocol, final


class Suspendable(Protocol):
    """Resource that needs CPU time only while it is visible, such as a watch or an image stream."""

    def suspend(self) -> None:
        """Suspend the resource while it is not visible. Idempotent."""

    def resume(self) -> None:
        """Resume the resource after `suspend`. Idempotent."""


class WatchHandle(Suspendable, Protocol):
    """Interface of a `Watch` for code that does not open watches."""

    def close(self) -> None:
        """Close the watch permanently. Idempotent."""


@final
class Watch:
    """Watch of one or several topics.

    The topics are subscribed to until `close`, except while the watch is suspended. Usable as a context
    manager.
    """

    def __init__(self, topics: Iterable[str], watches: Watches) -> None:
        self.topics = tuple(topics)
        self._watches: Watches | None = watches
        self._is_suspended = False

    @property
    def is_suspended(self) -> bool:
        """True if the watch is suspended."""
        return self._is_suspended

    def suspend(self) -> None:
        """Suspend the watch until `resume`."""
        if self._watches is not None and not self._is_suspended:
            self._is_suspended = True
            self._watches.deactivate(self.topics)

    def resume(self) -> None:
        """Resume the watch after `suspend`."""
        if self._watches is not None and self._is_suspended:
            self._is_suspended = False
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
    """Open watches, counted by topic. Not thread-safe; use it from the main thread."""

    def __init__(
        self,
        on_activated: Callable[[str], None],
        on_deactivated: Callable[[str], None],
        on_released: Callable[[str], None] = lambda _topic: None,
    ) -> None:
        # `on_activated` is called at a topic's first active watch, `on_deactivated` when the last one is
        # suspended or closed, `on_released` when the last one is closed.
        self._on_activated, self._on_deactivated, self._on_released = (
            on_activated,
            on_deactivated,
            on_released,
        )
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
        """Increment the number of active watches of each topic. Called by `Watch`."""
        for topic in topics:
            self._active_counts[topic] += 1
            if self._active_counts[topic] == 1:
                self._on_activated(topic)

    def deactivate(self, topics: Iterable[str]) -> None:
        """Decrement the number of active watches of each topic. Called by `Watch`."""
        for topic in topics:
            self._active_counts[topic] -= 1
            if self._active_counts[topic] == 0:
                del self._active_counts[topic]
                self._on_deactivated(topic)

    def release(self, topics: Iterable[str]) -> None:
        """Release the topics of a closed watch, after `deactivate`. Called by `Watch`."""
        for topic in topics:
            self._open_counts[topic] -= 1
            if self._open_counts[topic] == 0:
                del self._open_counts[topic]
                self._on_released(topic)
