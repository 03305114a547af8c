"""Servers, clients and surveyors of one node without a master.

Part of `NanomsgTransport`. Regardless of the mode, a server binds its port and clients connect; a
surveyor binds and respondents connect.
"""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from nep.backends.connection import Direct
from nep.backends.deadlines import Deadlines
from nep.backends.nanomsg.client import NanomsgClient
from nep.backends.nanomsg.direct import attach, dial
from nep.backends.nanomsg.library import listen, new_socket
from nep.backends.nanomsg.server import REPLY_TIMEOUT_S, NanomsgServer
from nep.backends.nanomsg.surveys import NanomsgSurveyor
from nep.backends.services import ClientSpec, ServerSpec
from nep.errors import ClosedError
from nep.protocol.service_wire import HEADER_BYTES, MAX_PAYLOAD_BYTES, NATIVE, ORIGINAL, Framing

if TYPE_CHECKING:
    from collections.abc import Callable

_MAX_MESSAGE_BYTES = MAX_PAYLOAD_BYTES + HEADER_BYTES
_REPLY_TIMEOUT_MS = round(REPLY_TIMEOUT_S * 1000)
_NEVER_RESEND = -1
_RECONNECT_MS = {"reconnect_time_min": 10, "reconnect_time_max": 500}
"""Socket options of pynng: initial and maximum reconnection interval in milliseconds."""


class DirectServices:
    """Servers, clients and surveyors of one node. Thread-safe."""

    def __init__(self, node_name: str) -> None:
        self._node_name = node_name
        self._lock = threading.Lock()
        self._deadlines = Deadlines(node_name)
        self._surveyors: set[NanomsgSurveyor] = set()
        self._servers: set[NanomsgServer] = set()
        self._clients: set[NanomsgClient] = set()
        self._is_closed = False

    def create_surveyor(self, spec: ClientSpec, direct: Direct, wait_s: float) -> NanomsgSurveyor:
        """Create a surveyor and wait up to `wait_s` seconds for a respondent to connect."""
        self._check_open()
        surveyor = NanomsgSurveyor(spec, direct, self._surveyors.discard)
        with self._lock:
            self._surveyors.add(surveyor)
        try:
            surveyor.wait_for_any(wait_s)
            self._check_open()
        except BaseException:
            surveyor.close()
            raise
        return surveyor

    def create_respondent(self, spec: ServerSpec, direct: Direct) -> NanomsgServer:
        """Create a respondent."""

        def attach_socket(socket: object) -> str:
            return attach(socket, direct, is_publisher=False, owner=f"a respondent of '{spec.service}'")

        return self._create_server(spec, "Respondent0", ORIGINAL, attach_socket)

    def create_server(self, spec: ServerSpec, direct: Direct) -> NanomsgServer:
        """Create a server and bind its port. Raises `AddressInUseError` if the port can't be bound."""

        def attach_socket(socket: object) -> str:
            listen(socket, f"{direct.ip}:{direct.port}", f"a server of '{spec.service}'")
            return f"tcp://{direct.ip}:{direct.port}"

        return self._create_server(spec, "Rep0", _framing(direct), attach_socket)

    def _create_server(
        self, spec: ServerSpec, kind: str, framing: Framing, attach_socket: Callable[[object], str]
    ) -> NanomsgServer:
        self._check_open()
        socket = new_socket(kind, send_timeout=_REPLY_TIMEOUT_MS, recv_max_size=_MAX_MESSAGE_BYTES)
        try:
            server = NanomsgServer(socket, attach_socket(socket), spec, framing, self._servers.discard)
        except BaseException:
            socket.close()
            raise
        with self._lock:
            self._servers.add(server)
        try:
            self._check_open()
        except BaseException:
            server.close(0.0)
            raise
        return server

    def create_client(self, spec: ClientSpec, direct: Direct) -> NanomsgClient:
        """Create a client and start connecting; the server may start later."""
        self._check_open()
        socket = new_socket(
            "Req0", resend_time=_NEVER_RESEND, recv_max_size=_MAX_MESSAGE_BYTES, **_RECONNECT_MS
        )
        try:
            client = NanomsgClient(socket, spec, _framing(direct), self._deadlines, self._clients.discard)
            dial(socket, f"{direct.ip}:{direct.port}")
        except BaseException:
            socket.close()
            raise
        with self._lock:
            self._clients.add(client)
            self._deadlines.add_client(client)
        try:
            self._check_open()
        except BaseException:
            client.close()
            raise
        return client

    def _check_open(self) -> None:
        if self._is_closed:
            raise ClosedError(f"node '{self._node_name}'")

    def begin_close(self) -> None:
        """Reject queued and new calls."""
        with self._lock:
            self._is_closed = True
            servers = tuple(self._servers)
        for server in servers:
            server.begin_close()

    def close(self, timeout_s: float) -> None:
        """Close all servers, clients and surveyors."""
        with self._lock:
            surveyors, servers, clients = tuple(self._surveyors), tuple(self._servers), tuple(self._clients)
        for surveyor in surveyors:
            surveyor.close()
        for client in clients:
            client.close()
        deadline = time.monotonic() + timeout_s
        for server in servers:
            server.close(max(0.0, deadline - time.monotonic()))
        self._deadlines.close(max(0.0, deadline - time.monotonic()))

    def forked(self) -> None:
        """Mark everything as closed in a forked child process. See `nep.system.forks`."""
        self._is_closed = True
        self._lock = threading.Lock()
        for surveyor in self._surveyors:
            surveyor.forked()
        for client in self._clients:
            client.forked()
        for server in self._servers:
            server.forked()


def _framing(direct: Direct) -> Framing:
    return ORIGINAL if direct.wire == "original" else NATIVE
