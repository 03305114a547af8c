"""Opening of a recording for replay. Only the index is read, and nothing is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.core.recording.opener import LocalOpener, RecordingOpener
from nep.errors import RecordingError
from nep.i18n import _
from nep.recordings.bookmarks import Bookmarks
from nep.recordings.formats.message_counts import TopicStats
from nep.recordings.reader import Recording

MAX_TOPICS = 10_000
Progress = Callable[[float], object]
"""Callback for the progress of scanning a file (0 to 1). If it raises an exception, opening is cancelled."""


@dataclass(frozen=True)
class OpenedRecording:
    """Recording that is open for replay, with its bookmarks and statistics."""

    recording: Recording
    bookmarks: Bookmarks
    stats: dict[str, TopicStats]


def open_recording(path: Path, progress: Progress, opener: RecordingOpener | None = None) -> OpenedRecording:
    """Open a recording for replay.

    Args:
        path: File of the recording.
        progress: Called with the progress of scanning a file without an index, 0 to 1.
        opener: Opens the file; by default, in this process.

    Raises:
        RecordingError: The file can't be read, contains no messages, or has more than `MAX_TOPICS`
            topics.
    """

    def report_progress(done: int, total: int) -> None:
        progress(done / max(1, total))

    progress(0.0)
    recording = (opener or LocalOpener()).open(path, progress=report_progress)
    try:
        if len(recording.topics) > MAX_TOPICS:
            template = _("the recording has {count} topics; at most {most} can be shown")
            raise RecordingError(str(path), template.format(count=len(recording.topics), most=MAX_TOPICS))
        if not recording.message_count:
            raise RecordingError(str(path), _("the recording contains no readable messages"))
        return OpenedRecording(recording, Bookmarks(recording), recording.stats())
    except BaseException:
        recording.close()
        raise
