"""Servers, clients and surveyors of one node without a master.

Part of `NanomsgTransport`. Regardless of the mode, a server binds its port and clients connect; a
surveyor binds and respondents connect.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nep.backends.bases.open_services import OpenServices
from nep.backends.connection import Direct
from nep.backends.nanomsg.client import NanomsgClient
from nep.backends.nanomsg.direct import attach, dial
from nep.backends.nanomsg.library import listen, new_socket
from nep.backends.nanomsg.server import REPLY_TIMEOUT_S, NanomsgServer
from nep.backends.nanomsg.surveys import NanomsgSurveyor
from nep.backends.services import ClientSpec, ServerSpec
from nep.backends.zeromq.transport import close_on_error
from nep.protocol.service_wire import HEADER_BYTES, MAX_PAYLOAD_BYTES, NATIVE, ORIGINAL, Framing

if TYPE_CHECKING:
    from collections.abc import Callable

_MAX_MESSAGE_BYTES = MAX_PAYLOAD_BYTES + HEADER_BYTES
_REPLY_TIMEOUT_MS = round(REPLY_TIMEOUT_S * 1000)
_NEVER_RESEND = -1
_RECONNECT_MS = {"reconnect_time_min": 10, "reconnect_time_max": 500}
"""Socket options of pynng: initial and maximum reconnection interval in milliseconds."""


class DirectServices(OpenServices[NanomsgServer, NanomsgClient | NanomsgSurveyor]):
    """Servers, clients and surveyors of one node. Thread-safe."""

    def create_surveyor(self, spec: ClientSpec, direct: Direct, wait_s: float) -> NanomsgSurveyor:
        """Create a surveyor and wait up to `wait_s` seconds for a respondent to connect."""
        self.check_open()
        surveyor = NanomsgSurveyor(spec, direct, self.discard)
        with close_on_error(surveyor.close):
            self.add_client(surveyor)
            surveyor.wait_for_any(wait_s)
            self.check_open()
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
        self.check_open()
        socket = new_socket(kind, send_timeout=_REPLY_TIMEOUT_MS, recv_max_size=_MAX_MESSAGE_BYTES)
        with close_on_error(socket.close):
            server = NanomsgServer(socket, attach_socket, spec, framing, self.discard)
        with close_on_error(lambda: server.close(0.0)):
            self.add_server(server)
        return server

    def create_client(self, spec: ClientSpec, direct: Direct) -> NanomsgClient:
        """Create a client and start connecting; the server may start later."""
        self.check_open()
        socket = new_socket(
            "Req0", resend_time=_NEVER_RESEND, recv_max_size=_MAX_MESSAGE_BYTES, **_RECONNECT_MS
        )
        with close_on_error(socket.close):
            client = NanomsgClient(socket, spec, _framing(direct), self.deadlines, self.discard)
            dial(socket, f"{direct.ip}:{direct.port}")
        with close_on_error(client.close):
            self.add_client(client)
            self.deadlines.add_client(client)
        return client


def _framing(direct: Direct) -> Framing:
    return ORIGINAL if direct.wire == "original" else NATIVE
