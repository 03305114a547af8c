"""Assignment of ports to topics and programs of the original NEP.

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
_BOOT_TIME_TOLERANCE_S = 120.0


@dataclass(frozen=True, order=True)
class TopicLine:
    """Topic in one frame format and connection mode, for which a pair of ports is assigned.

    Programs on the same line connect to the same ports.

    Attributes:
        topic: Name of the topic or service.
        framing: "prefixed" or "bare".
        codec: Native codec; "service" for clients and servers, whose bytes are not converted.
        mode: Connection mode: "many2many", "one2many" (the publisher binds) or "many2one" (the subscriber
            binds).
    """

    topic: str
    framing: Framing
    codec: str
    mode: Mode

    @property
    def is_service(self) -> bool:
        """True if the line is used by clients and servers instead of publishers and subscribers."""
        return self.codec == "service"


@dataclass(frozen=True)
class Registration:
    """Original program that has requested the port of a line.

    Attributes:
        line: Requested line.
        node: Name of the program's node.
        socket: Kind of socket: "publisher", "subscriber", "client", "server", "surveyor" or "respondent".
        msg_type: Message type of the original NEP.
        generation: Wire generation: "A" or "B".
        language: Programming language, if known.
        pid: Process id, if known.
        started: Start time of the process (s since 1970), if known.
    """

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
        """Unique id of the node, composed of its name and the process id."""
        return f"original:{escaped(self.node)}:{self.pid if self.pid is not None else '-'}"


class PortMap:
    """Assignment of ports to lines, and the programs that requested them.

    Unused lines keep their ports until the range is exhausted.

    Args:
        file: File with stored assignments, which `save` replaces; None to store nothing.
        boot_time_s: Boot time of this computer (s since 1970); earlier registrations are not loaded.
    """

    def __init__(self, file: Path | None, boot_time_s: float = 0.0) -> None:
        self._file = file
        self._boot_time_s = boot_time_s
        self._ports: dict[TopicLine, int] = {}
        self._registrations: dict[tuple[str, TopicLine, str], Registration] = {}
        if file is not None:
            self._load(file)

    @property
    def registrations(self) -> tuple[Registration, ...]:
        """Current registrations, oldest first."""
        return tuple(self._registrations.values())

    @property
    def base_ports(self) -> Mapping[TopicLine, int]:
        """Base ports by line."""
        return self._ports

    def port_of(self, line: TopicLine) -> int | None:
        """Return the base port of a line, or None if no port is assigned."""
        return self._ports.get(line)

    def candidates(self, is_used: Callable[[TopicLine], bool]) -> Iterator[int]:
        """Yield base ports for a new line: first unassigned ports, then ports of unused lines.

        Args:
            is_used: Returns True if a program uses the line.
        """
        line_by_port = {port: line for line, port in self._ports.items()}
        yield from (port for port in range(FIRST_PORT, LAST_PORT + 1, 2) if port not in line_by_port)
        yield from (port for port, line in line_by_port.items() if not is_used(line))

    def assign(self, line: TopicLine, port: int) -> None:
        """Assign a base port to a line, and remove its assignment to another line."""
        for other in [
            assigned_line
            for assigned_line, assigned_port in self._ports.items()
            if assigned_port == port and assigned_line != line
        ]:
            del self._ports[other]
        self._ports[line] = port

    def add(self, registration: Registration) -> None:
        """Add a registration, replacing an earlier one of the same node, line and socket."""
        key = (registration.node_id, registration.line, registration.socket)
        self._registrations[key] = registration

    def remove(self, registrations: set[Registration]) -> None:
        """Remove registrations. Their lines keep their ports."""
        self._registrations = {
            key: registration
            for key, registration in self._registrations.items()
            if registration not in registrations
        }

    def save(self) -> None:
        """Write the file atomically; no effect without a file. Raises `OSError` if writing fails."""
        if self._file is None:
            return
        document = {
            "version": _VERSION,
            "boot": self._boot_time_s,
            "lines": [{**asdict(line), "port": port} for line, port in self._ports.items()],
            "programs": [asdict(registration) for registration in self._registrations.values()],
        }
        self._file.parent.mkdir(parents=True, exist_ok=True)
        descriptor, temporary_name = tempfile.mkstemp(dir=self._file.parent, prefix=self._file.name)
        try:
            with os.fdopen(descriptor, "w", encoding="utf-8") as stream:
                json.dump(document, stream)
            replace_file(Path(temporary_name), self._file)
        except OSError:
            Path(temporary_name).unlink(missing_ok=True)
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
            if abs(document["boot"] - self._boot_time_s) > _BOOT_TIME_TOLERANCE_S:
                return
            for entry in document["programs"]:
                registration = _parse_registration(entry)
                if registration.line in self._ports:
                    self.add(registration)
        except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
            return


def default_file(port: int) -> Path:
    """Return the state file for the master at `port`.

    The file is in the folder `NEP_STATE_DIR`, or in the user's folder for application state.
    """
    state_dir = os.environ.get("NEP_STATE_DIR")
    if state_dir:
        folder = Path(state_dir)
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
        raise TypeError("the topic or codec of a line is not a string")
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
