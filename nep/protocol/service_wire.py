"""The wire of services: calls and answers ↔ parts. Pure functions; the specification is `docs/services.md`.

A native call or answer is two parts: a header of 16 bytes and the payload. Programs of the original NEP send
one part of JSON, which REQ and REP put an empty part before; their answers carry no number and come in the
order of the calls.

The master lists servers and clients of a service as publishers and subscribers of a topic whose name begins
with `PREFIX`. So masters that know nothing of services let them find each other, too.
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

__all__ = [
    "HEADER_BYTES",
    "NATIVE",
    "ORIGINAL",
    "ORIGINAL_CODEC",
    "PAYLOAD_MAX_BYTES",
    "PREFIX",
    "SERVICE_TYPE",
    "SURVEY",
    "CallHeader",
    "CallKind",
    "Framing",
    "ReadAnswer",
    "Reply",
    "check_service",
    "check_survey",
    "failure",
    "read_failure",
    "service_of",
    "topic_of",
]

PREFIX = "nep.service:"
SURVEY = "survey:"
"""Before a survey's name: its respondents are listed as the servers of a service that is called so."""
SERVICE_TYPE = "service"
"""Type and codec under which the master lists servers and clients."""
ORIGINAL_CODEC = "original"
"""Codec of servers that speak `ORIGINAL`: programs of the original NEP, listed by the gateway."""
PAYLOAD_MAX_BYTES = 64 * 2**20
"""Whoever sends a larger call or answer is disconnected."""

_VERSION = 1
_HEADER = struct.Struct("<BBHIQ")  # version, kind, codec, timeout_ms, number
HEADER_BYTES = _HEADER.size
_TIMEOUT_MAX_MS = 2**32 - 1
_JSON = 1
_CLASS_LETTERS, _REASON_LETTERS = 100, 2000
_FAILURE = b'{"nep_error":'


class CallKind(IntEnum):
    """What two parts are. REFUSED: the server did not carry the call out."""

    CALL = 1
    ANSWER = 2
    ERROR = 3
    REFUSED = 4


class Reply(NamedTuple):
    """What a server gives back: the payload of an answer, or a `failure`."""

    kind: CallKind
    data: bytes | memoryview
    codec: int = _JSON


class CallHeader(NamedTuple):
    """A call as a server reads it: who waits, and for how long (None: for ever)."""

    number: int
    codec: int
    timeout_s: float | None
    data: bytes | memoryview


class ReadAnswer(NamedTuple):
    """An answer as a client reads it; `number` is None when it answers the oldest call."""

    number: int | None
    reply: Reply


class Framing(Protocol):
    """How calls and answers become parts."""

    @property
    def in_order(self) -> bool:
        """Whether answers have no numbers and come in the order of the calls."""

    def call(
        self, number: int, codec: int, timeout_s: float | None, data: bytes | memoryview
    ) -> list[bytes | memoryview]:
        """The parts of a call."""

    def read_call(self, parts: Sequence[bytes | memoryview]) -> CallHeader:
        """A call from its parts. Raises `WireError`."""

    def answer(self, number: int, reply: Reply) -> list[bytes | memoryview]:
        """The parts of an answer."""

    def read_answer(self, parts: Sequence[bytes | memoryview]) -> ReadAnswer:
        """An answer from its parts. Raises `WireError`."""


class _Native:
    in_order = False

    def call(
        self, number: int, codec: int, timeout_s: float | None, data: bytes | memoryview
    ) -> list[bytes | memoryview]:
        # 0 is none: who waits for less than a millisecond waits for one.
        limit_ms = 0 if timeout_s is None else max(1, min(_TIMEOUT_MAX_MS, round(timeout_s * 1000)))
        return [_HEADER.pack(_VERSION, CallKind.CALL, codec, limit_ms, number), data]

    def read_call(self, parts: Sequence[bytes | memoryview]) -> CallHeader:
        kind, codec, limit_ms, number, data = _read(parts)
        if kind != CallKind.CALL:
            raise WireError(_("it is no call of a service"), code="call-kind")
        return CallHeader(number, codec, limit_ms / 1000 if limit_ms else None, data)

    def answer(self, number: int, reply: Reply) -> list[bytes | memoryview]:
        return [_HEADER.pack(_VERSION, reply.kind, reply.codec, 0, number), reply.data]

    def read_answer(self, parts: Sequence[bytes | memoryview]) -> ReadAnswer:
        kind, codec, _limit, number, data = _read(parts)
        if kind not in {CallKind.ANSWER, CallKind.ERROR, CallKind.REFUSED}:
            raise WireError(_("it is no answer of a service"), code="call-kind")
        return ReadAnswer(number, Reply(CallKind(kind), data, codec))


def _read(parts: Sequence[bytes | memoryview]) -> tuple[int, int, int, int, bytes | memoryview]:
    if len(parts) != 2 or len(parts[0]) != _HEADER.size:
        reason = _("a call has two parts, the first of {size} bytes").format(size=_HEADER.size)
        raise WireError(reason, code="call-parts")
    version, kind, codec, limit_ms, number = _HEADER.unpack(parts[0])
    if version != _VERSION:
        raise WireError(
            _("unsupported version {version} of the service protocol; update nep").format(version=version),
            code="call-version",
        )
    return kind, codec, limit_ms, number, parts[1]


class _Original:
    in_order = True

    def call(
        self,
        number: int,  # noqa: ARG002 - has no place in it
        codec: int,  # noqa: ARG002 - it is always JSON
        timeout_s: float | None,  # noqa: ARG002 - has no place in it
        data: bytes | memoryview,
    ) -> list[bytes | memoryview]:
        return [b"", data]

    def read_call(self, parts: Sequence[bytes | memoryview]) -> CallHeader:
        return CallHeader(0, _JSON, None, _only(parts))

    def answer(self, number: int, reply: Reply) -> list[bytes | memoryview]:  # noqa: ARG002 - has no place
        return [b"", reply.data]

    def read_answer(self, parts: Sequence[bytes | memoryview]) -> ReadAnswer:
        data = _only(parts)
        is_failure = bytes(data[: len(_FAILURE)]) == _FAILURE
        name, _reason = read_failure(data) if is_failure else ("", "")
        kind = CallKind.ANSWER if not is_failure else CallKind.ERROR if name else CallKind.REFUSED
        return ReadAnswer(None, Reply(kind, data))


def _only(parts: Sequence[bytes | memoryview]) -> bytes | memoryview:
    if len(parts) != 2 or len(parts[0]):
        raise WireError(_("REQ and REP send an empty part and one with the payload"), code="call-parts")
    return parts[1]


NATIVE: Framing = _Native()
"""Header and payload."""
ORIGINAL: Framing = _Original()
"""JSON between REQ and REP, as the original NEP's `client` and `server` have it."""


def failure(kind: CallKind, name: str, reason: str) -> Reply:
    """Why there is no answer: the name of the error's class (none when it is REFUSED), and a sentence."""
    # Halves of letters, which JSON has no form for, become "?".
    said = {"nep_error": _bounded(name, _CLASS_LETTERS), "reason": _bounded(reason, _REASON_LETTERS)}
    return Reply(kind, orjson.dumps(said))


def _bounded(text: str, most: int) -> str:
    return shortened(text, most).encode("utf-8", "replace").decode()


def read_failure(data: bytes | memoryview) -> tuple[str, str]:
    """The name of the error's class, and the sentence; whatever a stranger sent."""
    try:
        said = orjson.loads(data)
    except ValueError:
        said = None
    if not isinstance(said, dict):
        return "", _("the reason cannot be read")
    name, reason = said.get("nep_error", ""), said.get("reason", "")
    return escaped(bounded_str(name, _CLASS_LETTERS)), escaped(bounded_str(reason, _REASON_LETTERS))


def check_service(name: str) -> str:
    """`name` itself when a service may have it: as a topic, a dozen bytes shorter. Raises `BadTopicError`."""
    check_topic(name)
    if name.startswith(PREFIX):
        raise BadTopicError(name, _("'{prefix}' is put before it by nep itself").format(prefix=PREFIX))
    if name.startswith(SURVEY):
        raise BadTopicError(name, _("names that begin with '{prefix}' are surveys'").format(prefix=SURVEY))
    check_topic(topic_of(name))
    return name


def check_survey(name: str) -> str:
    """The service that a survey of this name is. Raises `BadTopicError`."""
    check_service(name)
    check_topic(topic_of(f"{SURVEY}{name}"))
    return f"{SURVEY}{name}"


def topic_of(service: str) -> str:
    """The topic under which the master lists who serves and calls it."""
    return f"{PREFIX}{service}"


def service_of(topic: str) -> str | None:
    """The service whose servers and clients are listed under this topic; None for any other topic."""
    return topic.removeprefix(PREFIX) if topic.startswith(PREFIX) and len(topic) > len(PREFIX) else None
