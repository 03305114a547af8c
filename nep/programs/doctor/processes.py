"""Information about processes that are bound to ports of this computer or run a master."""

from __future__ import annotations

import itertools
import socket
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING

from nep.programs.doctor.facts import ProcessFact
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")


_LOOPBACK_ADDRESSES = frozenset({"127.0.0.1", "0.0.0.0", "::", "::ffff:127.0.0.1"})  # noqa: S104  nothing is bound
_CODE_OPTIONS = frozenset({"-c", "-e", "--eval", "-p", "--print"})
"""Options of Python and Node.js that are followed by source code instead of a file name."""
_MAX_PORT_DISTANCE = 20
"""Maximum difference between a master's port and the usual port, if the process listens at several ports."""


def listening_ports() -> dict[int, int | None]:
    """Return the process ids by listening TCP port; None where the system doesn't report the process."""
    try:
        connections: Iterable[object] = psutil.net_connections(kind="tcp")
    except psutil.AccessDenied:  # on macOS, only root may query all connections
        connections = _own_connections()
    return port_holders(connections)


def port_holders(connections: Iterable[object]) -> dict[int, int | None]:
    """Return the process ids by listening port; None where the system doesn't report the process.

    If several processes listen at one port with different addresses, the process at 127.0.0.1 is returned.

    Args:
        connections: Entries of `psutil.net_connections()`.
    """
    loopback_pids: dict[int, int | None] = {}
    other_pids: dict[int, int | None] = {}
    for connection in connections:
        if getattr(connection, "status", "") != psutil.CONN_LISTEN:
            continue
        local = getattr(connection, "laddr", None)
        port = getattr(local, "port", None)
        if isinstance(port, int):
            pid_by_port = loopback_pids if getattr(local, "ip", "") in _LOOPBACK_ADDRESSES else other_pids
            pid_by_port[port] = getattr(connection, "pid", None) or pid_by_port.get(port)
    return other_pids | loopback_pids


def _own_connections() -> Iterable[object]:
    for process in psutil.process_iter():
        try:
            for connection in process.net_connections(kind="tcp"):
                yield _OwnedConnection(connection, process.pid)
        except psutil.Error:
            continue


class _OwnedConnection:
    """Connection of one process with its `pid`, like the entries of `psutil.net_connections()`."""

    def __init__(self, connection: object, pid: int) -> None:
        self.status = getattr(connection, "status", "")
        self.laddr = getattr(connection, "laddr", None)
        self.pid = pid


def is_free(port: int) -> bool:
    """Return True if a port of 127.0.0.1 can be bound, by binding it for a moment."""
    with socket.socket() as probe:
        if sys.platform != "win32":  # without it, connections in TIME_WAIT block the port for a while
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def process_fact(pid: int | None, master_pid: int | None = None) -> ProcessFact | None:
    """Return the facts about a process, or None if the process is unknown or has exited.

    Args:
        pid: Process id, or None.
        master_pid: Id of the process that is known to run a master, or None.
    """
    if pid is None:
        return None
    try:
        process = psutil.Process(pid)
        with process.oneshot():
            command = _command_line(process)
            is_master = pid == master_pid or is_master_command(command)
            return ProcessFact(pid, _program_name(process.name(), command), is_master, process.create_time())
    except psutil.Error:
        return None


def master_processes(
    ports: Mapping[int, int | None], usual_port: int
) -> tuple[tuple[ProcessFact, int | None], ...]:
    """Return the processes that run a master, each with its port (None if ambiguous).

    Args:
        ports: Process ids by listening port.
        usual_port: Usual port of a master; the process at this port comes first.
    """
    ports_by_pid: dict[int, list[int]] = {}
    for port, pid in ports.items():
        if pid is not None:
            ports_by_pid.setdefault(pid, []).append(port)
    masters = []
    for pid, own_ports in ports_by_pid.items():
        process = process_fact(pid)
        if process is not None and process.is_master:
            masters.append((process, _master_port(own_ports, usual_port)))
    return tuple(sorted(masters, key=lambda each: (each[1] != usual_port, each[1] or 0)))


def _master_port(ports: Sequence[int], usual_port: int) -> int | None:
    nearest = sorted(ports, key=lambda port: abs(port - usual_port))
    return (
        nearest[0]
        if nearest and (abs(nearest[0] - usual_port) <= _MAX_PORT_DISTANCE or len(nearest) == 1)
        else None
    )


def is_master_command(command: Sequence[str]) -> bool:
    """Return True if a command line runs a master, such as `nep master` or `python -m nep master`."""
    for argument, following in itertools.pairwise(command):
        if following == "master" and PurePath(argument).stem in {"nep", "__main__"}:
            return True
    return False


def open_files(pid: int) -> tuple[int | None, int | None]:
    """Return the number of a process's open files, and its limit; None where unknown."""
    try:
        process = psutil.Process(pid)
        open_count = process.num_fds() if hasattr(process, "num_fds") else None
        rlimit = getattr(process, "rlimit", None)
        limit = rlimit(psutil.RLIMIT_NOFILE)[0] if rlimit is not None else None
    except psutil.Error:
        return None, None
    return open_count, limit if limit is not None and limit > 0 else None


def _command_line(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.Error:
        return []


def _program_name(name: str, command: Sequence[str]) -> str:
    if PurePath(name).stem.lower().startswith(("python", "node", "java")):
        for argument in command[1:]:
            if argument in _CODE_OPTIONS:
                break
            if not argument.startswith("-"):
                return f"{name} {PurePath(argument).name}"
    return name
