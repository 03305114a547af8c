"""Codecs between payloads and bytes, chosen by name, and identified on the wire by number.

| name    | number | payload                                                                   |
|---------|--------|---------------------------------------------------------------------------|
| json    | 1      | JSON types; also numpy arrays and scalars, dataclasses, dates and times   |
| string  | 2      | `str`, as UTF-8                                                           |
| bytes   | 3      | `bytes`                                                                   |
| msgpack | 4      | msgpack types including bytes and NaN; dates and times as its timestamp   |
| image   | 5      | array (height, width, 3) in BGR order, see `nep.messages.image_codec`     |

JSON lacks NaN and infinity: they are sent as `null` and reported (`JsonEncoder`), because a sensor without a
value must not stop its robot's program or its readers. The original NEP raised `ValueError` up to 0.5.4.5;
0.5.4.8 sends `NaN`, which strict parsers reject. Number keys become strings. msgpack converts numpy arrays
and dataclasses as JSON does; readers in other languages may require text or number keys. Lists and maps have
at most 64 levels in both (`nep.messages.nesting`). Any other message type ("robot/description",
"sensor_msgs/Image") is encoded as json.

A module adds a codec with `register`. What other parts of nep need to know about a codec are attributes of
`Codec`: how ROS messages carry it, how it is recorded, and what its payloads are.
"""

from __future__ import annotations

import json
import logging
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from datetime import date, datetime, time, timezone
from enum import Enum
from time import monotonic
from typing import Any, Literal
from uuid import UUID

import msgpack  # type: ignore[import-untyped]
import orjson

from nep.errors import DecodeError, EncodeError, did_you_mean
from nep.i18n import _
from nep.messages import image_codec
from nep.messages.encoded import Encoded, new_encoded
from nep.messages.nesting import MAX_LEVELS, is_json_too_deep, is_packed_too_deep, too_deep_reason
from nep.messages.packing import pack, unpack

__all__ = [
    "CODECS",
    "NULL",
    "Codec",
    "Content",
    "Encoded",
    "JsonEncoder",
    "RecordedForm",
    "RosCarrier",
    "codec",
    "codec_by_number",
    "codec_for",
    "content_of",
    "find_nan",
    "numpy_option",
    "register",
]

Content = Literal["values", "text", "bytes", "image"]
"""Kind of a codec's payloads: values such as maps and numbers, text, bytes, or images (`image_codec`)."""
RosCarrier = Literal["text", "bytes", "image"]
"""ROS message that contains the data of a codec, see `nep.backends.ros_types.carriers`."""
RecordedForm = Literal["json", "msgpack", "text", "image", "wrapped"]
"""Form of a codec's data in recordings, see `nep.recordings.formats.channels`."""

_BYTES_TYPES = (bytes, bytearray, memoryview)
_NUMPY_OPTION = orjson.OPT_SERIALIZE_NUMPY
_modules = sys.modules

NAN_WARNING_INTERVAL_S = 10.0
"""Minimum interval in seconds between two warnings about NaN on the same topic."""
_logger = logging.getLogger("nep")
_MAX_DEPTH = 100
_MAX_NUMBER = 255
NULL = b"null"
"""JSON text of None.

Search for it with `rfind`, which takes half the time of `in` on data with many commas and digits.
"""
_PACKED_NAN = re.compile(rb"\xcb[\x7f\xff][\xf0-\xff]")
"""Pattern of NaN or infinity in msgpack. May also match other data."""


@dataclass(frozen=True)
class Codec:
    """Encoder and decoder of a message type.

    Attributes:
        name: Name of the codec.
        number: Number in the message header.
        encode: Encodes a payload as `Encoded`. Raises `EncodeError`.
        decode: Decodes bytes and extension to a payload. Raises `DecodeError`.
        empty: Returns the payload that `listen` returns if there is no message.
        check: Raises `EncodeError` for a payload of a wrong type, in constant time.
        is_small: True if messages are usually small, such as commands, replies and states.
        queue_length: Maximum number of messages in the queue of a connection, for codecs of large messages;
            None for the back end's default.
        content: Kind of the payloads. An image has the data and extension of `image_codec`.
        ros_carrier: ROS message that contains the data. `"text"` requires UTF-8 without zero bytes, and
            `"image"` a JPEG or PNG file. None for codecs of back ends, whose data is a ROS message.
        recorded_as: Form of the data in recordings: as is (JSON, msgpack), or in a message of Protocol
            Buffers that viewers show as text, as an image, or only as bytes ("wrapped").
    """

    name: str
    number: int
    encode: Callable[[object], Encoded]
    decode: Callable[[bytes | memoryview, Mapping[str, object]], object]
    empty: Callable[[], object]
    check: Callable[[object], object]
    is_small: bool = False
    queue_length: int | None = None
    content: Content = "values"
    ros_carrier: RosCarrier | None = "bytes"
    recorded_as: RecordedForm = "wrapped"


def _plain_value(value: object) -> object:
    # Called for types unknown to orjson and msgpack; numpy values have `tolist`.
    to_list = getattr(value, "tolist", None)
    if callable(to_list):
        return to_list()
    raise TypeError(_("'{kind}' can't be encoded as JSON").format(kind=type(value).__name__))


def numpy_option() -> int:
    """Return orjson's option for numpy values, or 0 while numpy is not imported.

    With the option set, orjson imports numpy at the first value of an unknown type. That takes 0.1 s, during
    which a publisher would stall. Without numpy loaded there can't be any numpy values.
    """
    return _NUMPY_OPTION if "numpy" in _modules else 0


def _encode_json(payload: object) -> Encoded:
    option = numpy_option()
    try:
        return new_encoded((_check_depth(orjson.dumps(payload, _plain_value, option), payload), None))
    except TypeError:
        pass  # number keys need the slower option; other errors are raised again below
    try:
        data = orjson.dumps(payload, _plain_value, option | orjson.OPT_NON_STR_KEYS)
    except (TypeError, RecursionError) as error:
        # orjson's own limit is 254 levels
        is_deep = isinstance(error, RecursionError) or "Recursion limit" in str(error)
        reason = too_deep_reason() if is_deep else str(error.__cause__ or error) or _("unsupported value")
        raise EncodeError("json", type(payload).__name__, reason) from error
    if is_json_too_deep(data):
        raise EncodeError("json", type(payload).__name__, too_deep_reason())
    return Encoded(data)


def _encode_json_fast(payload: object) -> bytes:
    # `numpy_option` inlined: the call would cost a tenth of the time of a small message
    return _check_depth(
        orjson.dumps(payload, _plain_value, _NUMPY_OPTION if "numpy" in _modules else 0), payload
    )


def _check_depth(data: bytes, payload: object) -> bytes:
    if len(data) > 2 * MAX_LEVELS and is_json_too_deep(data):
        raise EncodeError("json", type(payload).__name__, too_deep_reason())
    return data


def _decode_json(data: bytes | memoryview, _extension: Mapping[str, object]) -> object:
    if len(data) > 2 * MAX_LEVELS and is_json_too_deep(data):
        raise DecodeError("json", len(data), too_deep_reason())
    try:
        return orjson.loads(data)
    except orjson.JSONDecodeError as first:
        # the original NEP 0.5.4.8 sends NaN, which only Python's json accepts
        try:
            return json.loads(str(data, "utf-8-sig"))
        except (ValueError, RecursionError):
            raise DecodeError("json", len(data), str(first)) from first


def _accept_any(payload: object) -> None:
    # errors are detected by encoding only
    ...


def _check_string(payload: object) -> str:
    if not isinstance(payload, str):
        raise EncodeError("string", type(payload).__name__, _("publish a 'str', or use the type 'json'"))
    return payload


def _encode_string(payload: object) -> Encoded:
    text = _check_string(payload)
    try:
        return Encoded(text.encode("utf-8"))
    except UnicodeEncodeError as error:
        raise EncodeError("string", "str", _("the text contains an unpaired surrogate")) from error


def _decode_string(data: bytes | memoryview, _extension: Mapping[str, object]) -> object:
    try:
        return str(data, "utf-8")
    except UnicodeDecodeError as error:
        raise DecodeError(
            "string", len(data), _("byte {start} isn't valid UTF-8").format(start=error.start)
        ) from error


def _check_bytes(payload: object) -> bytes | bytearray | memoryview:
    if not isinstance(payload, _BYTES_TYPES):
        raise EncodeError("bytes", type(payload).__name__, _("publish 'bytes'"))
    return payload


def _encode_bytes(payload: object) -> Encoded:
    if isinstance(payload, bytes):
        return new_encoded((payload, None))
    return Encoded(bytes(_check_bytes(payload)))


def _encode_bytes_fast(payload: object) -> bytes:
    if type(payload) is bytes:
        return payload
    raise TypeError


def _decode_bytes(data: bytes | memoryview, _extension: Mapping[str, object]) -> object:
    return data if isinstance(data, bytes) else bytes(data)


def _packable_value(value: object) -> object:
    # Converts as JSON does, except for times.
    if isinstance(value, datetime):  # without a time zone, or of a subclass
        return msgpack.Timestamp.from_datetime(value.astimezone(timezone.utc))
    if isinstance(value, date | time):
        return value.isoformat()
    if isinstance(value, UUID):
        return str(value)
    if isinstance(value, Enum):
        return value.value
    if is_dataclass(value) and not isinstance(value, type):
        return {
            each.name: getattr(value, each.name) for each in fields(value) if not each.name.startswith("_")
        }
    return _plain_value(value)


def _encode_msgpack(payload: object) -> Encoded:
    try:
        data = pack(payload, _packable_value)
    except ValueError as error:
        is_deep = "recursion limit" in str(error)
        raise EncodeError(
            "msgpack", type(payload).__name__, too_deep_reason() if is_deep else str(error)
        ) from error
    if is_packed_too_deep(data, payload):
        raise EncodeError("msgpack", type(payload).__name__, too_deep_reason())
    return Encoded(data)


def _decode_msgpack(data: bytes | memoryview, _extension: Mapping[str, object]) -> object:
    try:
        value = unpack(data)
    except ValueError as error:
        is_deep = isinstance(error.__cause__, msgpack.StackError)
        raise DecodeError("msgpack", len(data), too_deep_reason() if is_deep else str(error)) from error
    if is_packed_too_deep(data, value):
        raise DecodeError("msgpack", len(data), too_deep_reason())
    return value


def _decode_image(data: bytes | memoryview, extension: Mapping[str, object]) -> object:
    return image_codec.decode(memoryview(data), extension)


def _empty_image() -> object:
    return None


_codecs: dict[str, Codec] = {}
_codecs_by_number: dict[int, Codec] = {}
_aliases: dict[str, Codec] = {}
CODECS: Mapping[str, Codec] = _codecs
"""Registered codecs by name."""


def register(codec: Codec, *aliases: str) -> Codec:
    """Add a codec for the message types with its name or an alias; return it.

    Register the codec before nodes use it. A program that hasn't registered it rejects its messages and
    counts them.

    Raises:
        ValueError: A name or the number is taken, or the number isn't 1 to 255.
    """
    names = (codec.name, *aliases)
    if not 1 <= codec.number <= _MAX_NUMBER:
        raise ValueError(f"the number of the codec '{codec.name}' is {codec.number}; use 1 to {_MAX_NUMBER}")
    if codec.number in _codecs_by_number or any(name in _codecs or name in _aliases for name in names):
        raise ValueError(f"the codec '{codec.name}' ({codec.number}) has the name or number of another one")
    _codecs[codec.name] = _codecs_by_number[codec.number] = codec
    _aliases.update(dict.fromkeys(aliases, codec))
    return codec


# The aliases are names of the original NEP.
JSON = register(
    Codec("json", 1, _encode_json, _decode_json, dict, _accept_any, is_small=True, ros_carrier="text",
          recorded_as="json"), "dictionary", "dict"
)  # fmt: skip
STRING = register(
    Codec("string", 2, _encode_string, _decode_string, str, _check_string, is_small=True, content="text",
          ros_carrier="text", recorded_as="text")
)  # fmt: skip
BYTES = register(
    Codec("bytes", 3, _encode_bytes, _decode_bytes, bytes, _check_bytes, queue_length=1000, content="bytes")
)
MSGPACK = register(
    Codec("msgpack", 4, _encode_msgpack, _decode_msgpack, dict, _accept_any, is_small=True,
          recorded_as="msgpack")
)  # fmt: skip
IMAGE = register(
    Codec("image", 5, image_codec.encode, _decode_image, _empty_image, image_codec.check_image,
          queue_length=64, content="image", ros_carrier="image", recorded_as="image"), "images"
)  # fmt: skip


_FAST_ENCODERS: Mapping[Callable[[object], Encoded], Callable[[Any], bytes]] = {
    _encode_json: _encode_json_fast,
    _encode_string: str.encode,
    _encode_bytes: _encode_bytes_fast,
}


def codec(name: str) -> Codec:
    """Return the codec called `name`. Raises `DecodeError` if there is none."""
    try:
        return CODECS[name]
    except KeyError:
        raise DecodeError(
            name, 0, _("unknown codec; {did_you_mean}").format(did_you_mean=did_you_mean(name, tuple(CODECS)))
        ) from None


def codec_by_number(number: int) -> Codec | None:
    """Return the codec with the number `number` on the wire, or None if this version of nep has none."""
    return _codecs_by_number.get(number)


def fast_encoder(codec: Codec) -> Callable[[Any], bytes] | None:
    """Return a faster encoder for common payloads of a codec, or None if there is none.

    For common payloads the encoder returns the same bytes as `codec.encode`. For all others it
    raises an exception of any type; call `codec.encode` then.
    """
    return _FAST_ENCODERS.get(codec.encode)


def codec_for(msg_type: str) -> Codec:
    """Return the codec of a message type: the codec with this name or alias, else json."""
    return _codecs.get(msg_type) or _aliases.get(msg_type, JSON)


def content_of(name: str) -> Content:
    """Return the kind of payloads of the codec called `name`; "values" for the codecs of back ends."""
    codec = _codecs.get(name)
    return "values" if codec is None else codec.content


# ---- NaN and infinity, which JSON lacks


class JsonEncoder:
    """JSON encoder of one publisher.

    Attributes:
        count: Number of messages in which NaN or infinity was replaced by `null`.
    """

    def __init__(
        self,
        topic: str,
        clock: Callable[[], float] = monotonic,
        encode: Callable[[object], Encoded] = JSON.encode,
    ) -> None:
        self.count = 0
        self._encode = encode
        is_typed = encode is not JSON.encode
        self._hint = (
            "readers of its type get NaN" if is_typed else "publish None there, or use the type 'msgpack'"
        )
        self._topic = topic
        self._clock = clock
        self._warned_at = -math.inf

    def encode(self, payload: object) -> Encoded:
        """Encode a payload as JSON. Raises `EncodeError` if JSON can't represent it.

        NaN and infinity are replaced by `null`; such messages are counted and logged.
        """
        encoded_payload = self._encode(payload)
        data = encoded_payload.data
        if type(data) is bytes and data.rfind(NULL) >= 0:
            self.check_for_nan(payload)
        return encoded_payload

    def check_for_nan(self, payload: object) -> None:
        """Count and log a message in which NaN or infinity was encoded as `null`.

        Call this for payloads whose encoding contains `NULL`, which may also be the encoding of None.
        """
        if _may_have_nan(payload) and (nan_path := find_nan(payload)) is not None:
            self.count += 1
            now = self._clock()
            if now - self._warned_at >= NAN_WARNING_INTERVAL_S:
                self._warned_at = now
                _logger.warning(
                    "'%s' sends NaN or infinity as null, because JSON has neither: at %s, message %d of "
                    "this kind; %s",
                    self._topic,
                    nan_path or "its only value",
                    self.count,
                    self._hint,
                )


def _may_have_nan(payload: object) -> bool:
    # Fast check: `null` is usually None, and msgpack takes a tenth of the time of a search in Python.
    try:
        return _PACKED_NAN.search(MSGPACK.encode(payload).data) is not None
    except EncodeError:
        return True


def find_nan(value: object, path: str = "", depth: int = _MAX_DEPTH) -> str | None:
    """Return the path of the first NaN or infinity in a payload, or None if there is none.

    The path is "" if the payload itself is NaN or infinity.

    Args:
        value: Payload, or a part of it.
        path: Path of `value` in the payload, such as "pose.x" or "joints[3]".
        depth: Maximum number of levels to search.
    """
    if isinstance(value, float):
        return None if math.isfinite(value) else path
    if value is None or isinstance(value, str | bytes | int) or depth <= 0:
        return None
    if isinstance(value, Mapping):
        parts = ((f"{path}.{key}" if path else str(key), part) for key, part in value.items())
    elif isinstance(value, Sequence):
        parts = ((f"{path}[{number}]", part) for number, part in enumerate(value))
    elif is_dataclass(value) and not isinstance(value, type):
        names = (data_field.name for data_field in fields(value))
        parts = ((f"{path}.{name}" if path else name, getattr(value, name, None)) for name in names)
    else:
        to_list = getattr(value, "tolist", None)  # numpy
        return find_nan(to_list(), path, depth - 1) if callable(to_list) else None
    for part_path, part in parts:
        nan_path = find_nan(part, part_path, depth - 1)
        if nan_path is not None:
            return nan_path
    return None
