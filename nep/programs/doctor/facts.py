"""What the doctor judges: facts about this computer, as frozen values. None stands for what is not known."""

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
"""Why an address is not reached from here: only its own computer reaches it, nobody listens there, nothing
answers, or another reason that the system gives; "" when it is reached, or was not tried."""


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
    """Installed package; `is_ours` is False for a package of another project with the same name."""

    name: str
    version: str
    place: str
    is_ours: bool = True


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
    `answers_at` is the loopback address at which a master answers when none does at `address`, which is of
    this computer, too; "" when none answers there, either. `reach` is why the address of a master that is
    on another computer and does not answer is not reached, "" when somebody is there, None when it was not
    tried. `packages` are those of this Python; `path_package` is the original `nep` imported by another
    Python that is `python3`; `node_packages` are the `nep-js` packages found by Node.js in this folder,
    starting with the imported one.
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
    """Who publishes the topic that somebody misses.

    `node` and `host` are its node's and its computer's names. `sent` is how many messages it has sent, None
    where nobody counts them (the original NEP); `last_s` when the newest was sent, in s since 1970 by the
    clock of this computer, None before the first. `endpoint` is where programs here connect to it ("" where
    nobody needs to), and `reach` why that fails. `remedies` are services of its node that are there to mend
    it.
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
    """What is known of a topic that somebody misses; `now_s` is the time in s since 1970.

    `address` is the master's, `is_shared` whether it serves other computers. `others` are the topics that
    are published, each with its messages a second (None: unknown); `services` the names of services.
    `alerts` are the master's about this topic. `listened_s` is how long somebody listened to it here,
    `received` what came meanwhile, `refused` how much of what came was no message of this version, and
    `unreadable` why the newest message can't be decoded ("" when it can). `bad_name` says why no topic can
    be called so.
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
