"""`RequestServer`: fixed ports of the original NEP, two for requests and one for the list of topics."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import zmq

from nep.i18n import _
from nep.programs.gateway.framing import PORT_A, PORT_B
from nep.programs.gateway.relay import AlertSink
from nep.programs.gateway.requests import (
    LOOPBACK,
    Member,
    Request,
    RequestError,
    encode_broadcast,
    encode_grant,
    encode_rejection,
    parse_request,
)

_logger = logging.getLogger("nep.programs.gateway")
_MAX_REQUEST_BYTES = 2**24
"""Size above which ZeroMQ disconnects the sender. Requests usually have a few hundred bytes."""


@dataclass(frozen=True)
class Ports:
    """Fixed ports of the original NEP; 0 disables a port.

    Attributes:
        requests_a: Request port of programs up to 0.5.4.5, nep-js and C#.
        requests_b: Request port of programs since 0.5.4.6.
        broadcast: Port at which the list of topics is published.
    """

    requests_a: int = PORT_A
    requests_b: int = PORT_B
    broadcast: int = 7777


class RequestServer:
    """Server that replies to every request, even to invalid ones. Used in the gateway's thread only.

    A port in use is reported as an alert and retried.

    Args:
        context: ZeroMQ context.
        ports: Fixed ports.
        alerts: Receiver of problems.
        assign_port: Returns the port for a request, or raises `RequestError`.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        ports: Ports,
        alerts: AlertSink,
        assign_port: Callable[[Request], int],
    ) -> None:
        self._context = context
        self._ports = ports
        self._alerts = alerts
        self._assign_port = assign_port
        self._request_sockets: dict[int, zmq.Socket[bytes]] = {}
        self._broadcast_socket: zmq.Socket[bytes] | None = None

    @property
    def ports(self) -> tuple[int, ...]:
        """Numbers of the enabled ports."""
        ports = (self._ports.requests_a, self._ports.requests_b, self._ports.broadcast)
        return tuple(port for port in ports if port)

    def open(self) -> bool:
        """Bind the ports that are not bound yet; return True if a request port was bound."""
        count_before = len(self._request_sockets)
        for port, versions in (
            (self._ports.requests_a, _("nep up to 0.5.4.5, nep-js and C#")),
            (self._ports.requests_b, "nep 0.5.4.8"),
        ):
            if port and port not in self._request_sockets:
                template = _("Another program is using port {port}: programs of {version} can't connect")
                socket = self._bind(zmq.ROUTER, port, template.format(port=port, version=versions))
                if socket is not None:
                    self._request_sockets[port] = socket
        if self._ports.broadcast and self._broadcast_socket is None:
            self._broadcast_socket = self._bind(
                zmq.PUB,
                self._ports.broadcast,
                _("Another program is using port {port}: tools of the original NEP can't show topics").format(
                    port=self._ports.broadcast
                ),
            )
        return len(self._request_sockets) != count_before

    def sockets(self) -> Iterator[tuple[zmq.Socket[bytes], int]]:
        """Yield the request sockets with their ports."""
        for port, socket in self._request_sockets.items():
            yield socket, port

    def reply(self, socket: zmq.Socket[bytes], port: int) -> None:
        """Reply to a pending request, if there is one. Never raises because of the request's content.

        A message without the envelope of a REQ socket gets no reply.

        Args:
            socket: Request socket.
            port: Port of the socket.
        """
        try:
            parts = socket.recv_multipart(zmq.NOBLOCK)
        except zmq.Again:
            return
        # Not a REP socket: after a request without envelope, libzmq 4.3.5 drops the next reply.
        if b"" not in parts:
            return
        end = parts.index(b"") + 1
        envelope, body = parts[:end], b"".join(parts[end:])
        try:
            request = parse_request(body, port)
            reply = encode_grant(request, self._assign_port(request))
        except RequestError as error:
            reply = encode_rejection(error)
        except Exception:  # a reply must be sent, or the port would hang for everyone
            _logger.exception("unexpected error while handling a request")
            reply = encode_rejection(RequestError("internal error of the gateway; see its log"))
        socket.send_multipart([*envelope, reply])

    def publish_members(self, members: Iterable[Member]) -> None:
        """Publish the list of all topics to tools of the original NEP."""
        if self._broadcast_socket is not None:
            self._broadcast_socket.send(encode_broadcast(members))

    def close(self) -> None:
        """Release the ports."""
        for socket in (
            *self._request_sockets.values(),
            *([self._broadcast_socket] if self._broadcast_socket is not None else []),
        ):
            socket.close(0)
        self._request_sockets.clear()
        self._broadcast_socket = None

    def _bind(self, kind: int, port: int, conflict_message: str) -> zmq.Socket[bytes] | None:
        socket = self._context.socket(kind)
        socket.setsockopt(zmq.MAXMSGSIZE, _MAX_REQUEST_BYTES)
        try:
            socket.bind(f"tcp://{LOOPBACK}:{port}")
        except zmq.ZMQError:
            socket.close(0)
            self._alerts.report(
                f"port:{port}",
                conflict_message,
                _("Close that program. It may be another master, or the AirPlay Receiver on macOS."),
            )
            return None
        self._alerts.resolve(f"port:{port}")
        return socket
