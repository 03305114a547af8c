"""Type mapping between message types of nep and ROS messages.

| msg_type                      | ROS message                 | data                                     |
|-------------------------------|-----------------------------|------------------------------------------|
| json, and other non-ROS names | std_msgs/String             | JSON text in `data`                      |
| string                        | std_msgs/String             | the text in `data`                       |
| bytes, msgpack                | std_msgs/UInt8MultiArray    | the bytes in `data`                      |
| image                         | sensor_msgs/CompressedImage | JPEG or PNG in `data`                    |
| sensor_msgs/Image             | itself                      | raw pixels, an array                     |
| package/Type                  | itself                      | see `nep.backends.ros_types.definition`  |

The ROS type announced by the publisher's connection decides how a message is decoded: a subscriber of `image`
accepts both image messages, and one of `json` decodes any message to a map.
"""

from __future__ import annotations

import re
import struct
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from nep.backends.ros.library import message_definition
from nep.backends.ros_types.carriers import (
    BYTES_TYPE,
    CARRIER_TYPES,
    COMPRESSED_IMAGE_TYPE,
    RAW_IMAGE_TYPE,
    STRING_TYPE,
    carrier_of,
    file_encoding,
    message_codec,
)
from nep.backends.ros_types.definition import Definition, parse
from nep.errors import EncodeError, NepError, WireError
from nep.i18n import _
from nep.messages import image_codec
from nep.messages.codecs import IMAGE, JSON, Codec, RosCarrier, codec_for
from nep.messages.encoded import Encoded
from nep.messages.image_codec import image_info, raw_array, raw_image, raw_layout
from nep.text import escaped, shortened

STAMP = struct.Struct("<III")
"""Binary layout of the start of a message with a header: seq, secs and nsecs."""
_LENGTH = struct.Struct("<I")
_ROS_TYPE = re.compile(r"[A-Za-z]\w*/[A-Z]\w*", re.ASCII)
_IMAGE_TYPES = (RAW_IMAGE_TYPE, COMPRESSED_IMAGE_TYPE)
_MD5SUMS = {
    STRING_TYPE: "992ce8a1687cec8c8bd883ec73ca41d1",
    BYTES_TYPE: "82373f1612381bb6ee473b5cd6f5d89c",
    COMPRESSED_IMAGE_TYPE: "8f7a12909da2c9d3332d540a0977563f",
    RAW_IMAGE_TYPE: "060021388200f6f0f447d0fcd9c64743",
}
"""MD5 sums of the built-in message definitions, by type."""
_EMPTY_LAYOUT = bytes(8)
_DEPTH_HEADER_BYTES = 12
"""Size in bytes of the header that compressed_depth_image_transport writes before the PNG.

The header has no meaning for 16-bit images.
"""
_CODEC_NUMBER = 6
"""Codec number of ROS messages. Never sent, because the native wire doesn't transfer ROS messages."""
_definitions: dict[str, Definition] = {}

UnpackedData = tuple[bytes | memoryview, Mapping[str, object] | None]
UnpackFunction = Callable[[memoryview], UnpackedData]


def is_ros_type(msg_type: str) -> bool:
    """Return True for a ROS type name: "package/Type", with a capital T."""
    return _ROS_TYPE.fullmatch(msg_type) is not None


def ros_type_of(msg_type: str) -> str:
    """Return the ROS message type in which messages of a nep message type are transferred."""
    return msg_type if is_ros_type(msg_type) else CARRIER_TYPES[carrier_of(msg_type)]


def installed_definition(name: str) -> Definition:
    """Return the definition of an installed ROS message type.

    Raises `NepError`, whose message names the package to install.
    """
    if name not in _definitions:
        definition = message_definition(name)
        if definition is None:
            raise not_installed_error(name, _("ROS message"))
        _definitions[name] = parse(name, definition[0])
    return _definitions[name]


def not_installed_error(name: str, kind: str) -> NepError:
    """Return the error for a type that isn't installed.

    Args:
        name: Name of the type.
        kind: Kind of the type, for the error message, such as "ROS message".
    """
    display_name = escaped(shortened(name, 100))
    return NepError(
        _(
            "unknown {what} '{name}'; check the spelling, or install it with 'sudo apt install "
            "python3-{package}'"
        ).format(
            what=kind, name=display_name, package=display_name.partition("/")[0].replace("_", "-").lower()
        )
    )


# ---- encoding


def codec_of(msg_type: str) -> Codec:
    """Return the codec of a message type. Raises `NepError` for a ROS type that isn't installed."""
    if msg_type in _IMAGE_TYPES:
        return _image_codec(installed_definition(msg_type))
    if is_ros_type(msg_type):
        return ros_codec(installed_definition(msg_type))
    codec = codec_for(msg_type)
    return replace(codec, encode=_encode_file) if codec is IMAGE else codec


def ros_codec(definition: Definition) -> Codec:
    """Return a codec that converts between maps and messages of a ROS type."""

    def encode(payload: object) -> bytes:
        return definition.encode(_with_stamp(payload) if definition.has_header else payload)

    return message_codec("ros", _CODEC_NUMBER, encode, definition.decode, definition.check)


def _with_stamp(payload: object) -> object:
    # Fills in the current time if the header has none, and accepts ROS 2's field names of a time.
    if not isinstance(payload, Mapping):
        return payload
    header = payload.get("header", {})
    if not isinstance(header, Mapping):
        return payload
    if "stamp" in header:
        stamp = header["stamp"]
        if not isinstance(stamp, Mapping) or stamp.keys() != {"sec", "nanosec"}:
            return payload
        ros_stamp = {"secs": stamp["sec"], "nsecs": stamp["nanosec"]}
        return {**payload, "header": {**header, "stamp": ros_stamp}}
    secs, nsecs = divmod(time.time_ns(), 1_000_000_000)
    return {**payload, "header": {**header, "stamp": {"secs": secs, "nsecs": nsecs}}}


def _image_codec(definition: Definition) -> Codec:
    map_codec = ros_codec(definition)

    def encode(payload: object) -> Encoded:
        if isinstance(payload, Mapping):
            return map_codec.encode(payload)
        return raw_image(payload) if definition.name == RAW_IMAGE_TYPE else _encode_file(payload)

    def check(payload: object) -> None:
        if not isinstance(payload, Mapping):
            image_codec.check_image(payload)

    return replace(IMAGE, encode=encode, check=check)


def _encode_file(payload: object) -> Encoded:
    encoded = image_codec.encode(payload)
    _check_file(encoded, type(payload).__name__)
    return encoded


def _check_file(encoded: Encoded, kind: str) -> str:
    encoding = file_encoding(encoded)
    if not encoding:
        raise EncodeError(
            "image", kind, _("'{name}' supports only JPEG and PNG; use the type '{raw}'").format(
                name=COMPRESSED_IMAGE_TYPE, raw=RAW_IMAGE_TYPE
            )
        )  # fmt: skip
    return encoding


def to_ros_body(ros_type: str, carrier: RosCarrier | None, encoded: Encoded) -> bytes:
    """Convert encoded data to the body of a ROS message.

    Args:
        ros_type: Type of the ROS message.
        carrier: Carrier of the codec of `encoded`; None if its data is a ROS message already.
        encoded: Data and extension.

    Raises:
        EncodeError: The data is a JPEG or PNG file that can't be read, or `ros_type` supports only such
            files.
        DecodeError: The data doesn't match the image format in the extension, or `ros_type` can't carry
            the extension.
    """
    data, extension = encoded.data, encoded.extension
    if carrier == "image" and extension:
        header = bytes(4) + _current_stamp() + bytes(4)
        if ros_type == RAW_IMAGE_TYPE:
            return header + _raw_image_body(data, extension)
        kind = _check_file(encoded, type(data).__name__).encode()
        return b"".join((header, _LENGTH.pack(len(kind)), kind, _LENGTH.pack(len(data)), data))
    if extension:
        raise WireError(_("a '{name}' can't carry an extension").format(name=ros_type), len(data))
    if carrier == "image" and ros_type == COMPRESSED_IMAGE_TYPE and _has_image_magic(data):
        info = image_info(data)
        if info is None:
            raise EncodeError("image", type(data).__name__, _("not a readable image"))
        return to_ros_body(ros_type, carrier, Encoded(data, info))
    if carrier is None or carrier == "image":
        return bytes(data)
    size = _LENGTH.pack(len(data))
    return b"".join((size, data)) if ros_type == STRING_TYPE else b"".join((_EMPTY_LAYOUT, size, data))


def _has_image_magic(data: bytes | memoryview) -> bool:
    return bytes(data[:3]) == b"\xff\xd8\xff" or bytes(data[:4]) == b"\x89PNG"


def _current_stamp() -> bytes:
    return struct.pack("<II", *divmod(time.time_ns(), 1_000_000_000))


def _raw_image_body(data: bytes | memoryview, extension: Mapping[str, object]) -> bytes:
    layout, shape = raw_layout(extension.get("encoding")), extension.get("shape")
    if layout is None or not isinstance(shape, list | tuple):
        raise WireError(
            _("'{name}' supports only raw pixels; publish an array, or use the type 'image'").format(
                name=RAW_IMAGE_TYPE
            )
        )
    frame = raw_array(memoryview(data), layout, shape)
    encoding = str(extension["encoding"])
    name = {"bgr16": "16UC3", "bgra16": "16UC4"}.get(encoding, encoding).encode()
    height, width = frame.shape[:2]
    return b"".join((
        struct.pack("<II", height, width), _LENGTH.pack(len(name)), name,
        struct.pack("<BII", 0, frame.strides[0], len(data)), data,
    ))  # fmt: skip


# ---- ROS messages to codec data


@dataclass(frozen=True)
class Unpacker:
    """Decoder for the messages of one publisher.

    Attributes:
        codec: Codec of the converted data.
        msg_type: Message type of the converted data.
        unpack: Converts the body of a ROS message to data and extension; raises `WireError` for an invalid
            body.
        has_header: True if the ROS message starts with a header.
    """

    codec: Codec
    msg_type: str
    unpack: UnpackFunction
    has_header: bool


def unpacker_for(msg_type: str, ros_type: str, text: str, md5sum: str = "*") -> Unpacker:
    """Return the decoder for a subscriber.

    Args:
        msg_type: Message type of the subscriber.
        ros_type: ROS type of the publisher.
        text: Definition of `ros_type`; "" if the publisher doesn't send it.
        md5sum: MD5 sum of the definition, or "*" if unknown.

    Raises:
        NepError: The types aren't compatible, their definitions differ, or the definition of `ros_type`
            is invalid or not installed.
    """
    codec = codec_for(msg_type)
    if md5sum not in {"*", _MD5SUMS.get(ros_type, md5sum)}:
        raise version_error(ros_type)
    if is_ros_type(msg_type) and msg_type != ros_type:
        raise _type_mismatch_error(msg_type, ros_type)
    is_image = codec.ros_carrier == "image"
    if ros_type in _IMAGE_TYPES and (msg_type in _IMAGE_TYPES or is_image):
        return Unpacker(
            codec if is_image else IMAGE,
            codec.name if is_image else IMAGE.name,
            _unpack_raw_image if ros_type == RAW_IMAGE_TYPE else _unpack_compressed_image,
            True,
        )
    if not is_ros_type(msg_type) and ros_type == CARRIER_TYPES[carrier_of(msg_type)]:
        unpack = _unpack_string if ros_type == STRING_TYPE else _unpack_array
        return Unpacker(codec, msg_type, unpack, has_header=False)
    if not is_ros_type(msg_type) and codec is not JSON:
        raise _type_mismatch_error(msg_type, ros_type)
    definition = parse(ros_type, text) if text else _matching_definition(ros_type, md5sum)
    return Unpacker(ros_codec(definition), ros_type, lambda body: (body, None), definition.has_header)


def _matching_definition(ros_type: str, md5sum: str) -> Definition:
    # For a publisher that doesn't announce its definition.
    definition, installed = installed_definition(ros_type), message_definition(ros_type)
    if installed is None or md5sum not in {"*", installed[1]}:
        raise version_error(ros_type)
    return definition


def version_error(ros_type: str) -> NepError:
    """Return the error for a type that the publisher defines differently from this program."""
    return NepError(
        _(
            "the publisher's '{ros_type}' has different fields from the definition on this computer; "
            "use the same version on both sides"
        ).format(ros_type=escaped(shortened(ros_type, 100)))
    )


def _type_mismatch_error(msg_type: str, ros_type: str) -> NepError:
    return NepError(
        _(
            "the publisher sends '{ros_type}', which a subscriber of '{msg_type}' can't read; "
            "subscribe with the publisher's type"
        ).format(ros_type=ros_type, msg_type=msg_type)
    )


def _read_sized(body: memoryview, offset: int) -> tuple[memoryview, int]:
    # Returns the bytes after the length at `offset`, and the offset of their end.
    (size,) = _LENGTH.unpack_from(body, offset)
    if offset + 4 + size > len(body):
        raise WireError(_("the data is truncated"), len(body))
    return body[offset + 4 : offset + 4 + size], offset + 4 + size


def _read_all(body: memoryview, offset: int) -> memoryview:
    data, end = _read_sized(body, offset)
    if end != len(body):
        raise WireError(
            _("{count} unexpected bytes follow the message").format(count=len(body) - end), len(body)
        )
    return data


def _unpack_string(body: memoryview) -> UnpackedData:
    return _read_all(body, 0), None


def _unpack_array(body: memoryview) -> UnpackedData:
    (count,) = _LENGTH.unpack_from(body, 0)
    position = 4
    if count * 12 > len(body):
        raise WireError(_("the data is truncated"), len(body))
    for _number in range(count):
        _label, position = _read_sized(body, position)
        position += 8
    (offset,) = _LENGTH.unpack_from(body, position)
    return _read_all(body, position + 4)[offset:], None


def _unpack_compressed_image(body: memoryview) -> UnpackedData:
    _frame, offset = _read_sized(body, STAMP.size)
    kind, offset = _read_sized(body, offset)
    data = _read_all(body, offset)
    if b"compressedDepth" in bytes(kind) and bytes(kind[:4]) == b"16UC":
        data = data[_DEPTH_HEADER_BYTES:]
    return data, image_info(data)


def _unpack_raw_image(body: memoryview) -> UnpackedData:
    # Returns the rows without padding, in little-endian order.
    _frame, offset = _read_sized(body, STAMP.size)
    height, width = struct.unpack_from("<II", body, offset)
    name, offset = _read_sized(body, offset + 8)
    is_big_endian, step = struct.unpack_from("<BI", body, offset)
    pixels = _read_all(body, offset + 5)
    encoding = str(name, "utf-8", "replace")
    encoding = f"{encoding}C1" if encoding in {"8U", "16U", "32F"} else encoding
    layout = raw_layout(encoding)
    if layout is None:
        raise WireError(
            _(
                "the encoding '{name}' isn't supported; use an encoding such as 'bgr8', 'mono8' or '16UC1'"
            ).format(name=encoding)
        )
    item_bytes = int(layout.dtype[-1])
    row_bytes = width * layout.channels * item_bytes
    if step < row_bytes or step * height != len(pixels):
        raise WireError(
            _("{width} x {height} pixels of '{name}' don't match {size} bytes").format(
                width=width, height=height, name=encoding, size=len(pixels)
            )
        )
    if step != row_bytes:
        rows = (pixels[offset : offset + row_bytes] for offset in range(0, len(pixels), step))
        pixels = memoryview(b"".join(rows))
    if is_big_endian and item_bytes > 1:
        pixels = _swap_bytes(pixels, item_bytes)
    return pixels, {"shape": [height, width, layout.channels], "encoding": encoding}


def _swap_bytes(pixels: memoryview, size: int) -> memoryview:
    swapped = bytearray(len(pixels))
    for number in range(size):
        swapped[number::size] = pixels[size - 1 - number :: size]
    return memoryview(bytes(swapped))
