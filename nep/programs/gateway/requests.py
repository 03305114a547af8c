"""Format of the requests, replies and broadcasts of the original NEP's master. Performs no I/O."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from nep.messages.codecs import codec_for
from nep.programs.gateway.framing import PORT_B, Framing, framing_of

Mode = Literal["many2many", "one2many", "many2one"]
Role = Literal["publisher", "subscriber"]

LOOPBACK = "127.0.0.1"
MAX_REQUEST_BYTES = 64 * 1024
MAX_NAME_BYTES = 200
_TOPIC_SOCKETS = frozenset({"publisher", "subscriber"})
_SERVICE_SOCKETS = frozenset({"client", "server", "surveyor", "respondent"})
_MODES: Mapping[str, Mode] = {"many2many": "many2many", "one2many": "one2many", "many2one": "many2one"}


class RequestError(ValueError):
    """Error for a request that can't be granted.

    Args:
        message: Reason of the rejection.
        topic: Requested topic, if known.
    """

    def __init__(self, message: str, topic: object = None) -> None:
        super().__init__(message)
        self.topic = topic


@dataclass(frozen=True)
class Request:
    """Request of an original program for the port of a topic or service.

    Attributes:
        node: Name of the program's node.
        topic: Name of the topic or service.
        socket: Kind of socket: "publisher", "subscriber", "client", "server", "surveyor" or "respondent".
        mode: Connection mode: "many2many", "one2many" (the publisher binds) or "many2one" (the subscriber
            binds).
        msg_type: Message type of the original NEP.
        pid: Process id, if known.
        request_port: Port to which the request was sent.
        language: Programming language, if known.
    """

    node: str
    topic: str
    socket: str
    mode: Mode
    msg_type: str
    pid: int | None
    request_port: int
    language: str | None

    @property
    def generation(self) -> str:
        """Wire generation of the program: "A" or "B", which are incompatible."""
        return "B" if self.request_port == PORT_B else "A"

    @property
    def framing(self) -> Framing:
        """Frame format of the program: "prefixed" or "bare"."""
        return framing_of(self.request_port, self.msg_type)

    @property
    def codec(self) -> str:
        """Native codec that corresponds to the requested message type."""
        return codec_for(self.msg_type).name

    @property
    def is_service(self) -> bool:
        """True if the request is for a service port, whose bytes are not converted."""
        return self.socket in _SERVICE_SOCKETS


def parse_request(data: bytes, request_port: int) -> Request:
    """Parse a request.

    Args:
        data: Request as JSON.
        request_port: Port to which the request was sent.

    Raises:
        RequestError: The request is too large, isn't a JSON object, or has a missing or invalid field.
    """
    if len(data) > MAX_REQUEST_BYTES:
        raise RequestError(f"the request has {len(data)} bytes; at most {MAX_REQUEST_BYTES} are allowed")
    try:
        fields = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise RequestError("the request is not JSON") from error
    if not isinstance(fields, dict):
        raise RequestError("the request is not a JSON object")
    topic = fields.get("topic")
    return Request(
        node=_name(fields, "node", topic),
        topic=_name(fields, "topic", topic),
        socket=_choice(fields, "socket", _TOPIC_SOCKETS | _SERVICE_SOCKETS, topic),
        mode=_MODES[_choice(fields, "mode", frozenset(_MODES), topic, default="many2many")],
        msg_type=_choice(fields, "msg_type", None, topic, default="json"),
        pid=_pid(fields.get("pid")),
        request_port=request_port,
        language=_language(fields),
    )


def encode_grant(request: Request, port: int) -> bytes:
    """Encode the reply that assigns `port`, in the format that original programs expect."""
    reply: dict[str, object] = {"topic": request.topic, "port": port}
    if not request.is_service:
        reply["mode"] = request.mode
    return _encode_json({**reply, "ip": LOOPBACK, "socket": request.socket, "state": "success"})


def encode_rejection(error: RequestError) -> bytes:
    """Encode the reply to a rejected request.

    Original programs evaluate only `state`; `error` is a description for the reader of a log.
    """
    return _encode_json({"topic": error.topic, "state": "failure", "error": str(error)})


@dataclass(frozen=True)
class Member:
    """Program on a topic, as listed in the broadcast.

    Attributes:
        topic: Name of the topic or service.
        node: Name of the program's node.
        port: Base port of the line.
        socket: Kind of socket.
        mode: Connection mode; None for a service.
        msg_type: Message type of the original NEP.
        pid: Process id, if known.
    """

    topic: str
    node: str
    port: int
    socket: str
    mode: Mode | None
    msg_type: str
    pid: int | None


def encode_broadcast(members: Iterable[Member]) -> bytes:
    """Encode the list of all topics and their nodes, with the prefix "master ", for port 7777."""
    topics: dict[str, dict[str, object]] = {}
    nodes: dict[str, dict[str, object]] = {}
    for member in members:
        if member.topic not in topics:
            nodes[member.topic] = {}
            description: dict[str, object] = {"port": member.port, "socket": member.socket, "ip": LOOPBACK}
            if member.mode is not None:
                description["mode"] = member.mode
            topics[member.topic] = {**description, "msg_type": member.msg_type, "nodes": nodes[member.topic]}
        nodes[member.topic][member.node] = {"socket": member.socket, "pid": member.pid, "ip": LOOPBACK}
    return b"master " + _encode_json(topics)


def _encode_json(value: object) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode("ascii")


def _name(fields: Mapping[str, object], key: str, topic: object) -> str:
    value = fields.get(key)
    if not isinstance(value, str) or not value:
        raise RequestError(f"the request has no '{key}'", topic)
    try:
        size = len(value.encode())
    except UnicodeEncodeError as error:
        raise RequestError(f"the '{key}' of the request is not text", topic) from error
    if size > MAX_NAME_BYTES:
        raise RequestError(
            f"the '{key}' of the request has {size} bytes; at most {MAX_NAME_BYTES} are allowed", topic
        )
    return value


def _choice(
    fields: Mapping[str, object],
    key: str,
    allowed: frozenset[str] | None,
    topic: object,
    default: str | None = None,
) -> str:
    value = fields.get(key, default)
    if not isinstance(value, str):
        raise RequestError(f"the request has no '{key}'", topic)
    if len(value) > MAX_NAME_BYTES:
        raise RequestError(
            f"the '{key}' of the request has {len(value)} characters; at most {MAX_NAME_BYTES} are allowed",
            topic,
        )
    if allowed is not None and value not in allowed:
        raise RequestError(f"unknown {key} '{value[:40]}'; use one of {', '.join(sorted(allowed))}", topic)
    return value


def _pid(value: object) -> int | None:
    if isinstance(value, bool):
        return None
    if isinstance(value, str) and value.isascii() and value.isdigit() and len(value) < 12:
        value = int(value)
    return value if isinstance(value, int) and 0 < value < 2**31 else None


def _language(fields: Mapping[str, object]) -> str | None:
    # Only C# sends its pid as text, and only C++ sends its language.
    language = fields.get("language")
    if isinstance(language, str):
        return language[:20].lower()
    pid = fields.get("pid")
    return "csharp" if isinstance(pid, str) and pid.isascii() and pid.isdigit() else None
