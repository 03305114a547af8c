"""Hands every message of a plotted topic on to the series that are picked from it, once a tick."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from app.core.network.mailbox import Batch
from app.core.network.watches import Watching

BETWEEN_TICKS = 8192
"""Messages of a plotted topic that wait for the next tick: 1 kHz for 8 s, should the window be that late."""


class SeriesTaker(Protocol):
    """Takes what arrived on one topic since the last tick."""

    def take(self, batch: Batch, now_ns: int) -> None:
        """Take over a batch; ``now_ns`` is this computer's time, for messages that carry none."""

    def rewind(self) -> None:
        """What comes next is of another time: nothing that was there counts any more, and nothing is lost."""


class SeriesFeed:
    """Who wants the messages of which topics. One thread uses it (the window's).

    A topic is subscribed while somebody takes its messages, also while no panel can be seen: a plot that is
    looked at again has no hole. ``origin_ns`` is the time that all series count their seconds from.
    """

    def __init__(
        self,
        watch: Callable[[str], Watching],
        clock_ns: Callable[[], int],
        set_room: Callable[[str, int | None], None] = lambda _topic, _messages: None,
    ) -> None:
        """``watch`` looks at a topic by its name among those of all networks.

        ``set_room`` says how many of its messages are to be kept between two ticks (`Mailbox.set_room`).
        """
        self._watch, self._clock_ns, self._set_room = watch, clock_ns, set_room
        self._takers: dict[str, list[SeriesTaker]] = {}
        self._deep: dict[str, list[SeriesTaker]] = {}
        self._watching: dict[str, Watching] = {}
        self.origin_ns = clock_ns()

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics whose messages somebody takes."""
        return tuple(self._takers)

    def now_s(self) -> float:
        """This computer's time in the seconds of all series."""
        return (self._clock_ns() - self.origin_ns) / 1e9

    def join(self, topic: str, taker: SeriesTaker, *, deep: bool = True) -> None:
        """Give ``taker`` the messages of a topic from now on.

        Who is not ``deep`` gets along without those that a late window drops, and without a recording's past.
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
        """Give it nothing more; said twice it does nothing."""
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
        """The source is at another time: what these topics (None: all) had is forgotten."""
        for topic in list(self._takers) if topics is None else topics:
            for taker in self._takers.get(topic, ()):
                taker.rewind()

    def add(self, batches: Mapping[str, Batch]) -> None:
        """Hand over what arrived since the last tick, by topic."""
        if not self._takers:
            return
        now_ns = self._clock_ns()
        for topic, batch in batches.items():
            for taker in self._takers.get(topic, ()):
                taker.take(batch, now_ns)
