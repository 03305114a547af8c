"""Facts about this computer that the doctor evaluates, as frozen dataclasses. None means unknown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from nep.programs.doctor.installs import Install
from nep.protocol.graph_view import Alert, GraphView

ReachFailure = Literal["", "elsewhere", "refused", "timeout", "unknown"]
"""Reason why an address can't be reached; "" if it can, or was not tried.

"elsewhere": reachable only from its own computer. "refused": the port is closed. "timeout": no reply.
"unknown": another error of the operating system.
"""


@dataclass(frozen=True)
class ProcessFact:
    """Process of this computer.

    Attributes:
        pid: Process id.
        name: Name of its program.
        is_master: True if the process runs a master.
        since_s: Start time (s since 1970).
    """

    pid: int | None
    name: str
    is_master: bool = False
    started_s: float | None = None


@dataclass(frozen=True)
class PortFact:
    """Port of this computer.

    Attributes:
        port: Number of the port.
        purpose: What the port is used for.
        is_taken: True if a process is bound to the port.
        holder: That process; None if the port is free or the system doesn't report the process.
    """

    port: int
    purpose: str
    is_taken: bool
    holder: ProcessFact | None = None


@dataclass(frozen=True)
class PackageFact:
    """Installed package; `is_ours` is False for another project's package with the same name."""

    name: str
    version: str
    location: str
    is_ours: bool = True


@dataclass(frozen=True)
class FileFact:
    """Limits of open files, and the number of files that the master has open.

    Attributes:
        soft: Soft limit of this process; None for no limit.
        hard: Hard limit of this process; None for no limit.
        master_open: Number of files that the master has open.
        master_limit: Limit of the master.
    """

    soft_limit: int | None
    hard_limit: int | None
    master_open_count: int | None = None
    master_limit: int | None = None


@dataclass(frozen=True)
class ProgramFact:
    """Open files of a program with a node.

    Attributes:
        pid: Process id.
        name: Name of the node.
        opened: Number of open files.
        limit: Limit of open files.
    """

    pid: int
    name: str
    open_count: int
    limit: int


@dataclass(frozen=True)
class FolderFact:
    """Folder that must be writable.

    Attributes:
        path: Path of the folder.
        purpose: What the folder is used for.
        problem: Reason why the folder isn't writable; "" if it is.
    """

    path: str
    purpose: str
    problem: str = ""


@dataclass(frozen=True)
class ClockFact:
    """Computer whose clock is ahead by `ahead_s` seconds, according to the time stamps of its messages."""

    host: str
    ahead_s: float


@dataclass(frozen=True)
class Facts:
    """All facts that the doctor evaluates.

    Attributes:
        now_s: Current time (s since 1970).
        address: Address of the master.
        platform: Value of `sys.platform`.
        versions: Versions of NEP Studio, Python and libraries.
        nep_file: Folder from which the package `nep` is imported.
        view: Graph of the master; None if no master replies.
        answered_s: Time that the master took to reply.
        master_port: Port of the master's address; None if the address is not of this computer.
        ports: Fixed ports of the original NEP.
        masters: All processes here that run a master, each with its port.
        joins_originals: True if the gateway is enabled.
        packages: Installed packages of this Python named nep or nep-studio.
        strange_files: Files of the original NEP found in `nep_file`.
        shadow: File that hides the package from programs started here.
        files: Limits of open files.
        folders: Folders that must be writable.
        clocks: Computers whose clocks are ahead.
        loopback: Reason why programs of this computer can't reach each other; "" if they can.
        master_install: Installation of the running master; None if unknown.
        programs: Programs of this computer that have nodes and whose open files are known.
        is_known: False if the host name of the master's address can't be resolved.
        answers_at: Loopback address at which a master replies, if `address` is of this computer but doesn't
            reply; else "".
        reach: Reason why the address of a remote master that doesn't reply can't be reached; "" if it can,
            None if it was not tried.
        path_package: Package `nep` of the original NEP that `python3` of the PATH imports, if that is another
            Python.
        node_packages: Packages `nep-js` that Node.js finds from this folder; the first one is imported.
    """

    now_s: float
    address: str
    platform: str
    versions: Mapping[str, str]
    nep_folder: str
    view: GraphView | None = None
    reply_time_s: float | None = None
    master_port: PortFact | None = None
    ports: tuple[PortFact, ...] = ()
    masters: tuple[tuple[ProcessFact, int | None], ...] = ()
    is_gateway_enabled: bool = True
    packages: tuple[PackageFact, ...] = ()
    original_files: tuple[str, ...] = ()
    shadow: str = ""
    files: FileFact = field(default_factory=lambda: FileFact(None, None))
    folders: tuple[FolderFact, ...] = ()
    clocks: tuple[ClockFact, ...] = ()
    loopback_problem: str = ""
    master_install: Install | None = None
    programs: tuple[ProgramFact, ...] = ()
    is_host_known: bool = True
    replying_address: str = ""
    reach_failure: ReachFailure | None = None
    path_package: PackageFact | None = None
    node_packages: tuple[PackageFact, ...] = ()


@dataclass(frozen=True)
class PublisherFact:
    """Publisher of the topic under diagnosis.

    Attributes:
        node: Name of its node.
        host: Name of its computer.
        generation: "native" or the version of the original NEP.
        sent: Number of messages sent; None if not counted (original NEP).
        last_s: Time of the last message (s since 1970, this computer's clock); None before the first.
        endpoint: Address to which programs on this computer connect; "" if none is needed.
        reach: Reason why the endpoint can't be reached.
        remedies: Services of its node that can restart the node.
    """

    node: str
    host: str
    generation: str = "native"
    sent: int | None = None
    last_message_s: float | None = None
    endpoint: str = ""
    reach_failure: ReachFailure = ""
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
        others: Rates of other published topics in Hz (None: unknown).
        services: Names of all services.
        alerts: Alerts of the master about this topic.
        listened_s: How long the doctor was subscribed to the topic.
        received: Number of messages received in that time.
        refused: Number of messages rejected because of an unknown wire version.
        unreadable: Reason why the newest message can't be decoded; "" if it can.
        bad_name: Reason why the topic's name is invalid; "" if it is valid.
    """

    topic: str
    now_s: float
    address: str
    is_shared: bool = False
    publishers: tuple[PublisherFact, ...] = ()
    other_topics: Mapping[str, float | None] = field(default_factory=dict)
    services: tuple[str, ...] = ()
    alerts: tuple[Alert, ...] = ()
    listen_duration_s: float = 0.0
    received: int = 0
    rejected: int = 0
    decode_problem: str = ""
    name_problem: str = ""
