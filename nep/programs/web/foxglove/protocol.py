"""Parsing and encoding of the messages of Foxglove's WebSocket protocol. Performs no I/O.

Text messages from a client start with "{", binary messages with the byte 1 or 2.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import NamedTuple

import orjson

from nep.errors import NepError
from nep.i18n import _
from nep.messages.nesting import is_json_too_deep
from nep.programs.web.outgoing import Frame

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
CAPABILITIES = ("clientPublish", "services", "connectionGraph")
ENCODING = "json"
"""Encoding of messages published by clients, and of requests and responses of services."""
MAX_ID = 2**32 - 1
_MESSAGE_DATA = struct.Struct("<BIQ")
"""Header of a message: opcode 1, subscription id, log time in nanoseconds."""
_RESPONSE = struct.Struct("<BIII")
"""Header of a service response: opcode 3, service id, call id, length of the encoding's name."""
_CLIENT_MESSAGE = struct.Struct("<BI")
_SERVICE_REQUEST = struct.Struct("<BIII")


def is_offered(subprotocols: Iterable[str]) -> bool:
    """Return True if the values of the header ``Sec-WebSocket-Protocol`` include Foxglove's protocol."""
    return any(each.strip() in SUBPROTOCOLS for each in ",".join(subprotocols).split(","))


class ClientMessage(NamedTuple):
    """Message published by a client.

    Attributes:
        channel_id: Id of the channel that the client advertised.
        data: Encoded message.
    """

    channel_id: int
    data: bytes


class ServiceRequest(NamedTuple):
    """Service call of a client.

    Attributes:
        service_id: Id of the advertised service.
        call_id: Id of the call, chosen by the client.
        encoding: Encoding of the request.
        data: Encoded request.
    """

    service_id: int
    call_id: int
    encoding: str
    data: bytes


def parse(data: bytes) -> ClientMessage | ServiceRequest | Mapping[str, object]:
    """Parse a message from a client. Raises `NepError` if the message is malformed.

    Returns:
        A `ClientMessage` or `ServiceRequest` for a binary message, the fields of a JSON message.
    """
    if data[:1] == b"\x01" and len(data) >= _CLIENT_MESSAGE.size:
        return ClientMessage(_CLIENT_MESSAGE.unpack_from(data)[1], data[_CLIENT_MESSAGE.size :])
    if data[:1] == b"\x02" and len(data) >= _SERVICE_REQUEST.size:
        _opcode, service_id, call_id, length = _SERVICE_REQUEST.unpack_from(data)
        begin = _SERVICE_REQUEST.size
        encoding = data[begin : begin + length].decode("utf-8", "replace")
        return ServiceRequest(service_id, call_id, encoding, data[begin + length :])
    if not is_json_too_deep(data):
        with suppress(json.JSONDecodeError):  # the base class of orjson's error
            fields = orjson.loads(data)
            if isinstance(fields, dict):
                return fields
    raise NepError(_("this isn't a message of Foxglove's WebSocket protocol"))


def as_list(value: object) -> list[object]:
    """Return `value` if it is a list, else an empty list."""
    return value if isinstance(value, list) else []


def control_frame(fields: Mapping[str, object]) -> Frame:
    """Encode a JSON message to a client."""
    return Frame(orjson.dumps(fields), is_text=True)


def message_frame(subscription_id: int, log_ns: int, data: bytes) -> Frame:
    """Encode a message of a topic for a client.

    Args:
        subscription_id: Id of the client's subscription.
        log_ns: Time of receipt in ns since 1970.
        data: Encoded message.
    """
    return Frame(_MESSAGE_DATA.pack(1, subscription_id, log_ns) + data, is_text=False)


def response_frame(service_id: int, call_id: int, data: bytes) -> Frame:
    """Encode the response to a service call.

    Args:
        service_id: Id of the advertised service.
        call_id: Id of the call.
        data: Response in the encoding `ENCODING`.
    """
    header = _RESPONSE.pack(3, service_id, call_id, len(ENCODING)) + ENCODING.encode()
    return Frame(header + data, is_text=False)
