"""Opening a recording: its index is read, and one that was not ended is repaired to a copy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from nep.errors import RecordingError
from nep.i18n import _
from nep.recordings.bookmarks import Bookmarks
from nep.recordings.figures import TopicFigures
from nep.recordings.reader import Recording
from nep.recordings.repair import RepairReport, repair

Stage = Literal["reading", "repairing"]
Progress = Callable[[Stage, float], object]
"""Told what is being done, and how much of it is (0 to 1); what it raises ends the opening."""


@dataclass(frozen=True)
class OpenedRecording:
    """A recording that can be played.

    ``asked`` is the file that a person chose, which is another one when it was repaired: ``repaired`` says
    then what was done, None when a copy that was made earlier was there. ``why_not_repaired`` says why one
    that was not ended is read as it is.
    """

    recording: Recording
    bookmarks: Bookmarks
    figures: dict[str, TopicFigures]
    asked: Path
    repaired: RepairReport | None = None
    why_not_repaired: str = ""

    @property
    def is_copy(self) -> bool:
        """Whether it is a repaired copy of the file that was asked for."""
        return self.recording.path != self.asked


def open_recording(path: Path, progress: Progress) -> OpenedRecording:
    """Open a recording to play it. Raises `RecordingError` when it holds no message that can be read."""

    def reading(done: int, whole: int) -> None:
        progress("reading", done / max(1, whole))

    def repairing(done: int, whole: int) -> None:
        progress("repairing", done / max(1, whole))

    progress("reading", 0.0)
    recording = Recording(path, progress=reading)
    report, why_not = None, ""
    try:
        if not recording.is_complete:
            copy = _earlier_copy(path)
            if copy is None:
                try:
                    report = repair(path, progress=repairing)
                    copy = report.path
                except (
                    RecordingError
                ) as error:  # a full disk, say: it can be read all the same, if it has any
                    why_not = error.reason
            if copy is not None:
                recording.close()
                recording = Recording(copy, progress=reading)
        if not recording.message_count:
            raise RecordingError(str(path), _("it holds no message that can be read"))
        return OpenedRecording(recording, Bookmarks(recording), recording.figures(), path, report, why_not)
    except BaseException:
        recording.close()
        raise


def _earlier_copy(path: Path) -> Path | None:
    """The copy that was made when the file was opened before; None when there is none, or it is older."""
    copy = path.with_name(f"{path.stem}.repaired.mcap")
    try:
        if copy.stat().st_mtime_ns < path.stat().st_mtime_ns:
            return None
        with Recording(copy) as there:
            return copy if there.is_complete and there.message_count else None
    except (OSError, RecordingError):
        return None
