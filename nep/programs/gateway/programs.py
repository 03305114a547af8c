"""`ProgramTable`: original programs and their roles, which are derived from their connections."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, cast, get_args

from nep.programs.gateway.portmap import PortMap, Registration, TopicLine
from nep.programs.gateway.processes import Processes
from nep.programs.gateway.proxy_pair import Endpoint, ProxyPair
from nep.programs.gateway.requests import Member, Role

_START_TIME_TOLERANCE_S = 5.0
_CONNECT_GRACE_S = 10.0
"""Time in seconds that a program has to connect after its request.

Until then, short connections may belong to other programs.
"""


ServiceRole = Literal["server", "client"]


@dataclass(frozen=True)
class TopicLink:
    """Role of an original program on a topic or for a service.

    Attributes:
        topic: Name of the topic or service.
        msg_type: Message type of the original NEP.
        codec: Native codec, or "service".
        role: "publisher", "subscriber", "server" or "client".
        port: Port of the service; None for a topic.
    """

    topic: str
    msg_type: str
    codec: str
    role: Role | ServiceRole
    port: int | None = None


@dataclass(frozen=True)
class OriginalProgram:
    """Node of an original program, as shown in the graph.

    Attributes:
        node_id: Unique id of the node.
        name: Name of the node.
        pid: Process id, if known.
        generation: "A" or "B", or the version of an unsupported program ("0.5.4.6", "0.5.4.7").
        language: Programming language, if known.
        links: Roles on topics and services.
    """

    node_id: str
    name: str
    pid: int | None
    generation: str
    language: str | None
    links: tuple[TopicLink, ...]


class ProgramTable:
    """Tracker of the programs that are registered in a port map. Used in the gateway's thread only.

    Args:
        port_map: Port map with the registrations.
        processes: Information about the processes of this computer.
        pair_of: Returns the open sockets of a line, or None.
        clock: Monotonic clock in seconds.
    """

    def __init__(
        self,
        port_map: PortMap,
        processes: Processes,
        pair_of: Callable[[TopicLine], ProxyPair | None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock = clock
        self._port_map = port_map
        self._processes = processes
        self._pair_of = pair_of
        self._roles: dict[Registration, frozenset[Role]] = {}
        self._once_connected: set[Registration] = set()
        """Registrations of programs that have been connected since their request."""
        self._connect_counts: dict[Registration, tuple[int, float]] = {}

    def update(self, lines: Iterable[TopicLine] | None = None) -> None:
        """Update the roles of the programs on some lines, or on all lines if `lines` is None."""
        selected_lines = None if lines is None else set(lines)
        for registration in self._port_map.registrations:
            if selected_lines is None or registration.line in selected_lines:
                roles = frozenset(self._roles_of(registration))
                self._roles[registration] = roles
                if roles or self._was_briefly_connected(registration):
                    self._once_connected.add(registration)

    def expect_connection(self, registration: Registration) -> None:
        """Treat a program as not connected yet, because it has sent a new request.

        Earlier connections of the program to the line are ignored.
        """
        self._once_connected.discard(registration)
        self._connect_counts.pop(registration, None)

    def remove_ended(self) -> bool:
        """Remove programs that exited or closed their connections; return True if any was removed."""
        ended = {
            registration for registration in self._port_map.registrations if self._has_ended(registration)
        }
        self._discard(ended)
        return bool(ended)

    def _discard(self, registrations: set[Registration]) -> None:
        if registrations:
            self._port_map.remove(registrations)
            self._once_connected -= registrations
            for registration in registrations:
                self._roles.pop(registration, None)
                self._connect_counts.pop(registration, None)

    def evict_unconnected(self) -> bool:
        """Remove the oldest registration without a connection; return False if there is none."""
        for registration in self._port_map.registrations:
            if not self._roles.get(registration):
                self._discard({registration})
                return True
        return False

    def programs(self) -> tuple[OriginalProgram, ...]:
        """Return the current original nodes with their roles."""
        registrations_by_node: dict[str, list[Registration]] = {}
        for registration in self._port_map.registrations:
            registrations_by_node.setdefault(registration.node_id, []).append(registration)
        return tuple(
            self._program(node_id, registrations) for node_id, registrations in registrations_by_node.items()
        )

    def names(self, line: TopicLine, role: Role) -> tuple[str, ...]:
        """Return the names of the nodes that have a role on a line."""
        return tuple(
            dict.fromkeys(
                registration.node
                for registration in self._port_map.registrations
                if registration.line == line and role in self._roles.get(registration, ())
            )
        )

    def languages(self) -> dict[TopicLine, frozenset[str]]:
        """Return the known programming languages of the programs, by line."""
        languages_by_line: dict[TopicLine, frozenset[str]] = {}
        for registration in self._port_map.registrations:
            if registration.language is not None:
                languages = languages_by_line.get(registration.line, frozenset())
                languages_by_line[registration.line] = languages | {registration.language}
        return languages_by_line

    def members(self) -> list[Member]:
        """Return the entries for the broadcast of the original NEP, without lines that have no port."""
        members: list[Member] = []
        for registration in self._port_map.registrations:
            line = registration.line
            port = self._port_map.port_of(line)
            if port is not None:
                mode = None if line.is_service else line.mode
                members.append(
                    Member(
                        line.topic,
                        registration.node,
                        port,
                        registration.socket,
                        mode,
                        registration.msg_type,
                        registration.pid,
                    )
                )
        return members

    def is_used(self, line: TopicLine) -> bool:
        """Return True if a program has requested a line or is connected to it."""
        pair = self._pair_of(line)
        if pair is not None and any(pair.connections.values()):
            return True
        return any(registration.line == line for registration in self._port_map.registrations)

    def _program(self, node_id: str, registrations: list[Registration]) -> OriginalProgram:
        links = {
            TopicLink(registration.line.topic, registration.msg_type, registration.line.codec, role): None
            for registration in registrations
            for role in sorted(self._roles.get(registration, ()))
        }
        links |= dict.fromkeys(self._service_links(registrations))
        first = registrations[0]
        generation = self._unsupported_version(registrations) or first.generation
        return OriginalProgram(node_id, first.node, first.pid, generation, first.language, tuple(links))

    def _service_links(self, registrations: list[Registration]) -> Iterator[TopicLink]:
        for registration in registrations:
            if (
                registration.line.is_service
                and registration.started is not None
                and registration.socket in get_args(ServiceRole)
            ):
                role = cast("ServiceRole", registration.socket)
                port = self._port_map.port_of(registration.line)
                yield TopicLink(
                    registration.line.topic, registration.msg_type, registration.line.codec, role, port
                )

    def _unsupported_version(self, registrations: list[Registration]) -> str | None:
        for registration in registrations:
            pair = self._pair_of(registration.line)
            for role in self._roles.get(registration, ()):
                version = pair.unsupported_versions.get(role) if pair is not None else None
                if version is not None and len(self.names(registration.line, role)) == 1:
                    return version
        return None

    def _roles_of(self, registration: Registration) -> Iterable[Role]:
        pair = self._pair_of(registration.line)
        if pair is None:
            return
        for end in pair.ends:
            if pair.connections[end.role] and self._is_connected(registration, end):
                yield end.role

    def _is_connected(self, registration: Registration, end: Endpoint) -> bool:
        if registration.pid is not None and registration.started is not None:
            is_connected = self._processes.is_connected(
                registration.pid, end.port, is_bound_by_process=end.is_bound_by_program
            )
            if is_connected is not None:
                return is_connected
        return registration.socket == end.role

    def _was_briefly_connected(self, registration: Registration) -> bool:
        # True if a program connected to the line after the request and left before it was seen.
        pair = self._pair_of(registration.line)
        if pair is None:
            return False
        now = self._clock()
        count_before, first_checked_at = self._connect_counts.setdefault(
            registration, (pair.connect_count, now)
        )
        was_connected = pair.connect_count > count_before and not any(pair.connections.values())
        return was_connected and now - first_checked_at >= _CONNECT_GRACE_S

    def _has_ended(self, registration: Registration) -> bool:
        if registration.pid is not None and registration.started is not None:
            started = self._processes.start_time_s(registration.pid)
            if started is None or abs(started - registration.started) > _START_TIME_TOLERANCE_S:
                return True
        return registration in self._once_connected and not self._roles.get(registration)
