"""Feed of the series: passes every message of plotted topics on, once per tick."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from app.core.network.mailbox import Batch
from app.core.network.watches import Watching

BETWEEN_TICKS = 8192
"""Maximum number of messages of a plotted topic between ticks: 1 kHz for 8 s, if the window is that late."""


class SeriesTaker(Protocol):
    """Receiver of a topic's messages."""

    def process(self, batch: Batch, now_ns: int) -> None:
        """Process a batch; ``now_ns`` is this computer's time, for messages without a time stamp."""

    def rewind(self) -> None:
        """Clear: the source moved to another time, which counts as no loss."""


class SeriesFeed:
    """Receivers of messages by topic. Not thread-safe: use it from the window's thread.

    A topic is subscribed to while it has a receiver, also while no panel is visible, so that plots have no
    gaps. ``origin_ns`` is the time from which all series count their seconds.
    """

    def __init__(
        self,
        watch: Callable[[str], Watching],
        clock_ns: Callable[[], int],
        set_room: Callable[[str, int | None], None] = lambda _topic, _messages: None,
    ) -> None:
        # `watch` opens a watch by topic key; `set_room` sets the number of messages kept between ticks
        # (`Mailbox.set_room`).
        self._watch, self._clock_ns, self._set_room = watch, clock_ns, set_room
        self._takers: dict[str, list[SeriesTaker]] = {}
        self._deep: dict[str, list[SeriesTaker]] = {}
        self._watching: dict[str, Watching] = {}
        self.origin_ns = clock_ns()

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics with receivers."""
        return tuple(self._takers)

    def now_s(self) -> float:
        """Return this computer's time in the seconds of all series."""
        return (self._clock_ns() - self.origin_ns) / 1e9

    def join(self, topic: str, taker: SeriesTaker, *, deep: bool = True) -> None:
        """Pass the messages of a topic to ``taker`` from now on.

        If not ``deep``, it accepts drops of a late window, and gets no history of a recording.
        """
        self._takers.setdefault(topic, []).append(taker)
        if deep:
            deep_ones = self._deep.setdefault(topic, [])
            deep_ones.append(taker)
            if len(deep_ones) == 1:
                self._set_room(topic, BETWEEN_TICKS)
        if topic not in self._watching:
            self._watching[topic] = self._watch(topic)

    def leave(self, topic: str, taker: SeriesTaker) -> None:
        """Remove a receiver. Idempotent."""
        takers, deep = self._takers.get(topic, []), self._deep.get(topic, [])
        if taker in takers:
            takers.remove(taker)
        if not takers and topic in self._watching:
            del self._takers[topic]
            self._watching.pop(topic).close()
        if taker in deep:
            deep.remove(taker)
            if not deep:
                del self._deep[topic]
                self._set_room(topic, None)

    def rewind(self, topics: Iterable[str] | None = None) -> None:
        """Clear these topics (None: all): the source moved to another time."""
        for topic in list(self._takers) if topics is None else topics:
            for taker in self._takers.get(topic, ()):
                taker.rewind()

    def add(self, batches: Mapping[str, Batch]) -> None:
        """Pass on the messages of a tick, by topic."""
        if not self._takers:
            return
        now_ns = self._clock_ns()
        for topic, batch in batches.items():
            for taker in self._takers.get(topic, ()):
                taker.process(batch, now_ns)
