"""Channels of a recording: how a message lies in it, so that it comes out as it was received.

A channel has the messages of one publisher on one topic that are alike: its metadata tell once what they have
in common (codec, type, publisher, whether it is latched), a message's record has its time of arrival (log
time), its stamp (publish time) and the lower half of its number (sequence). JSON and msgpack lie there as
they were received; pictures, text and bytes in a message of Protocol Buffers that has them in one piece
(`nep.recordings.formats.protobuf`). What does not fit, such as a number above 2^32 or bytes that are no JSON,
is wrapped in one, too; the rest is in its field 1000. docs/recordings.md has the whole table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import orjson

from nep.errors import DecodeError
from nep.messages.codecs import codec_for
from nep.messages.image_codec import picture_info, raw_layout
from nep.messages.message import NOTHING, Message, MessageKind, arrived, kind_of
from nep.messages.packing import pack, unpack
from nep.recordings.formats.protobuf import (
    EXTRA,
    bytes_field,
    descriptor_set,
    fields,
    fixed_field,
    timestamp_field,
)
from nep.recordings.formats.records import RawMessage
from nep.recordings.formats.schemas import schema_of

__all__ = [
    "OWN_TOPICS",
    "PREFIX",
    "ChannelDecoder",
    "ChannelDefinition",
    "Encoding",
    "LiveChannels",
    "Role",
    "definition_of",
    "encoding_of",
    "own_channel",
]

PREFIX = "nep."
"""How the keys of nep's own metadata begin."""
_U32, _U64 = 2**32 - 1, 2**64 - 1
Role = str
OWN_TOPICS: Mapping[Role, str] = {
    "figures": "/nep/recording/figures",
    "alerts": "/nep/recording/alerts",
    "notes": "/nep/recording/notes",
    "runs": "/nep/recording/runs",
    "alarms": "/nep/recording/alarms",
}
"""What the recorder says itself, by its role: counts of each topic, alerts, bookmarks and notes; and what it
is told by whoever runs behaviours and watches over alarms."""


@dataclass(frozen=True)
class ChannelDefinition:
    """A channel and its schema, as they stand in the file."""

    topic: str
    message_encoding: str
    schema_name: str
    schema_encoding: str
    schema_data: bytes
    metadata: tuple[tuple[str, str], ...]


class Encoding(NamedTuple):
    """How a message is written: its form, what stands before its bytes, and the two numbers of its record."""

    form: str
    before: bytes
    sequence: int
    publish_ns: int
    is_decodable: bool
    is_apart: bool = False
    """Whether its publisher and the like are told with it, for a recording that has too many channels."""


_SCHEMAS = {"picture": "foxglove.CompressedImage", "raw": "foxglove.RawImage", "text": "nep.Text"}
_DATA_FIELD = {"picture": 2, "raw": 6, "text": 1, "wrapped": 1}
_RAW_SHOWN = frozenset({
    "bgr8", "bgra8", "rgb8", "rgba8", "mono8", "mono16", "8UC1", "8UC3", "16UC1", "32FC1",
})  # fmt: skip
"""Layouts of raw pixels that `foxglove.RawImage` has, too."""


# ---- a message becomes a record


def encoding_of(message: Message, log_ns: int, *, is_apart: bool = False) -> Encoding:
    """How to write a message that arrived at `log_ns`. Never raises, whatever the message has.

    `is_apart`: tell all of it in the record, because there is no channel for its publisher.
    """
    seq, stamp = message.seq, message.stamp_ns
    codec, extension = message.kind.codec, message.extension
    form, is_decodable, before = _form(message, log_ns if stamp is None else stamp)
    extra: dict[str, Any] = {}
    if extension:
        extra["extension"] = dict(extension)
    if seq is not None and not 0 <= seq <= _U32:
        extra["seq"] = seq
    if stamp is not None and not 0 <= stamp <= _U64:
        extra["stamp_ns"] = stamp
    if is_apart:
        kind = message.kind
        extra.update(
            codec=codec,
            msg_type=kind.msg_type,
            publisher=message.publisher,
            is_latched=kind.is_latched,
            seq=seq,
            stamp_ns=stamp,
        )
    if extra and form not in _DATA_FIELD:
        form = "wrapped"
    if form in _DATA_FIELD:
        if extra:
            packed = _packed(extra)
            before += bytes_field(EXTRA, len(packed)) + packed
        before += bytes_field(_DATA_FIELD[form], message.size_bytes)
    sequence = 0 if seq is None else seq & _U32
    publish_ns = log_ns if stamp is None else max(0, min(stamp, _U64))
    return Encoding(form, before, sequence, publish_ns, is_decodable, is_apart)


def _packed(extra: Mapping[str, Any]) -> bytes:
    try:
        return pack(extra)
    except ValueError:  # an extension or a number that cannot have come over a wire
        plain = {key: value for key, value in extra.items() if key != "extension"}
        numbers = {key: max(-(2**63), min(each, _U64)) for key, each in plain.items() if type(each) is int}
        return pack(plain | numbers)


def _form(message: Message, stamp_ns: int) -> tuple[str, bool, bytes]:
    """(how it lies in the file, whether it can be decoded, fields that come before its data)."""
    codec = message.kind.codec
    if codec == "json":
        try:
            orjson.loads(message.raw)
        except orjson.JSONDecodeError:
            return "wrapped", _is_decodable(message), b""
        return "json", True, b""
    if codec == "image":
        return _picture_form(message, stamp_ns)
    is_decodable = codec == "bytes" or _is_decodable(message)
    if codec == "string" and is_decodable:
        return "text", True, b""
    if codec == "msgpack" and is_decodable:
        return "msgpack", True, b""
    return "wrapped", is_decodable, b""


def _is_decodable(message: Message) -> bool:
    try:
        message.kind.decode(message.raw, message.extension)
    except DecodeError:
        return False
    return True


def _picture_form(message: Message, stamp_ns: int) -> tuple[str, bool, bytes]:
    encoding = message.extension.get("encoding")
    time = timestamp_field(1, max(0, min(stamp_ns, _U64)))
    layout = raw_layout(encoding)
    if layout is None:
        info = picture_info(message.raw)
        if info is None:
            return "wrapped", False, b""
        kind = str(info["encoding"]).encode()
        return "picture", True, time + bytes_field(3, len(kind)) + kind
    shape = message.extension.get("shape")
    sides = shape[:2] if isinstance(shape, list | tuple) else ()
    if len(sides) != 2 or not all(type(side) is int and 0 < side <= _U32 for side in sides):
        return "wrapped", False, b""
    height, width = sides
    step = message.size_bytes // height
    if width * _pixel_bytes(layout.numbers, layout.channels) * height != message.size_bytes:
        return "wrapped", False, b""
    if encoding not in _RAW_SHOWN or step > _U32:
        return "wrapped", True, b""
    name = str(encoding).encode()
    sizes = fixed_field(2, width) + fixed_field(3, height) + bytes_field(4, len(name)) + name
    return "raw", True, time + sizes + fixed_field(5, step)


def _pixel_bytes(numbers: str, channels: int) -> int:
    return int(numbers[-1]) * channels


def definition_of(message: Message, encoding: Encoding) -> ChannelDefinition:
    """The channel that a message so encoded belongs to."""
    kind, form = message.kind, encoding.form
    metadata = [("nep.form", form)]
    if not encoding.is_apart:
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
    elif form == "msgpack":  # of anything; `mcap doctor` calls it an error when a channel has no schema
        schema = (kind.msg_type, "jsonschema", b"{}")
    elif form in _DATA_FIELD:
        name = _SCHEMAS.get(form, "nep.Bytes")
        schema = (name, "protobuf", descriptor_set(name))
    encoded_as = "protobuf" if form in _DATA_FIELD else form
    return ChannelDefinition(kind.topic, encoded_as, *schema, tuple(metadata))


def own_channel(role: Role) -> ChannelDefinition:
    """A channel of what the recorder says itself, as JSON."""
    topic = OWN_TOPICS[role]
    return ChannelDefinition(
        topic, "json", f"nep/{role}", "jsonschema", b'{"type":"object"}', (("nep.role", role),)
    )


class LiveChannels:
    """Channels of live topics, without a file, for clients that read them (`nep web --foxglove`)."""

    _FORMS: ClassVar[Mapping[str, str]] = {
        "json": "json", "msgpack": "msgpack", "string": "text", "image": "picture",
    }  # fmt: skip

    def expected(self, topic: str, msg_type: str) -> ChannelDefinition:
        """Return the most likely channel of a topic that has had no message yet."""
        codec = codec_for(msg_type).name
        message = arrived(kind_of(topic, codec, msg_type), b"", None, 0, 0)
        form = self._FORMS.get(codec, "wrapped")
        return definition_of(message, Encoding(form, b"", 0, 0, is_decodable=True))

    def encoded(self, message: Message, log_ns: int) -> tuple[ChannelDefinition, bytes]:
        """Return the channel of a message that arrived at `log_ns`, and its bytes in that channel.

        Raises:
            DecodeError: The message is malformed. A recorder keeps it; a client could not show it.
        """
        encoding = encoding_of(message, log_ns)
        if not encoding.is_decodable:
            message.kind.decode(message.raw, message.extension)  # raises
        return definition_of(message, encoding), b"".join((encoding.before, message.raw))


# ---- and back


class ChannelDecoder:
    """Makes messages of the records of one channel; of other programs' recordings, too, as far as they go."""

    def __init__(self, definition: ChannelDefinition) -> None:
        self.definition = definition
        metadata = dict(definition.metadata)
        self.role: Role | None = metadata.get("nep.role")
        """What the recorder says with it; None for a topic's messages."""
        self._form = metadata.get("nep.form", "")
        self._has_seq = bool(metadata.get("nep.has_seq", "1" if not self._form else ""))
        self._has_stamp = bool(metadata.get("nep.has_stamp", "1" if not self._form else ""))
        self._publisher = _number(metadata.get("nep.publisher", ""))
        schema = definition.schema_name
        self._is_wrapped = definition.message_encoding == "protobuf" and (
            self._form in _DATA_FIELD or schema in {"foxglove.CompressedImage", "foxglove.RawImage"}
        )
        self._data_field = 6 if schema == "foxglove.RawImage" else 2 if schema.endswith("Image") else 1
        self.codec = metadata.get("nep.codec", "") or self._likely_codec()
        self.msg_type = metadata.get("nep.msg_type", "") or schema or self.codec
        self._kind = kind_of(
            definition.topic,
            self.codec,
            self.msg_type,
            is_latched=bool(metadata.get("nep.is_latched")),
        )
        self._kinds: dict[tuple[str, str, bool], MessageKind] = {}

    def _likely_codec(self) -> str:
        """Of a channel that another program has made."""
        if self._is_wrapped:
            return "image" if self.definition.schema_name.endswith("Image") else "bytes"
        encoded = self.definition.message_encoding
        return encoded if encoded in {"json", "msgpack"} else "bytes"

    @property
    def topic(self) -> str:
        """The topic's name."""
        return self.definition.topic

    @property
    def publisher(self) -> int | None:
        """The publisher of its messages, when all have the same."""
        return self._publisher

    def message(self, raw: RawMessage) -> Message:
        """The message as it was received. A record that is no such message gives one of its bytes."""
        kind, data = self._kind, raw.data
        seq = raw.sequence if self._has_seq else None
        stamp = raw.publish_ns if self._has_stamp else None
        publisher, extension = self._publisher, NOTHING
        if self._is_wrapped:
            data, extra = self._unwrapped(data)
            if extra:  # of a damaged or made up file they may be anything
                told = extra.get("extension", NOTHING)
                extension = told if isinstance(told, Mapping) else NOTHING
                seq, stamp = _whole(extra.get("seq", seq)), _whole(extra.get("stamp_ns", stamp))
                if "publisher" in extra:
                    publisher, kind = _whole(extra["publisher"]), self._kind_of(extra)
        # A publisher's number may be missing, which `arrived` takes as it is.
        return arrived(kind, data, stamp, seq, publisher, extension)  # type: ignore[arg-type]

    def _kind_of(self, extra: Mapping[str, Any]) -> MessageKind:
        key = (str(extra.get("codec")), str(extra.get("msg_type")), bool(extra.get("is_latched")))
        if key not in self._kinds:
            if len(self._kinds) >= 1000:
                self._kinds.clear()
            self._kinds[key] = kind_of(self.topic, key[0], key[1], is_latched=key[2])
        return self._kinds[key]

    def _unwrapped(self, data: memoryview) -> tuple[memoryview, dict[str, Any]]:
        payload, extra = data, {}
        told: dict[int, int | memoryview] = {}
        try:
            for number, value in fields(data):
                if number == self._data_field and isinstance(value, memoryview):
                    payload = value
                elif number == EXTRA and isinstance(value, memoryview):
                    made = unpack(value)
                    extra = made if isinstance(made, dict) else {}
                else:
                    told[number] = value
        except ValueError:
            return data, {}
        if not self._form and self._data_field != 1:  # another program's picture
            extra = {"extension": self._foreign_extension(told)}
        return payload, extra

    def _foreign_extension(self, told: Mapping[int, int | memoryview]) -> Mapping[str, object]:
        name = told.get(3 if self._data_field == 2 else 4)
        encoding = str(name, "utf-8", "replace") if isinstance(name, memoryview) else ""
        if self._data_field == 2:
            return {"encoding": encoding}
        layout = raw_layout(encoding)
        channels = 1 if layout is None else layout.channels
        return {"shape": [_whole(told.get(3)) or 0, _whole(told.get(2)) or 0, channels], "encoding": encoding}


def _whole(value: object) -> int | None:
    return value if type(value) is int else None


def _number(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 20 else None
