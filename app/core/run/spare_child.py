"""Child process that is started before its program is known, so that Run doesn't wait for its imports."""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Callable
from pathlib import Path

from app.core.run.child_process import ChildProcess
from app.errors import RunnerError

EXIT_TIMEOUT_S = 2.0
_CODE_FOLDERS = ("app/blocks", "app/robots", "nep")
_Version = tuple[dict[str, str], int]


class SpareChild:
    """At most one child process that waits for its program. Thread-safe.

    A spare is discarded if it has ended, or if the environment or the Python files that it loaded have
    changed since it was started. Its input closes with Studio's process, which ends it.

    Args:
        create: Starts a child process; raises RunnerError if that fails.
        source: Folder that contains the packages, or None in a frozen build.
    """

    def __init__(self, create: Callable[[], ChildProcess], source: Path | None) -> None:
        self._create, self._source = create, source
        self._lock = threading.Lock()
        self._child: ChildProcess | None = None
        self._version: _Version | None = None
        self._is_closed = False

    @property
    def pid(self) -> int | None:
        """Process id of the spare, or None."""
        child = self._child
        return None if child is None else child.popen.pid

    def prepare(self) -> None:
        """Start a spare unless one waits already or `close` was called."""
        with self._lock:
            if self._is_closed or self._child is not None:
                return
            version = self._current_version()
            try:
                self._child, self._version = self._create(), version
            except RunnerError:
                return  # Run tries again, and reports the error

    def prepare_in_background(self) -> None:
        """Call `prepare` in another thread if there is no spare."""
        if self._child is None and not self._is_closed:
            threading.Thread(target=self.prepare, name="spare child", daemon=True).start()

    def take(self) -> ChildProcess | None:
        """Return the spare, which belongs to the caller from now on, or None if there is no usable one."""
        with self._lock:
            child, self._child = self._child, None
            if child is None:
                return None
            if not child.has_ended and self._version == self._current_version():
                return child
        _discard(child)
        return None

    def close(self) -> None:
        """Kill the spare and start no other."""
        with self._lock:
            self._is_closed = True
            child, self._child = self._child, None
        if child is not None:
            _discard(child)

    def _current_version(self) -> _Version:
        return dict(os.environ), 0 if self._source is None else _newest_change_ns(self._source)


def _newest_change_ns(source: Path) -> int:
    paths = itertools.chain.from_iterable((source / folder).rglob("*.py") for folder in _CODE_FOLDERS)
    return max(map(_changed_ns, paths), default=0)


def _changed_ns(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _discard(child: ChildProcess) -> None:
    child.kill()
    child.wait(EXIT_TIMEOUT_S)
    for stream in (child.popen.stdin, child.popen.stdout, child.popen.stderr):
        if stream is not None:
            stream.close()
