"""A lock that several Studios on one computer share: a file beside what is written."""

from __future__ import annotations

import errno
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

LOOK_S = 0.01

if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes]) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


HELD = frozenset({errno.EACCES, errno.EAGAIN, errno.EWOULDBLOCK, errno.EDEADLK})
"""What systems say of a lock that another process has; all else is a disk that has no locks."""


def _try(file: IO[bytes]) -> bool:
    try:
        _lock(file)
    except OSError:
        return False
    return True


def _opened(path: Path) -> int:
    # Only for its owner; a pipe that somebody put there is not waited for.
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_NONBLOCK", 0), 0o600)


class FileLock:
    """A lock that is kept until it is left, or until this process ends."""

    def __init__(self, path: Path) -> None:
        """It is the file ``<name>.lock`` beside ``path``."""
        self._path = path
        self._file: IO[bytes] | None = None

    def acquire(self) -> bool:
        """Whether nobody else has it; then it is ours. Also where there is no lock to be had."""
        if self._file is not None:
            return True
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            file = os.fdopen(_opened(self._path.with_name(f"{self._path.name}.lock")), "ab")
        except OSError:
            return True
        try:
            _lock(file)
        except OSError as error:
            file.close()
            return error.errno not in HELD
        self._file = file
        return True

    def release(self) -> None:
        """Let others have it; said twice it does nothing."""
        if self._file is not None:
            self._file.close()
            self._file = None


@contextmanager
def locked(path: Path, within_s: float = 1.0) -> Iterator[bool]:
    """Hold the lock of ``path`` (the file ``<name>.lock`` beside it); whether it could be had in time.

    Where there is none to be had (a network disk, a folder that can't be written) the work goes on without.
    The lock of a process that dies is free at once.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.fdopen(_opened(path.with_name(f"{path.name}.lock")), "ab")
    except OSError:
        yield False
        return
    with file:
        end, pause = time.monotonic() + within_s, threading.Event()
        held = _try(file)
        while not held and time.monotonic() < end:
            pause.wait(LOOK_S)
            held = _try(file)
        yield held
