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
    import ctypes
    import msvcrt
    from ctypes import wintypes

    # Not msvcrt.locking: Microsoft's C library lets the thread sleep for a second before it says that
    # another process has the lock, also when it is told not to wait.
    _kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    _FIRST_BYTE = (0, 0, 1, 0)  # offset and length, each as two halves
    for _call in (_kernel.LockFile, _kernel.UnlockFile):
        _call.argtypes = [wintypes.HANDLE, *[wintypes.DWORD] * 4]
        _call.restype = wintypes.BOOL

    def _lock(file: IO[bytes]) -> None:
        if not _kernel.LockFile(msvcrt.get_osfhandle(file.fileno()), *_FIRST_BYTE):
            raise ctypes.WinError(ctypes.get_last_error())

    def _unlock(file: IO[bytes]) -> None:
        # A file that is only closed Windows unlocks when it has the time for it.
        _kernel.UnlockFile(msvcrt.get_osfhandle(file.fileno()), *_FIRST_BYTE)
else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _unlock(file: IO[bytes]) -> None:
        pass  # closing does it; a child that has the file, too, keeps the lock as before


HELD = frozenset({errno.EACCES, errno.EAGAIN, errno.EWOULDBLOCK, errno.EDEADLK})
"""What systems say of a lock that another process has; all else is a disk that has no locks."""


def _wait_for(file: IO[bytes], until: float) -> bool:
    """Take the lock of a file, at the latest at that time; whether it is ours. A disk has none: at once."""
    pause = threading.Event()
    while True:
        try:
            _lock(file)
        except OSError as error:
            if error.errno not in HELD or time.monotonic() >= until:
                return False
        else:
            return True
        pause.wait(LOOK_S)


def _opened(path: Path) -> IO[bytes]:
    """The file beside ``path`` that is locked. Raises OSError."""
    # Only for its owner; a pipe that somebody put there is not waited for.
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_NONBLOCK", 0)
    return os.fdopen(os.open(path.with_name(f"{path.name}.lock"), flags, 0o600), "ab")


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
            file = _opened(self._path)
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
            _unlock(self._file)
            self._file.close()
            self._file = None


@contextmanager
def locked(path: Path, within_s: float = 1.0) -> Iterator[bool]:
    """Hold the lock of ``path`` (the file ``<name>.lock`` beside it); whether it could be had in time.

    Where there is none to be had (a network disk, a folder that can't be written) the work goes on without,
    and at once. The lock of a process that dies is free at once.
    """
    until = time.monotonic() + within_s
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = _opened(path)
    except OSError:
        yield False
        return
    with file:
        held = _wait_for(file, until)
        try:
            yield held
        finally:
            if held:
                _unlock(file)
