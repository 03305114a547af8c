"""Opening of recordings in a separate process, so that a damaged file can't crash Studio.

Tests and programs without a window can read recordings in their own process (`LocalOpener`).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from app.core.reports.own_process import module_command
from nep.recordings.apart.remote import ReaderProcess
from nep.recordings.file_reader import CACHE_BYTES, FileReader
from nep.recordings.formats.limits import ReadBudget
from nep.recordings.reader import Recording


class RecordingOpener(Protocol):
    """Interface for opening recordings (see `nep.recordings.apart.remote.ReaderProcess`)."""

    def open(
        self,
        path: Path,
        *,
        cache_bytes: int = CACHE_BYTES,
        progress: Callable[[int, int], object] | None = None,
        budget: tuple[int, float | None] | None = None,
    ) -> Recording:
        """Open a recording.

        Args:
            path: File of the recording.
            cache_bytes: Size of the cache for decompressed chunks.
            progress: Called with the number of scanned bytes and the total size.
            budget: Maximum number of bytes, and of seconds (None for no limit), for scanning a file
                without an index; None for no limit at all.

        Raises:
            RecordingError: The file can't be read. `RecordingTooLargeError` if `budget` is exceeded.
        """

    def close(self) -> None:
        """Stop immediately, even if a recording is being read. Idempotent."""


def process_opener() -> RecordingOpener:
    """Return an opener that reads recordings in a child process, started with the first recording."""
    return ReaderProcess(module_command("nep.recordings.apart.reader_process"))


class LocalOpener:
    """Opener that reads recordings in this process."""

    def open(
        self,
        path: Path,
        *,
        cache_bytes: int = CACHE_BYTES,
        progress: Callable[[int, int], object] | None = None,
        budget: tuple[int, float | None] | None = None,
    ) -> Recording:
        """Open a recording in this process. See `RecordingOpener.open`."""
        limit = None if budget is None else ReadBudget(path, *budget)
        return Recording(
            path, file=FileReader(path, cache_bytes=cache_bytes, progress=progress, budget=limit)
        )

    def close(self) -> None:
        """Do nothing. A local opener has no process to stop."""
