"""Ports assigned to topics and programs of the original NEP.

The assignments are stored in a file, because an original program requests its port only once.
"""

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
    """Key of a pair of ports: a topic, its frame format, and its connection mode.

    For clients and servers, whose bytes are not converted, `codec` is "service".
    """

    topic: str
    framing: Framing
    codec: str
    mode: Mode

    @property
    def is_service(self) -> bool:
        """True if the line belongs to clients and servers."""
        return self.codec == "service"


@dataclass(frozen=True)
class Registration:
    """Request of an original program for a line. `started` is the start time of its process, if known."""

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
        """Unique id of the node. Nodes with the same name differ in the process id."""
        return f"original:{escaped(self.node)}:{self.pid if self.pid is not None else '-'}"


class PortMap:
    """Assignment of ports to lines, and the programs that requested them.

    Unused lines keep their ports until the range is exhausted.

    Args:
        file: File that `save` replaces atomically, or None.
        boot: Boot time of this computer; registrations from before are invalid.
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
        """Current registrations, oldest first."""
        return tuple(self._registrations.values())

    @property
    def lines(self) -> Mapping[TopicLine, int]:
        """Base port of each known line."""
        return self._ports

    def port_of(self, line: TopicLine) -> int | None:
        """Return the base port of a line, or None if the line is unknown."""
        return self._ports.get(line)

    def candidates(self, is_used: Callable[[TopicLine], bool]) -> Iterator[int]:
        """Yield base ports for a new line: first unassigned ports, then those of unused lines."""
        assigned = {port: line for line, port in self._ports.items()}
        yield from (port for port in range(FIRST_PORT, LAST_PORT + 1, 2) if port not in assigned)
        yield from (port for port, line in assigned.items() if not is_used(line))

    def assign(self, line: TopicLine, port: int) -> None:
        """Assign `port` to `line`; another line with this port loses it."""
        for other in [known for known, used in self._ports.items() if used == port and known != line]:
            del self._ports[other]
        self._ports[line] = port

    def add(self, registration: Registration) -> None:
        """Add a registration. An earlier one for the same line and socket is replaced."""
        key = (registration.node_id, registration.line, registration.socket)
        self._registrations[key] = registration

    def remove(self, registrations: set[Registration]) -> None:
        """Remove registrations; their lines keep their ports."""
        self._registrations = {
            key: known for key, known in self._registrations.items() if known not in registrations
        }

    def save(self) -> None:
        """Write the file atomically. Raises `OSError`."""
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
                    self._ports[_parse_line(entry)] = port
            if abs(document["boot"] - self._boot) > _SAME_BOOT_S:
                return
            for entry in document["programs"]:
                known = _parse_registration(entry)
                if known.line in self._ports:
                    self.add(known)
        except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
            return


def default_file(port: int) -> Path:
    """Return the state file of the master at `port`, in `NEP_STATE_DIR` or the system's folder."""
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


def _parse_line(entry: Mapping[str, object]) -> TopicLine:
    topic, framing, codec, mode = (entry[key] for key in ("topic", "framing", "codec", "mode"))
    if not isinstance(topic, str) or not isinstance(codec, str):
        raise TypeError("a line is not of text")
    framings: tuple[Framing, ...] = get_args(Framing)
    modes: tuple[Mode, ...] = get_args(Mode)
    return TopicLine(topic, framings[framings.index(framing)], codec, modes[modes.index(mode)])


def _parse_registration(entry: Mapping[str, object]) -> Registration:
    line, pid, started, language = (entry[key] for key in ("line", "pid", "started", "language"))
    if not isinstance(line, dict):
        raise TypeError("a registration has no line")
    return Registration(
        line=_parse_line(line),
        node=str(entry["node"]),
        socket=str(entry["socket"]),
        msg_type=str(entry["msg_type"]),
        generation=str(entry["generation"]),
        language=language if isinstance(language, str) else None,
        pid=pid if isinstance(pid, int) else None,
        started=started if isinstance(started, (int, float)) else None,
    )
