"""What the system knows of the original programs: alive or gone, which language, who is connected."""

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
    """What the gateway asks about processes of this computer; tests bring their own."""

    def started(self, pid: int) -> float | None:
        """When the process began (seconds since 1970), `None` if there is none."""

    def language(self, pid: int) -> str | None:
        """The language that the program is written in, as far as its interpreter tells."""

    def is_joined(self, pid: int, port: int, *, binds: bool) -> bool | None:
        """Whether the process holds a connection over `port`, bound by itself (`binds`) or by another.

        `None`: the system does not let us know.
        """


def load_of(pid: int) -> CpuLoad:
    """How much of a core a process of this computer uses, as far as the system tells."""

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
    """The processes of this computer."""

    def started(self, pid: int) -> float | None:
        """See `Processes`."""
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
        """See `Processes`."""
        try:
            name = PurePath(psutil.Process(pid).name()).stem.lower()
        except psutil.Error:
            return None
        return next((language for word, language in _INTERPRETERS.items() if name.startswith(word)), None)

    def is_joined(self, pid: int, port: int, *, binds: bool) -> bool | None:
        """See `Processes`."""
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
