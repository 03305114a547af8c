"""Buffer for messages of publishers that the master does not list yet, bounded per publisher and in total."""

from __future__ import annotations

from collections import deque

from nep.messages.message import Message

MAX_PUBLISHERS = 64
MAX_PER_PUBLISHER = 4


class PendingMessages:
    """Bounded buffer of messages of unknown publishers.

    If a publisher sends too many messages, its own oldest message is evicted. If there are too many
    publishers, messages of new publishers are dropped.

    Args:
        per_publisher: Maximum number of messages of one publisher.
        publishers: Maximum number of publishers.
    """

    def __init__(self, *, per_publisher: int = MAX_PER_PUBLISHER, publishers: int = MAX_PUBLISHERS) -> None:
        self._per_publisher, self._publishers = per_publisher, publishers
        self._messages: dict[int | None, deque[Message]] = {}

    def __bool__(self) -> bool:
        return bool(self._messages)

    def has_messages_of(self, publisher: int | None) -> bool:
        """Return True if messages of this publisher are stored."""
        return publisher in self._messages

    def add(self, message: Message) -> None:
        """Store a message; see the class for the limits."""
        messages = self._messages.get(message.publisher)
        if messages is None:
            if len(self._messages) >= self._publishers:
                return
            messages = self._messages[message.publisher] = deque(maxlen=self._per_publisher)
        messages.append(message)

    def pop_all(self) -> list[Message]:
        """Remove and return all messages; messages of one publisher are in order of arrival."""
        pending = [message for messages in self._messages.values() for message in messages]
        self._messages.clear()
        return pending
