"""Type mapping: the ROS message for each message type of nep, and the conversion of its data.

| msg_type                 | ROS type                        | content                    |
|--------------------------|---------------------------------|----------------------------|
| json, and any other      | std_msgs/msg/String             | the JSON text              |
| string                   | std_msgs/msg/String             | the text                   |
| bytes, msgpack           | std_msgs/msg/UInt8MultiArray    | the bytes, no dimensions   |
| image                    | sensor_msgs/msg/CompressedImage | the JPEG or PNG file       |
| a ROS type by its name   | that type                       | its fields                 |

A ROS type has the codec "cdr": its payload is a map, its data the CDR of the message.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from nep.backends.ros2.message_types import message_types
from nep.backends.ros2.names import is_type_name
from nep.backends.ros_types.carriers import (
    BYTES_TYPE,
    CARRIER_TYPES,
    COMPRESSED_IMAGE_TYPE,
    carrier_of,
    file_encoding,
    message_codec,
    ros2_name,
)
from nep.errors import DecodeError, EncodeError, WireError
from nep.i18n import _
from nep.messages import codecs
from nep.messages.codecs import Codec, RosCarrier
from nep.messages.encoded import Encoded
from nep.messages.image_files import parse_header
from nep.messages.message import MessageKind
from nep.protocol.wire import extension_part

CDR = "cdr"
"""Name of the codec of ROS types, whose data is the CDR of the message."""
_BYTES_TYPE = ros2_name(BYTES_TYPE)
_IMAGE_TYPE = ros2_name(COMPRESSED_IMAGE_TYPE)
_CDR_HEADER = b"\0\1\0\0"
"""Encapsulation header of little-endian CDR."""
_MAX_CDR_BYTES = 2**32 - 64


@dataclass(frozen=True)
class TypeMapping:
    """Conversion between a message type of nep and a ROS type.

    Attributes:
        ros_type: ROS type.
        codec: Codec of the payloads.
        pack: Converts encoded data to a ROS message. Raises `WireError`.
        unpack: Converts a ROS message to encoded data. Raises `WireError`.
    """

    ros_type: str
    codec: Codec
    pack: Callable[[Encoded], bytes]
    unpack: Callable[[bytes], bytes | memoryview]

    def kind(self, topic: str, msg_type: str, *, is_latched: bool) -> MessageKind:
        """Return the properties that all messages of a publisher have in common."""
        return MessageKind(topic, self.codec.name, msg_type, is_latched, self.codec.decode)


def codec_for(msg_type: str) -> Codec:
    """Return the codec for a message type. Raises `NepError` for an unknown ROS type."""
    return mapping_for(msg_type).codec


def mapping_for(msg_type: str) -> TypeMapping:
    """Return the mapping for a message type. Raises `NepError` for an unknown ROS type."""
    if is_type_name(msg_type):
        return _ros_mapping(message_types().validate(msg_type))
    codec, carrier = codecs.codec_for(msg_type), carrier_of(msg_type)
    encode, pack, unpack = _CONVERSIONS[carrier]
    if encode is not None and codec.content == carrier:
        codec = replace(codec, encode=partial(encode, codec))
    return TypeMapping(ros2_name(CARRIER_TYPES[carrier]), codec, pack, unpack)


# ---- ROS message types by name


def _ros_mapping(name: str) -> TypeMapping:
    types = message_types()
    codec = message_codec(
        CDR, 0, partial(types.encode, name), partial(types.decode, name), partial(_check_map, name)
    )
    return TypeMapping(name, codec, _pack_cdr, bytes)


def _check_map(name: str, payload: object) -> None:
    if not isinstance(payload, Mapping):
        raise EncodeError(
            name, type(payload).__name__, _("publish a map of the fields of '{name}'").format(name=name)
        )


def _pack_cdr(encoded: Encoded) -> bytes:
    data = _data_without_extension(encoded)
    if len(data) < 4 or data[:1] != b"\0" or data[1] > 1:
        raise WireError(_("a ROS message must begin with the 4 bytes of the CDR header"), len(data))
    return data


# ---- nep message types


def _data_without_extension(encoded: Encoded) -> bytes:
    # ROS messages can't carry extensions. Raises `WireError` as other back ends do.
    if encoded.extension:
        extension_part(encoded.extension)
    data = encoded.data if isinstance(encoded.data, bytes) else bytes(encoded.data)
    if len(data) > _MAX_CDR_BYTES:
        raise WireError(_("a ROS message must be smaller than 4 GB"), len(data))
    return data


def _encode_text(codec: Codec, payload: object) -> Encoded:
    # Rejects zero bytes, which end a string in ROS. Raises `EncodeError`.
    encoded = codec.encode(payload)
    if 0 in encoded.data:
        raise EncodeError(codec.name, "str", _null_character_reason())
    return encoded


def _null_character_reason() -> str:
    return _("the text contains a null character, which isn't allowed in ROS strings; use the type 'bytes'")


def _pack_text(encoded: Encoded) -> bytes:
    data = _data_without_extension(encoded)
    if 0 in data:
        raise WireError(_null_character_reason(), len(data))
    return b"".join((_CDR_HEADER, struct.pack("<I", len(data) + 1), data, b"\0"))


def _unpack_text(cdr: bytes) -> memoryview:
    (size,) = _read_numbers(cdr, "I", 4)
    if not 0 < size <= len(cdr) - 8 or cdr[7 + size] != 0:
        raise WireError(_("not a ROS string"), len(cdr))
    return memoryview(cdr)[8 : 7 + size]


def _pack_bytes(encoded: Encoded) -> bytes:
    data = _data_without_extension(encoded)
    return b"".join((_CDR_HEADER, struct.pack("<III", 0, 0, len(data)), data))


def _unpack_bytes(cdr: bytes) -> bytes | memoryview:
    dimensions, _offset, size = _read_numbers(cdr, "III", 4)
    if dimensions:
        return _read_data_field(_BYTES_TYPE, cdr)
    if size > len(cdr) - 16:
        raise WireError(_("not a ROS byte array"), len(cdr))
    return memoryview(cdr)[16 : 16 + size]


def _read_numbers(cdr: bytes, format_chars: str, offset: int) -> tuple[int, ...]:
    # The header has the byte order. Raises `WireError`.
    if len(cdr) < offset + 4 * len(format_chars) or cdr[0] != 0 or cdr[1] > 1:
        raise WireError(_("not a ROS message"), len(cdr))
    return struct.unpack_from(f"{'<' if cdr[1] else '>'}{format_chars}", cdr, offset)


def _read_data_field(name: str, cdr: bytes) -> bytes:
    # Raises `WireError`.
    try:
        decoded = message_types().decode(name, cdr)
    except DecodeError as error:
        raise WireError(error.reason, len(cdr)) from error
    data = decoded.get("data") if isinstance(decoded, dict) else None
    return data if isinstance(data, bytes) else b""


def _encode_image(codec: Codec, payload: object) -> Encoded:
    # Rejects raw images. Raises `EncodeError`.
    encoded = codec.encode(payload)
    if not file_encoding(encoded):
        raise EncodeError(codec.name, type(payload).__name__, _raw_image_reason())
    return encoded


def _raw_image_reason() -> str:
    return _(
        "arrays of this type can't be compressed as JPEG or PNG; publish a 'uint8' or 'uint16' array, "
        "or a 'sensor_msgs/msg/Image' as a map of its fields"
    )


def _pack_image(encoded: Encoded) -> bytes:
    data = _data_without_extension(encoded)
    try:
        kind = parse_header(data).kind
    except DecodeError as error:
        raise WireError(_raw_image_reason(), len(data)) from error
    seconds, nanoseconds = divmod(time.time_ns(), 10**9)
    # stamp, empty frame_id with padding, format, file
    header = struct.pack("<iI", seconds, nanoseconds) + struct.pack("<I4x", 1)
    name = kind.encode() + b"\0"
    format_field = struct.pack("<I", len(name)) + name + bytes(-len(name) % 4)
    return b"".join((_CDR_HEADER, header, format_field, struct.pack("<I", len(data)), data))


def _unpack_image(cdr: bytes) -> bytes:
    return _read_data_field(_IMAGE_TYPE, cdr)


_RejectingEncoder = Callable[[Codec, object], Encoded]
_CONVERSIONS: Mapping[
    RosCarrier,
    tuple[_RejectingEncoder | None, Callable[[Encoded], bytes], Callable[[bytes], bytes | memoryview]],
] = {
    "text": (_encode_text, _pack_text, _unpack_text),
    "bytes": (None, _pack_bytes, _unpack_bytes),
    "image": (_encode_image, _pack_image, _unpack_image),
}
"""Encoder that rejects what a carrier can't contain, and conversions to and from the ROS message."""
