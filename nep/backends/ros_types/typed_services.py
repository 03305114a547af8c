"""Typed services, as in ROS: conversion between codec data and typed request and response bodies.

Requests and responses of ROS service types are maps. Calls between nep nodes use a type that needs no
installation:

    uint16 codec
    uint32 timeout_ms
    uint8[] data
    ---
    uint8 kind
    uint16 codec
    uint8[] data

The fields are:

- `codec`: 1 (JSON) or 4 (msgpack)
- `timeout_ms`: timeout of the call in milliseconds; 0 waits forever
- `kind`: 2 (reply), 3 (error) or 4 (rejected)
- `data`: payload; of an error, the JSON that docs/services.md describes
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from nep.errors import DecodeError, WireError
from nep.i18n import _
from nep.messages.codecs import CODECS, Codec, codec_by_number
from nep.protocol.service_wire import CallKind, Reply

CALL_REQUEST = "uint16 codec\nuint32 timeout_ms\nuint8[] data"
CALL_RESPONSE = "uint8 kind\nuint16 codec\nuint8[] data"
_KINDS = (CallKind.REPLY, CallKind.ERROR, CallKind.REJECTED)
_MAX_TIMEOUT_MS = 2**32 - 1


class DecodedCall(NamedTuple):
    """Decoded request for a nep server.

    Attributes:
        data: Encoded payload.
        codec: Number of the codec of `data`.
        timeout_s: Timeout of the client in seconds; None if the client waits forever.
    """

    data: bytes | memoryview
    codec: int
    timeout_s: float | None


class BodyCodec(Protocol):
    """Codec for a request or response body, which converts between maps and bytes."""

    def encode(self, payload: Any) -> bytes:  # noqa: ANN401 - any payload
        """Encode a map. Raises `EncodeError`."""

    def decode(self, data: bytes) -> dict[str, Any]:
        """Decode a body to a map. Raises `DecodeError`."""


@dataclass(frozen=True)
class TypedService:
    """Service type with its request and response codecs.

    Attributes:
        name: Name of the service type.
        request: Codec of request bodies.
        response: Codec of response bodies.
        is_nep: True for the type described in the module docstring, whose fields are a codec number and
            data.
    """

    name: str
    request: BodyCodec
    response: BodyCodec
    is_nep: bool = False

    # ---- for clients

    def encode_call(self, codec: Codec, data: bytes | memoryview, timeout_s: float | None) -> bytes:
        """Convert an encoded request to a request body. Raises `EncodeError` or `DecodeError`.

        Args:
            codec: Codec of `data`.
            data: Encoded request.
            timeout_s: Timeout of the call in seconds; None waits forever.
        """
        if not self.is_nep:
            return self.request.encode(codec.decode(data, {}))
        limit_ms = 0 if timeout_s is None else max(1, min(_MAX_TIMEOUT_MS, round(timeout_s * 1000)))
        return self.request.encode({"codec": codec.number, "timeout_ms": limit_ms, "data": bytes(data)})

    def decode_reply(self, body: bytes, codec: Codec) -> Reply:
        """Convert a response body to a reply.

        Args:
            body: Response body.
            codec: Codec for the data of the reply, if the service type is a ROS type.

        Raises:
            DecodeError: The body is malformed.
            EncodeError: The codec can't encode the response.
        """
        response = self.response.decode(body)
        if not self.is_nep:
            return Reply(CallKind.REPLY, codec.encode(response).data, codec.number)
        kind, number, data = response["kind"], response["codec"], response["data"]
        reply_kind = next((each for each in _KINDS if each == kind), None)
        if reply_kind is None or not isinstance(number, int) or not isinstance(data, bytes):
            raise WireError(_("not a service reply"), len(body))
        return Reply(reply_kind, data, number)

    # ---- for servers

    def decode_call(self, body: bytes) -> DecodedCall:
        """Decode a request body. Raises `DecodeError`.

        A request of a ROS type is converted to msgpack, which supports bytes and NaN.
        """
        request = self.request.decode(body)
        if not self.is_nep:
            codec = CODECS["msgpack"]
            return DecodedCall(codec.encode(request).data, codec.number, None)
        number, limit_ms, data = request["codec"], request["timeout_ms"], request["data"]
        if not isinstance(number, int) or not isinstance(limit_ms, int) or not isinstance(data, bytes):
            raise WireError(_("not a service call"), len(body))
        return DecodedCall(data, number, limit_ms / 1000 if limit_ms else None)

    def encode_reply(self, reply: Reply) -> bytes:
        """Convert a reply to a response body.

        Raises:
            DecodeError: The reply to a call of a ROS type is an error, or its data can't be decoded.
            EncodeError: The response type can't represent the payload.
        """
        if self.is_nep:
            kind, data = int(reply.kind), bytes(reply.data)
            return self.response.encode({"kind": kind, "codec": reply.codec, "data": data})
        codec = codec_by_number(reply.codec)
        if codec is None or reply.kind != CallKind.REPLY:
            raise DecodeError(self.name, len(reply.data), _("not a service reply"))
        return self.response.encode(codec.decode(reply.data, {}))
