"""Facts about this computer that the doctor judges, as frozen dataclasses. None means unknown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from nep.programs.doctor.installs import Install
from nep.protocol.graph_view import Alert, GraphView

__all__ = [
    "ClockFact",
    "Facts",
    "FileFact",
    "FolderFact",
    "PackageFact",
    "PortFact",
    "ProcessFact",
    "ProgramFact",
    "PublisherFact",
    "Reach",
    "TopicFacts",
]

Reach = Literal["", "elsewhere", "refused", "timeout", "unknown"]
"""Why an address can't be reached; "" if it can, or was not tried.

"elsewhere": reachable only on its own computer. "refused": the port is closed. "timeout": no reply.
"unknown": another error of the system.
"""


@dataclass(frozen=True)
class ProcessFact:
    """Process: its id, its program's name, and its start time (s since 1970)."""

    pid: int | None
    name: str
    is_master: bool = False
    since_s: float | None = None


@dataclass(frozen=True)
class PortFact:
    """Port of this computer, its purpose, whether it is taken, and its holder.

    `holder` is None if the port is free or the system doesn't report the process.
    """

    port: int
    purpose: str
    is_taken: bool
    holder: ProcessFact | None = None


@dataclass(frozen=True)
class PackageFact:
    """Installed package; `is_ours` is False for a package of another project with the same name."""

    name: str
    version: str
    place: str
    is_ours: bool = True


@dataclass(frozen=True)
class FileFact:
    """Open-file limits of this process (None: unlimited), and the master's number of open files and limit."""

    soft: int | None
    hard: int | None
    master_open: int | None = None
    master_limit: int | None = None


@dataclass(frozen=True)
class ProgramFact:
    """Process of this computer with a node `name`: its number of open files and its limit."""

    pid: int
    name: str
    opened: int
    limit: int


@dataclass(frozen=True)
class FolderFact:
    """Folder that must be writable, its purpose, and why it is not ("" if it is)."""

    path: str
    purpose: str
    problem: str = ""


@dataclass(frozen=True)
class ClockFact:
    """Computer whose messages are stamped `ahead_s` seconds in the future."""

    host: str
    ahead_s: float


@dataclass(frozen=True)
class Facts:
    """Everything that the doctor inspects.

    Attributes:
        now_s: Current time (s since 1970).
        address: Address of the master.
        platform: Value of `sys.platform`.
        versions: Versions of NEP Studio, Python and libraries.
        nep_file: Folder from which the package `nep` is imported.
        view: Graph of the master, None if no master replies.
        answered_s: Time the master took to reply.
        master_port: Port of the master's address, None if the address is not of this computer.
        ports: Fixed ports of the original NEP.
        masters: All processes here that run a master, each with its port.
        joins_originals: True if the gateway is enabled.
        packages: Installed packages named nep or nep-studio of this Python.
        strange_files: Files of the original NEP found in `nep_file`.
        shadow: File that hides the package from programs started here.
        files: Open-file limits.
        folders: Folders that must be writable.
        clocks: Computers whose clocks are ahead.
        loopback: Why programs of this computer can't reach each other, "" if they can.
        master_install: Installation of the running master, None if unknown.
        programs: Programs of this computer that have nodes, if their files are known.
        is_known: False if the host name of the master's address can't be resolved.
        answers_at: Loopback address at which a master replies although `address`, of this computer too, does
            not; else "".
        reach: Why the address of a remote master that doesn't reply can't be reached; "" if it can, None if
            not tried.
        path_package: Original `nep` imported by `python3` of the PATH, if that is another Python.
        node_packages: `nep-js` packages found by Node.js in this folder, the imported one first.
    """

    now_s: float
    address: str
    platform: str
    versions: Mapping[str, str]
    nep_file: str
    view: GraphView | None = None
    answered_s: float | None = None
    master_port: PortFact | None = None
    ports: tuple[PortFact, ...] = ()
    masters: tuple[tuple[ProcessFact, int | None], ...] = ()
    joins_originals: bool = True
    packages: tuple[PackageFact, ...] = ()
    strange_files: tuple[str, ...] = ()
    shadow: str = ""
    files: FileFact = field(default_factory=lambda: FileFact(None, None))
    folders: tuple[FolderFact, ...] = ()
    clocks: tuple[ClockFact, ...] = ()
    loopback: str = ""
    master_install: Install | None = None
    programs: tuple[ProgramFact, ...] = ()
    is_known: bool = True
    answers_at: str = ""
    reach: Reach | None = None
    path_package: PackageFact | None = None
    node_packages: tuple[PackageFact, ...] = ()


@dataclass(frozen=True)
class PublisherFact:
    """Publisher of the topic under diagnosis.

    Attributes:
        node: Name of its node.
        host: Name of its computer.
        generation: "native" or the version of the original NEP.
        sent: Number of messages sent, None if not counted (original NEP).
        last_s: Time of the last message (s since 1970, this computer's clock), None before the first.
        endpoint: Address to which programs here connect, "" if none is needed.
        reach: Why the endpoint can't be reached.
        remedies: Services of its node that can restart it.
    """

    node: str
    host: str
    generation: str = "native"
    sent: int | None = None
    last_s: float | None = None
    endpoint: str = ""
    reach: Reach = ""
    remedies: tuple[str, ...] = ()


@dataclass(frozen=True)
class TopicFacts:
    """Facts about the topic under diagnosis.

    Attributes:
        topic: Name of the topic.
        now_s: Current time (s since 1970).
        address: Address of the master.
        is_shared: True if the master accepts other computers.
        publishers: Publishers of the topic.
        others: Published topics with their rates in Hz (None: unknown).
        services: Names of all services.
        alerts: Alerts of the master about this topic.
        listened_s: How long the doctor subscribed to the topic.
        received: Number of messages received meanwhile.
        refused: Number of received messages with an unknown wire version.
        unreadable: Why the newest message can't be decoded, "" if it can.
        bad_name: Why the topic's name is invalid, "" if it is valid.
    """

    topic: str
    now_s: float
    address: str
    is_shared: bool = False
    publishers: tuple[PublisherFact, ...] = ()
    others: Mapping[str, float | None] = field(default_factory=dict)
    services: tuple[str, ...] = ()
    alerts: tuple[Alert, ...] = ()
    listened_s: float = 0.0
    received: int = 0
    refused: int = 0
    unreadable: str = ""
    bad_name: str = ""
