"""Information about the processes of original programs: start time, language, connections."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING, Protocol

from nep.system.cpu import CpuLoad
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")


class Processes(Protocol):
    """Interface to the processes of this computer; replaced in tests."""

    def started(self, pid: int) -> float | None:
        """Return the start time of a process (s since 1970), or None if it doesn't exist."""

    def language(self, pid: int) -> str | None:
        """Return the programming language of a process, derived from its interpreter, or None if unknown."""

    def is_joined(self, pid: int, port: int, *, binds: bool) -> bool | None:
        """Return True if the process has an established connection over `port`, None if access is denied.

        Args:
            pid: Process id.
            port: Number of the port.
            binds: True if the process itself binds the port.
        """


def load_of(pid: int) -> CpuLoad:
    """Return a meter of the CPU load of a process."""

    def used_s() -> float | None:
        try:
            times = psutil.Process(pid).cpu_times()
        except psutil.Error:
            return None
        return float(times.user + times.system)

    return CpuLoad(used_s)


_INTERPRETERS = {
    "python": "python",
    "pypy": "python",
    "node": "javascript",
    "electron": "javascript",
    "java": "java",
    "matlab": "matlab",
    "octave": "matlab",
    "mono": "csharp",
    "dotnet": "csharp",
    "unity": "csharp",
}


class SystemProcesses:
    """`Processes` of this computer."""

    def started(self, pid: int) -> float | None:
        """Return the start time of a process; None if the process is missing or a zombie."""
        try:
            process = psutil.Process(pid)
            if process.status() == psutil.STATUS_ZOMBIE:
                return None
            return process.create_time()
        except psutil.NoSuchProcess:
            return None
        except psutil.AccessDenied:
            return 0.0

    def language(self, pid: int) -> str | None:
        """Return the programming language of a process, or None if unknown."""
        try:
            name = PurePath(psutil.Process(pid).name()).stem.lower()
        except psutil.Error:
            return None
        return next((language for word, language in _INTERPRETERS.items() if name.startswith(word)), None)

    def is_joined(self, pid: int, port: int, *, binds: bool) -> bool | None:
        """Return True if the process has an established connection over `port`; None if unknown."""
        try:
            connections = psutil.Process(pid).net_connections(kind="tcp")
        except psutil.NoSuchProcess:
            return False
        except psutil.AccessDenied:
            return None
        for connection in connections:
            end = connection.laddr if binds else connection.raddr
            if getattr(end, "port", None) == port and connection.status == psutil.CONN_ESTABLISHED:
                return True
        return False
