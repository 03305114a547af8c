"""Conversion of NEP messages to the shapes of ROS messages, and back. Performs no I/O.

    | NEP message type    | ROS type                     | shape                                           |
    |---------------------|------------------------------|-------------------------------------------------|
    | string              | std_msgs/String              | `{data: text}`                                  |
    | bytes               | std_msgs/UInt8MultiArray     | `{layout, data}`                                |
    | image               | sensor_msgs/CompressedImage  | `{header, format, data}`: the JPEG or PNG file  |
    |                     | sensor_msgs/Image, on request | `{header, height, width, encoding, …, data}`   |
    | json                | nep/Json                     | unchanged                                       |
    | msgpack             | nep/Msgpack                  | unchanged                                       |
    | package/Type        | same name                    | unchanged: NEP's typed messages have ROS's fields |

Bytes are base64 text in JSON, and bytes in CBOR. The ROS back end encodes and decodes ROS messages.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Mapping, Sequence
from typing import cast

from nep.backends.ros import type_mapping
from nep.backends.ros_types.carriers import (
    CARRIER_TYPES,
    COMPRESSED_IMAGE_TYPE,
    RAW_IMAGE_TYPE,
    STRING_TYPE,
)
from nep.errors import DecodeError, EncodeError, NepError
from nep.i18n import _
from nep.messages import image_codec
from nep.messages.codecs import CODECS, JSON, Codec, Content, codec_for
from nep.messages.encoded import Encoded
from nep.messages.image_files import parse_header
from nep.messages.message import Message
from nep.programs.web.messages.ros_definitions import (
    JSON_TYPE,
    MSGPACK_TYPE,
    bare_type,
    definition_of,
    full_definition_text,
)
from nep.text import bounded_str, escaped

_UNKNOWN_TYPES = frozenset({"", "*"})
_STAMP = struct.Struct("<II")
_NS_PER_S = 1_000_000_000


class PayloadError(NepError):
    """Error for a message that doesn't have the shape of its type."""


def nep_type_of(ros_type: str) -> str:
    """Return the NEP message type for a ROS type, such as "string" for "std_msgs/String".

    Names without a counterpart are returned unchanged.
    """
    bare_name = bare_type(ros_type)
    if bare_name == RAW_IMAGE_TYPE:
        return "image"
    return next((each.name for each in CODECS.values() if _ros_type_of(each) == bare_name), bare_name)


def ros_type_of(msg_type: str) -> str:
    """Return the ROS type under which pages see a NEP message type."""
    if msg_type in _UNKNOWN_TYPES:
        return JSON_TYPE
    codec = codec_for(msg_type)
    return msg_type if codec is JSON and "/" in msg_type else _ros_type_of(codec)


def _ros_type_of(codec: Codec) -> str:
    shape = _shape_of(codec)
    return f"nep/{codec.name.capitalize()}" if shape == "values" else CARRIER_TYPES[shape]


def _shape_of(codec: Codec) -> Content:
    """Return the kind of ROS message that has the payloads of a codec; "values" if they are unchanged."""
    return codec.content if codec.content == codec.ros_carrier else "values"


def is_compatible(ros_type: str, msg_type: str) -> bool:
    """Return True if a page may use a ROS type on a topic.

    A topic of plain JSON accepts any type, because its messages are forwarded unchanged.

    Args:
        ros_type: Type that the page requests.
        msg_type: NEP message type of the topic.
    """
    if msg_type in _UNKNOWN_TYPES or not ros_type or ros_type_of(msg_type) == JSON_TYPE:
        return True
    requested_type = bare_type(ros_type)
    return requested_type == JSON_TYPE or nep_type_of(ros_type) == codec_or_type(msg_type)


def codec_or_type(msg_type: str) -> str:
    """Return the codec of a message type ("image" for "images"), or the type itself if it is a typed name."""
    codec = codec_for(msg_type).name
    return msg_type if codec == "json" and "/" in msg_type else codec


# ---- to pages


def to_ros(message: Message, *, as_pixels: bool = False) -> object:
    """Return the payload of a message in its ROS shape, in which bytes stay `bytes`.

    Payloads of the codecs string, bytes and image are converted; others are returned unchanged.

    Args:
        message: Message to convert.
        as_pixels: Convert an image to the pixels of ``sensor_msgs/Image``.

    Raises:
        DecodeError: The message can't be decoded.
        EncodeError: The payload has no ROS shape.
    """
    shape = _shape_of(codec_for(message.codec))
    if shape == "text":
        return {"data": message.payload}
    if shape == "bytes":
        return {"layout": {"dim": [], "data_offset": 0}, "data": message.payload}
    if shape == "image":
        ros_type = RAW_IMAGE_TYPE if as_pixels else COMPRESSED_IMAGE_TYPE
        definition = definition_of(ros_type)
        fields = definition.decode(_image_bytes(message, ros_type)) if definition is not None else {}
        header = cast("dict[str, object]", fields["header"])
        fields["header"] = {**header, "seq": (message.seq or 0) & 0xFFFFFFFF}
        return fields
    return message.payload


def ros_bytes(message: Message, *, as_pixels: bool = False) -> bytes:
    """Return a message in ROS 1 serialization.

    A message whose type has no ROS definition becomes a ``std_msgs/String`` that contains JSON. The
    arguments and exceptions are those of `to_ros`.
    """
    shape = _shape_of(codec_for(message.codec))
    if shape == "image":
        return _image_bytes(message, RAW_IMAGE_TYPE if as_pixels else COMPRESSED_IMAGE_TYPE)
    if shape != "values":
        return type_mapping.to_ros_body(CARRIER_TYPES[shape], shape, Encoded(bytes(message.data)))
    definition = definition_of(bare_type(ros_type_of(message.msg_type)))
    if definition is not None and definition.name not in {JSON_TYPE, MSGPACK_TYPE}:
        return definition.encode(_with_ros1_times(message.payload))
    json_data = bytes(message.data) if message.codec == JSON.name else JSON.encode(message.payload).data
    return type_mapping.to_ros_body(STRING_TYPE, "text", Encoded(bytes(json_data)))


def _image_bytes(message: Message, ros_type: str) -> bytes:
    """Return an image in ROS serialization; the header has the time of publication."""
    encoded = Encoded(message.data, dict(message.extension) or parse_header(message.data).extension)
    layout = image_codec.raw_layout((encoded.extension or {}).get("encoding"))
    if ros_type == COMPRESSED_IMAGE_TYPE and layout is not None:
        encoded = image_codec.encode(message.payload)
    elif ros_type == RAW_IMAGE_TYPE and layout is None:
        encoded = image_codec.raw_image(message.payload)
    body = type_mapping.to_ros_body(ros_type, "image", encoded)
    stamp_ns = message.stamp_ns
    if stamp_ns is None or not 0 <= stamp_ns < 2**32 * _NS_PER_S:
        return body
    return body[:4] + _STAMP.pack(*divmod(stamp_ns, _NS_PER_S)) + body[12:]


def _with_ros1_times(value: object) -> object:
    """Replace times of the form `{sec, nanosec}` (NEP, ROS 2) with `{secs, nsecs}` (ROS 1)."""
    if isinstance(value, dict):
        if value.keys() == {"sec", "nanosec"}:
            return {"secs": value["sec"], "nsecs": value["nanosec"]}
        return {key: _with_ros1_times(each) for key, each in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], dict | list):
        return [_with_ros1_times(each) for each in value]
    return value


# ---- from pages


def from_ros(msg: object, ros_type: str, msg_type: str) -> object:
    """Convert a message from a page to a payload. Messages of JSON topics are returned unchanged.

    Args:
        msg: Message in its ROS shape.
        ros_type: ROS type of the message.
        msg_type: NEP message type of the topic.

    Raises:
        PayloadError: The message isn't a map, or a field doesn't match; the error names the field.
    """
    shape = _shape_of(codec_for(msg_type))
    if shape == "text":
        text = _as_map(msg, ros_type).get("data", "")
        if not isinstance(text, str):
            raise _field_error("data", text, _("a string"))
        return text
    if shape == "bytes":
        return _to_bytes(_as_map(msg, ros_type).get("data", ""), "data")
    if shape == "image":
        return _image(_as_map(msg, ros_type), bare_type(ros_type))
    return _as_map(msg, ros_type) if "/" in codec_or_type(msg_type) else msg


def _as_map(msg: object, ros_type: str) -> Mapping[str, object]:
    if not isinstance(msg, Mapping):
        raise PayloadError(
            _("a message of '{type}' must be a map of its fields, not {given}").format(
                type=escaped(ros_type), given=escaped(bounded_str(msg, 60))
            )
        )
    return msg


def _to_bytes(value: object, field: str) -> bytes:
    """Convert base64 text, or a list of numbers from 0 to 255, to bytes."""
    if isinstance(value, str):
        try:
            return base64.b64decode(value, validate=True)
        except (binascii.Error, ValueError):
            raise _field_error(field, value, _("base64")) from None
    if isinstance(value, Sequence):
        try:
            return bytes(value)
        except (TypeError, ValueError):
            pass
    raise _field_error(field, value, _("base64 or numbers from 0 to 255"))


def _image(fields: Mapping[str, object], ros_type: str) -> object:
    data = _to_bytes(fields.get("data", ""), "data")
    if ros_type != RAW_IMAGE_TYPE:
        return data  # the codec reads whether it is a JPEG or a PNG
    definition = definition_of(RAW_IMAGE_TYPE)
    unpack = type_mapping.unpacker_for(
        "image", RAW_IMAGE_TYPE, full_definition_text(RAW_IMAGE_TYPE) or ""
    ).unpack
    try:
        members = (
            {each.name: fields[each.name] for each in definition.fields if each.name in fields}
            if (definition is not None)
            else {}
        )
        members.pop("header", None)
        body = b"" if definition is None else definition.encode({**members, "data": data})
        pixels, extension = unpack(memoryview(body))
    except (EncodeError, DecodeError) as error:
        raise PayloadError(str(error)) from None
    return Encoded(bytes(pixels), extension)


def _field_error(field: str, value: object, expected: str) -> PayloadError:
    return PayloadError(
        _("'{field}' is {given}; expected {wanted}").format(
            field=field, given=escaped(bounded_str(value, 60)), wanted=expected
        )
    )
