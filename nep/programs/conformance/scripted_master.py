"""Simulated master that records all requests and can modify its replies.

Its state is a `nep.masters.graph.Graph`, like that of the real master, but without a clock: a lease
doesn't expire until a rule calls `ScriptedMaster.expire_lease`.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import msgpack  # type: ignore[import-untyped]
import zmq

from nep.errors import WireError
from nep.masters.graph import Graph, OutgoingMessage
from nep.programs.conformance.ports import bind_again
from nep.protocol.encoding import decode_request, encode_reply
from nep.protocol.requests import (
    NodeRecord,
    PublisherAdded,
    PublisherRecord,
    RejectedReply,
    RemotePublisher,
    Request,
)

PEER = "peer"
"""Route of the tester's own nodes."""


@dataclass(frozen=True)
class RecordedRequest:
    """Received request.

    Attributes:
        at: Time of arrival (monotonic, s).
        sender: Route of the sender.
        do: Name of the request.
        call: Number of the call; 0 if invalid.
        fields: Content of the request.
        problem: Reason why the request is malformed; "" if it is valid.
    """

    at: float
    sender: str
    do: str = ""
    call: int = 0
    fields: dict[str, Any] = field(default_factory=dict)
    problem: str = ""


ReplyFilter = Callable[[RecordedRequest, dict[str, Any]], "dict[str, Any] | None"]
"""Function that returns a modified reply to a request, or None to send no reply."""


class ScriptedMaster:
    """Simulated master on a free port of 127.0.0.1. Call `pump` to process requests.

    Args:
        context: ZeroMQ context.
        on_push: Called with each message that is pushed to one of the tester's nodes.
    """

    def __init__(self, context: zmq.Context[Any], on_push: Callable[[OutgoingMessage], None]) -> None:
        self._context = context
        self._on_push = on_push
        self.received: list[RecordedRequest] = []
        self.reply_filter: ReplyFilter = lambda _request, reply: reply
        self.port = 0
        self._socket: zmq.Socket[bytes] | None = None
        self.start()

    @property
    def address(self) -> str:
        """Address of the master."""
        return f"127.0.0.1:{self.port}"

    @property
    def sockets(self) -> list[zmq.Socket[bytes]]:
        """Sockets to be polled; empty while the master is stopped."""
        return [] if self._socket is None else [self._socket]

    def start(self) -> None:
        """Bind with a new epoch and an empty graph. A restarted master binds to the same port."""
        self.graph = Graph(secrets.randbits(62) | 1, 0.0, learn_s=0.0)
        self._socket = self._context.socket(zmq.ROUTER)
        self._socket.linger = 0
        self._socket.router_mandatory = 1
        if self.port:
            bind_again(self._socket, f"tcp://127.0.0.1:{self.port}")
        else:
            self.port = self._socket.bind_to_random_port("tcp://127.0.0.1")

    def stop(self) -> None:
        """Close the socket, as if no master were running."""
        if self._socket is not None:
            self._socket.close(0)
            self._socket = None

    def pump(self) -> None:
        """Reply to all pending requests."""
        while self._socket is not None and self._socket.poll(0):
            sender, *parts = self._socket.recv_multipart()
            self._serve(sender.decode("utf-8", "surrogateescape"), parts)

    def submit(self, request: Request) -> None:
        """Execute a request of one of the tester's nodes. Raises `WireError` if it is rejected."""
        for message in self.graph.apply(request, 1, 0.0, PEER):
            if isinstance(message.body, RejectedReply):
                raise WireError(message.body.reason)
            if message.call is None:
                self._push(message)

    def expire_lease(self, node_id: str) -> None:
        """Remove a node from the graph, as if its lease had expired."""
        for message in self.graph.unregister_nodes([node_id]):
            self._push(message)

    def repeat_pushes(self, node_id: str, record: PublisherRecord, node: NodeRecord) -> None:
        """Push a publisher to the adapter's node two more times.

        Args:
            node_id: Id of the adapter's node.
            record: Record of the publisher.
            node: Node of the publisher.
        """
        notification = PublisherAdded(
            self.graph.epoch, self.graph.revision, RemotePublisher(record, node.id, node.name)
        )
        for _turn in range(2):
            self.push(node_id, encode_reply(notification))

    def push(self, node_id: str, body: bytes) -> None:
        """Send an encoded message to the adapter's node, even an invalid one."""
        member = self.graph.members.get(node_id)
        if member is not None and member.route != PEER:
            self._send(member.route, body)

    def _serve(self, sender: str, parts: list[bytes]) -> None:
        body = parts[-1]
        request = _parse_request(sender, parts)
        self.received.append(request)
        decoded = decode_request(body)
        if isinstance(decoded.request, WireError):
            epoch, revision = self.graph.epoch, self.graph.revision
            error = decoded.request
            self._reply(
                request,
                OutgoingMessage(
                    sender, RejectedReply(epoch, revision, error.reason, error.code), request.call
                ),
            )
            return
        for message in self.graph.apply(decoded.request, decoded.call, 0.0, sender, is_foreign=True):
            if message.call is None:
                self._push(message)
            else:
                self._reply(request, message)

    def _reply(self, request: RecordedRequest, message: OutgoingMessage) -> None:
        encoded = encode_reply(message.body, message.call or 0)
        reply = self.reply_filter(request, msgpack.unpackb(encoded, strict_map_key=False))
        if reply is not None:
            self._send(message.to, msgpack.packb(reply))

    def _push(self, message: OutgoingMessage) -> None:
        member = self.graph.members.get(message.to)
        if member is None:
            return
        if member.route == PEER:
            self._on_push(message)
        else:
            self._send(member.route, encode_reply(message.body))

    def _send(self, route: str, body: bytes) -> None:
        if self._socket is None:
            return
        with suppress(zmq.ZMQError):  # connection closed
            self._socket.send_multipart([route.encode("utf-8", "surrogateescape"), body])


def _parse_request(sender: str, parts: list[bytes]) -> RecordedRequest:
    now = time.monotonic()
    if len(parts) != 1:
        return RecordedRequest(now, sender, problem=f"{len(parts)} parts")
    try:
        body = msgpack.unpackb(parts[0], strict_map_key=False)
    except ValueError:
        return RecordedRequest(now, sender, problem="not msgpack")
    if not isinstance(body, dict):
        return RecordedRequest(now, sender, problem="not a map")
    do, call, fields = body.get("do"), body.get("call"), body.get("what", {})
    if not isinstance(do, str) or not isinstance(fields, dict):
        return RecordedRequest(now, sender, problem=f"do: {type(do).__name__}, what: {type(fields).__name__}")
    if type(call) is not int or call < 1:
        return RecordedRequest(now, sender, do, 0, fields, f"call: {call!r}")
    return RecordedRequest(now, sender, do, call, fields)
