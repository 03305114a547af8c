"""Messages of publishers that no master has told of yet: a few of each, of a bounded number of publishers."""

from __future__ import annotations

from collections import deque

from nep.messages.message import Message

MAX_PUBLISHERS = 64
MAX_PER_PUBLISHER = 4


class HeldMessages:
    """A publisher that floods displaces its own messages only, and no new publisher those of another."""

    def __init__(self, *, per_publisher: int = MAX_PER_PUBLISHER, publishers: int = MAX_PUBLISHERS) -> None:
        """Keep the newest ``per_publisher`` messages of each of the first ``publishers`` that come."""
        self._per_publisher, self._publishers = per_publisher, publishers
        self._messages: dict[int | None, deque[Message]] = {}

    def __bool__(self) -> bool:
        return bool(self._messages)

    def holds(self, publisher: int | None) -> bool:
        """Return whether messages of this publisher are held."""
        return publisher in self._messages

    def put(self, message: Message) -> None:
        """Hold a message."""
        held = self._messages.get(message.publisher)
        if held is None:
            if len(self._messages) >= self._publishers:
                return
            held = self._messages[message.publisher] = deque(maxlen=self._per_publisher)
        held.append(message)

    def take(self) -> list[Message]:
        """Return what is held, in order within each publisher, and hold nothing more."""
        taken = [message for held in self._messages.values() for message in held]
        self._messages.clear()
        return taken
