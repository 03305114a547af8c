"""Where a recording is written to: one file, and what its disk must have."""

from __future__ import annotations

import errno
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from nep.errors import RecordingError
from nep.i18n import _
from nep.recordings.formats.mcap_file import FileWriter

__all__ = ["USUAL_LIMITS", "Destination", "OneFile", "WriterLimits", "disk_sentence"]


@dataclass(frozen=True)
class WriterLimits:
    """How much a writer holds, and how long.

    `queue_bytes`, `queue_messages`: what may wait to be written. `least_free_bytes`: with less of it free on
    the disk a recording ends, because other programs need some, too. `flush_s`: what came is in the file so
    long after at most. `figures_s`: how often it writes what became of the topics' messages.
    """

    queue_bytes: int = 256_000_000
    queue_messages: int = 200_000
    least_free_bytes: int = 200_000_000
    flush_s: float = 0.5
    figures_s: float = 1.0


USUAL_LIMITS = WriterLimits()


class Destination(Protocol):
    """Where a writer's thread writes to. All of it is called by that thread alone."""

    @property
    def file(self) -> FileWriter:
        """The file for what comes next."""

    def flushed(self) -> None:
        """A chunk was written. Raises `OSError`, `RecordingError`."""

    @property
    def is_full(self) -> bool:
        """Whether the recording is to go on in another file."""

    def next_file(self) -> None:
        """Finish the file, in which counts and metadata are, and begin the next. Raises as `finish` does."""

    def look(self) -> None:
        """Once a second: is there still room? Raises `RecordingError` with the sentence when not."""

    def finish(self) -> None:
        """Nothing more comes. Raises `OSError`."""

    def fail(self) -> None:
        """Close it as it is, after an error."""


class OneFile:
    """A recording's file."""

    def __init__(self, file: FileWriter, least_free_bytes: int) -> None:
        self.file = file
        self._least_free_bytes = least_free_bytes
        self._identity = _identity(file.path)

    is_full = False

    def flushed(self) -> None:
        """There is nothing to do."""

    def next_file(self) -> None:
        """There is none."""

    def look(self) -> None:
        """See `Destination`."""
        if _identity(self.file.path) != self._identity:
            raise RecordingError(
                str(self.file.path), _("somebody has moved or deleted it while it was written")
            )
        if shutil.disk_usage(self.file.path.parent).free < self._least_free_bytes:
            raise RecordingError(str(self.file.path), _("the disk is full; what came before is kept"))

    def finish(self) -> None:
        """See `Destination`."""
        self.file.finish()

    def fail(self) -> None:
        """See `Destination`."""
        self.file.close()


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def disk_sentence(path: Path, error: OSError) -> RecordingError:
    """What a disk's error means for a recording."""
    if error.errno in {errno.ENOSPC, errno.EDQUOT if hasattr(errno, "EDQUOT") else errno.ENOSPC, errno.EFBIG}:
        reason = _("the disk is full; what came before is kept")
    else:
        reason = (error.strerror or str(error)).lower()
    return RecordingError(str(path), reason)
