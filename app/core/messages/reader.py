"""Reads a message for people: a small one at once, large ones in a thread, one at a time, the newest only."""

from __future__ import annotations

from dataclasses import dataclass

from app.core.messages.lazy_json import JsonIndex
from app.core.messages.newest_only import NewestOnly
from nep.errors import NepError
from nep.i18n import _
from nep.messages.message import Message

LARGE_BYTES = 1_000_000
"""JSON above this is looked into, not decoded; what is larger is never read in the window's thread."""
EVERY_S = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """A message that was read: its ``value``, or the sentence why it can't be (``error``).

    ``index`` tells where things are in a large JSON text; None for other messages.
    """

    message: Message
    value: object = None
    error: str | None = None
    index: JsonIndex | None = None


def read(message: Message) -> Reading:
    """Read a message, in any thread; large JSON is looked into (`app.core.messages.lazy_json`)."""
    try:
        if message.codec == "json" and message.size_bytes > LARGE_BYTES:
            index = JsonIndex(message.data)
            return Reading(message, index.root, index=index)
        return Reading(message, message.payload)
    except (NepError, ValueError) as error:
        return Reading(message, error=str(error))
    except MemoryError:
        return Reading(message, error=_("not enough memory"))


class Reader(NewestOnly[Message, Reading]):
    """One thread that reads for one panel; it is started by the first message and waits for more."""

    def __init__(self) -> None:
        """Nothing to read yet."""
        super().__init__(self._read, "studio-reader")
        self._asked_at: float | None = None

    @staticmethod
    def _read(message: Message) -> Reading:
        return read(message)

    def ask_at_leisure(self, message: Message, now: float) -> bool:
        """Read this one unless something is being read, or was begun less than a second ago.

        A large message takes a while, and nobody reads faster. ``now`` is monotonic; whether it will be read.
        """
        if self.busy or (self._asked_at is not None and now - self._asked_at < EVERY_S):
            return False
        self._asked_at = now
        self.ask(message)
        return True

    def forget(self) -> None:
        """Nobody wants what waits or is being read; the next one may be read at once."""
        self._asked_at = None
        super().forget()
