"""Facts about this computer that the doctor evaluates, as frozen dataclasses. None means unknown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from nep.programs.doctor.installs import Install
from nep.protocol.graph_view import Alert, GraphView

ReachFailure = Literal["", "elsewhere", "refused", "timeout", "unknown"]
"""Reason why an address can't be reached.

"": the address can be reached, or was not tried. "elsewhere": only programs on its own computer can
reach the address. "refused": the port is closed. "timeout": no reply. "unknown": another error of the
operating system.
"""


@dataclass(frozen=True)
class ProcessFact:
    """Process on this computer.

    Attributes:
        pid: Process id; None if unknown.
        name: Name of the executable, with the script for an interpreter.
        is_master: True if the process runs a master.
        started_s: Start time (s since 1970).
    """

    pid: int | None
    name: str
    is_master: bool = False
    started_s: float | None = None


@dataclass(frozen=True)
class PortFact:
    """TCP port of this computer.

    Attributes:
        port: Port number.
        purpose: Description of the port's use.
        is_taken: True if a process is bound to the port.
        holder: Process that is bound to the port; None if the port is free or the process is unknown.
    """

    port: int
    purpose: str
    is_taken: bool
    holder: ProcessFact | None = None


@dataclass(frozen=True)
class PackageFact:
    """Installed package.

    Attributes:
        name: Name of the package.
        version: Version of the package.
        location: Folder of the package.
        is_ours: False for another project's package with the same name.
    """

    name: str
    version: str
    location: str
    is_ours: bool = True


@dataclass(frozen=True)
class FileFact:
    """Limits on open files, and the number of files that the master has open. None means unknown or no limit.

    Attributes:
        soft_limit: Soft limit of this process.
        hard_limit: Hard limit of this process.
        master_open_count: Number of files that the master has open.
        master_limit: Maximum number of open files of the master.
    """

    soft_limit: int | None
    hard_limit: int | None
    master_open_count: int | None = None
    master_limit: int | None = None


@dataclass(frozen=True)
class ProgramFact:
    """Open files of a program that has a node.

    Attributes:
        pid: Process id.
        name: Name of the node.
        open_count: Number of open files.
        limit: Maximum number of open files.
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
        purpose: Description of the files that are saved in the folder.
        problem: Reason why the folder isn't writable; "" if it is.
    """

    path: str
    purpose: str
    problem: str = ""


@dataclass(frozen=True)
class ClockFact:
    """Computer whose clock is ahead of this computer's, according to the time stamps of its messages.

    Attributes:
        host: Name of the computer.
        ahead_s: Difference of the clocks in seconds.
    """

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
        nep_folder: Folder from which the package `nep` is imported.
        view: Graph of the master; None if the master doesn't reply.
        reply_time_s: Time in seconds that the master took to reply; None if it doesn't reply.
        master_port: Port of the master's address; None for an address of another computer.
        ports: Fixed ports of the original NEP.
        masters: Processes on this computer that run a master, each with its port.
        is_gateway_enabled: True if the gateway is enabled.
        packages: Packages named nep or nep-studio in this Python environment.
        original_files: Names of files of the original NEP in the folder `nep_folder`.
        shadowing_file: File that hides the package `nep` from programs started in this folder; "" if there is
            none.
        files: Limits on open files.
        folders: Folders that must be writable.
        clocks: Computers whose clocks are ahead.
        loopback_problem: Reason why programs on this computer can't reach each other; "" if they can.
        master_install: Installation of the running master; None if unknown.
        programs: Programs on this computer that have nodes and whose open files are known.
        is_host_known: False if the host name of the master's address can't be resolved.
        replying_address: Loopback address at which a master replies, if `address` is of this computer but
            doesn't reply; else "".
        reach_failure: Reason why the address of a remote master that doesn't reply can't be reached; "" if
            it can be reached, None if it was not tried.
        path_package: Package `nep` of the original NEP that `python3` on the PATH imports; None if there is
            none, or if `python3` is this Python.
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
    shadowing_file: str = ""
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
        node: Name of the publisher's node.
        host: Name of the publisher's computer.
        generation: "native", or the wire generation or version of the original NEP.
        sent: Number of messages sent; None if not counted (original NEP).
        last_message_s: Time of the last message (s since 1970, this computer's clock); None before the first.
        endpoint: Address to which programs on this computer connect; "" if none is needed.
        reach_failure: Reason why the endpoint can't be reached; "" if it can.
        remedies: Services of the node that may restart its program.
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
        is_shared: True if other computers can connect to the master.
        publishers: Publishers of the topic.
        other_topics: Rates in Hz of all published topics, by topic; None if unknown.
        services: Names of all services.
        alerts: Alerts of the master about this topic.
        listen_duration_s: Time in seconds for which the doctor was subscribed to the topic.
        received: Number of messages received in that time.
        rejected: Number of messages rejected because of an unknown wire version.
        decode_problem: Reason why the newest message can't be decoded; "" if it can.
        name_problem: Reason why the topic's name is invalid; "" if it is valid.
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
