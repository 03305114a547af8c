"""Recently unregistered publishers, for subscribers that were disconnected when they unregistered.

Such a subscriber counts lost messages from the last sequence numbers of these publishers.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

_RETENTION_S = 60.0
_MAX_PUBLISHERS = 1000
_MAX_PUBLISHERS_PER_TOPIC = 64
"""Maximum number of publishers per topic. A program that restarts repeatedly adds one each time."""

P = TypeVar("P")


class DepartedPublishers(Generic[P]):
    """Publishers that were unregistered within the last minute, limited in number.

    Each publisher is stored under its topic and under the patterns that matched the topic. The time
    is passed to `tick`.
    """

    def __init__(self) -> None:
        self.removal_count = 0
        """Number of removals so far; if it has changed, caches of callers are outdated."""
        self._by_name: dict[str, dict[int, P]] = {}
        self._names: dict[int, frozenset[str]] = {}
        """Names under which each publisher is stored, by its id, oldest first."""
        self._expires_at: dict[int, float] = {}
        """Expiry times of the entries that `tick` has seen, by publisher id."""

    def __contains__(self, publisher: int) -> bool:
        return publisher in self._names

    def for_topic(self, topic: str) -> dict[int, P]:
        """Return the stored publishers of a topic or pattern by id. The result must not be modified."""
        return self._by_name.get(topic, {})

    def add(self, names: Iterable[str], publisher: int, value: P) -> None:
        """Add an unregistered publisher.

        Args:
            names: Topic of the publisher and the patterns that matched the topic.
            publisher: Id of the publisher.
            value: Value to store for the publisher.
        """
        self._remove(publisher)
        self._names[publisher] = frozenset(names)
        for name in self._names[publisher]:
            publishers = self._by_name.setdefault(name, {})
            publishers[publisher] = value
            if len(publishers) > _MAX_PUBLISHERS_PER_TOPIC:
                del publishers[next(iter(publishers))]
        if len(self._names) > _MAX_PUBLISHERS:
            self._remove(next(iter(self._names)))

    def tick(self, now: float) -> None:
        """Remove expired publishers. `now` is a monotonic time in seconds."""
        for publisher in self._names:
            self._expires_at.setdefault(publisher, now + _RETENTION_S)
        for publisher in [each for each, end in self._expires_at.items() if end <= now]:
            self._remove(publisher)

    def _remove(self, publisher: int) -> None:
        self._expires_at.pop(publisher, None)
        names = self._names.pop(publisher, frozenset())
        self.removal_count += bool(names)
        for name in names:
            publishers = self._by_name.get(name, {})
            publishers.pop(publisher, None)
            if not publishers:
                self._by_name.pop(name, None)
