"""Index of subscribers with patterns, and of the published topics that match each pattern.

A topic is matched against every pattern when its first publisher is added; a pattern is matched against
every topic when its first subscriber is added. The numbers of both are limited, and the results are
cached.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

from nep.protocol.topic_pattern import matches

MAX_PATTERNS_PER_NODE = 100
"""Maximum number of one node's subscribers with patterns."""
MAX_PATTERNS = 1_000
"""Maximum number of all nodes' subscribers with patterns."""

T = TypeVar("T")


class PatternIndex(Generic[T]):
    """Index of patterns and the topics that match them. `T` is the owner of a subscriber."""

    def __init__(self) -> None:
        self._subscribers: dict[str, dict[int, T]] = {}
        self._topics: dict[str, set[str]] = {}
        self._patterns: dict[str, set[str]] = {}
        """Matching patterns by topic."""

    def __len__(self) -> int:
        return sum(map(len, self._subscribers.values()))

    def __contains__(self, pattern: object) -> bool:
        return pattern in self._subscribers

    def add(self, pattern: str, subscriber: int, owner: T, published: Iterable[str]) -> None:
        """Add a subscriber.

        Args:
            pattern: Pattern of the subscriber.
            subscriber: Id of the subscriber.
            owner: Owner of the subscriber.
            published: All published topics.
        """
        if pattern not in self._subscribers:
            self._subscribers[pattern] = {}
            self._topics[pattern] = {topic for topic in published if matches(pattern, topic)}
            for topic in self._topics[pattern]:
                self._patterns.setdefault(topic, set()).add(pattern)
        self._subscribers[pattern][subscriber] = owner

    def remove(self, pattern: str, subscriber: int) -> None:
        """Remove a subscriber. Idempotent."""
        subscribers = self._subscribers.get(pattern)
        if subscribers is None:
            return
        subscribers.pop(subscriber, None)
        if not subscribers:
            del self._subscribers[pattern]
            for topic in self._topics.pop(pattern):
                self._discard(topic, pattern)

    def add_topic(self, topic: str) -> None:
        """Add a topic that got its first publisher."""
        if topic in self._patterns:
            return
        patterns = {pattern for pattern in self._subscribers if matches(pattern, topic)}
        if patterns:
            self._patterns[topic] = patterns
            for pattern in patterns:
                self._topics[pattern].add(topic)

    def remove_topic(self, topic: str) -> None:
        """Remove a topic that has lost its last publisher."""
        for pattern in self._patterns.pop(topic, ()):
            self._topics[pattern].discard(topic)

    def topics_of(self, pattern: str) -> set[str]:
        """Return the published topics that match a pattern; empty if the pattern has no subscriber."""
        return self._topics.get(pattern, set())

    def subscribers_of(self, topic: str) -> list[tuple[T, int]]:
        """Return (owner, id) of each subscriber whose pattern matches a topic, which may be a removed one."""
        if not self._subscribers:
            return []
        patterns = self._patterns.get(topic)
        if patterns is None:
            patterns = {pattern for pattern in self._subscribers if matches(pattern, topic)}
        return [
            (owner, subscriber)
            for pattern in sorted(patterns)
            for subscriber, owner in self._subscribers[pattern].items()
        ]

    def _discard(self, topic: str, pattern: str) -> None:
        patterns = self._patterns.get(topic)
        if patterns is not None:
            patterns.discard(pattern)
            if not patterns:
                del self._patterns[topic]
