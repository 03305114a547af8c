"""Who looks at which topic. A topic is subscribed while at least one watch is open."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import final


@final
class Watch:
    """Somebody looks at some topics until `close`; also a context manager."""

    def __init__(self, topics: Iterable[str], close: Callable[[str], None]) -> None:
        """Made by `Watches.open`."""
        self.topics = tuple(topics)
        self._close: Callable[[str], None] | None = close

    def close(self) -> None:
        """Look no more; said twice it does nothing."""
        close, self._close = self._close, None
        if close is not None:
            for topic in self.topics:
                close(topic)

    def __enter__(self) -> Watch:
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()


class Watches:
    """Counts the watches of each topic. One thread uses it (the window's)."""

    def __init__(self, begin: Callable[[str], None], end: Callable[[str], None]) -> None:
        """``begin(topic)`` at the first watch of a topic, ``end(topic)`` after the last."""
        self._begin = begin
        self._end = end
        self._counts: Counter[str] = Counter()

    def open(self, topics: Iterable[str]) -> Watch:
        """Look at these topics until the watch is closed."""
        watch = Watch(topics, self._release)
        for topic in watch.topics:
            self._counts[topic] += 1
            if self._counts[topic] == 1:
                self._begin(topic)
        return watch

    def watched(self, topic: str) -> bool:
        """Whether anybody looks."""
        return self._counts[topic] > 0

    def _release(self, topic: str) -> None:
        self._counts[topic] -= 1
        if self._counts[topic] == 0:
            del self._counts[topic]
            self._end(topic)
