"""Wire format of service calls. Pure functions; specification: `docs/services.md`.

A native call or reply consists of two parts: a header of 16 bytes and the payload. Programs of the
original NEP send one part of JSON, which REQ and REP prefix with an empty part; their replies have no
number and arrive in the order of the calls.

The master lists servers and clients as publishers and subscribers of a topic that starts with
`SERVICE_PREFIX`, so that older masters without services also connect them.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple, Protocol

import orjson

from nep.errors import BadTopicError, WireError
from nep.i18n import _
from nep.protocol.wire import check_topic
from nep.text import bounded_str, escaped, shortened

SERVICE_PREFIX = "nep.service:"
SURVEY_PREFIX = "survey:"
"""Prefix of a survey's service name.

The master lists the survey's respondents as servers of that service.
"""
SERVICE_TYPE = "service"
"""Message type and codec under which the master lists servers and clients."""
ORIGINAL_CODEC = "original"
"""Codec of servers with `ORIGINAL` framing: programs of the original NEP that the gateway registers."""
MAX_PAYLOAD_BYTES = 64 * 2**20
"""Maximum size of a call or reply in bytes; a peer that sends more is disconnected."""

_VERSION = 1
_HEADER = struct.Struct("<BBHIQ")  # version, kind, codec, timeout_ms, number
HEADER_BYTES = _HEADER.size
_MAX_TIMEOUT_MS = 2**32 - 1
_JSON_CODEC = 1
_MAX_CLASS_LENGTH, _MAX_REASON_LENGTH = 100, 2000
_ERROR_PREFIX = b'{"nep_error":'


class CallKind(IntEnum):
    """Kind of a service frame. `REJECTED` is the reply to a call that the server did not execute."""

    CALL = 1
    REPLY = 2
    ERROR = 3
    REJECTED = 4


class Reply(NamedTuple):
    """Reply of a server: an encoded payload, or an error created by `error_reply`.

    Attributes:
        kind: Kind of the frame.
        data: Encoded payload or error.
        codec: Code of the codec on the wire.
    """

    kind: CallKind
    data: bytes | memoryview
    codec: int = _JSON_CODEC


class ReceivedCall(NamedTuple):
    """Parsed call, as a server receives it.

    Attributes:
        number: Number of the call, which the reply repeats.
        codec: Code of the codec on the wire.
        timeout_s: Time limit of the client in seconds; None for no limit.
        data: Encoded request.
    """

    number: int
    codec: int
    timeout_s: float | None
    data: bytes | memoryview


class ReceivedReply(NamedTuple):
    """Parsed reply, as a client receives it.

    Attributes:
        number: Number of the call; None for the reply to the oldest call.
        reply: The reply.
    """

    number: int | None
    reply: Reply


class Framing(Protocol):
    """Wire format of calls and replies."""

    @property
    def is_in_order(self) -> bool:
        """True if replies have no numbers and arrive in the order of the calls."""

    def encode_call(
        self, number: int, codec: int, timeout_s: float | None, data: bytes | memoryview
    ) -> list[bytes | memoryview]:
        """Encode a call.

        Args:
            number: Number of the call, which the reply repeats.
            codec: Code of the codec on the wire.
            timeout_s: Time limit of the client in seconds; None for no limit.
            data: Encoded request.
        """

    def read_call(self, parts: Sequence[bytes | memoryview]) -> ReceivedCall:
        """Parse a call. Raises `WireError`."""

    def encode_reply(self, number: int, reply: Reply) -> list[bytes | memoryview]:
        """Encode a reply to the call with this number."""

    def read_reply(self, parts: Sequence[bytes | memoryview]) -> ReceivedReply:
        """Parse a reply. Raises `WireError`."""


class _NativeFraming:
    is_in_order = False

    def encode_call(
        self, number: int, codec: int, timeout_s: float | None, data: bytes | memoryview
    ) -> list[bytes | memoryview]:
        # 0 means no limit, so shorter limits are rounded up to 1 ms
        limit_ms = 0 if timeout_s is None else max(1, min(_MAX_TIMEOUT_MS, round(timeout_s * 1000)))
        return [_HEADER.pack(_VERSION, CallKind.CALL, codec, limit_ms, number), data]

    def read_call(self, parts: Sequence[bytes | memoryview]) -> ReceivedCall:
        kind, codec, limit_ms, number, data = _read_frame(parts)
        if kind != CallKind.CALL:
            raise WireError(_("not a service call"), code="call-kind")
        return ReceivedCall(number, codec, limit_ms / 1000 if limit_ms else None, data)

    def encode_reply(self, number: int, reply: Reply) -> list[bytes | memoryview]:
        return [_HEADER.pack(_VERSION, reply.kind, reply.codec, 0, number), reply.data]

    def read_reply(self, parts: Sequence[bytes | memoryview]) -> ReceivedReply:
        kind, codec, _limit, number, data = _read_frame(parts)
        if kind not in {CallKind.REPLY, CallKind.ERROR, CallKind.REJECTED}:
            raise WireError(_("not a service reply"), code="call-kind")
        return ReceivedReply(number, Reply(CallKind(kind), data, codec))


def _read_frame(parts: Sequence[bytes | memoryview]) -> tuple[int, int, int, int, bytes | memoryview]:
    if len(parts) != 2 or len(parts[0]) != _HEADER.size:
        reason = _("a call must have two parts, the first of {size} bytes").format(size=_HEADER.size)
        raise WireError(reason, code="call-parts")
    version, kind, codec, limit_ms, number = _HEADER.unpack(parts[0])
    if version != _VERSION:
        raise WireError(
            _("unsupported version {version} of the service protocol; update nep").format(version=version),
            code="call-version",
        )
    return kind, codec, limit_ms, number, parts[1]


def split_frame(frame: bytes) -> list[bytes]:
    """Split a call or reply of the native framing, joined in one frame, into its parts."""
    return [frame[:HEADER_BYTES], frame[HEADER_BYTES:]]


class _OriginalFraming:
    is_in_order = True

    def encode_call(
        self,
        number: int,  # noqa: ARG002 - not in this format
        codec: int,  # noqa: ARG002 - always JSON
        timeout_s: float | None,  # noqa: ARG002 - not in this format
        data: bytes | memoryview,
    ) -> list[bytes | memoryview]:
        return [b"", data]

    def read_call(self, parts: Sequence[bytes | memoryview]) -> ReceivedCall:
        return ReceivedCall(0, _JSON_CODEC, None, _single_part(parts))

    # not in this format
    def encode_reply(self, number: int, reply: Reply) -> list[bytes | memoryview]:  # noqa: ARG002
        return [b"", reply.data]

    def read_reply(self, parts: Sequence[bytes | memoryview]) -> ReceivedReply:
        data = _single_part(parts)
        is_failure = bytes(data[: len(_ERROR_PREFIX)]) == _ERROR_PREFIX
        name, _reason = read_error_reply(data) if is_failure else ("", "")
        kind = CallKind.REPLY if not is_failure else CallKind.ERROR if name else CallKind.REJECTED
        return ReceivedReply(None, Reply(kind, data))


def _single_part(parts: Sequence[bytes | memoryview]) -> bytes | memoryview:
    if len(parts) != 2 or len(parts[0]):
        raise WireError(
            _("a REQ or REP message needs an empty part followed by the payload"), code="call-parts"
        )
    return parts[1]


NATIVE: Framing = _NativeFraming()
"""Framing with a header and a payload."""
ORIGINAL: Framing = _OriginalFraming()
"""Framing of the original NEP's `client` and `server`: JSON over REQ and REP."""


def error_reply(kind: CallKind, name: str, reason: str) -> Reply:
    """Return an error reply.

    Args:
        kind: `ERROR` or `REJECTED`.
        name: Class name of the exception; "" for `REJECTED`.
        reason: Message of the exception.
    """
    # lone surrogates become "?"
    content = {
        "nep_error": _bounded_text(name, _MAX_CLASS_LENGTH),
        "reason": _bounded_text(reason, _MAX_REASON_LENGTH),
    }
    return Reply(kind, orjson.dumps(content))


def _bounded_text(text: str, max_length: int) -> str:
    return shortened(text, max_length).encode("utf-8", "replace").decode()


def read_error_reply(data: bytes | memoryview) -> tuple[str, str]:
    """Return the class name and message of an error reply. Accepts any untrusted data."""
    try:
        content = orjson.loads(data)
    except ValueError:
        content = None
    if not isinstance(content, dict):
        return "", _("the reason can't be read")
    name, reason = content.get("nep_error", ""), content.get("reason", "")
    return escaped(bounded_str(name, _MAX_CLASS_LENGTH)), escaped(bounded_str(reason, _MAX_REASON_LENGTH))


def check_service(name: str) -> str:
    """Validate a service name and return it. Raises `BadTopicError`."""
    check_topic(name)
    if name.startswith(SERVICE_PREFIX):
        raise BadTopicError(name, _("omit '{prefix}'; nep adds it").format(prefix=SERVICE_PREFIX))
    if name.startswith(SURVEY_PREFIX):
        raise BadTopicError(
            name, _("names that start with '{prefix}' are reserved for surveys").format(prefix=SURVEY_PREFIX)
        )
    check_topic(topic_of(name))
    return name


def check_survey(name: str) -> str:
    """Validate the name of a survey and return the name of its service. Raises `BadTopicError`."""
    check_service(name)
    check_topic(topic_of(f"{SURVEY_PREFIX}{name}"))
    return f"{SURVEY_PREFIX}{name}"


def topic_of(service: str) -> str:
    """Return the topic under which the master lists the servers and clients of a service."""
    return f"{SERVICE_PREFIX}{service}"


def service_of(topic: str) -> str | None:
    """Return the service that is listed under a topic, or None for any other topic."""
    return (
        topic.removeprefix(SERVICE_PREFIX)
        if topic.startswith(SERVICE_PREFIX) and len(topic) > len(SERVICE_PREFIX)
        else None
    )
