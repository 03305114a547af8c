"""Feed that passes all messages of plotted topics to the series, once per tick."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from app.core.network.mailbox import Batch
from app.core.network.watches import WatchHandle

LOSSLESS_CAPACITY = 8192
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
        set_capacity: Callable[[str, int | None], None] = lambda _topic, _messages: None,
    ) -> None:
        # `watch` opens a watch by topic key; `set_capacity` sets the number of messages kept between ticks
        # (`Mailbox.set_capacity`).
        self._watch, self._clock_ns, self._set_capacity = watch, clock_ns, set_capacity
        self._receivers: dict[str, list[SeriesReceiver]] = {}
        self._lossless_receivers: dict[str, list[SeriesReceiver]] = {}
        self._watch_handles: dict[str, WatchHandle] = {}
        self.origin_ns = clock_ns()

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics that have a receiver."""
        return tuple(self._receivers)

    def now_s(self) -> float:
        """Return the current time of this computer in seconds since ``origin_ns``."""
        return (self._clock_ns() - self.origin_ns) / 1e9

    def register(self, topic: str, receiver: SeriesReceiver, *, is_lossless: bool = True) -> None:
        """Add a receiver for the messages of a topic.

        Args:
            topic: Key of the topic.
            receiver: Receiver.
            is_lossless: True to receive all messages, and the history of a recording. If False, messages may
                be dropped while the window is busy.
        """
        self._receivers.setdefault(topic, []).append(receiver)
        if is_lossless:
            lossless_receivers = self._lossless_receivers.setdefault(topic, [])
            lossless_receivers.append(receiver)
            if len(lossless_receivers) == 1:
                self._set_capacity(topic, LOSSLESS_CAPACITY)
        if topic not in self._watch_handles:
            self._watch_handles[topic] = self._watch(topic)

    def unregister(self, topic: str, receiver: SeriesReceiver) -> None:
        """Remove a receiver. Idempotent."""
        receivers, lossless_receivers = (
            self._receivers.get(topic, []),
            self._lossless_receivers.get(topic, []),
        )
        if receiver in receivers:
            receivers.remove(receiver)
        if not receivers and topic in self._watch_handles:
            del self._receivers[topic]
            self._watch_handles.pop(topic).close()
        if receiver in lossless_receivers:
            lossless_receivers.remove(receiver)
            if not lossless_receivers:
                del self._lossless_receivers[topic]
                self._set_capacity(topic, None)

    def reset(self, topics: Iterable[str] | None = None) -> None:
        """Reset the receivers of topics (None: all topics). Called when the source seeks to another time."""
        for topic in list(self._receivers) if topics is None else topics:
            for receiver in self._receivers.get(topic, ()):
                receiver.reset()

    def dispatch(self, batches: Mapping[str, Batch]) -> None:
        """Pass the messages received since the last tick to the receivers."""
        if not self._receivers:
            return
        now_ns = self._clock_ns()
        for topic, batch in batches.items():
            for receiver in self._receivers.get(topic, ()):
                receiver.process(batch, now_ns)
