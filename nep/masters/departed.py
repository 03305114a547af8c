"""Recently unregistered publishers, for subscribers that were disconnected when they closed.

Such a subscriber counts its lost messages by their last sequence numbers.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

__all__ = ["Departed"]

_RETENTION_S = 60.0
_MAX_PUBLISHERS = 1000
_MAX_PER_TOPIC = 64
"""Limit per topic: a program that restarts repeatedly leaves a publisher behind each time."""

P = TypeVar("P")


class Departed(Generic[P]):
    """Publishers unregistered within the last minute, bounded in number. Has no clock.

    They are found by their topic, and by the patterns of their subscribers.
    """

    def __init__(self) -> None:
        self.changes = 0
        """Number of removals, by which callers invalidate caches; additions are known to them."""
        self._by_name: dict[str, dict[int, P]] = {}
        self._names: dict[int, frozenset[str]] = {}
        """Names by publisher id, oldest first."""
        self._expires_at: dict[int, float] = {}
        """Expiry times of entries that `tick` has seen."""

    def __contains__(self, publisher: int) -> bool:
        return publisher in self._names

    def of(self, topic: str) -> dict[int, P]:
        """Return the publishers of a topic or pattern by id. Read-only."""
        return self._by_name.get(topic, {})

    def add(self, names: Iterable[str], publisher: int, what: P) -> None:
        """Add an unregistered publisher. `names` are its topic and the patterns that matched it."""
        self._remove(publisher)
        self._names[publisher] = frozenset(names)
        for name in self._names[publisher]:
            found = self._by_name.setdefault(name, {})
            found[publisher] = what
            if len(found) > _MAX_PER_TOPIC:
                del found[next(iter(found))]
        if len(self._names) > _MAX_PUBLISHERS:
            self._remove(next(iter(self._names)))

    def tick(self, now: float) -> None:
        """Remove expired publishers."""
        for publisher in self._names:
            self._expires_at.setdefault(publisher, now + _RETENTION_S)
        for publisher in [each for each, end in self._expires_at.items() if end <= now]:
            self._remove(publisher)

    def _remove(self, publisher: int) -> None:
        self._expires_at.pop(publisher, None)
        names = self._names.pop(publisher, frozenset())
        self.changes += bool(names)
        for name in names:
            found = self._by_name.get(name, {})
            found.pop(publisher, None)
            if not found:
                self._by_name.pop(name, None)
