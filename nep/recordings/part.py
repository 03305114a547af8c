"""What is known of one file of a recording that may be split into several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from nep.messages.message import Message
from nep.recordings.figures import TopicFigures

__all__ = ["RecordingPart"]

_MAX_LATCHED, _MAX_LATCHED_BYTES = 1_000, 16_000_000


@dataclass
class RecordingPart:
    """What is known of one file of a recording that is split."""

    number: int = 1
    messages_before: int = 0
    bytes_before: int = 0
    repeated: int = 0
    """Latched messages that stand in an earlier file, too."""
    before: Mapping[str, TopicFigures] = field(default_factory=dict)
    """The counts when it began."""
    latched: dict[tuple[str, int | None], Message] = field(default_factory=dict)
    latched_bytes: int = 0

    def keep(self, message: Message) -> None:
        """A latched message, which the next file needs, too; as many as fit."""
        key = (message.topic, message.publisher)
        old = self.latched.get(key)
        grown = message.size_bytes - (old.size_bytes if old is not None else 0)
        if old is None and len(self.latched) >= _MAX_LATCHED:
            return
        if self.latched_bytes + grown <= _MAX_LATCHED_BYTES:
            self.latched[key] = message
            self.latched_bytes += grown

    def of(self, figures: Mapping[str, TopicFigures]) -> dict[str, TopicFigures]:
        """What was counted in this file."""
        nothing = TopicFigures()
        return {topic: each.since(self.before.get(topic, nothing)) for topic, each in figures.items()}

    def following(self, figures: Mapping[str, TopicFigures], messages: int, size_bytes: int) -> RecordingPart:
        """The next file's, where so much is in this one and those before."""
        return RecordingPart(
            self.number + 1,
            messages,
            size_bytes,
            0,
            dict(figures),
            self.latched,
            self.latched_bytes,
        )
