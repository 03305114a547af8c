"""Lock for the fixed ports of the original NEP, so that only one test run per computer uses them."""

from __future__ import annotations

import contextlib
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import pytest

_MAX_WAIT_S = 900.0
_held: list[IO[bytes]] = []
"""Open lock file, once per holder in this process; a second lock would wait for the first."""


@contextlib.contextmanager
def one_run_at_a_time() -> Iterator[None]:
    """Hold the lock during a block. Reentrant within one process."""
    stream = _held[0] if _held else (Path(tempfile.gettempdir()) / "nep-interop.lock").open("a+b")
    if not _held:
        _wait_for(stream)
    _held.append(stream)
    try:
        yield
    finally:
        _held.pop()
        if not _held:
            stream.close()


def _wait_for(stream: IO[bytes]) -> None:
    deadline = time.monotonic() + _MAX_WAIT_S
    while not _try_lock(stream.fileno()):
        if time.monotonic() > deadline:
            stream.close()
            pytest.fail("another run of the interop tests holds the fixed ports for 15 minutes")
        threading.Event().wait(0.2)


def _try_lock(handle: int) -> bool:
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
