"""Which topic of the originals has which ports, and who asked; in a file, for originals never ask twice."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import get_args

from nep.programs.gateway.framing import Framing
from nep.programs.gateway.requests import Mode
from nep.system.replace_file import replace_file
from nep.text import escaped

FIRST_PORT = 9000
LAST_PORT = 9998
_VERSION = 1
_SAME_BOOT_S = 120.0


@dataclass(frozen=True, order=True)
class TopicLine:
    """What has a pair of ports of its own: one topic, in one form, joined in one way.

    `codec` is "service" for clients and servers, whose bytes are not translated.
    """

    topic: str
    framing: Framing
    codec: str
    mode: Mode

    @property
    def is_service(self) -> bool:
        """Whether the line belongs to clients and servers."""
        return self.codec == "service"


@dataclass(frozen=True)
class Registration:
    """One original program asked for one line; `started` is when its process began, if there is one."""

    line: TopicLine
    node: str
    socket: str
    msg_type: str
    generation: str
    language: str | None
    pid: int | None
    started: float | None

    @property
    def node_id(self) -> str:
        """Tells nodes apart, also those of one name."""
        return f"original:{escaped(self.node)}:{self.pid if self.pid is not None else '-'}"


class PortMap:
    """The lines that have ports and the programs that asked for them.

    `save()` writes the file in one step, so that a killed master leaves either the old one or the new one.
    Ports of lines that nobody uses any more stay theirs until the range is full. `boot` is when this computer
    was started: no program that asked before then is still there.
    """

    def __init__(self, file: Path | None, boot: float = 0.0) -> None:
        self._file = file
        self._boot = boot
        self._ports: dict[TopicLine, int] = {}
        self._registrations: dict[tuple[str, TopicLine, str], Registration] = {}
        if file is not None:
            self._load(file)

    @property
    def registrations(self) -> tuple[Registration, ...]:
        """Everything asked for and not given up, oldest first."""
        return tuple(self._registrations.values())

    @property
    def lines(self) -> Mapping[TopicLine, int]:
        """The base port of each known line."""
        return self._ports

    def port_of(self, line: TopicLine) -> int | None:
        """The base port of `line`, if it has one."""
        return self._ports.get(line)

    def candidates(self, is_used: Callable[[TopicLine], bool]) -> Iterator[int]:
        """Base ports for a new line, best first: never given ones, then those whose line nobody uses."""
        taken = {port: line for line, port in self._ports.items()}
        yield from (port for port in range(FIRST_PORT, LAST_PORT + 1, 2) if port not in taken)
        yield from (port for port, line in taken.items() if not is_used(line))

    def give(self, line: TopicLine, port: int) -> None:
        """Let `line` have `port`; a line that had it before loses it."""
        for other in [known for known, used in self._ports.items() if used == port and known != line]:
            del self._ports[other]
        self._ports[line] = port

    def add(self, registration: Registration) -> None:
        """Note who asked for what; asking again replaces."""
        key = (registration.node_id, registration.line, registration.socket)
        self._registrations[key] = registration

    def remove(self, registrations: set[Registration]) -> None:
        """Forget these registrations; their lines keep their ports."""
        self._registrations = {
            key: known for key, known in self._registrations.items() if known not in registrations
        }

    def save(self) -> None:
        """Write the file. Raises `OSError`."""
        if self._file is None:
            return
        document = {
            "version": _VERSION,
            "boot": self._boot,
            "lines": [{**asdict(line), "port": port} for line, port in self._ports.items()],
            "programs": [asdict(registration) for registration in self._registrations.values()],
        }
        self._file.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=self._file.parent, prefix=self._file.name)
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as stream:
                json.dump(document, stream)
            replace_file(Path(name), self._file)
        except OSError:
            Path(name).unlink(missing_ok=True)
            raise

    def _load(self, file: Path) -> None:
        try:
            document = json.loads(file.read_text(encoding="utf-8"))
            if document["version"] != _VERSION:
                return
            for entry in document["lines"]:
                port = entry["port"]
                if isinstance(port, int) and FIRST_PORT <= port <= LAST_PORT:
                    self._ports[_line(entry)] = port
            if abs(document["boot"] - self._boot) > _SAME_BOOT_S:
                return
            for entry in document["programs"]:
                known = _registration(entry)
                if known.line in self._ports:
                    self.add(known)
        except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
            return


def default_file(port: int) -> Path:
    """Where the master at `port` keeps its map: `NEP_STATE_DIR`, or the system's place for such files."""
    chosen = os.environ.get("NEP_STATE_DIR")
    if chosen:
        folder = Path(chosen)
    elif sys.platform == "win32":
        folder = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "nep"
    elif sys.platform == "darwin":
        folder = Path.home() / "Library" / "Application Support" / "nep"
    else:
        folder = Path(os.environ.get("XDG_STATE_HOME", Path.home() / ".local" / "state")) / "nep"
    return folder / f"gateway-{port}.json"


def _line(entry: Mapping[str, object]) -> TopicLine:
    topic, framing, codec, mode = (entry[key] for key in ("topic", "framing", "codec", "mode"))
    if not isinstance(topic, str) or not isinstance(codec, str):
        raise TypeError("a line is not of text")
    framings: tuple[Framing, ...] = get_args(Framing)
    modes: tuple[Mode, ...] = get_args(Mode)
    return TopicLine(topic, framings[framings.index(framing)], codec, modes[modes.index(mode)])


def _registration(entry: Mapping[str, object]) -> Registration:
    line, pid, started, language = (entry[key] for key in ("line", "pid", "started", "language"))
    if not isinstance(line, dict):
        raise TypeError("a registration has no line")
    return Registration(
        line=_line(line),
        node=str(entry["node"]),
        socket=str(entry["socket"]),
        msg_type=str(entry["msg_type"]),
        generation=str(entry["generation"]),
        language=language if isinstance(language, str) else None,
        pid=pid if isinstance(pid, int) else None,
        started=started if isinstance(started, (int, float)) else None,
    )
