"""Decoding of messages for display: small ones immediately, large ones in a background thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from app.core.messages.lazy_json import JsonIndex
from app.core.messages.newest_only import NewestJobWorker
from nep.errors import NepError
from nep.i18n import _
from nep.messages.codecs import content_of
from nep.messages.message import Message

LARGE_BYTES = 1_000_000
"""Message size in bytes above which JSON is indexed instead of decoded, in a background thread."""
READ_INTERVAL_S = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class ReadResult:
    """Result of reading a message.

    Attributes:
        message: Message that was read.
        value: Decoded value.
        error: Error message, or None.
        index: Index of a large JSON text; None for other messages.
    """

    message: Message
    value: object = None
    error: str | None = None
    index: JsonIndex | None = None


def read(message: Message, summarize_image: Callable[[Message], object] | None = None) -> ReadResult:
    """Decode a message for display; large JSON is indexed instead (`app.core.messages.lazy_json`).

    If that fails, the result contains the reason (`ReadResult.error`). Thread-safe.

    Args:
        message: Message to read.
        summarize_image: Returns the value of an image; None to decode its pixels.
    """
    try:
        if summarize_image is not None and content_of(message.codec) == "image":
            return ReadResult(message, summarize_image(message))
        if message.codec == "json" and message.size_bytes > LARGE_BYTES:
            index = JsonIndex(message.data)
            return ReadResult(message, index.root, index=index)
        return ReadResult(message, message.payload)
    except (NepError, ValueError) as error:
        return ReadResult(message, error=str(error))
    except MemoryError:
        return ReadResult(message, error=_("not enough memory"))


class MessageReader(NewestJobWorker[Message, ReadResult]):
    """Background thread that reads the messages of one panel. The first message starts the thread."""

    def __init__(self) -> None:
        super().__init__(self._read, "studio-reader")
        self._requested_s: float | None = None

    @staticmethod
    def _read(message: Message) -> ReadResult:
        return read(message)

    def submit_throttled(self, message: Message, now: float) -> bool:
        """Read a message, unless a read is running or the last read started less than a second ago.

        Limits the CPU load of large messages.

        Args:
            message: Message to read.
            now: Monotonic seconds.

        Returns:
            True if the message will be read.
        """
        if self.is_busy or (self._requested_s is not None and now - self._requested_s < READ_INTERVAL_S):
            return False
        self._requested_s = now
        self.submit(message)
        return True

    def clear(self) -> None:
        """Discard pending and running reads, so that the next one may start immediately."""
        self._requested_s = None
        super().clear()
