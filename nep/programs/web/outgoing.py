"""Encoding of operations for a page as WebSocket messages, with compression and fragments.

Performs no input or output.
"""

from __future__ import annotations

import base64
import itertools
import time
from array import array
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import orjson

from nep.backends.ros_types.definition import Definition, FieldKind
from nep.errors import EncodeError
from nep.messages.message import Message
from nep.messages.nesting import is_json_too_deep
from nep.programs.web.messages.fragments import split_text
from nep.programs.web.messages.operations import Compression
from nep.programs.web.messages.payloads import ros_bytes, ros_type_of, to_ros
from nep.programs.web.messages.png import encode_png
from nep.programs.web.messages.ros_definitions import bare_type, definition_of
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import cbor2
else:
    cbor2 = lazy_module("cbor2")


_NS_PER_S = 1_000_000_000
_TYPED_ARRAYS = {
    "int8": (72, "b"), "uint16": (69, "H"), "uint32": (70, "I"), "uint64": (71, "Q"), "int16": (77, "h"),
    "int32": (78, "i"), "int64": (79, "q"), "float32": (85, "f"), "float64": (86, "d"),
}  # fmt: skip
"""Tag of the little-endian typed array (RFC 8746) and type code of `array`, by ROS type."""
_fragment_numbers = itertools.count(1)


class Frame(NamedTuple):
    """WebSocket message.

    Attributes:
        data: Content; UTF-8 for text.
        is_text: True for a text message, False for a binary message.
    """

    data: bytes
    is_text: bool


class EncodingOptions(NamedTuple):
    """Encoding that a page requests for its messages.

    Attributes:
        compression: Compression of the messages.
        fragment_size: Maximum number of characters in a message to the page; None for no limit.
        as_pixels: Send images as the pixels of ``sensor_msgs/Image``.
    """

    compression: Compression = "none"
    fragment_size: int | None = None
    as_pixels: bool = False


def publish_frames(topic: str, message: Message, options: EncodingOptions) -> list[Frame]:
    """Encode a message of a topic for a subscriber.

    Args:
        topic: Name of the topic.
        message: Message to encode.
        options: Encoding that the page requests.

    Raises:
        NepError: The message can't be decoded, or can't be encoded in this form.
    """
    if options.compression == "cbor-raw":
        secs, nsecs = divmod(message.stamp_ns or time.time_ns(), _NS_PER_S)
        raw = {"secs": secs, "nsecs": nsecs, "bytes": ros_bytes(message, as_pixels=options.as_pixels)}
        return [Frame(cbor2.dumps({"op": "publish", "topic": topic, "msg": raw}), is_text=False)]
    if options.compression == "cbor":
        msg = to_ros(message, as_pixels=options.as_pixels)
        definition = definition_of(bare_type(ros_type_of(message.msg_type)))
        if definition is not None and message.codec == "json" and isinstance(msg, Mapping):
            msg = _with_typed_arrays(msg, definition)
        return [Frame(_encode_cbor({"op": "publish", "topic": topic, "msg": msg}), is_text=False)]
    body = _json_payload(message) if message.codec == "json" else None
    if body is None:
        text = encode_json(
            {"op": "publish", "topic": topic, "msg": to_ros(message, as_pixels=options.as_pixels)}
        )
    else:
        text = b'{"op":"publish","topic":%b,"msg":%b}' % (orjson.dumps(topic), body)
    return _text_frames(text, options)


def operation_frames(operation: Mapping[str, object], options: EncodingOptions) -> list[Frame]:
    """Encode an operation that isn't a topic's message, such as the response of a service.

    Args:
        operation: Fields of the operation.
        options: Encoding that the page requests.

    Raises:
        NepError: A field can't be encoded in this form.
    """
    if options.compression in {"cbor", "cbor-raw"}:
        return [Frame(_encode_cbor(operation), is_text=False)]
    return _text_frames(encode_json(operation), options)


def _text_frames(text: bytes, options: EncodingOptions) -> list[Frame]:
    if options.compression == "png":
        text = encode_json({"op": "png", "data": encode_png(text)})
    if options.fragment_size is None or len(text) <= options.fragment_size:
        return [Frame(text, is_text=True)]
    pieces = split_text(text.decode(), options.fragment_size)
    id_ = f"fragment:{next(_fragment_numbers)}"
    return [
        Frame(
            encode_json({"op": "fragment", "id": id_, "data": piece, "num": number, "total": len(pieces)}),
            is_text=True,
        )
        for number, piece in enumerate(pieces)
    ]


def _json_payload(message: Message) -> bytes | None:
    """Return the data of a JSON message if pages can parse it, else None."""
    data = bytes(message.data)
    if is_json_too_deep(data):
        return None
    try:
        orjson.loads(data)
    except orjson.JSONDecodeError:
        return None  # NaN of the original NEP; the caller decodes and encodes the payload
    return data


def encode_json(value: object) -> bytes:
    """Encode a value as JSON, with bytes in base64. Raises `EncodeError` if that is impossible."""
    try:
        return orjson.dumps(value, _encode_default, orjson.OPT_NON_STR_KEYS | orjson.OPT_SERIALIZE_NUMPY)
    except (TypeError, RecursionError) as error:
        raise EncodeError("json", type(value).__name__, str(error.__cause__ or error)) from error


def _encode_default(value: object) -> object:
    if isinstance(value, bytes | bytearray | memoryview):
        return base64.b64encode(value).decode()
    raise TypeError(type(value).__name__)


def _encode_cbor(value: object) -> bytes:
    try:
        return cbor2.dumps(value)
    except (cbor2.CBOREncodeError, OverflowError, RecursionError, UnicodeError) as error:
        raise EncodeError("cbor", type(value).__name__, str(error)) from error


def _with_typed_arrays(msg: Mapping[str, object], definition: Definition) -> object:
    return {**msg, **_typed_array_fields(msg, [(each.name, each.kind) for each in definition.fields])}


def _typed_array_fields(value: object, kinds: list[tuple[str, FieldKind]]) -> dict[str, object]:
    """Return the fields of a map that contain arrays of numbers, converted to typed arrays."""
    converted_fields: dict[str, object] = {}
    if not isinstance(value, Mapping):
        return converted_fields
    for name, kind in kinds:
        if name not in value:
            continue
        field_value = value[name]
        if kind.element is not None and kind.element.name in _TYPED_ARRAYS:
            converted_fields[name] = _to_typed_array(field_value, kind.element.name)
        elif kind.fields and isinstance(field_value, Mapping):
            converted_fields[name] = {
                **field_value,
                **_typed_array_fields(field_value, [(each.name, each.kind) for each in kind.fields]),
            }
    return converted_fields


def _to_typed_array(values: object, kind: str) -> object:
    """Convert a list of numbers to a typed array, in which `null` (NaN in JSON) becomes NaN."""
    tag, type_code = _TYPED_ARRAYS[kind]
    if not isinstance(values, list):
        return values
    if type_code in "fd" and None in values:
        values = [float("nan") if each is None else each for each in values]
    try:
        return cbor2.CBORTag(tag, array(type_code, values).tobytes())
    except (TypeError, OverflowError, ValueError):
        return values
