"""Who looks at which topic. A topic is subscribed while at least one watch is open and does not rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Protocol, final


class Suspendable(Protocol):
    """Something that costs while somebody looks: a watch, a stream of pictures."""

    def rest(self) -> None:
        """Nobody can see it for now: get nothing more; said twice it does nothing."""

    def wake(self) -> None:
        """It can be seen again; said twice it does nothing."""


class Watching(Suspendable, Protocol):
    """What keeps a topic subscribed: a `Watch`, as those need it who only hold one."""

    def close(self) -> None:
        """For good; said twice it does nothing."""


@final
class Watch:
    """Somebody looks at some topics until `close`; also a context manager."""

    def __init__(self, topics: Iterable[str], watches: Watches) -> None:
        """Made by `Watches.open`."""
        self.topics = tuple(topics)
        self._watches: Watches | None = watches
        self._resting = False

    @property
    def resting(self) -> bool:
        """Whether it is not subscribed for this watch now."""
        return self._resting

    def rest(self) -> None:
        """Nobody can see what arrives: it is not subscribed for this watch until `wake`."""
        if self._watches is not None and not self._resting:
            self._resting = True
            self._watches.leave(self.topics)

    def wake(self) -> None:
        """Look again after `rest`."""
        if self._watches is not None and self._resting:
            self._resting = False
            self._watches.enter(self.topics)

    def close(self) -> None:
        """Look no more; said twice it does nothing."""
        watches = self._watches
        self.rest()
        self._watches = None
        if watches is not None:
            watches.forget(self.topics)

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

    def __init__(
        self,
        begin: Callable[[str], None],
        end: Callable[[str], None],
        forgotten: Callable[[str], None] = lambda _topic: None,
    ) -> None:
        """``begin(topic)`` when the first looks at a topic, ``end(topic)`` when the last rests or closes.

        ``forgotten(topic)`` when the last closed: until then a watch that rests still wants to know.
        """
        self._begin, self._end, self._forgotten = begin, end, forgotten
        self._looking: Counter[str] = Counter()
        self._known: Counter[str] = Counter()

    def open(self, topics: Iterable[str]) -> Watch:
        """Look at these topics until the watch is closed."""
        watch = Watch(topics, self)
        self._known.update(watch.topics)
        self.enter(watch.topics)
        return watch

    def watched(self, topic: str) -> bool:
        """Whether anybody looks now."""
        return self._looking[topic] > 0

    def enter(self, topics: Iterable[str]) -> None:
        """One more looks at these; for `Watch`."""
        for topic in topics:
            self._looking[topic] += 1
            if self._looking[topic] == 1:
                self._begin(topic)

    def leave(self, topics: Iterable[str]) -> None:
        """One less looks at these; for `Watch`."""
        for topic in topics:
            self._looking[topic] -= 1
            if self._looking[topic] == 0:
                del self._looking[topic]
                self._end(topic)

    def forget(self, topics: Iterable[str]) -> None:
        """One watch of these, which rests, is closed; for `Watch`."""
        for topic in topics:
            self._known[topic] -= 1
            if self._known[topic] == 0:
                del self._known[topic]
                self._forgotten(topic)
