"""Types of ROS services: requests and answers of nep's in bodies of ROS messages, and back.

A service of a type of ROS ("std_srvs/SetBool") has maps for requests and answers. Where nep itself calls nep
it is `nep_msgs/Call`, which is installed nowhere:

    uint16 codec
    uint32 timeout_ms
    uint8[] data
    ---
    uint8 kind
    uint16 codec
    uint8[] data

`codec` is 1 (JSON) or 4 (msgpack), `timeout_ms` 0 for ever, `kind` 2 an answer, 3 an error, 4 refused; `data`
of an error is JSON, see docs/services.md.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import NamedTuple

from nep.backends.ros.carried import is_ros_type, not_installed
from nep.backends.ros.definition import Definition, parse
from nep.backends.ros.library import service_texts
from nep.errors import DecodeError, NepError, WireError
from nep.i18n import _
from nep.messages.codecs import CODECS, Codec, codec_numbered
from nep.protocol.service_wire import CallKind, Reply

__all__ = ["NEP_CALL", "AskedCall", "ServiceType", "installed_service", "served_type"]

_REQUEST = "uint16 codec\nuint32 timeout_ms\nuint8[] data"
_ANSWER = "uint8 kind\nuint16 codec\nuint8[] data"
_KINDS = (CallKind.ANSWER, CallKind.ERROR, CallKind.REFUSED)
_TIMEOUT_MAX_MS = 2**32 - 1
_types: dict[str, ServiceType] = {}


class AskedCall(NamedTuple):
    """A request as a server of nep's reads it."""

    data: bytes | memoryview
    codec: int
    timeout_s: float | None


@dataclass(frozen=True)
class ServiceType:
    """A type of services: its definitions, and their checksum."""

    name: str
    md5sum: str
    request: Definition
    answer: Definition

    # ---- for clients

    def body_of_call(self, codec: Codec, data: bytes | memoryview, timeout_s: float | None) -> bytes:
        """A request, which has bytes of a codec. Raises `EncodeError`, `DecodeError`."""
        if self is not NEP_CALL:
            return self.request.encode(codec.decode(data, {}))
        limit_ms = 0 if timeout_s is None else max(1, min(_TIMEOUT_MAX_MS, round(timeout_s * 1000)))
        return self.request.encode({"codec": codec.number, "timeout_ms": limit_ms, "data": bytes(data)})

    def reply_in(self, body: bytes, codec: Codec) -> Reply:
        """An answer as bytes of a codec. Raises `DecodeError`, and `EncodeError` for what has none of it."""
        answer = self.answer.decode(body)
        if self is not NEP_CALL:
            return Reply(CallKind.ANSWER, codec.encode(answer).data, codec.number)
        kind, number, data = answer["kind"], answer["codec"], answer["data"]
        found = next((each for each in _KINDS if each == kind), None)
        if found is None or not isinstance(number, int) or not isinstance(data, bytes):
            raise WireError(_("it is no answer of a service"), len(body))
        return Reply(found, data, number)

    # ---- for servers

    def call_in(self, body: bytes) -> AskedCall:
        """A request; one of a type of ROS becomes msgpack, which has bytes and NaN. Raises `DecodeError`."""
        asked = self.request.decode(body)
        if self is not NEP_CALL:
            codec = CODECS["msgpack"]
            return AskedCall(codec.encode(asked).data, codec.number, None)
        number, limit_ms, data = asked["codec"], asked["timeout_ms"], asked["data"]
        if not isinstance(number, int) or not isinstance(limit_ms, int) or not isinstance(data, bytes):
            raise WireError(_("it is no call of a service"), len(body))
        return AskedCall(data, number, limit_ms / 1000 if limit_ms else None)

    def body_of_reply(self, reply: Reply) -> bytes:
        """An answer; a failure only in `nep_msgs/Call`. Raises `EncodeError` for what is no such answer."""
        if self is NEP_CALL:
            kind, data = int(reply.kind), bytes(reply.data)
            return self.answer.encode({"kind": kind, "codec": reply.codec, "data": data})
        codec = codec_numbered(reply.codec)
        if codec is None or reply.kind != CallKind.ANSWER:
            raise DecodeError(self.name, len(reply.data), _("it is no answer of a service"))
        return self.answer.encode(codec.decode(reply.data, {}))


NEP_CALL = ServiceType(
    "nep_msgs/Call",
    hashlib.md5((_REQUEST + _ANSWER).encode(), usedforsecurity=False).hexdigest(),  # as ROS computes it
    parse("nep_msgs/CallRequest", _REQUEST),
    parse("nep_msgs/CallResponse", _ANSWER),
)


def installed_service(name: str) -> ServiceType:
    """A type of ROS, or `nep_msgs/Call`. Raises `NepError` that says what to install."""
    if name == NEP_CALL.name:
        return NEP_CALL
    if name not in _types:
        found = service_texts(name)
        if found is None:
            raise not_installed(name, _("ROS service"))
        request = parse(f"{name}Request", found.request)
        _types[name] = ServiceType(name, found.md5sum, request, parse(f"{name}Response", found.answer))
    return _types[name]


def served_type(msg_type: str) -> ServiceType:
    """The type of a server that is made for `msg_type`. Raises `NepError`."""
    if is_ros_type(msg_type):
        return installed_service(msg_type)
    if msg_type not in {"json", "msgpack"}:
        raise NepError(
            _("a service of ROS cannot have the type '{name}'; use one such as 'std_srvs/SetBool'").format(
                name=msg_type
            )
        )
    return NEP_CALL
