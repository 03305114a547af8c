"""Tests that recordings meet the requirements of Lichtblick's and Foxglove's readers, even after faults.

These viewers derive fields from the schema of a topic's first channel in the summary, and do not show a
topic whose schema contains anything else than what is allowed here.
"""

from __future__ import annotations

import base64
import dataclasses
import enum
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Optional, TypedDict

import pytest
from mcap.reader import make_reader

from nep import geometry, sensor
from nep.messages.message import Message
from nep.recordings.export import export
from nep.recordings.formats.protobuf import fields
from nep.recordings.formats.schemas import json_schema
from nep.recordings.reader import Recording
from nep.recordings.repair import repair
from nep.recordings.ring import FlightRecorder
from tests.nep.recordings.messages import START_NS, TestClock, json_message, limits, odd_messages, record

PLAIN = {"boolean", "string", "number", "integer"}
MAX_SECONDS = 2**53 - 1
Made = Callable[[Path], Path]


class UnreadableError(Exception):
    """Raised for a topic that a viewer would not show."""


def demand(is_met: object, what: str) -> None:
    if not is_met:
        raise UnreadableError(what)


def look_at_schema(schema: Any, name: str = "") -> None:
    """Check the fields of a JSON Schema as viewers read them."""
    demand(isinstance(schema, dict) and schema.get("type") == "object", f"{name}: no object")
    for key, field in schema.get("properties", {}).items():
        at = f"{name}.{key}"
        if isinstance(field.get("oneOf"), list):
            demand(
                all(type(each.get("const")) in {int, float} for each in field["oneOf"]), f"{at}: no numbers"
            )
            continue
        is_list = field.get("type") == "array"
        inner = field.get("items") if is_list else field
        demand(isinstance(inner, dict), f"{at}: a list of what")
        if inner.get("type") == "object":
            look_at_schema(inner, at)
            continue
        demand(isinstance(inner.get("type"), str) and inner["type"] in PLAIN, f"{at}: {inner.get('type')}")
        encoded = inner.get("contentEncoding")
        demand(encoded is None or (encoded == "base64" and not is_list), f"{at}: {encoded}")


def decode(schema: Mapping[str, Any], value: Any) -> Any:
    """Decode base64 texts of a message to bytes, as viewers do."""
    if not isinstance(value, dict):
        return value
    made = dict(value)
    for key, field in schema.get("properties", {}).items():
        if field.get("contentEncoding") == "base64" and isinstance(value.get(key), str):
            made[key] = base64.b64decode(value[key], validate=True)
        elif field.get("type") == "object" and key in value:
            made[key] = decode(field, value[key])
    return made


def declared(described: bytes) -> dict[str, dict[int, tuple[str, int]]]:
    """Return the messages of a FileDescriptorSet by full name: the name and type of each field, by number."""
    found: dict[str, dict[int, tuple[str, int]]] = {}
    for _set, file in fields(memoryview(described)):
        parts: list[tuple[int, Any]] = list(fields(file))
        (package,) = [bytes(each).decode() for number, each in parts if number == 2]
        for message in [each for number, each in parts if number == 4]:
            inside = list(fields(message))
            (name,) = [bytes(each).decode() for number, each in inside if number == 1]
            mine: dict[int, tuple[str, int]] = {}
            for field in [dict(fields(each)) for number, each in inside if number == 2]:
                mine[field[3]] = (bytes(field[1]).decode(), field[5])
                if field[5] == 11:
                    demand(bytes(field[6]).decode()[1:] in found, f"{name}: a type that is not described")
            found[f"{package}.{name}"] = mine
    return found


def look_at_protobuf(name: str, described: bytes, data: bytes) -> None:
    known = declared(described)
    demand(name in known, f"{name} is not in its description")
    for number, value in fields(memoryview(data)):
        field, kind = known[name].get(number, ("", 0))
        if not field:  # unknown field
            continue
        demand(isinstance(value, memoryview) == (kind in {9, 11, 12}), f"{name}.{field}: another type")
        if kind == 9:
            bytes(value).decode()
        if kind == 11:
            stamp = dict(fields(value))
            demand(0 <= stamp.get(1, 0) <= MAX_SECONDS, f"{name}.{field}: too late")
            demand(0 <= stamp.get(2, 0) < 10**9, f"{name}.{field}: no nanoseconds")


def look(path: Path) -> Iterator[tuple[str, object]]:
    """Yield the topic and the displayed value of each message; raise `UnreadableError` as a viewer would."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        demand(summary is not None and summary.statistics is not None, "no summary")
        first: dict[str, Any] = {}
        for channel in summary.channels.values():
            first.setdefault(channel.topic, channel)
            demand(channel.schema_id in summary.schemas, f"{channel.topic}: no schema")
        for _schema, channel, message in reader.iter_messages():
            assumed = first[channel.topic]
            is_other = assumed.message_encoding != channel.message_encoding
            if is_other or (
                channel.message_encoding == "protobuf" and assumed.schema_id != channel.schema_id
            ):
                yield channel.topic, UnreadableError
                continue
            schema = summary.schemas[assumed.schema_id]
            if assumed.message_encoding == "json":
                demand(schema.encoding == "jsonschema", f"{channel.topic}: {schema.encoding}")
                rules = json.loads(schema.data)
                look_at_schema(rules, schema.name)
                yield (
                    channel.topic,
                    decode(rules, json.loads(bytes(message.data), parse_constant=pytest.fail)),
                )
            elif assumed.message_encoding == "protobuf":
                demand(schema.encoding == "protobuf", f"{channel.topic}: {schema.encoding}")
                look_at_protobuf(schema.name, schema.data, message.data)
                yield channel.topic, schema.name
            else:
                demand(assumed.message_encoding == "msgpack", f"{channel.topic}: {assumed.message_encoding}")
                yield channel.topic, UnreadableError


def fresh(folder: Path) -> Path:
    record(folder / "a.mcap", [odd_messages(), [json_message(seq) for seq in range(2, 30)]])
    return folder / "a.mcap"


def cut(folder: Path) -> Path:
    data = fresh(folder).read_bytes()
    (folder / "cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    return repair(folder / "cut.mcap").path


def exported(folder: Path) -> Path:
    with Recording(fresh(folder)) as recording:
        return export(recording, "mcap", folder / "out")[0].path


def kept_by_a_ring(folder: Path) -> Path:
    with FlightRecorder(folder / "ring", seconds=60.0, clock=TestClock(), limits=limits()) as ring:
        for message in odd_messages():
            ring.post([message])
        ring.save(folder / "kept.mcap", 60.0)
    return folder / "kept.mcap"


@pytest.mark.parametrize("made", [fresh, cut, exported, kept_by_a_ring])
def test_viewer_reads_all_topics_except_msgpack_and_raw_images_that_follow_jpegs(
    made: Made, tmp_path: Path
) -> None:
    shown = [(topic, each) for topic, each in look(made(tmp_path)) if not topic.startswith("/nep/")]
    assert {topic for topic, each in shown if each is UnreadableError} <= {"/packed", "/camera"}
    assert ("/typed", {"x": 1.0}) in shown
    pictures = [each for topic, each in shown if topic == "/camera"]
    # Viewers decode raw pixels that follow a JPEG on the same topic as a JPEG.
    assert pictures
    assert (
        pictures == ["foxglove.CompressedImage", "foxglove.CompressedImage", UnreadableError][: len(pictures)]
    )


@pytest.mark.parametrize("order", [1, -1])
def test_viewer_shows_json_topic_with_some_undecodable_messages(order: int, tmp_path: Path) -> None:
    whole = json_message(1)
    broken = Message("/odom", b"{", "json", "json", stamp_ns=START_NS, seq=2, publisher=7)
    record(tmp_path / "a.mcap", [[whole, broken][::order]])
    shown = [each for topic, each in look(tmp_path / "a.mcap") if topic == "/odom"]
    assert shown == [json.loads(bytes(whole.data)), UnreadableError][::order]


class Mood(enum.IntEnum):
    GOOD = 1


class Row(TypedDict):
    name: str
    cells: list[float]


@dataclass
class Odd:
    """Class with fields of every kind that a program may declare."""

    number: complex
    data: bytes
    maybe: Optional[float]  # noqa: UP045 - as older programs write it
    either: int | str
    kind: Literal["a", "b"]
    mood: Mood
    anything: Any
    by_name: dict[str, float]
    grid: list[list[float]]
    rows: list[Row]
    pair: tuple[int, str]
    many: tuple[int, ...]
    nothing: None
    again: Optional[Odd] = None  # noqa: UP045


def types_of_nep() -> list[type]:
    kinds = [vars(module)[name] for module in (geometry, sensor) for name in module.__all__]
    return [each for each in kinds if dataclasses.is_dataclass(each)]


@pytest.mark.parametrize("kind", [*types_of_nep(), Odd], ids=lambda kind: kind.__name__)
def test_every_schema_is_supported_by_viewers(kind: type) -> None:
    made = json.loads(json_schema(kind))
    look_at_schema(made, kind.__name__)
    assert made["properties"].keys() <= {each.name for each in dataclasses.fields(kind)}
    assert made["properties"]


@pytest.mark.parametrize(
    "schema",
    [
        [],
        {},
        {"type": "array"},
        {"type": ["object", "null"]},
        {"type": "object", "properties": {"a": {}}},
        {"type": "object", "properties": {"a": {"type": "null"}}},
        {"type": "object", "properties": {"a": {"type": ["number", "null"]}}},
        {"type": "object", "properties": {"a": {"type": "array"}}},
        {"type": "object", "properties": {"a": {"type": "array", "items": {"type": "array"}}}},
        {"type": "object", "properties": {"a": {"oneOf": [{"const": "x"}]}}},
        {"type": "object", "properties": {"a": {"type": "string", "contentEncoding": "base32"}}},
        {"type": "object", "properties": {"a": {"type": "object", "properties": {"b": {}}}}},
    ],
)
def test_schema_unsupported_by_viewers_is_detected(schema: Any) -> None:
    with pytest.raises(UnreadableError):
        look_at_schema(schema)
