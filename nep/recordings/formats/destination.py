"""`SingleFile`: destination of a recording in a single file, with checks of the file and its disk."""

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
        min_free_bytes: Free disk space at which a recording stops, so that other programs can still
            write.
        flush_interval_s: Maximum time in seconds until a received message is written to the file.
        stats_interval_s: Interval in seconds at which the message counts by topic are written.
    """

    queue_bytes: int = 256_000_000
    queue_messages: int = 200_000
    min_free_bytes: int = 200_000_000
    flush_interval_s: float = 0.5
    stats_interval_s: float = 1.0


DEFAULT_LIMITS = WriterLimits()


class Destination(Protocol):
    """Interface to the file or files to which a writer writes. Called in the writer's thread only."""

    @property
    def file(self) -> FileWriter:
        """File to which messages are currently written."""

    def on_flushed(self) -> None:
        """Called after a chunk was written. Raises `OSError` or `RecordingError`."""

    @property
    def is_full(self) -> bool:
        """True if the recording should continue in another file."""

    def next_file(self) -> None:
        """Finish the current file and open the next one. Raises `OSError` or `RecordingError`.

        The counts and metadata of the current file have already been written.
        """

    def check_file(self) -> None:
        """Check the file and its disk; called once a second.

        Raises `RecordingError` if the file is missing or the disk is full.
        """

    def finish(self) -> None:
        """Finish the recording. Raises `OSError`."""

    def abort(self) -> None:
        """Close the file without a summary, because an error has occurred."""


class SingleFile:
    """Destination that writes a single file.

    Args:
        file: Writer of the file.
        min_free_bytes: Free disk space at which the recording stops.
    """

    def __init__(self, file: FileWriter, min_free_bytes: int) -> None:
        self.file = file
        self._min_free_bytes = min_free_bytes
        self._identity = _file_identity(file.path)

    is_full = False

    def on_flushed(self) -> None:
        """Do nothing, because the file has no maximum size."""

    def next_file(self) -> None:
        """Do nothing, because there is only one file."""

    def check_file(self) -> None:
        """Raise `RecordingError` if the file no longer exists or the disk is full."""
        if _file_identity(self.file.path) != self._identity:
            raise RecordingError(str(self.file.path), _("the file was moved or deleted during recording"))
        if shutil.disk_usage(self.file.path.parent).free < self._min_free_bytes:
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
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def disk_error(path: Path, error: OSError) -> RecordingError:
    """Return a `RecordingError` for an I/O error."""
    if error.errno in {errno.ENOSPC, errno.EDQUOT if hasattr(errno, "EDQUOT") else errno.ENOSPC, errno.EFBIG}:
        reason = _("the disk is full; everything recorded before is saved")
    else:
        reason = (error.strerror or str(error)).lower()
    return RecordingError(str(path), reason)
