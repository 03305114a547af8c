"""Rendezvous: connects the sessions of one user on one computer without a fixed port.

Each session listens on a free loopback port and creates a file, named after the port, in a folder of
the user. Under a lock, a new session connects to all sessions that have a file and then creates its own
file. Any two sessions are therefore connected, regardless of the order in which they start and end.
"""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import psutil

from nep.errors import AddressInUseError, NepError
from nep.i18n import _
from nep.system.addresses import LOOPBACK, ORIGINAL_PORTS

_logger = logging.getLogger("nep")
_LOCK_TIMEOUT_S = 5.0
_LOCK_POLL_S = 0.002
_PORT_ATTEMPTS = 100
_SUSPENDED_STATUSES = frozenset({psutil.STATUS_STOPPED, psutil.STATUS_TRACING_STOP})


class SessionEntry(NamedTuple):
    """Port and process of a session, encoded in a file name.

    Attributes:
        port: Port of the session.
        pid: Id of its process.
        start_time: Start time of the process in hundredths of a second since the epoch, which detects a
            reused process id.
    """

    port: int
    pid: int
    start_time: int

    @property
    def name(self) -> str:
        """Name of the session's file."""
        return f"{self.port}-{self.pid}-{self.start_time}"


def free_port() -> int:
    """Return a free loopback port that the original NEP doesn't use.

    Raises `AddressInUseError` if no such port is found.
    """
    for _try in range(_PORT_ATTEMPTS):
        with socket.socket() as probe:
            probe.bind((LOOPBACK, 0))
            port = int(probe.getsockname()[1])
        if port not in ORIGINAL_PORTS:
            return port
    raise AddressInUseError(f"{LOOPBACK}:*")


class Rendezvous:
    """Folder of all sessions of a local network. Raises `NepError` if the folder can't be used.

    Args:
        name: Name of the local network.
    """

    def __init__(self, name: str) -> None:
        self._folder = _create_private_folder(_create_private_folder(_root_folder()) / name)

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """Hold the lock that is needed for opening a session.

        If another process hangs while it holds the lock, the context is entered without the lock after 5 s.
        """
        with (self._folder / "lock").open("ab") as file:
            is_held = _lock(file.fileno())
            if not is_held:
                _logger.warning(
                    "another process holds the session lock at %s and doesn't respond; continuing",
                    self._folder,
                )
            try:
                yield
            finally:
                if is_held:
                    _unlock(file.fileno())

    def entries(self) -> list[SessionEntry]:
        """Return the sessions of running processes; delete the files of processes that have ended.

        Suspended processes are skipped with a warning.
        """
        live_entries = []
        for path in self._folder.iterdir():
            entry = _parse_entry(path.name)
            if entry is None:
                continue
            status = _process_status(entry)
            if status is None:
                path.unlink(missing_ok=True)
            elif status in _SUSPENDED_STATUSES:
                _logger.warning(
                    "skipping process %d, which is suspended; nodes created now can't reach it", entry.pid
                )
            else:
                live_entries.append(entry)
        return live_entries

    def add(self, port: int) -> SessionEntry:
        """Create and return the entry of a session of this process, which listens on `port`."""
        entry = SessionEntry(port, os.getpid(), _start_time(os.getpid()))
        (self._folder / entry.name).touch(mode=0o600)
        return entry

    def remove(self, entry: SessionEntry) -> None:
        """Delete the file of a session."""
        with contextlib.suppress(OSError):
            (self._folder / entry.name).unlink(missing_ok=True)


def _root_folder() -> Path:
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    if runtime and Path(runtime).is_dir() and os.access(runtime, os.W_OK):
        return Path(runtime) / "nep-zenoh"
    user = f"-{os.getuid()}" if sys.platform != "win32" else ""
    return Path(tempfile.gettempdir()) / f"nep-zenoh{user}"


def _create_private_folder(folder: Path) -> Path:
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
    except OSError as error:
        raise NepError(
            _(
                "can't use '{folder}' to connect nodes: {error}; set XDG_RUNTIME_DIR to a folder that you own"
            ).format(folder=folder, error=error.strerror or error)
        ) from error
    is_ours = sys.platform == "win32" or status.st_uid == os.getuid()
    if not stat.S_ISDIR(status.st_mode) or not is_ours:
        raise NepError(
            _(
                "can't use '{folder}' to connect nodes: it is a link or belongs to another user; set "
                "XDG_RUNTIME_DIR to a folder that you own"
            ).format(folder=folder)
        )
    return folder


def _parse_entry(name: str) -> SessionEntry | None:
    parts = name.split("-")
    if len(parts) != len(SessionEntry._fields) or not all(
        each.isascii() and each.isdigit() for each in parts
    ):
        return None
    entry = SessionEntry(*map(int, parts))
    return entry if 0 < entry.port < 65536 and 0 < entry.pid < 2**31 else None


def _start_time(pid: int) -> int:
    return round(psutil.Process(pid).create_time() * 100)


def _process_status(entry: SessionEntry) -> str | None:
    # Returns None if the process has ended.
    try:
        process = psutil.Process(entry.pid)
        status = process.status()
        is_same_process = abs(round(process.create_time() * 100) - entry.start_time) <= 1
    except psutil.NoSuchProcess:
        return None
    except psutil.Error:
        return psutil.STATUS_RUNNING
    return status if is_same_process and status != psutil.STATUS_ZOMBIE else None


def _lock(descriptor: int) -> bool:
    # Returns False on timeout.
    pause, deadline = threading.Event(), time.monotonic() + _LOCK_TIMEOUT_S
    while not _try_lock(descriptor):
        if time.monotonic() > deadline:
            return False
        pause.wait(_LOCK_POLL_S)
    return True


if sys.platform == "win32":
    import msvcrt

    def _try_lock(descriptor: int) -> bool:
        try:
            os.lseek(descriptor, 0, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

    def _unlock(descriptor: int) -> None:
        os.lseek(descriptor, 0, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_UNLCK, 1)

else:
    import fcntl

    def _try_lock(descriptor: int) -> bool:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True

    def _unlock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_UN)
