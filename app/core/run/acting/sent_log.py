"""What was sent and called by hand or from a recording: when, where to, who asked, and what came of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from app.core.run.acting.arming import Target

MOST_KEPT = 200
KEPT_BYTES = 16 * 1024
"""A larger message is listed, and can't be copied or repeated from there."""

Asker = Literal["publish", "service", "replay", "image", "switch"]


@dataclass(frozen=True, slots=True)
class SentRecord:
    """One entry. ``at_s`` is the last time that it happened (epoch seconds), ``count`` how often in a row.

    ``name`` is the topic or service, "" of the switch; ``words`` say what came of it, well or not
    (``is_bad``). ``text`` is the message or request, "" where it is too large or is none, ``source`` the same
    as a person wrote it; ``again`` sends or calls it once more and gives why it can't, None where that makes
    no sense.
    """

    at_s: float
    asker: Asker
    name: str
    words: str
    is_bad: bool = False
    text: str = ""
    source: str = ""
    again: Callable[[], str] | None = None
    count: int = 1
    number: int = 0

    @property
    def target(self) -> Target:
        """Where it went."""
        return Target("service" if self.asker == "service" else "topic", self.name)

    def is_like(self, other: SentRecord) -> bool:
        """Whether both tell the same of the same."""
        facts = (self.asker, self.name, self.words, self.is_bad, self.source)
        return facts == (other.asker, other.name, other.words, other.is_bad, other.source)


class SentLog:
    """The last 200 entries, oldest first, and how much was sent in all. One thread uses it (the window's)."""

    def __init__(self) -> None:
        self._records: deque[SentRecord] = deque(maxlen=MOST_KEPT)
        self._last = 0
        self.total = 0
        """Messages and calls that went out."""
        self.since_s: float | None = None
        """When the first of them did (epoch seconds)."""
        self.revision = 0

    @property
    def records(self) -> Sequence[SentRecord]:
        """All that are kept, oldest first."""
        return self._records

    def get(self, number: int) -> SentRecord | None:
        """The entry of that number, while it is kept."""
        return next((each for each in self._records if each.number == number), None)

    def put(self, record: SentRecord, sent: int) -> None:
        """This happened; ``sent`` messages or calls went out by it. The log gives it its number.

        The same once more is counted in the entry that is the newest. A text that is too large is not kept,
        and neither is how to do it again.
        """
        self.revision += 1
        if sent > 0:
            self.total += sent
            self.since_s = record.at_s if self.since_s is None else self.since_s
        if is_large(record.text) or is_large(record.source):
            record = replace(record, text="", source="", again=None)
        newest = self._records[-1] if self._records else None
        if newest is not None and record.asker != "switch" and newest.is_like(record):
            self._records[-1] = replace(record, number=newest.number, count=newest.count + 1)
        else:
            self._last += 1
            self._records.append(replace(record, number=self._last))

    def clear(self) -> None:
        """Forget the entries; what was sent in all is still known."""
        self._records.clear()
        self.revision += 1


def is_large(text: str) -> bool:
    """Whether a text is not kept."""
    return len(text) > KEPT_BYTES or len(text.encode("utf-8", "replace")) > KEPT_BYTES
