"""Limits on the cost of reading a recording, which may be untrusted.

A file may declare any sizes and counts. Memory is limited per chunk (`max_chunk_bytes`) and work per file
(`ReadBudget`). Both limits depend on the actual size of the file, not on its declarations.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from nep.errors import RecordingTooLargeError
from nep.i18n import _

MAX_PLAIN_CHUNK_BYTES = 64 * 2**20
"""Decompressed size in bytes up to which a chunk is always accepted."""
_MAX_COMPRESSION_RATIO = 2
_MAX_CHUNK_BYTES = 2**30
RECORD_COST_BYTES = 200
"""Cost of parsing a record, in bytes that can be decompressed in the same time (1 µs, Python 3.11)."""
_OPEN_BUDGET_BYTES = 400_000_000
_OPEN_BUDGET_RATIO = 64


def max_chunk_bytes(compressed_bytes: int) -> int:
    """Return the maximum decompressed size of a chunk, in bytes.

    The maximum is 64 MiB or twice the compressed size, whichever is larger, and never above 1 GiB: a
    single message of 200 MB is accepted, a kilobyte that expands to gigabytes is not.

    Args:
        compressed_bytes: Size of the chunk in the file.
    """
    return min(_MAX_CHUNK_BYTES, max(MAX_PLAIN_CHUNK_BYTES, _MAX_COMPRESSION_RATIO * compressed_bytes))


class ReadBudget:
    """Limit of the work for reading one file. Not thread-safe.

    Args:
        path: Path of the file, for error messages.
        work_bytes: Maximum number of bytes to process.
        seconds: Maximum time in seconds; None for no limit.
        clock: Monotonic clock in seconds.
    """

    def __init__(
        self,
        path: Path,
        work_bytes: int,
        seconds: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self._remaining_bytes = path, work_bytes
        self._clock = clock
        self._deadline = None if seconds is None else clock() + seconds

    def spend(self, work_bytes: int) -> None:
        """Subtract work from the budget. Raises `RecordingTooLargeError` if the budget is exceeded."""
        self._remaining_bytes -= work_bytes
        if self._remaining_bytes < 0:
            raise RecordingTooLargeError(str(self._path), _("the file is too large to read"))
        if self._deadline is not None and self._clock() > self._deadline:
            raise RecordingTooLargeError(str(self._path), _("reading the file takes too long"))


def open_budget(path: Path, size_bytes: int) -> ReadBudget:
    """Return the budget for opening a file, which is proportional to the file's size.

    Args:
        path: Path of the file, for error messages.
        size_bytes: Size of the file.
    """
    return ReadBudget(path, _OPEN_BUDGET_BYTES + _OPEN_BUDGET_RATIO * size_bytes)
