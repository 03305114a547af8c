"""Departed: publishers that are not listed any more, for subscribers that were cut off when they ended.

A subscriber that was not there to be told of the end counts what it missed by their newest messages.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

__all__ = ["Departed"]

_KEPT_S = 60.0
_KEPT_MAX = 1000
_KEPT_OF_TOPIC = 64
"""A program that is started again and again leaves a publisher behind each time."""

P = TypeVar("P")


class Departed(Generic[P]):
    """The newest of them, each for a minute while there is room. No clock.

    Each is found by its topic, and by the wildcards of those who heard it.
    """

    def __init__(self) -> None:
        self.changes = 0
        """Grows when some are forgotten; whoever adds one knows."""
        self._heard_as: dict[str, dict[int, P]] = {}
        self._names: dict[int, frozenset[str]] = {}
        """By id, the oldest first."""
        self._ends: dict[int, float] = {}
        """Until when each is kept, of those that `tick` has seen."""

    def __contains__(self, publisher: int) -> bool:
        return publisher in self._names

    def of(self, topic: str) -> dict[int, P]:
        """Those of a topic, or of wildcards, by id. Only to be looked at."""
        return self._heard_as.get(topic, {})

    def add(self, names: Iterable[str], publisher: int, what: P) -> None:
        """This one is not listed any more. `names` are its topic and the wildcards by which it was heard."""
        self._forget(publisher)
        self._names[publisher] = frozenset(names)
        for name in self._names[publisher]:
            found = self._heard_as.setdefault(name, {})
            found[publisher] = what
            if len(found) > _KEPT_OF_TOPIC:
                del found[next(iter(found))]
        if len(self._names) > _KEPT_MAX:
            self._forget(next(iter(self._names)))

    def tick(self, now: float) -> None:
        """Forget those that ended long ago."""
        for publisher in self._names:
            self._ends.setdefault(publisher, now + _KEPT_S)
        for publisher in [each for each, end in self._ends.items() if end <= now]:
            self._forget(publisher)

    def _forget(self, publisher: int) -> None:
        self._ends.pop(publisher, None)
        names = self._names.pop(publisher, frozenset())
        self.changes += bool(names)
        for name in names:
            found = self._heard_as.get(name, {})
            found.pop(publisher, None)
            if not found:
                self._heard_as.pop(name, None)
