"""Protocol Buffers messages that wrap recorded images, text and bytes.

The payload is contained unchanged and in one piece, so that it is written without conversion and read as a
slice. Programs without nep (Foxglove, Lichtblick) can show the payload, and a replay has the original bytes.
JSON would need base64: a third larger, and 0.8 ms per image. There are four messages:

    foxglove.CompressedImage    timestamp 1, data 2, format 3, frame_id 4
    foxglove.RawImage           timestamp 1, width 2, height 3, encoding 4, step 5, data 6, frame_id 7
    nep.Text                    data 1 (string)
    nep.Bytes                   data 1 (bytes)

Each message may have the field 1000, placed before the data, which other programs ignore: a msgpack map of
properties that the channel lacks (`nep.recordings.formats.channels`).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from functools import cache

EXTRA_FIELD = 1000
"""Number of the field that contains properties of nep."""
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_U32, _U64 = struct.Struct("<I"), struct.Struct("<Q")
_NS_PER_S = 1_000_000_000


def _encode_varint(number: int) -> bytes:
    encoded = bytearray()
    while number > 0x7F:
        encoded.append(number & 0x7F | 0x80)
        number >>= 7
    encoded.append(number)
    return bytes(encoded)


def bytes_field_head(number: int, size_bytes: int) -> bytes:
    """Encode the part of a field of bytes, text or a message that precedes its content.

    Args:
        number: Number of the field.
        size_bytes: Size of the content.
    """
    return _encode_varint(number << 3 | _BYTES) + _encode_varint(size_bytes)


def _complete_field(number: int, data: bytes) -> bytes:
    return bytes_field_head(number, len(data)) + data


def fixed_field(number: int, value: int) -> bytes:
    """Encode a field of type `fixed32`."""
    return _encode_varint(number << 3 | _FIXED32) + _U32.pack(value)


def timestamp_field(number: int, stamp_ns: int) -> bytes:
    """Encode a field of type `google.protobuf.Timestamp`.

    Args:
        number: Number of the field.
        stamp_ns: Time in ns since 1970.
    """
    seconds, nanoseconds = divmod(stamp_ns, _NS_PER_S)
    return _complete_field(number, b"\x08" + _encode_varint(seconds) + b"\x10" + _encode_varint(nanoseconds))


def _read_varint(data: memoryview, offset: int) -> tuple[int, int]:
    number = shift = 0
    while shift < 70:
        byte = data[offset]
        offset += 1
        number |= (byte & 0x7F) << shift
        if byte < 0x80:
            return number, offset
        shift += 7
    raise ValueError("varint")


def fields(message: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Iterate over the fields of a message as (number, value).

    A value is a whole number, or a slice of the message. Raises `ValueError` for invalid data.
    """
    offset, size = 0, len(message)
    while offset < size:
        try:
            tag, offset = _read_varint(message, offset)
            kind = tag & 7
            value: int | memoryview
            if kind == _VARINT:
                value, offset = _read_varint(message, offset)
            elif kind == _BYTES:
                length, offset = _read_varint(message, offset)
                value, offset = message[offset : offset + length], offset + length
            elif kind == _FIXED32:
                value, offset = _U32.unpack_from(message, offset)[0], offset + 4
            elif kind == _FIXED64:
                value, offset = _U64.unpack_from(message, offset)[0], offset + 8
            else:
                raise ValueError("kind")
        except (IndexError, struct.error) as error:
            raise ValueError("cut") from error
        if offset > size:
            raise ValueError("cut")
        yield tag >> 3, value


# ---- FileDescriptorSet for other programs

_INT64, _FIXED32_TYPE, _INT32, _STRING, _BYTES_TYPE, _MESSAGE = 3, 7, 5, 9, 12, 11
_STAMP = "google.protobuf.Timestamp"
_Fields = Mapping[str, tuple[int, int]]
"""Field numbers and types by field name."""

SCHEMAS: Mapping[str, _Fields] = {
    "foxglove.CompressedImage": {
        "timestamp": (1, _MESSAGE),
        "data": (2, _BYTES_TYPE),
        "format": (3, _STRING),
        "frame_id": (4, _STRING),
    },
    "foxglove.RawImage": {
        "timestamp": (1, _MESSAGE),
        "width": (2, _FIXED32_TYPE),
        "height": (3, _FIXED32_TYPE),
        "encoding": (4, _STRING),
        "step": (5, _FIXED32_TYPE),
        "data": (6, _BYTES_TYPE),
        "frame_id": (7, _STRING),
    },
    "nep.Text": {"data": (1, _STRING)},
    "nep.Bytes": {"data": (1, _BYTES_TYPE)},
}
"""Fields of each message, by the name of the message."""


def _message_descriptor(name: str, field_types: _Fields) -> bytes:
    encoded = _complete_field(1, name.encode())
    for field_name, (number, kind) in field_types.items():
        encoded_field = _complete_field(1, field_name.encode())
        encoded_field += (
            b"\x18" + _encode_varint(number) + b"\x20\x01\x28" + _encode_varint(kind)
        )  # number, optional, type
        if kind == _MESSAGE:
            encoded_field += _complete_field(6, f".{_STAMP}".encode())
        encoded += _complete_field(2, encoded_field)
    return encoded


def _file_descriptor(name: str, package: str, dependency: str, message: bytes) -> bytes:
    encoded = _complete_field(1, name.encode()) + _complete_field(2, package.encode())
    if dependency:
        encoded += _complete_field(3, dependency.encode())
    return encoded + _complete_field(4, message) + _complete_field(12, b"proto3")


@cache
def descriptor_set(schema: str) -> bytes:
    """Return the data of an MCAP schema record: the descriptor of a message and its dependencies.

    Args:
        schema: Name of the message.
    """
    package, name = schema.split(".")
    message = _message_descriptor(name, SCHEMAS[schema])
    dependency = "google/protobuf/timestamp.proto" if "timestamp" in SCHEMAS[schema] else ""
    encoded = b""
    if dependency:
        stamp = _message_descriptor("Timestamp", {"seconds": (1, _INT64), "nanos": (2, _INT32)})
        encoded += _complete_field(1, _file_descriptor(dependency, "google.protobuf", "", stamp))
    return encoded + _complete_field(
        1, _file_descriptor(f"{package}/{name}.proto", package, dependency, message)
    )
