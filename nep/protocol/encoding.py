"""Wire encoding of requests, replies and pushes. Pure functions; specification: `docs/wire.md`.

A body is one msgpack map. Requests have `do` (the operation) and `call` (a number that the reply
repeats as `re`); replies and pushes have `is`; `what` holds the fields.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple, TypeVar

import msgspec
from msgspec import Raw, Struct, field, msgpack

from nep.errors import WireError
from nep.i18n import _, lazy
from nep.messages.packing import pack_saturated
from nep.protocol.requests import (
    AddedReply,
    AddPublisher,
    AddSubscriber,
    DoneReply,
    FoundReply,
    GraphReply,
    Join,
    Leave,
    Listen,
    Ping,
    Probe,
    PublisherAdded,
    PublisherRemoved,
    Push,
    QueryGraph,
    RejectedReply,
    RemovePublisher,
    RemoveSubscriber,
    Renew,
    RenewedReply,
    Reply,
    ReportMissing,
    Request,
)

T = TypeVar("T")

_REQUESTS: Mapping[str, type[Request]] = {
    "join": Join,
    "publisher+": AddPublisher,
    "subscriber+": AddSubscriber,
    "publisher-": RemovePublisher,
    "subscriber-": RemoveSubscriber,
    "leave": Leave,
    "renew": Renew,
    "missing": ReportMissing,
    "listen": Listen,
    "look": QueryGraph,
    "ping": Ping,
}
_REPLIES: Mapping[str, type[Reply | Push]] = {
    "done": DoneReply,
    "added": AddedReply,
    "found": FoundReply,
    "renewed": RenewedReply,
    "seen": GraphReply,
    "refused": RejectedReply,
    "publisher+": PublisherAdded,
    "publisher-": PublisherRemoved,
    "probe": Probe,
}
_REQUEST_NAMES = {kind: name for name, kind in _REQUESTS.items()}
_REPLY_NAMES = {kind: name for name, kind in _REPLIES.items()}
_MISSING_FIELD_MESSAGE = lazy("'{field}' is missing")
_WRONG_TYPE_MESSAGE = lazy("'{field}' must be '{wanted}', not '{given}'")
_NOT_A_LIST_MESSAGE = lazy("'{field}' must be a list, not '{given}'")
_NOT_A_MAP_MESSAGE = lazy("'{field}' must be a map, not '{given}'")
_WRONG_TYPE_MESSAGES = {"array": _NOT_A_LIST_MESSAGE, "object": _NOT_A_MAP_MESSAGE}
_MISSING_FIELD = re.compile(r"Object missing required field `(?P<name>.+?)`(?: - at `\$(?P<path>.*)`)?$")
_WRONG_TYPE = re.compile(r"Expected `(?P<wanted>.+?)`, got `(?P<given>.+?)`(?: - at `\$(?P<path>.*)`)?$")
_ENCODER = msgpack.Encoder()


class _ReceivedRequest(Struct):
    name: Raw = field(default=Raw(b"\xc0"), name="do")
    call: Raw = Raw(b"\x00")
    fields: Raw = field(default=Raw(b"\x80"), name="what")


class _ReceivedReply(Struct):
    name: Raw = field(default=Raw(b"\xc0"), name="is")
    call: Raw = field(default=Raw(b"\x00"), name="re")
    fields: Raw = field(default=Raw(b"\x80"), name="what")


class _SentRequest(Struct):
    name: str = field(name="do")
    call: int
    fields: object = field(name="what")


class _SentReply(Struct):
    name: str = field(name="is")
    call: int = field(name="re")
    fields: object = field(name="what")


class ReceivedRequest(NamedTuple):
    """Result of decoding a request.

    Attributes:
        call: Id of the request; 0 if it is missing or invalid.
        request: The request, or the error if it is malformed.
    """

    call: int
    request: Request | WireError


def encode_request(request: Request, call: int) -> bytes:
    """Encode a request."""
    return _encode(_SentRequest(_REQUEST_NAMES[type(request)], call, request))


def decode_request(body: bytes) -> ReceivedRequest:
    """Decode a request. Never raises: errors are returned, so that every sender gets a reply."""
    call = 0
    try:
        received = _decode_body(_ReceivedRequest, body)
        number = _decode_scalar(int, received.call)
        # negative numbers are reserved for calls inside the master's process
        call = number if number is not None and number >= 0 else 0
        name = _decode_scalar(str, received.name)
        kind = _REQUESTS.get(name or "")
        if kind is None:
            raise WireError(_("unknown request '{name}'").format(name=name), code="request")
        return ReceivedRequest(call, _decode_fields(kind, received.fields))
    except WireError as error:
        return ReceivedRequest(call, error)


def encode_reply(reply: Reply | Push, call: int = 0) -> bytes:
    """Encode a reply to `call`, or a push."""
    return _encode(_SentReply(_REPLY_NAMES[type(reply)], call, reply))


def decode_reply(body: bytes) -> tuple[int, Reply | Push]:
    """Decode a reply or push, and return it with its call id, which is 0 for a push. Raises `WireError`."""
    received = _decode_body(_ReceivedReply, body)
    name, call = _decode_scalar(str, received.name), _decode_scalar(int, received.call)
    kind = _REPLIES.get(name or "")
    if kind is None or call is None:
        raise WireError(_("unknown reply '{name}'").format(name=name), code="answer")
    return call, _decode_fields(kind, received.fields)


def call_of_reply(body: bytes) -> int | None:
    """Return the call id of a reply whose fields can't be decoded; None if the id is unknown."""
    try:
        return _decode_scalar(int, _decode_body(_ReceivedReply, body).call)
    except WireError:
        return None


def _encode(message: _SentRequest | _SentReply) -> bytes:
    try:
        return _ENCODER.encode(message)
    except (OverflowError, UnicodeEncodeError):  # values of a broken program
        return pack_saturated(msgspec.to_builtins(message))


def _decode_body(kind: type[T], body: bytes) -> T:
    try:
        return msgpack.decode(body, type=kind)
    except msgspec.ValidationError as error:
        raise WireError(_("the body isn't a map"), len(body), code="map") from error
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        reason = _("the body isn't valid msgpack: {error}").format(error=error)
        raise WireError(reason, len(body), code="msgpack") from error


def _decode_scalar(kind: type[T], data: Raw) -> T | None:
    # None for values of other types.
    try:
        return msgpack.decode(data, type=kind)
    except (msgspec.DecodeError, ValueError, RecursionError):
        return None


def _decode_fields(kind: type[T], data: Raw) -> T:
    # Unknown fields are ignored, because newer peers may send more fields.
    try:
        return msgpack.decode(data, type=kind)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise _field_error(kind, str(error)) from None


def _field_error(kind: type, reason: str) -> WireError:
    missing = _MISSING_FIELD.fullmatch(reason)
    if missing is not None:
        name = f"{kind.__name__}{missing['path'] or ''}.{missing['name']}"
        return WireError(_(_MISSING_FIELD_MESSAGE).format(field=name), code="field-missing")
    wrong = _WRONG_TYPE.fullmatch(reason)
    if wrong is None:
        error = _("'{field}' is invalid: {reason}").format(field=kind.__name__, reason=reason)
        return WireError(error, code="field-type")
    name, wanted = f"{kind.__name__}{wrong['path'] or ''}", wrong["wanted"]
    template = _WRONG_TYPE_MESSAGES.get(wanted, _WRONG_TYPE_MESSAGE)
    return WireError(_(template).format(field=name, wanted=wanted, given=wrong["given"]), code="field-type")
