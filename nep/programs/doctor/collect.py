"""Collection of the facts that the doctor evaluates: processes, ports, files, the graph, this Python."""

from __future__ import annotations

import os
import platform
import socket
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import zmq

import nep.errors
from nep.i18n import _, lazy
from nep.nodes.node import Node
from nep.programs.doctor import installs, namesakes, processes
from nep.programs.doctor.facts import (
    ClockFact,
    Facts,
    FileFact,
    FolderFact,
    PackageFact,
    PortFact,
    ProgramFact,
)
from nep.programs.doctor.finding import Finding
from nep.programs.doctor.listen import probe_endpoint
from nep.programs.doctor.network import loopback_findings, master_findings
from nep.programs.gateway.portmap import default_file
from nep.protocol.graph_view import GraphView
from nep.system import descriptors
from nep.system.addresses import host_of, is_loopback, master_address
from nep.system.lazy_import import lazy_module
from nep.version import __version__

if TYPE_CHECKING:
    from importlib import metadata

    import psutil
else:
    metadata, psutil = lazy_module("importlib.metadata"), lazy_module("psutil")


PORT_PURPOSES: Mapping[int, str] = {
    7000: lazy("which programs of nep up to 0.5.4.5, nep-js and C# connect to"),
    50000: lazy("which programs of nep 0.5.4.8 connect to"),
    7777: lazy("from which tools of the original NEP read the topics"),
    12345: lazy("which shuts down programs of the original NEP"),
}
_GRAPH_TIMEOUT_S = 1.0
_MAX_CLOCK_AHEAD_S = 0.5
_MIN_FREE_BYTES = 10_000_000
_ORIGINAL_FILES = ("helpers.py", "master.py", "publisher.py", "subscriber.py")
_GATEWAY_OFF_VALUES = {"0", "false", "no", "off"}


def collect_facts(
    address: str | None = None,
    *,
    folders: Sequence[tuple[str, Path]] = (),
    working_folder: Path | None = None,
) -> Facts:
    """Collect all facts. Takes up to two seconds if no master replies.

    Args:
        address: Address of the master (default: NEP_MASTER or the default address).
        folders: Further folders that must be writable, as (purpose, path).
        working_folder: Folder in which programs are started (default: the current folder).
    """
    *_parts, (_known, facts) = collect_in_steps(address, folders=folders, working_folder=working_folder)
    return facts


def collect_in_steps(
    address: str | None = None,
    *,
    folders: Sequence[tuple[str, Path]] = (),
    working_folder: Path | None = None,
) -> Iterator[tuple[tuple[str, ...], Facts]]:
    """Collect facts step by step, quick steps first.

    The arguments are those of `collect_facts`.

    Yields:
        Names of the checks in `nep.programs.doctor.diagnosis.CHECKS` whose facts are complete, and all facts
        so far.
    """
    resolved_address, package = master_address(address), Path(nep.errors.__file__).parent
    facts = Facts(time.time(), resolved_address, sys.platform, _versions(), str(package))
    yield ("clock", "versions"), facts
    facts = replace(facts, loopback_problem=loopback_problem())
    yield ("loopback",), facts
    port_folder = (_("The ports assigned to programs of the original NEP"), default_file(0).parent)
    facts = replace(
        facts, folders=tuple(_folder_fact(purpose, path) for purpose, path in (port_folder, *folders))
    )
    yield ("folders",), facts
    facts = replace(
        facts,
        packages=tuple(_packages()),
        original_files=tuple(name for name in _ORIGINAL_FILES if (package / name).exists()),
        shadowing_file=_shadowing_file(working_folder or Path.cwd(), package),
        path_package=namesakes.path_python_package(),
        node_packages=namesakes.node_packages(working_folder or Path.cwd()),
    )
    yield ("packages",), facts
    facts, master_pid, pid_by_port = _collect_master(facts)
    yield ("masters", "alerts", "clocks"), facts
    is_gateway_enabled = os.environ.get("NEP_GATEWAY", "1").lower() not in _GATEWAY_OFF_VALUES
    ports = tuple(
        _port_fact(port, purpose, pid_by_port, master_pid) for port, purpose in PORT_PURPOSES.items()
    )
    facts = replace(facts, ports=ports, is_gateway_enabled=is_gateway_enabled)
    yield ("ports", "originals"), facts
    holder = facts.master_port.holder if facts.master_port is not None else None
    facts = replace(
        facts, files=_file_fact(holder.pid if holder is not None and holder.is_master else master_pid)
    )
    yield ("files",), facts
    yield ("programs",), replace(facts, programs=tuple(_programs(facts.view)))


def _collect_master(facts: Facts) -> tuple[Facts, int | None, Mapping[int, int | None]]:
    address = facts.address
    port = int(address.rpartition(":")[2])
    view, reply_time_s, is_host_known = _query_graph(address)
    pid_by_port = processes.listening_ports()
    master_port = _port_fact(port, "the master's", pid_by_port) if _is_own_address(address) else None
    holder = master_port.holder if master_port is not None else None
    master_pid = holder.pid if view is not None and holder is not None else None
    is_port_taken = view is None and master_port is not None and master_port.is_taken
    is_remote = view is None and is_host_known and master_port is None
    updated = replace(
        facts,
        view=view,
        reply_time_s=reply_time_s,
        master_port=master_port,
        masters=processes.master_processes(pid_by_port, port),
        clocks=tuple(_clocks(view)),
        master_install=installs.install_of(master_pid) if master_pid is not None else None,
        is_host_known=is_host_known,
        replying_address=_replying_address(address) if is_port_taken else "",
        reach_failure=probe_endpoint(f"tcp://{address}") if is_remote else None,
    )
    return updated, master_pid, pid_by_port


def _replying_address(address: str) -> str:
    local_address = f"127.0.0.1:{address.rpartition(':')[2]}"
    return local_address if not is_loopback(address) and _query_graph(local_address)[0] is not None else ""


def start_blocker(address: str | None = None) -> Finding | None:
    """Return the finding about what prevents a master from starting, or None if nothing does.

    An address that is not loopback is an obstacle, because masters are started at loopback addresses
    only.
    """
    resolved_address = master_address(address)
    facts = Facts(time.time(), resolved_address, sys.platform, {}, "", loopback_problem=loopback_problem())
    if is_loopback(resolved_address):
        port = _port_fact(int(resolved_address.rpartition(":")[2]), "", processes.listening_ports())
        facts = replace(facts, master_port=port)
    else:
        facts, *_more = _collect_master(facts)
    for finding in (*loopback_findings(facts), *master_findings(facts)):
        if finding.severity == "error" and finding.id != "master:none":
            return finding
    return None


def _query_graph(address: str) -> tuple[GraphView | None, float | None, bool]:
    start_s = time.monotonic()
    try:
        with Node(f"nep-doctor-{os.getpid()}", master=address) as node:
            return node.graph(_GRAPH_TIMEOUT_S), time.monotonic() - start_s, True
    except nep.errors.MasterUnreachable as error:
        return None, None, error.is_known
    except (nep.errors.NepError, zmq.ZMQError, OSError):
        return None, None, True


def _is_own_address(address: str) -> bool:
    host = host_of(address)
    if host in {"localhost", "*", "0.0.0.0", "[::1]"} or host.startswith("127."):  # noqa: S104 - no binding
        return True
    own_addresses = {each.address for addresses in psutil.net_if_addrs().values() for each in addresses}
    return host in own_addresses


def _port_fact(
    port: int, purpose: str, pid_by_port: Mapping[int, int | None], master_pid: int | None = None
) -> PortFact:
    if port in pid_by_port:
        return PortFact(port, purpose, True, processes.process_fact(pid_by_port[port], master_pid))
    return PortFact(port, purpose, not processes.is_free(port))


def loopback_problem() -> str:
    """Return the reason why this program can't connect to itself over 127.0.0.1, or "" if it can."""
    try:
        with socket.socket() as server:
            server.bind(("127.0.0.1", 0))
            server.listen(1)
            with socket.create_connection(server.getsockname(), timeout=1.0) as client:
                client.sendall(b"?")
        return ""
    except OSError as error:
        return (error.strerror or str(error)).lower()


def _versions() -> dict[str, str]:
    return {
        "NEP Studio": __version__,
        "Python": platform.python_version(),
        "pyzmq": zmq.pyzmq_version(),
        "libzmq": zmq.zmq_version(),
        platform.system(): platform.release(),
    }


def _packages() -> Iterator[PackageFact]:
    for distribution in metadata.distributions():
        name = distribution.metadata["Name"] or ""
        if name.lower().replace("_", "-") in {"nep", "nep-studio"}:
            yield PackageFact(name, distribution.version, str(distribution.locate_file("")))


def _shadowing_file(folder: Path, package: Path) -> str:
    for candidate in (folder / "nep.py", folder / "nep" / "__init__.py"):
        if candidate.exists() and candidate.resolve().parent != package.resolve():
            return str(candidate)
    return ""


def _file_fact(master_pid: int | None) -> FileFact:
    open_count = limit = None
    if master_pid is not None:
        open_count, limit = processes.open_files(master_pid)
    if sys.platform == "win32":
        return FileFact(None, None, open_count, limit)
    import resource  # noqa: PLC0415 - not on Windows

    soft, hard = (
        None if each == resource.RLIM_INFINITY else each
        for each in resource.getrlimit(resource.RLIMIT_NOFILE)
    )
    return FileFact(soft, hard, open_count, limit)


def _programs(view: GraphView | None) -> Iterator[ProgramFact]:
    name_by_pid = {
        node.pid: node.name
        for node in (view.nodes.values() if view is not None else ())
        if node.generation == "native" and node.host == platform.node() and node.pid != os.getpid()
    }
    for pid, name in name_by_pid.items():
        if pid is None:
            continue
        open_count, limit = processes.open_files(pid)
        limit = limit or descriptors.descriptor_limit()  # macOS reports only the limit of this process
        if open_count is not None and limit is not None:
            yield ProgramFact(pid, name, open_count, limit)


def _folder_fact(purpose: str, path: Path) -> FolderFact:
    existing_folder = path
    while not existing_folder.exists() and existing_folder != existing_folder.parent:
        existing_folder = existing_folder.parent
    try:
        with tempfile.TemporaryFile(dir=existing_folder):
            pass
        free_bytes = psutil.disk_usage(str(existing_folder)).free
    except OSError as error:
        return FolderFact(str(path), purpose, (error.strerror or str(error)).lower())
    problem = _("the disk is full") if free_bytes < _MIN_FREE_BYTES else ""
    return FolderFact(str(path), purpose, problem)


def _clocks(view: GraphView | None) -> Iterator[ClockFact]:
    now_s = time.time()
    ahead_s_by_host: dict[str, float] = {}
    for topic in view.topics.values() if view is not None else ():
        for publisher in topic.publishers:
            node = view.nodes.get(publisher.node_id) if view is not None else None
            if node is not None and publisher.last_stamp_ns is not None:
                ahead_s_by_host[node.host] = max(
                    ahead_s_by_host.get(node.host, 0.0), publisher.last_stamp_ns / 1e9 - now_s
                )
    for host, seconds in ahead_s_by_host.items():
        if seconds > _MAX_CLOCK_AHEAD_S:
            yield ClockFact(host, seconds)
