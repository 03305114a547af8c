"""The picture that stands for a recording: one from its middle."""

from __future__ import annotations

from pathlib import Path

from app.core.messages.picture import Picture, Size, decode
from nep.errors import NepError
from nep.recordings.reader import Recording

CACHE_BYTES = 8_000_000
"""Of one recording that is open for a moment only."""


def picture_in(path: Path, fit: Size) -> Picture | None:
    """A picture of its fullest topic of pictures, for a view of that size; None where it has none."""
    try:
        with Recording(path, cache_bytes=CACHE_BYTES) as recording:
            topics = [each for each in recording.topics.values() if each.codec == "image"]
            if not topics:
                return None
            topic = max(topics, key=lambda each: each.message_count).name
            middle = (recording.start_ns + recording.end_ns) // 2
            found = recording.newest(middle, (topic,)).get(topic) or recording.after(middle, topic)
            return decode(found.message, 0.0, fit)[0] if found is not None else None
    except (NepError, OSError):
        return None
