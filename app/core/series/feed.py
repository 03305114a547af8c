"""Feed that passes all messages of plotted topics to the series, once per tick."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from app.core.network.mailbox import Batch
from app.core.network.watches import WatchHandle

DEEP_CAPACITY = 8192
"""Maximum number of messages of a plotted topic between two ticks, enough for 8 s at 1 kHz."""


class SeriesReceiver(Protocol):
    """Receiver of the messages of a topic."""

    def process(self, batch: Batch, now_ns: int) -> None:
        """Process the messages received since the last tick.

        Args:
            batch: Messages, oldest first.
            now_ns: Current time of this computer in ns since 1970, used for messages without a time
                stamp.
        """

    def reset(self) -> None:
        """Remove all messages without counting them as lost. Called when the source seeks to another time."""


class SeriesFeed:
    """Receivers of messages, by topic. Not thread-safe; use it from the main thread.

    A topic is subscribed to while it has a receiver, even if no panel is visible, so that plots have no
    gaps.

    Attributes:
        origin_ns: Time 0 of all series, in ns since 1970.
    """

    def __init__(
        self,
        watch: Callable[[str], WatchHandle],
        clock_ns: Callable[[], int],
        set_room: Callable[[str, int | None], None] = lambda _topic, _messages: None,
    ) -> None:
        # `watch` opens a watch by topic key; `set_room` sets the number of messages kept between ticks
        # (`Mailbox.set_capacity`).
        self._watch, self._clock_ns, self._set_room = watch, clock_ns, set_room
        self._takers: dict[str, list[SeriesReceiver]] = {}
        self._lossless_receivers: dict[str, list[SeriesReceiver]] = {}
        self._watching: dict[str, WatchHandle] = {}
        self.origin_ns = clock_ns()

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics that have a receiver."""
        return tuple(self._takers)

    def now_s(self) -> float:
        """Return the current time of this computer in seconds since ``origin_ns``."""
        return (self._clock_ns() - self.origin_ns) / 1e9

    def register(self, topic: str, taker: SeriesReceiver, *, is_lossless: bool = True) -> None:
        """Add a receiver for the messages of a topic.

        Args:
            topic: Key of the topic.
            taker: Receiver.
            is_lossless: True to receive all messages, and the history of a recording. If False, messages may
                be dropped while the window is busy.
        """
        self._takers.setdefault(topic, []).append(taker)
        if is_lossless:
            deep_ones = self._lossless_receivers.setdefault(topic, [])
            deep_ones.append(taker)
            if len(deep_ones) == 1:
                self._set_room(topic, DEEP_CAPACITY)
        if topic not in self._watching:
            self._watching[topic] = self._watch(topic)

    def unregister(self, topic: str, taker: SeriesReceiver) -> None:
        """Remove a receiver. Idempotent."""
        takers, lossless = self._takers.get(topic, []), self._lossless_receivers.get(topic, [])
        if taker in takers:
            takers.remove(taker)
        if not takers and topic in self._watching:
            del self._takers[topic]
            self._watching.pop(topic).close()
        if taker in lossless:
            lossless.remove(taker)
            if not lossless:
                del self._lossless_receivers[topic]
                self._set_room(topic, None)

    def reset(self, topics: Iterable[str] | None = None) -> None:
        """Reset the receivers of topics (None: all topics). Called when the source seeks to another time."""
        for topic in list(self._takers) if topics is None else topics:
            for taker in self._takers.get(topic, ()):
                taker.reset()

    def dispatch(self, batches: Mapping[str, Batch]) -> None:
        """Pass the messages received since the last tick to the receivers."""
        if not self._takers:
            return
        now_ns = self._clock_ns()
        for topic, batch in batches.items():
            for taker in self._takers.get(topic, ()):
                taker.process(batch, now_ns)
