"""Parsing of rosbridge v2 operations sent by a page to typed values. Performs no I/O.

For any input, `parse` returns an operation or raises `OperationError` with a message for the page.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, cast

import orjson

from nep.errors import BadTopicError, NepError, did_you_mean
from nep.i18n import _, format_list
from nep.messages.nesting import is_json_too_deep, too_deep_reason
from nep.programs.web.limits import (
    CALL_TIMEOUT_S,
    MAX_CALL_TIMEOUT_S,
    MAX_FRAGMENTS,
    MAX_MESSAGE_BYTES,
    MAX_NAME_LENGTH,
    MAX_QUEUED_MESSAGES,
    MAX_VALUES,
    MIN_FRAGMENT_SIZE,
)
from nep.protocol.wire import check_topic
from nep.text import bounded_str, escaped, quotable

OperationId = str | int | None
Compression = Literal["none", "png", "cbor", "cbor-raw"]
Level = Literal["info", "warning", "error", "none"]
COMPRESSIONS: tuple[Compression, ...] = ("none", "png", "cbor", "cbor-raw")
"""Compressions in ascending priority, for subscriptions of a page to one topic that differ."""
LEVELS: tuple[Level, ...] = ("info", "warning", "error", "none")
_RESERVED_PREFIX = "/nep/"
_MAX_NUMBER = 2**53
_MAX_THROTTLE_MS = 3_600_000


class OperationError(NepError):
    """Error for an operation that failed.

    Args:
        message: Message for the page.
        id: Id of the operation, if any.
        level: Level of the status that the page receives.
    """

    def __init__(self, message: str, id: OperationId = None, level: Level = "error") -> None:
        self.id = id
        self.level = level
        super().__init__(message)


@dataclass(frozen=True, slots=True)
class Advertise:
    """Request to advertise a topic, on which the page will publish."""

    id: OperationId
    topic: str
    ros_type: str
    is_latched: bool


@dataclass(frozen=True, slots=True)
class Unadvertise:
    """Request to end the advertisement with an id, or all advertisements of the topic if `id` is None."""

    id: OperationId
    topic: str


@dataclass(frozen=True, slots=True)
class Publish:
    """Request to publish a message."""

    id: OperationId
    topic: str
    msg: object
    size_bytes: int = field(default=0, compare=False)
    """Size of the operation in bytes, as received."""


@dataclass(frozen=True, slots=True)
class Subscribe:
    """Request to subscribe to a topic.

    Attributes:
        id: Id of the subscription, if any.
        topic: Name of the topic.
        ros_type: Expected ROS type; "" for the topic's own type.
        throttle_s: Minimum time in seconds between two messages.
        queue_length: Maximum number of queued messages; 0 for the default.
        fragment_size: Maximum number of characters in a message to the page; None for no limit.
        compression: Compression of the messages.
    """

    id: OperationId
    topic: str
    ros_type: str = ""
    throttle_s: float = 0.0
    queue_length: int = 0
    fragment_size: int | None = None
    compression: Compression = "none"


@dataclass(frozen=True, slots=True)
class Unsubscribe:
    """Request to end the subscription with an id, or all subscriptions to the topic if `id` is None."""

    id: OperationId
    topic: str


@dataclass(frozen=True, slots=True)
class CallService:
    """Request to call a service."""

    id: OperationId
    service: str
    args: object
    timeout_s: float = CALL_TIMEOUT_S
    fragment_size: int | None = None
    compression: Compression = "none"


@dataclass(frozen=True, slots=True)
class AdvertiseService:
    """Request to advertise a service, which the page serves."""

    id: OperationId
    service: str
    ros_type: str


@dataclass(frozen=True, slots=True)
class UnadvertiseService:
    """Request to stop serving a service."""

    id: OperationId
    service: str


@dataclass(frozen=True, slots=True)
class ServiceResponse:
    """Reply of the page to a call from another node."""

    id: OperationId
    service: str
    values: object
    is_success: bool


@dataclass(frozen=True, slots=True)
class Fragment:
    """Piece of the text of an operation.

    Attributes:
        id: Id shared by the fragments of one operation.
        data: Piece of the text.
        number: Index of the fragment, from 0.
        total: Number of fragments.
    """

    id: OperationId
    data: str
    number: int
    total: int


@dataclass(frozen=True, slots=True)
class Png:
    """Text of an operation or fragment, encoded in the pixels of a PNG file.

    Attributes:
        id: Id shared by the fragments of one operation.
        data: PNG file, or piece of it, in base64.
        number: Index of the fragment, from 0.
        total: Number of fragments.
    """

    id: OperationId
    data: str
    number: int
    total: int


@dataclass(frozen=True, slots=True)
class SetLevel:
    """Request to receive only statuses of this level or above."""

    id: OperationId
    level: Level


@dataclass(frozen=True, slots=True)
class PageStatus:
    """Status message from the page, which is written to the log."""

    id: OperationId
    level: Level
    msg: str


@dataclass(frozen=True, slots=True)
class Auth:
    """Credentials in the form of rosauth.

    Attributes:
        id: Id of the operation, if any.
        mac: SHA-512 of the token and the other fields, in hexadecimal.
        client: Address of the client.
        dest: Address of the server.
        rand: Random text.
        time_s: Time of the request (s since 1970).
        level: Requested level of access.
        end_s: Time at which the credentials expire (s since 1970).
    """

    id: OperationId
    mac: str
    client: str
    dest: str
    rand: str
    time_s: int
    level: str
    end_s: int


Operation = (
    Advertise
    | Unadvertise
    | Publish
    | Subscribe
    | Unsubscribe
    | CallService
    | AdvertiseService
    | UnadvertiseService
    | ServiceResponse
    | Fragment
    | Png
    | SetLevel
    | PageStatus
    | Auth
)


def parse(data: bytes) -> Operation:
    """Parse the operation in a message from a page.

    Raises `OperationError` if the message isn't JSON within the limits, or isn't a valid operation.
    """
    fields = parse_json(data)
    if not isinstance(fields, dict):
        raise OperationError(_("an operation must be a JSON object with an 'op'"))
    return parse_operation(fields, len(data))


def parse_operation(fields: Mapping[str, object], size_bytes: int = 0) -> Operation:
    """Convert the fields of a message to an operation.

    Args:
        fields: Fields of the message.
        size_bytes: Size of the message in bytes.

    Raises:
        OperationError: The operation is unknown, or a field is missing or invalid.
    """
    return _parse_fields(_Fields(fields, size_bytes))


def parse_json(data: bytes) -> object:
    """Parse JSON from a page. Raises `OperationError` if it is invalid or exceeds the limits."""
    if len(data) > MAX_MESSAGE_BYTES:
        raise OperationError(
            _("an operation is {count} bytes; at most {most} are allowed").format(
                count=len(data), most=MAX_MESSAGE_BYTES
            )
        )
    if is_json_too_deep(data):
        raise OperationError(_("an operation was rejected: {reason}").format(reason=too_deep_reason()))
    if len(data) > MAX_VALUES and sum(map(data.count, (b",", b"[", b"{"))) > MAX_VALUES:
        raise OperationError(
            _("an operation has more than {most} values; send less data at once").format(most=MAX_VALUES)
        )
    try:
        return orjson.loads(data)
    except orjson.JSONDecodeError as error:
        raise OperationError(
            _("an operation isn't valid JSON: {reason}").format(reason=quotable(str(error)))
        ) from None


def log_text(text: str) -> str:
    """Return text from a page for the log, escaped and shortened."""
    return escaped(bounded_str(text, 1_000))


class _Fields:
    """Accessor of an operation's fields that validates each field when it is read."""

    def __init__(self, fields: Mapping[str, object], size_bytes: int) -> None:
        self._fields = fields
        self.size_bytes = size_bytes
        raw_id = fields.get("id")
        is_id = isinstance(raw_id, str | int) and not isinstance(raw_id, bool)
        self.id = cast("str | int", raw_id) if is_id and len(str(raw_id)) <= MAX_NAME_LENGTH else None
        self.op = self.text("op")

    def get(self, name: str, default: object = None) -> object:
        """Return the value of a field without validation."""
        return self._fields.get(name, default)

    def text(self, name: str, default: str | None = None, *, max_length: int = MAX_NAME_LENGTH) -> str:
        """Return a text field of at most `max_length` characters; without a default, it is required."""
        value = self._fields.get(name)
        if value is None and default is not None:
            return default
        if not isinstance(value, str):
            raise self.invalid_field(name, _("a string"))
        if len(value) > max_length:
            raise self.error(
                _("'{name}' has {count} characters; at most {most} are allowed").format(
                    name=name, count=len(value), most=max_length
                )
            )
        return value

    def topic(self, name: str) -> str:
        """Return a field that contains the name of a topic or service."""
        try:
            return check_topic(self.text(name))
        except BadTopicError as error:
            raise self.error(str(error)) from None

    def type_name(self, default: str | None = None) -> str:
        """Return the field "type", or the default if the field is missing."""
        name = self.text("type", default)
        try:
            return check_topic(name) if name else name
        except BadTopicError as error:
            raise self.error(_("'type' is invalid: {reason}").format(reason=error.reason)) from None

    def unreserved_name(self, name: str) -> str:
        """Return the name of a topic or service that the page creates, which must not be reserved."""
        topic = self.topic(name)
        if topic.startswith(_RESERVED_PREFIX):
            template = _("names that start with '{prefix}' are reserved; choose another name")
            raise self.error(template.format(prefix=_RESERVED_PREFIX))
        return topic

    def number(self, name: str, default: int | None, minimum: int, maximum: int) -> int:
        """Return a number field as an integer. The field is required if there is no default.

        Floats are accepted, because some programs send whole numbers as floats; a fraction is
        truncated.

        Args:
            name: Name of the field.
            default: Value for a missing field; None for a required field.
            minimum: Smallest valid value.
            maximum: Largest valid value.
        """
        value = self._fields.get(name)
        if value is None and default is not None:
            return default
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not math.isfinite(cast("float", value)):
            raise self.invalid_field(name, _("a number"))
        number = int(cast("float", value))
        if not minimum <= number <= maximum:
            raise self.error(
                _("'{name}' is {number}; it must be from {least} to {most}").format(
                    name=name, number=bounded_str(number, 40), least=minimum, most=maximum
                )
            )
        return number

    def choice(self, name: str, default: str | None, choices: tuple[str, ...]) -> str:
        """Return a text field whose value is one of `choices`."""
        value = self.text(name, default)
        if value not in choices:
            raise self.invalid_field(name, format_list([f"'{each}'" for each in choices], "or"))
        return value

    def compression(self) -> Compression:
        """Return the compression that the page requests."""
        return cast("Compression", self.choice("compression", "none", COMPRESSIONS))

    def fragment_size(self) -> int | None:
        """Return the maximum number of characters in a message to the page; None for no limit."""
        if self._fields.get("fragment_size") is None:
            return None
        return max(MIN_FRAGMENT_SIZE, self.number("fragment_size", None, 1, _MAX_NUMBER))

    def fragment_position(self) -> tuple[int, int]:
        """Return the index of a fragment, and the number of fragments."""
        total = self.number("total", 1, 1, MAX_FRAGMENTS)
        return self.number("num", 0, 0, total - 1), total

    def error(self, message: str) -> OperationError:
        """Return an error with the id of this operation."""
        return OperationError(message, self.id)

    def invalid_field(self, name: str, expected: str) -> OperationError:
        """Return the error for a missing or invalid field.

        Args:
            name: Name of the field.
            expected: Description of a valid value.
        """
        op = quotable(self._fields.get("op"))
        if name not in self._fields:
            return self.error(
                _("'{op}' requires '{name}' ({wanted})").format(op=op, name=name, wanted=expected)
            )
        return self.error(
            _("'{name}' of '{op}' is {given}; expected {wanted}").format(
                name=name, op=op, given=escaped(bounded_str(self._fields[name], 60)), wanted=expected
            )
        )


def _parse_fields(fields: _Fields) -> Operation:
    parser = _PARSERS.get(fields.op)
    if parser is None:
        suggestion = did_you_mean(fields.op, tuple(_PARSERS))
        raise fields.error(
            _("unknown operation '{op}'; {did_you_mean}").format(
                op=quotable(fields.op), did_you_mean=suggestion
            )
        )
    return parser(fields)


def _parse_advertise(fields: _Fields) -> Operation:
    is_latched = fields.get("latch") is True
    return Advertise(fields.id, fields.unreserved_name("topic"), fields.type_name(), is_latched)


def _parse_publish(fields: _Fields) -> Operation:
    return Publish(fields.id, fields.unreserved_name("topic"), fields.get("msg", {}), fields.size_bytes)


def _parse_subscribe(fields: _Fields) -> Operation:
    return Subscribe(
        fields.id,
        fields.topic("topic"),
        fields.type_name(""),
        fields.number("throttle_rate", 0, 0, _MAX_THROTTLE_MS) / 1000,
        min(fields.number("queue_length", 0, 0, _MAX_NUMBER), MAX_QUEUED_MESSAGES),
        fields.fragment_size(),
        fields.compression(),
    )


def _parse_call_service(fields: _Fields) -> Operation:
    service, separator, id_in_name = fields.topic("service").partition("#")
    args = fields.get("args")
    timeout = fields.get("timeout")
    is_time = isinstance(timeout, int | float) and not isinstance(timeout, bool) and timeout > 0
    return CallService(
        id_in_name if separator and fields.id is None else fields.id,
        service,
        {} if args in (None, []) else args,
        min(float(cast("float", timeout)), MAX_CALL_TIMEOUT_S) if is_time else CALL_TIMEOUT_S,
        fields.fragment_size(),
        fields.compression(),
    )


def _parse_service_response(fields: _Fields) -> Operation:
    is_success = fields.get("result", True)
    if not isinstance(is_success, bool):
        raise fields.invalid_field("result", _("true or false"))
    values = fields.get("values")
    return ServiceResponse(fields.id, fields.topic("service"), {} if values is None else values, is_success)


def _parse_fragment(fields: _Fields) -> Operation:
    number, total = fields.fragment_position()
    return Fragment(fields.id, fields.text("data", max_length=MAX_MESSAGE_BYTES), number, total)


def _parse_png(fields: _Fields) -> Operation:
    number, total = fields.fragment_position()
    return Png(fields.id, fields.text("data", max_length=MAX_MESSAGE_BYTES), number, total)


def _parse_status(fields: _Fields) -> Operation:
    level = cast("Level", fields.choice("level", "info", LEVELS))
    return PageStatus(fields.id, level, fields.text("msg", "", max_length=MAX_MESSAGE_BYTES))


def _parse_auth(fields: _Fields) -> Operation:
    return Auth(
        fields.id,
        fields.text("mac"),
        fields.text("client"),
        fields.text("dest"),
        fields.text("rand"),
        fields.number("t", None, 0, _MAX_NUMBER),
        fields.text("level"),
        fields.number("end", None, 0, _MAX_NUMBER),
    )


_PARSERS = {
    "advertise": _parse_advertise,
    "unadvertise": lambda fields: Unadvertise(fields.id, fields.topic("topic")),
    "publish": _parse_publish,
    "subscribe": _parse_subscribe,
    "unsubscribe": lambda fields: Unsubscribe(fields.id, fields.topic("topic")),
    "call_service": _parse_call_service,
    "advertise_service": lambda fields: AdvertiseService(
        fields.id, fields.unreserved_name("service"), fields.type_name("")
    ),
    "unadvertise_service": lambda fields: UnadvertiseService(fields.id, fields.topic("service")),
    "service_response": _parse_service_response,
    "fragment": _parse_fragment,
    "png": _parse_png,
    "set_level": lambda fields: SetLevel(fields.id, cast("Level", fields.choice("level", None, LEVELS))),
    "status": _parse_status,
    "auth": _parse_auth,
}
