"""Lock file that several instances on one computer share."""

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

POLL_INTERVAL_S = 0.01

if sys.platform == "win32":
    import ctypes
    import msvcrt
    from ctypes import wintypes

    # Not msvcrt.locking: Microsoft's C library sleeps for a second before it reports a held lock, even in
    # non-blocking mode.
    _kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    _FIRST_BYTE = (0, 0, 1, 0)  # offset and length, each as two halves
    for _call in (_kernel.LockFile, _kernel.UnlockFile):
        _call.argtypes = [wintypes.HANDLE, *[wintypes.DWORD] * 4]
        _call.restype = wintypes.BOOL

    def _lock(file: IO[bytes]) -> None:
        if not _kernel.LockFile(msvcrt.get_osfhandle(file.fileno()), *_FIRST_BYTE):
            raise ctypes.WinError(ctypes.get_last_error())

    def _unlock(file: IO[bytes]) -> None:
        # Windows unlocks a closed file only eventually.
        _kernel.UnlockFile(msvcrt.get_osfhandle(file.fileno()), *_FIRST_BYTE)
else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _unlock(file: IO[bytes]) -> None:
        pass  # closing unlocks it; a child that inherited the file keeps the lock


HELD_ERRNOS = frozenset({errno.EACCES, errno.EAGAIN, errno.EWOULDBLOCK, errno.EDEADLK})
"""Error numbers that mean that another process holds the lock.

Other error numbers mean that the file system doesn't support locks.
"""


def _acquire(file: IO[bytes], deadline_s: float) -> bool:
    # Returns whether the lock was acquired. Without lock support False at once.
    pause = threading.Event()
    while True:
        try:
            _lock(file)
        except OSError as error:
            if error.errno not in HELD_ERRNOS or time.monotonic() >= deadline_s:
                return False
        else:
            return True
        pause.wait(POLL_INTERVAL_S)


def _open_lock_file(path: Path) -> IO[bytes]:
    # The lock file of `path`. Raises OSError.
    # Private; never blocks on a pipe of that name.
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_NONBLOCK", 0)
    return os.fdopen(os.open(path.with_name(f"{path.name}.lock"), flags, 0o600), "ab")


class FileLock:
    """Lock on a file, held until it is released or this process exits."""

    def __init__(self, path: Path) -> None:
        # The lock file is `<name>.lock` next to `path`.
        self._path = path
        self._file: IO[bytes] | None = None

    def acquire(self) -> bool:
        """Try to acquire the lock; return False if another process holds it.

        Returns True if the file system doesn't support locks.
        """
        if self._file is not None:
            return True
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            file = _open_lock_file(self._path)
        except OSError:
            return True
        try:
            _lock(file)
        except OSError as error:
            file.close()
            return error.errno not in HELD_ERRNOS
        self._file = file
        return True

    def release(self) -> None:
        """Release the lock. Idempotent."""
        if self._file is not None:
            _unlock(self._file)
            self._file.close()
            self._file = None


@contextmanager
def locked(path: Path, within_s: float = 1.0) -> Iterator[bool]:
    """Return a context manager that holds the lock file ``<name>.lock`` of a file.

    The value of the context manager is True if the lock was acquired. Otherwise the body runs without a
    lock: after the timeout, or because locks aren't possible (a network disk, a read-only folder). A
    lock is released immediately if its process crashes.

    Args:
        path: File to lock.
        within_s: Maximum time to wait for another process, in seconds.
    """
    deadline_s = time.monotonic() + within_s
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = _open_lock_file(path)
    except OSError:
        yield False
        return
    with file:
        is_locked = _acquire(file, deadline_s)
        try:
            yield is_locked
        finally:
            if is_locked:
                _unlock(file)
