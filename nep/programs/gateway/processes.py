"""Information about the processes of original programs: start times, languages and connections."""

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
    """Interface to the processes of this computer, which tests replace."""

    def start_time_s(self, pid: int) -> float | None:
        """Return the start time of a process (s since 1970).

        Returns None if the process doesn't exist, and 0 if access is denied.
        """

    def language(self, pid: int) -> str | None:
        """Return the programming language of a process according to its interpreter, or None if unknown."""

    def is_connected(self, pid: int, port: int, *, is_bound_by_process: bool) -> bool | None:
        """Return True if a process has an established connection over a port, None if access is denied.

        Args:
            pid: Process id. If there is no such process, the result is False.
            port: Port number.
            is_bound_by_process: True if the process itself binds the port.
        """


def cpu_load_of(pid: int) -> CpuLoad:
    """Return a CPU load meter for a process."""

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
    """Implementation of `Processes` with psutil."""

    def start_time_s(self, pid: int) -> float | None:
        """Return the start time of a process (s since 1970).

        Returns None if the process doesn't exist or is a zombie, and 0 if access is denied.
        """
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
        return next((language for prefix, language in _INTERPRETERS.items() if name.startswith(prefix)), None)

    def is_connected(self, pid: int, port: int, *, is_bound_by_process: bool) -> bool | None:
        """Return True if a process has an established connection over a port, None if access is denied.

        Args:
            pid: Process id. If there is no such process, the result is False.
            port: Port number.
            is_bound_by_process: True if the process itself binds the port.
        """
        try:
            connections = psutil.Process(pid).net_connections(kind="tcp")
        except psutil.NoSuchProcess:
            return False
        except psutil.AccessDenied:
            return None
        for connection in connections:
            end = connection.laddr if is_bound_by_process else connection.raddr
            if getattr(end, "port", None) == port and connection.status == psutil.CONN_ESTABLISHED:
                return True
        return False
