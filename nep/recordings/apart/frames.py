"""Frames exchanged with the reader process: msgpack maps with a prefix that contains the length."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import IO

from nep.messages.packing import pack, unpack
from nep.recordings.file_reader import FileInfo
from nep.recordings.formats.channels import ChannelDefinition
from nep.recordings.formats.index import AttachedFile, CorruptRange
from nep.recordings.formats.records import RawMessage, pack_message_head

_LENGTH = struct.Struct("<I")
_MAX_FRAME_BYTES = 2**31 - 1


def write_frame(stream: IO[bytes], content: Mapping[str, object]) -> None:
    """Write a frame and flush the stream. Raises `OSError`, or `ValueError` if the stream is closed."""
    packed = pack(content)
    stream.write(_LENGTH.pack(len(packed)))
    stream.write(packed)
    stream.flush()


def read_frame(stream: IO[bytes]) -> dict[str, object] | None:
    """Read a frame; return None at the end of the stream or if the data is invalid. Raises `OSError`."""
    header = stream.read(_LENGTH.size)
    if len(header) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(header)
    packed = stream.read(length) if length <= _MAX_FRAME_BYTES else b""
    if len(packed) < length:
        return None
    try:
        content = unpack(packed)
    except ValueError:
        return None
    return content if isinstance(content, dict) else None


def pack_messages(messages: Iterable[RawMessage]) -> bytes:
    """Encode messages as consecutive MCAP records, which `records_in` decodes."""
    pieces: list[bytes | memoryview] = []
    for raw in messages:
        size = raw.data.nbytes
        pieces += (pack_message_head(raw.channel, raw.sequence, raw.log_ns, raw.publish_ns, size), raw.data)
    return b"".join(pieces)


def corruption_to_plain(damage: Iterable[CorruptRange]) -> list[dict[str, object]]:
    """Convert the damage of a file to plain values for a frame."""
    return [asdict(each) for each in damage]


def corruption_from_plain(value: object) -> tuple[CorruptRange, ...]:
    """Convert plain values of a frame to the damage of a file; no damage if `value` isn't a list.

    Raises `TypeError` for invalid items.
    """
    return tuple(CorruptRange(**each) for each in value) if isinstance(value, list) else ()


def file_info_to_plain(info: FileInfo) -> dict[str, object]:
    """Convert the properties of a file to plain values for a frame."""
    return {
        **{name: getattr(info, name) for name in _SCALAR_FIELDS},
        "channels": {
            number: (
                each.topic,
                each.message_encoding,
                each.schema_name,
                each.schema_encoding,
                each.schema_data,
                each.metadata,
            )
            for number, each in info.channels.items()
        },
        "counts": dict(info.counts),
        "metadata": [(name, dict(values)) for name, values in info.metadata],
        "attachments": [asdict(each) for each in info.attachments],
        "compressions": dict(info.compressions),
    }


_SCALAR_FIELDS = ("start_ns", "end_ns", "size_bytes", "is_complete", "profile", "library")


def file_info_from_plain(value: object) -> FileInfo:
    """Convert plain values of a frame to the properties of a file.

    Raises `TypeError` or `KeyError` for invalid data.
    """
    if not isinstance(value, dict):
        raise TypeError("facts")
    definitions = {
        number: ChannelDefinition(topic, encoding, name, kind, data, tuple(map(tuple, metadata)))
        for number, (topic, encoding, name, kind, data, metadata) in value["channels"].items()
    }
    return FileInfo(
        channels=definitions,
        counts=value["counts"],
        metadata=tuple((name, values) for name, values in value["metadata"]),
        attachments=tuple(AttachedFile(**each) for each in value["attachments"]),
        compressions=value["compressions"],
        **{name: value[name] for name in _SCALAR_FIELDS},
    )
