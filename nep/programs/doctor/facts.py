"""What the doctor judges: facts about this computer, as frozen values. None stands for what is not known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from nep.programs.doctor.installs import Install
from nep.protocol.graph_view import GraphView

__all__ = [
    "ClockFact",
    "Facts",
    "FileFact",
    "FolderFact",
    "PackageFact",
    "PortFact",
    "ProcessFact",
    "ProgramFact",
]


@dataclass(frozen=True)
class ProcessFact:
    """A process: its id, its program's name, and when it began (s since 1970)."""

    pid: int | None
    name: str
    is_master: bool = False
    since_s: float | None = None


@dataclass(frozen=True)
class PortFact:
    """A port of this computer, what it is for, whether it is taken, and by whom.

    `holder` is None when nobody holds it, or when the system does not say who does.
    """

    port: int
    purpose: str
    is_taken: bool
    holder: ProcessFact | None = None


@dataclass(frozen=True)
class PackageFact:
    """A package that is installed in this Python."""

    name: str
    version: str
    place: str


@dataclass(frozen=True)
class FileFact:
    """How many files a program may open (None: no limit), and how many the master has open."""

    soft: int | None
    hard: int | None
    master_open: int | None = None
    master_limit: int | None = None


@dataclass(frozen=True)
class ProgramFact:
    """A program of this computer with a node `name`: how many files it has open, and how many it may have."""

    pid: int
    name: str
    opened: int
    limit: int


@dataclass(frozen=True)
class FolderFact:
    """A folder that must take files: what for, and why it does not ("" when it does)."""

    path: str
    purpose: str
    problem: str = ""


@dataclass(frozen=True)
class ClockFact:
    """A computer whose messages are stamped so many seconds in the future."""

    host: str
    ahead_s: float


@dataclass(frozen=True)
class Facts:
    """Everything that the doctor looks at. `now_s` is the time in s since 1970.

    `address` is the master's. `view` is its graph, None when no master answers; `answered_s` is how long that
    took. `masters` are all processes here that run a master, each with its port. `nep_file` is where the
    package `nep` is imported from; `strange_files` in it are the original NEP's. `shadow` is a file that
    hides it from programs that are started here. `loopback` says why programs of this computer cannot reach
    each other, "" when they can. `master_install` is where the master that answers was started from, None
    when that is not known. `programs` are those of this computer that have nodes, as far as the system tells
    of their files. Not `is_known`: no computer has the name that the master's address begins with.
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
