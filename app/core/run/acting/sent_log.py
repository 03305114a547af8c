"""Log of messages and calls sent manually or from a recording, with time, target, origin and result."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from app.core.run.acting.arming import Target

MAX_ENTRIES = 200
MAX_TEXT_BYTES = 16 * 1024
"""Maximum size in bytes of stored messages. Larger messages are listed but can't be copied or sent again."""

SendOrigin = Literal["publish", "service", "replay", "image", "switch"]


@dataclass(frozen=True, slots=True)
class SentRecord:
    """Entry of the log.

    Attributes:
        at_s: Time of the last occurrence in seconds since 1970.
        name: Topic or service; "" for an operation of the switch.
        result_text: Result as text.
        is_error: True if the result is an error.
        text: Message or request; "" if there is none or it is too large.
        source: Message or request as the user wrote it.
        resend: Sends the message or call again and returns the reason if that isn't possible; None for
            other entries.
        count: Number of consecutive occurrences.
    """

    at_s: float
    origin: SendOrigin
    name: str
    result_text: str
    is_error: bool = False
    text: str = ""
    source: str = ""
    resend: Callable[[], str] | None = None
    count: int = 1
    number: int = 0

    @property
    def target(self) -> Target:
        """Topic or service of the entry."""
        return Target("service" if self.origin == "service" else "topic", self.name)

    def is_like(self, other: SentRecord) -> bool:
        """Return True if both entries describe the same operation with the same result."""
        key = (self.origin, self.name, self.result_text, self.is_error, self.source)
        return key == (other.origin, other.name, other.result_text, other.is_error, other.source)


class SentLog:
    """Newest `MAX_ENTRIES` entries, oldest first, and the number of messages and calls sent so far.

    Not thread-safe; use it from the main thread.
    """

    def __init__(self) -> None:
        self._records: deque[SentRecord] = deque(maxlen=MAX_ENTRIES)
        self._last_number = 0
        self.total = 0
        """Number of messages and calls sent."""
        self.since_s: float | None = None
        """Time of the first message or call (seconds since 1970); None before it."""
        self.revision = 0

    @property
    def records(self) -> Sequence[SentRecord]:
        """Entries, oldest first."""
        return self._records

    def get(self, number: int) -> SentRecord | None:
        """Return the entry with this number, or None if it was evicted."""
        return next((each for each in self._records if each.number == number), None)

    def add(self, record: SentRecord, sent_count: int) -> None:
        """Add an entry and give it a number.

        If the entry equals the newest one, only the count of that one increases. Large texts are not
        stored, and such entries can't be sent again.

        Args:
            record: New entry.
            sent_count: Number of messages or calls that were sent.
        """
        self.revision += 1
        if sent_count > 0:
            self.total += sent_count
            self.since_s = record.at_s if self.since_s is None else self.since_s
        if is_large(record.text) or is_large(record.source):
            record = replace(record, text="", source="", resend=None)
        newest = self._records[-1] if self._records else None
        if newest is not None and record.origin != "switch" and newest.is_like(record):
            self._records[-1] = replace(record, number=newest.number, count=newest.count + 1)
        else:
            self._last_number += 1
            self._records.append(replace(record, number=self._last_number))

    def clear(self) -> None:
        """Remove all entries. `total` is not reset."""
        self._records.clear()
        self.revision += 1


def is_large(text: str) -> bool:
    """Return True if a text exceeds `MAX_TEXT_BYTES`."""
    return len(text) > MAX_TEXT_BYTES or len(text.encode("utf-8", "replace")) > MAX_TEXT_BYTES
