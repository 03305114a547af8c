"""Destination of a recording: a single file, with checks of the file and its disk."""

from __future__ import annotations

import errno
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from nep.errors import RecordingError
from nep.i18n import _
from nep.recordings.formats.mcap_file import FileWriter


@dataclass(frozen=True)
class WriterLimits:
    """Limits of a writer.

    Attributes:
        queue_bytes: Maximum size of queued messages.
        queue_messages: Maximum number of queued messages.
        least_free_bytes: Free disk space below which a recording stops, so that other programs have some
            left.
        flush_s: Maximum time until a received message is written to the file.
        stats_interval_s: Interval at which the counts by topic are written.
    """

    queue_bytes: int = 256_000_000
    queue_messages: int = 200_000
    min_free_bytes: int = 200_000_000
    flush_interval_s: float = 0.5
    stats_interval_s: float = 1.0


DEFAULT_LIMITS = WriterLimits()


class Destination(Protocol):
    """Destination of a writer. Called in the writer's thread only."""

    @property
    def file(self) -> FileWriter:
        """File that is currently written."""

    def on_flushed(self) -> None:
        """Process the end of a written chunk. Raises `OSError` or `RecordingError`."""

    @property
    def is_full(self) -> bool:
        """True if the recording should continue in another file."""

    def next_file(self) -> None:
        """Finish the current file, which has its counts and metadata, and open the next one.

        Raises the exceptions of `finish`.
        """

    def check_file(self) -> None:
        """Check the file and its disk. Called once a second. Raises `RecordingError` if the disk is full."""

    def finish(self) -> None:
        """Finish the recording. Raises `OSError`."""

    def abort(self) -> None:
        """Close the file without a summary, after an error."""


class OneFile:
    """Destination with a single file."""

    def __init__(self, file: FileWriter, least_free_bytes: int) -> None:
        self.file = file
        self._least_free_bytes = least_free_bytes
        self._identity = _file_identity(file.path)

    is_full = False

    def on_flushed(self) -> None:
        """Do nothing."""

    def next_file(self) -> None:
        """Do nothing, because there is only one file."""

    def check_file(self) -> None:
        """Check that the file still exists and the disk is not full. Raises `RecordingError`."""
        if _file_identity(self.file.path) != self._identity:
            raise RecordingError(str(self.file.path), _("the file was moved or deleted during recording"))
        if shutil.disk_usage(self.file.path.parent).free < self._least_free_bytes:
            raise RecordingError(
                str(self.file.path), _("the disk is full; everything recorded before is saved")
            )

    def finish(self) -> None:
        """Write the summary and close the file. Raises `OSError`."""
        self.file.finish()

    def abort(self) -> None:
        """Close the file without a summary."""
        self.file.close()


def _file_identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def disk_error(path: Path, error: OSError) -> RecordingError:
    """Convert an I/O error to a `RecordingError`."""
    if error.errno in {errno.ENOSPC, errno.EDQUOT if hasattr(errno, "EDQUOT") else errno.ENOSPC, errno.EFBIG}:
        reason = _("the disk is full; everything recorded before is saved")
    else:
        reason = (error.strerror or str(error)).lower()
    return RecordingError(str(path), reason)
