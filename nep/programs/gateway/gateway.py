"""`Gateway`: thread that replies to original programs, relays messages and updates the graph."""

from __future__ import annotations

import logging
import threading
import time
from pathlib import Path
from typing import Protocol

import zmq

from nep.i18n import _
from nep.messages.message import Message
from nep.programs.gateway.inbox import NativeInbox
from nep.programs.gateway.portmap import PortMap, Registration, TopicLine
from nep.programs.gateway.processes import Processes
from nep.programs.gateway.programs import OriginalProgram, ProgramTable
from nep.programs.gateway.proxy_pair import ProxyPair, is_free, reply_port
from nep.programs.gateway.relay import AlertSink, NativeSide, Relay
from nep.programs.gateway.request_server import Ports, RequestServer
from nep.programs.gateway.requests import LOOPBACK, Request, RequestError, Role
from nep.system.descriptors import RESERVED_DESCRIPTORS, has_free_descriptors
from nep.system.forks import call_in_child, close_in_child

_MAINTENANCE_INTERVAL_S = 1.0
"""Interval in seconds at which exited programs are removed and ports that were in use are retried."""
_MAX_SOCKETS = 8192
_FILES_PER_PAIR = 20
_ERROR_PAUSE_S = 0.2
_MAX_REGISTRATIONS = 2000
"""Maximum number of registrations, because each request rewrites the file that contains them."""
_logger = logging.getLogger("nep.programs.gateway")


class GatewayNetwork(NativeSide, AlertSink, Protocol):
    """Interface to the native network, called in the gateway's thread."""

    def start(self, inbox: NativeInbox) -> None:
        """Join the native network, and start posting native messages to `inbox`."""

    def data_of(self, message: Message) -> bytes | memoryview | None:
        """Return the data of a message in a form that original programs can decode, or None.

        Images are encoded as JPEG or PNG.
        """

    def tick(self) -> None:
        """Perform periodic work. Called once a second."""

    def set_programs(self, programs: tuple[OriginalProgram, ...]) -> None:
        """Register these original programs in the graph, and unregister all others."""

    def close(self) -> None:
        """Leave the native network."""


class Gateway:
    """Gateway between programs of the original NEP and the native network.

    Runs in one thread and binds to the loopback address only.

    Args:
        network: Native network.
        processes: Information about the processes of this computer.
        file: File that stores the ports of programs, so that the programs stay connected after a restart of
            the gateway; None to store nothing.
        ports: Fixed ports of the gateway (default: `Ports()`).
        boot_time_s: Boot time of this computer (s since 1970).
    """

    def __init__(
        self,
        network: GatewayNetwork,
        processes: Processes,
        file: Path | None = None,
        *,
        ports: Ports | None = None,
        boot_time_s: float = 0.0,
    ) -> None:
        self._network = network
        self._processes = processes
        self._port_map = PortMap(file, boot_time_s)
        self._inbox = NativeInbox()
        self._ready = threading.Event()
        self._stopping = threading.Event()
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._context.set(zmq.MAX_SOCKETS, _MAX_SOCKETS)
        self._relay = Relay(self._context, network, network, self._program_names)
        self._request_server = RequestServer(self._context, ports or Ports(), network, self._assign_port)
        self._programs = ProgramTable(self._port_map, processes, self._relay.pair)
        self._poller: zmq.Poller | None = None
        self._request_sockets: dict[zmq.Socket[bytes], int] = {}
        self._pairs: dict[zmq.Socket[bytes], ProxyPair] = {}
        self._maintain_at = 0.0
        self._published_versions: dict[TopicLine, dict[Role, str]] = {}
        self._thread = threading.Thread(target=self._run, name="nep-gateway", daemon=True)
        call_in_child(self._give_up_in_child)

    def _give_up_in_child(self) -> None:
        for port in self._request_server.ports:
            close_in_child(f"tcp://{LOOPBACK}:{port}")
        for pair in tuple(self._relay.pairs):
            close_in_child(*(f"tcp://{LOOPBACK}:{end.port}" for end in pair.ends))

    def start(self, timeout_s: float = 5.0) -> bool:
        """Start the thread; return False if it does not serve requests within `timeout_s` seconds."""
        self._thread.start()
        return self._ready.wait(timeout_s)

    def close(self, timeout_s: float = 5.0) -> None:
        """Stop the thread and release all ports, waiting at most `timeout_s` seconds."""
        self._stopping.set()
        self._inbox.wake()
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        if not self._thread.is_alive():
            self._inbox.close()

    def _run(self) -> None:
        try:
            self._network.start(self._inbox)
            self._restore()
            self._request_server.open()
            self._publish_state()
            self._ready.set()
            while not self._stopping.is_set():
                self._try_step()
        finally:
            self._relay.close()
            self._request_server.close()
            self._network.close()
            self._context.term()

    def _try_step(self) -> None:
        # An error in one topic must not stop the others.
        try:
            self._step()
        except Exception:
            _logger.exception("unexpected error in the gateway")
            self._poller = None
            self._stopping.wait(_ERROR_PAUSE_S)

    def _step(self) -> None:
        if self._poller is None:
            self._poller = self._new_poller()
        wait_s = max(0.0, self._maintain_at - time.monotonic())
        ready_sockets = [socket for socket, _ in self._poller.poll(int(wait_s * 1000) + 1)]
        changed_lines: set[TopicLine] = set()
        for pair in {
            id(pair): pair for pair in map(self._pairs.get, ready_sockets) if pair is not None
        }.values():
            if self._relay.serve(pair):
                changed_lines.add(pair.line)
        for socket in ready_sockets:
            if socket in self._request_sockets:
                self._request_server.reply(socket, self._request_sockets[socket])
        for message in self._inbox.pop_all():
            data = self._network.data_of(message)
            if data is not None:
                self._relay.deliver(message.topic, message.codec, data)
        if changed_lines:
            self._programs.update(changed_lines)
            self._publish_state()
        if time.monotonic() >= self._maintain_at:
            self._maintain()

    def _new_poller(self) -> zmq.Poller:
        poller = zmq.Poller()
        self._request_sockets = dict(self._request_server.sockets())
        self._pairs = dict(self._relay.sockets())
        for socket in (*self._request_sockets, *self._pairs):
            poller.register(socket, zmq.POLLIN)
        poller.register(self._inbox.fileno(), zmq.POLLIN)
        return poller

    def _maintain(self) -> None:
        self._maintain_at = time.monotonic() + _MAINTENANCE_INTERVAL_S
        self._relay.tick()
        self._programs.update()
        if self._programs.remove_ended():
            for line in [pair.line for pair in self._relay.pairs if not self._programs.is_used(pair.line)]:
                self._relay.close_line(line)
            self._poller = None
            self._save()
            self._publish_state()
        if self._request_server.open():
            self._poller = None
        if self._unsupported_versions() != self._published_versions:
            self._publish_state()
        self._network.tick()

    def _program_names(self, line: TopicLine, role: Role) -> tuple[str, ...]:
        return self._programs.names(line, role)  # created after the relay, whose pairs it uses

    def _unsupported_versions(self) -> dict[TopicLine, dict[Role, str]]:
        return {
            pair.line: dict(pair.unsupported_versions)
            for pair in self._relay.pairs
            if pair.unsupported_versions
        }

    def _publish_state(self) -> None:
        self._published_versions = self._unsupported_versions()
        self._relay.set_languages(self._programs.languages())
        self._network.set_programs(self._programs.programs())
        self._request_server.publish_members(self._programs.members())

    def _restore(self) -> None:
        # Binds the ports of running programs again, because programs request a port only once.
        self._programs.remove_ended()
        for line in {
            registration.line
            for registration in self._port_map.registrations
            if not registration.line.is_service
        }:
            base = self._port_map.port_of(line)
            if base is not None and not self._open_line(line, base):
                self._network.report(
                    f"port:{base}",
                    _("Another program is using port {first} or {second}, which “{topic}” needs").format(
                        first=base, second=base + 1, topic=line.topic
                    ),
                    _("Close that program, then restart the programs of the original NEP on this topic."),
                )

    def _assign_port(self, request: Request) -> int:
        codec = "service" if request.is_service else request.codec
        line = TopicLine(request.topic, request.framing, codec, request.mode)
        if line.is_service:
            line = TopicLine(request.topic, "bare", codec, "many2many")
        base = self._port_for(line)
        if len(self._port_map.registrations) >= _MAX_REGISTRATIONS and not self._programs.evict_unconnected():
            raise RequestError(
                _("{count} programs are already registered, the maximum").format(count=_MAX_REGISTRATIONS),
                line.topic,
            )
        registration = self._registration(request, line)
        self._port_map.add(registration)
        self._programs.expect_connection(registration)
        self._save()
        self._programs.update([line])
        self._publish_state()
        return reply_port(line, base, request.socket)

    def _port_for(self, line: TopicLine) -> int:
        assigned_port = self._port_map.port_of(line)
        if assigned_port is not None and (
            line.is_service or self._relay.pair(line) or self._open_line(line, assigned_port)
        ):
            return assigned_port
        if not has_free_descriptors(_FILES_PER_PAIR + RESERVED_DESCRIPTORS):
            raise RequestError(
                _("the master has too many files open; close programs, or restart the master"), line.topic
            )
        for base in self._port_map.candidates(self._programs.is_used):
            if self._open_line(line, base):
                self._port_map.assign(line, base)
                return base
        raise RequestError(_("all ports from 9000 to 9999 are in use"), line.topic)

    def _open_line(self, line: TopicLine, base: int) -> bool:
        if line.is_service:
            return is_free(base)
        if not has_free_descriptors(_FILES_PER_PAIR + RESERVED_DESCRIPTORS):
            return False
        try:
            self._relay.open(line, base)
        except zmq.ZMQError:
            return False
        self._poller = None
        return True

    def _registration(self, request: Request, line: TopicLine) -> Registration:
        pid = request.pid
        started_s = self._processes.start_time_s(pid) if pid is not None else None
        language = request.language or (self._processes.language(pid) if pid is not None else None)
        return Registration(
            line, request.node, request.socket, request.msg_type, request.generation, language, pid, started_s
        )

    def _save(self) -> None:
        try:
            self._port_map.save()
        except OSError as error:
            self._network.report(
                "gateway:file",
                _("Can't save the ports of programs of the original NEP: {strerror}").format(
                    strerror=error.strerror
                ),
                _("After a restart of the master, restart the programs of the original NEP."),
            )
        else:
            self._network.resolve("gateway:file")
