"""Channels of a recording, with encodings from which messages can be restored exactly.

A channel contains messages of one publisher on one topic that have the same codec, type and latched flag;
these properties are in the channel's metadata. A record has the log time (time of receipt), the publish time
(time stamp) and the lower half of the sequence number. JSON and msgpack are stored as received. Images, text
and bytes are stored in a Protocol Buffers message that contains them unchanged
(`nep.recordings.formats.protobuf`). Other data, such as invalid JSON, is wrapped in such a message, too;
properties that don't fit a record, such as sequence numbers above 2^32, are in its field 1000. See the table
in docs/recordings.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import orjson

from nep.errors import DecodeError
from nep.messages.codecs import CODECS, RecordedForm, codec_for
from nep.messages.image_codec import image_info, raw_layout
from nep.messages.message import NO_EXTENSION, Message, MessageKind, message_kind, received_message
from nep.messages.packing import pack, unpack
from nep.recordings.formats.protobuf import (
    EXTRA_FIELD,
    bytes_field_head,
    descriptor_set,
    fields,
    fixed_field,
    timestamp_field,
)
from nep.recordings.formats.records import RawMessage
from nep.recordings.formats.schemas import schema_of

METADATA_PREFIX = "nep."
"""Prefix of nep's keys in the metadata of channels."""
_MAX_U32, _MAX_U64 = 2**32 - 1, 2**64 - 1
Role = str
RECORDER_TOPICS: Mapping[Role, str] = {
    "figures": "/nep/recording/figures",
    "alerts": "/nep/recording/alerts",
    "notes": "/nep/recording/notes",
    "runs": "/nep/recording/runs",
    "alarms": "/nep/recording/alarms",
}
"""Topics of the entries that the recorder itself writes, by role.

The entries are message counts, alerts, notes, and events of runs and alarms.
"""


@dataclass(frozen=True)
class ChannelDefinition:
    """Channel and its schema, as stored in the file.

    Attributes:
        topic: Name of the topic.
        message_encoding: Encoding of the messages, such as "json".
        schema_name: Name of the message type.
        schema_encoding: Encoding of the schema, such as "jsonschema"; "" without a schema.
        schema_data: Encoded schema.
        metadata: Keys and values of the channel's metadata.
    """

    topic: str
    message_encoding: str
    schema_name: str
    schema_encoding: str
    schema_data: bytes
    metadata: tuple[tuple[str, str], ...]


class Encoding(NamedTuple):
    """Encoding of a message in a record.

    Attributes:
        form: Name of the encoding, such as "json" or "picture".
        prefix: Bytes that precede the message's data.
        sequence: Sequence number in the record.
        publish_ns: Publish time in the record (ns since 1970).
        is_decodable: True if the message can be decoded.
        is_self_contained: True if the record contains all properties, because its publisher has no
            channel.
    """

    form: str
    prefix: bytes
    sequence: int
    publish_ns: int
    is_decodable: bool
    is_self_contained: bool = False


_SCHEMAS = {"picture": "foxglove.CompressedImage", "raw": "foxglove.RawImage", "text": "nep.Text"}
_DATA_FIELD_NUMBERS = {"picture": 2, "raw": 6, "text": 1, "wrapped": 1}
_VIEWABLE_LAYOUTS = frozenset({
    "bgr8", "bgra8", "rgb8", "rgba8", "mono8", "mono16", "8UC1", "8UC3", "16UC1", "32FC1",
})  # fmt: skip
"""Pixel layouts supported by `foxglove.RawImage`."""


# ---- encoding


def encoding_of(message: Message, log_ns: int, *, is_self_contained: bool = False) -> Encoding:
    """Return the encoding of a message. Never raises.

    Args:
        message: Message to store.
        log_ns: Time of receipt in ns since 1970.
        is_self_contained: Store all properties in the record, because its publisher has no channel.
    """
    seq, stamp = message.seq, message.stamp_ns
    codec, extension = message.kind.codec, message.extension
    form, is_decodable, prefix = _determine_form(message, log_ns if stamp is None else stamp)
    extra: dict[str, Any] = {}
    if extension:
        extra["extension"] = dict(extension)
    if seq is not None and not 0 <= seq <= _MAX_U32:
        extra["seq"] = seq
    if stamp is not None and not 0 <= stamp <= _MAX_U64:
        extra["stamp_ns"] = stamp
    if is_self_contained:
        kind = message.kind
        extra.update(
            codec=codec,
            msg_type=kind.msg_type,
            publisher=message.publisher,
            is_latched=kind.is_latched,
            seq=seq,
            stamp_ns=stamp,
        )
    if extra and form not in _DATA_FIELD_NUMBERS:
        form = "wrapped"
    if form in _DATA_FIELD_NUMBERS:
        if extra:
            packed = _pack_extra(extra)
            prefix += bytes_field_head(EXTRA_FIELD, len(packed)) + packed
        prefix += bytes_field_head(_DATA_FIELD_NUMBERS[form], message.size_bytes)
    sequence = 0 if seq is None else seq & _MAX_U32
    publish_ns = log_ns if stamp is None else max(0, min(stamp, _MAX_U64))
    return Encoding(form, prefix, sequence, publish_ns, is_decodable, is_self_contained)


def _pack_extra(extra: Mapping[str, Any]) -> bytes:
    try:
        return pack(extra)
    except ValueError:  # an extension or number that can't have been received from a wire
        filtered = {key: value for key, value in extra.items() if key != "extension"}
        numbers = {
            key: max(-(2**63), min(each, _MAX_U64)) for key, each in filtered.items() if type(each) is int
        }
        return pack(filtered | numbers)


def _determine_form(message: Message, stamp_ns: int) -> tuple[str, bool, bytes]:
    # (form, whether it can be decoded, fields before its data)
    codec = CODECS.get(message.kind.codec)
    form: RecordedForm = "wrapped" if codec is None else codec.recorded_as
    if form == "json":
        try:
            orjson.loads(message.raw)
        except orjson.JSONDecodeError:
            return "wrapped", _is_decodable(message), b""
        return "json", True, b""
    if form == "image":
        return _determine_image_form(message, stamp_ns)
    is_decodable = (codec is not None and codec.content == "bytes") or _is_decodable(message)
    return form if is_decodable else "wrapped", is_decodable, b""


def _is_decodable(message: Message) -> bool:
    try:
        message.kind.decode(message.raw, message.extension)
    except DecodeError:
        return False
    return True


def _determine_image_form(message: Message, stamp_ns: int) -> tuple[str, bool, bytes]:
    encoding = message.extension.get("encoding")
    time = timestamp_field(1, max(0, min(stamp_ns, _MAX_U64)))
    layout = raw_layout(encoding)
    if layout is None:
        info = image_info(message.raw)
        if info is None:
            return "wrapped", False, b""
        kind = str(info["encoding"]).encode()
        return "picture", True, time + bytes_field_head(3, len(kind)) + kind
    shape = message.extension.get("shape")
    sides = shape[:2] if isinstance(shape, list | tuple) else ()
    if len(sides) != 2 or not all(type(side) is int and 0 < side <= _MAX_U32 for side in sides):
        return "wrapped", False, b""
    height, width = sides
    step = message.size_bytes // height
    if width * _pixel_bytes(layout.dtype, layout.channels) * height != message.size_bytes:
        return "wrapped", False, b""
    if encoding not in _VIEWABLE_LAYOUTS or step > _MAX_U32:
        return "wrapped", True, b""
    name = str(encoding).encode()
    sizes = fixed_field(2, width) + fixed_field(3, height) + bytes_field_head(4, len(name)) + name
    return "raw", True, time + sizes + fixed_field(5, step)


def _pixel_bytes(dtype: str, channels: int) -> int:
    return int(dtype[-1]) * channels


def definition_of(message: Message, encoding: Encoding) -> ChannelDefinition:
    """Return the channel in which a message with this encoding is stored."""
    kind, form = message.kind, encoding.form
    metadata = [("nep.form", form)]
    if not encoding.is_self_contained:
        metadata += [
            ("nep.codec", kind.codec),
            ("nep.msg_type", kind.msg_type),
            ("nep.publisher", "" if message.publisher is None else str(message.publisher)),
            ("nep.is_latched", "1" if kind.is_latched else ""),
            ("nep.has_seq", "" if message.seq is None else "1"),
            ("nep.has_stamp", "" if message.stamp_ns is None else "1"),
        ]
    schema = ("", "", b"")
    if form == "json":
        schema = (kind.msg_type, "jsonschema", schema_of(kind.msg_type))
    elif form == "msgpack":  # any value; `mcap doctor` reports an error for a channel without schema
        schema = (kind.msg_type, "jsonschema", b"{}")
    elif form in _DATA_FIELD_NUMBERS:
        name = _SCHEMAS.get(form, "nep.Bytes")
        schema = (name, "protobuf", descriptor_set(name))
    message_encoding = "protobuf" if form in _DATA_FIELD_NUMBERS else form
    return ChannelDefinition(kind.topic, message_encoding, *schema, tuple(metadata))


def recorder_channel(role: Role) -> ChannelDefinition:
    """Return the channel for the recorder's own entries of a role, encoded as JSON."""
    topic = RECORDER_TOPICS[role]
    return ChannelDefinition(
        topic, "json", f"nep/{role}", "jsonschema", b'{"type":"object"}', (("nep.role", role),)
    )


class LiveChannels:
    """Encoder of live messages as in a recording, for clients of `nep web --foxglove`."""

    def expected_channel(self, topic: str, msg_type: str) -> ChannelDefinition:
        """Return the most likely channel for a topic on which no message was received yet."""
        codec = codec_for(msg_type)
        message = received_message(message_kind(topic, codec.name, msg_type), b"", None, 0, 0)
        form = "picture" if codec.recorded_as == "image" else codec.recorded_as
        return definition_of(message, Encoding(form, b"", 0, 0, is_decodable=True))

    def encode(self, message: Message, log_ns: int) -> tuple[ChannelDefinition, bytes]:
        """Return the channel of a message, and the message's encoded data.

        Args:
            message: Message to encode.
            log_ns: Time of receipt in ns since 1970.

        Raises:
            DecodeError: The message is malformed. A recorder stores such messages, but a client can't show
                them.
        """
        encoding = encoding_of(message, log_ns)
        if not encoding.is_decodable:
            message.kind.decode(message.raw, message.extension)  # raises
        return definition_of(message, encoding), b"".join((encoding.prefix, message.raw))


# ---- decoding


class ChannelDecoder:
    """Decoder for the records of one channel, which supports many recordings of other programs.

    Args:
        definition: Channel of the records.
    """

    def __init__(self, definition: ChannelDefinition) -> None:
        self.definition = definition
        metadata = dict(definition.metadata)
        self.role: Role | None = metadata.get("nep.role")
        """Role of the recorder's own entries, or None for messages of a topic."""
        self._form = metadata.get("nep.form", "")
        self._has_seq = bool(metadata.get("nep.has_seq", "1" if not self._form else ""))
        self._has_stamp = bool(metadata.get("nep.has_stamp", "1" if not self._form else ""))
        self._publisher = _parse_id(metadata.get("nep.publisher", ""))
        schema = definition.schema_name
        self._is_wrapped = definition.message_encoding == "protobuf" and (
            self._form in _DATA_FIELD_NUMBERS or schema in {"foxglove.CompressedImage", "foxglove.RawImage"}
        )
        self._data_field = 6 if schema == "foxglove.RawImage" else 2 if schema.endswith("Image") else 1
        self.codec = metadata.get("nep.codec", "") or self._guess_codec()
        self.msg_type = metadata.get("nep.msg_type", "") or schema or self.codec
        self._kind = message_kind(
            definition.topic,
            self.codec,
            self.msg_type,
            is_latched=bool(metadata.get("nep.is_latched")),
        )
        self._kinds: dict[tuple[str, str, bool], MessageKind] = {}

    def _guess_codec(self) -> str:
        # For channels of other programs.
        if self._is_wrapped:
            return "image" if self.definition.schema_name.endswith("Image") else "bytes"
        message_encoding = self.definition.message_encoding
        return message_encoding if message_encoding in {"json", "msgpack"} else "bytes"

    @property
    def topic(self) -> str:
        """Name of the topic."""
        return self.definition.topic

    @property
    def publisher(self) -> int | None:
        """Id of the publisher of all messages; None if unknown, or if there are several publishers."""
        return self._publisher

    def message(self, raw: RawMessage) -> Message:
        """Restore the message that was recorded. An invalid record is returned as a message of bytes."""
        kind, data = self._kind, raw.data
        seq = raw.sequence if self._has_seq else None
        stamp = raw.publish_ns if self._has_stamp else None
        publisher, extension = self._publisher, NO_EXTENSION
        if self._is_wrapped:
            data, extra = self._unwrap(data)
            if extra:  # untrusted: may contain any values
                extra_extension = extra.get("extension", NO_EXTENSION)
                extension = extra_extension if isinstance(extra_extension, Mapping) else NO_EXTENSION
                seq, stamp = _int_or_none(extra.get("seq", seq)), _int_or_none(extra.get("stamp_ns", stamp))
                if "publisher" in extra:
                    publisher, kind = _int_or_none(extra["publisher"]), self._kind_of(extra)
        # `received_message` accepts a missing publisher
        return received_message(kind, data, stamp, seq, publisher, extension)  # type: ignore[arg-type]

    def _kind_of(self, extra: Mapping[str, Any]) -> MessageKind:
        key = (str(extra.get("codec")), str(extra.get("msg_type")), bool(extra.get("is_latched")))
        if key not in self._kinds:
            if len(self._kinds) >= 1000:
                self._kinds.clear()
            self._kinds[key] = message_kind(self.topic, key[0], key[1], is_latched=key[2])
        return self._kinds[key]

    def _unwrap(self, data: memoryview) -> tuple[memoryview, dict[str, Any]]:
        payload, extra = data, {}
        values: dict[int, int | memoryview] = {}
        try:
            for number, value in fields(data):
                if number == self._data_field and isinstance(value, memoryview):
                    payload = value
                elif number == EXTRA_FIELD and isinstance(value, memoryview):
                    decoded = unpack(value)
                    extra = decoded if isinstance(decoded, dict) else {}
                else:
                    values[number] = value
        except ValueError:
            return data, {}
        if not self._form and self._data_field != 1:  # an image of another program
            extra = {"extension": self._foreign_extension(values)}
        return payload, extra

    def _foreign_extension(self, fields: Mapping[int, int | memoryview]) -> Mapping[str, object]:
        name = fields.get(3 if self._data_field == 2 else 4)
        encoding = str(name, "utf-8", "replace") if isinstance(name, memoryview) else ""
        if self._data_field == 2:
            return {"encoding": encoding}
        layout = raw_layout(encoding)
        channels = 1 if layout is None else layout.channels
        return {
            "shape": [_int_or_none(fields.get(3)) or 0, _int_or_none(fields.get(2)) or 0, channels],
            "encoding": encoding,
        }


def _int_or_none(value: object) -> int | None:
    return value if type(value) is int else None


def _parse_id(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 20 else None
