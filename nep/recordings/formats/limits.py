"""Limits on what reading a recording may cost, whoever wrote it.

A file that comes from anywhere may state any size and any number of records. Memory is bounded for each chunk
(`max_chunk_bytes`), work for each file (`ReadBudget`): both grow with the size of the file itself, never with
what the file says of itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from nep.errors import RecordingTooLargeError
from nep.i18n import _

__all__ = ["MAX_PLAIN_CHUNK_BYTES", "RECORD_COST_BYTES", "ReadBudget", "max_chunk_bytes", "open_budget"]

MAX_PLAIN_CHUNK_BYTES = 64 * 2**20
"""Any chunk may have this size when it is decompressed."""
_MAX_RATIO = 2
_MAX_CHUNK_BYTES = 2**30
RECORD_COST_BYTES = 200
"""Parsing one record takes as long as decompressing about so many bytes (1 us, Python 3.11)."""
_OPEN_BYTES = 400_000_000
_OPEN_RATIO = 64


def max_chunk_bytes(compressed_bytes: int) -> int:
    """Return the largest decompressed size that is accepted of a chunk with so many bytes in the file.

    64 MiB, or twice its size in the file: a single message of 200 MB is still read, a kilobyte that
    expands to gigabytes is not.
    """
    return min(_MAX_CHUNK_BYTES, max(MAX_PLAIN_CHUNK_BYTES, _MAX_RATIO * compressed_bytes))


class ReadBudget:
    """Bounds the work of reading one file, in bytes and optionally in seconds. Not thread-safe."""

    def __init__(
        self,
        path: Path,
        work_bytes: int,
        seconds: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self._left = path, work_bytes
        self._clock = clock
        self._until = None if seconds is None else clock() + seconds

    def spend(self, work_bytes: int) -> None:
        """Count work. Raises `RecordingTooLargeError` when more was done than is allowed."""
        self._left -= work_bytes
        if self._left < 0:
            raise RecordingTooLargeError(str(self._path), _("it holds more than can be read at once"))
        if self._until is not None and self._clock() > self._until:
            raise RecordingTooLargeError(str(self._path), _("reading it takes too long"))


def open_budget(path: Path, size_bytes: int) -> ReadBudget:
    """Return what opening a file may cost: generous for what people record, and linear in its size."""
    return ReadBudget(path, _OPEN_BYTES + _OPEN_RATIO * size_bytes)
