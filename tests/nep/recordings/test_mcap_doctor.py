"""Tests of the test suite's own MCAP doctor: for each rule there is a file that breaks it."""

from __future__ import annotations

import ast
import inspect
import io
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import zstandard
from mcap import records as kinds
from mcap.data_stream import ReadDataStream, RecordBuilder

from tests.nep.recordings import mcap_doctor
from tests.nep.recordings.mcap_doctor import MAGIC, McapDoctor
from tests.nep.recordings.messages import json_message, picture, record

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, METADATA_INDEX, OFFSET, DATA_END = 0x0B, 0x0D, 0x0E, 0x0F
KINDS: dict[int, Any] = {
    HEADER: kinds.Header, FOOTER: kinds.Footer, SCHEMA: kinds.Schema, CHANNEL: kinds.Channel,
    CHUNK: kinds.Chunk, MESSAGE_INDEX: kinds.MessageIndex, CHUNK_INDEX: kinds.ChunkIndex,
    STATISTICS: kinds.Statistics, METADATA_INDEX: kinds.MetadataIndex, OFFSET: kinds.SummaryOffset,
    DATA_END: kinds.DataEnd,
}  # fmt: skip
WRONG_CRC = 0x12345678
Records = list[tuple[int, bytes]]
Damage = Callable[[Records], None]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Recording with two topics, their schemas, and a chunk with several messages."""
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    record(path, [[json_message(1), picture(1), json_message(2)], [json_message(3)]])
    assert McapDoctor(path).problems == []
    return path.read_bytes()


def taken_apart(data: bytes) -> Records:
    """Return the opcode and content of each record."""
    at, found = len(MAGIC), []
    while at < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append((opcode, data[at + 9 : at + 9 + length]))
        at += 9 + length
    return found


def put_together(records: Records) -> bytes:
    body = b"".join(struct.pack("<BQ", opcode, len(content)) + content for opcode, content in records)
    return MAGIC + body + MAGIC


def place(records: Records, opcode: int, nth: int) -> int:
    """Return the index of the nth record of a kind; -1 is the last."""
    return [number for number, each in enumerate(records) if each[0] == opcode][nth]


def changed(opcode: int, nth: int = 0, /, **fields: object) -> Damage:
    """Return a damage that changes fields of one record; a callable receives the old value."""

    def damage(records: Records) -> None:
        at = place(records, opcode, nth)
        made = KINDS[opcode].read(ReadDataStream(io.BytesIO(records[at][1])))
        new = {name: each(getattr(made, name)) if callable(each) else each for name, each in fields.items()}
        builder = RecordBuilder()
        replace(made, **new).write(builder)
        records[at] = (opcode, builder.end()[9:])

    return damage


def without(opcode: int, nth: int = 0) -> Damage:
    return lambda records: records.__delitem__(place(records, opcode, nth))


def twice(opcode: int, nth: int = 0) -> Damage:
    def damage(records: Records) -> None:
        at = place(records, opcode, nth)
        records.insert(at, records[at])

    return damage


def moved(opcode: int, nth: int, before: int, its_nth: int) -> Damage:
    def damage(records: Records) -> None:
        taken = records.pop(place(records, opcode, nth))
        records.insert(place(records, before, its_nth), taken)

    return damage


def put_in(opcode: int, content: bytes, before: int) -> Damage:
    return lambda records: records.insert(place(records, before, 0), (opcode, content))


def in_chunk(change: Callable[[Records], Records]) -> Damage:
    """Return a damage that changes the messages of the first chunk, with correct sizes and CRC."""

    def damage(records: Records) -> None:
        chunk = kinds.Chunk.read(ReadDataStream(io.BytesIO(records[place(records, CHUNK, 0)][1])))
        data = chunk.data
        if chunk.compression == "zstd":
            data = zstandard.ZstdDecompressor().decompress(data, max_output_size=chunk.uncompressed_size)
        messages = change(taken_apart(MAGIC + data + MAGIC))
        data = put_together(messages)[len(MAGIC) : -len(MAGIC)]
        changed(
            CHUNK, compression="", data=data, uncompressed_size=len(data), uncompressed_crc=zlib.crc32(data)
        )(records)

    return damage


def cut_length(records: Records) -> None:
    """Let a chunk state more bytes than it has."""
    at = place(records, CHUNK, 0)
    content = bytearray(records[at][1])
    (letters,) = struct.unpack_from("<I", content, 28)
    struct.pack_into("<Q", content, 32 + letters, 2**64 - 1)
    records[at] = (CHUNK, bytes(content))


def first_of(change: Callable[[int], int]) -> Callable[[dict[int, int]], dict[int, int]]:
    """Return a function that changes the first value of a map."""
    return lambda known: {
        key: change(value) if not n else value for n, (key, value) in enumerate(known.items())
    }


def more(value: int) -> int:
    return value + 1


DAMAGES: list[tuple[str, Damage]] = [
    ("the first record is no header", without(HEADER)),
    ("the last record is no footer", without(FOOTER)),
    ("not one data end", without(DATA_END)),
    ("not one data end", twice(DATA_END)),
    ("the data's CRC is wrong", changed(DATA_END, data_section_crc=WRONG_CRC)),
    ("unknown profile", changed(HEADER, profile="ros9")),
    ("no library", changed(HEADER, library="")),
    ("a message outside of a chunk", put_in(MESSAGE, bytes(22), DATA_END)),
    ("unknown opcode", put_in(0x7F, b"", DATA_END)),
    ("unknown opcode", put_in(0, b"", DATA_END)),
    ("a schema 0", changed(SCHEMA, id=0)),
    ("a schema without encoding", changed(SCHEMA, encoding="")),
    ("a schema twice", twice(SCHEMA)),
    ("a schema in the summary alone", without(SCHEMA)),
    ("a schema in the summary alone", changed(SCHEMA, -1, name="another")),
    ("a schema in the summary alone", changed(SCHEMA, -1, data=b"{}")),
    ("a channel without its schema", without(SCHEMA)),
    ("a channel without its schema", changed(CHANNEL, schema_id=2**16 - 1)),
    ("a channel twice", twice(CHANNEL)),
    ("a channel in the summary alone", without(CHANNEL)),
    ("a channel in the summary alone", changed(CHANNEL, -1, topic="/another")),
    ("a channel in the summary alone", changed(CHANNEL, -1, metadata={})),
    ("a channel in the summary alone", changed(CHANNEL, -1, message_encoding="cdr")),
    ("counts before the channels of the summary", moved(CHANNEL, -1, OFFSET, 0)),
    ("a summary offset that is wrong", changed(OFFSET, group_start=more)),
    ("a summary offset that is wrong", changed(OFFSET, -1, group_length=0)),
    ("a metadata index that is wrong", changed(METADATA_INDEX, offset=more)),
    ("a metadata index that is wrong", changed(METADATA_INDEX, length=more)),
    ("a chunk's data has another length", cut_length),
    ("a chunk has another size", changed(CHUNK, uncompressed_size=more)),
    ("a chunk's CRC is wrong", changed(CHUNK, uncompressed_crc=WRONG_CRC)),
    ("a chunk that cannot be decompressed", changed(CHUNK, data=b"nothing", uncompressed_size=7)),
    ("a chunk that cannot be decompressed", changed(CHUNK, compression="of tomorrow")),
    ("another opcode in a chunk", in_chunk(lambda each: [*each, (MESSAGE_INDEX, b"")])),
    ("a message before its channel",
     in_chunk(lambda each: [(MESSAGE, b"\xff\xff" + content[2:]) for _opcode, content in each])),
    ("a message earlier than the one before", in_chunk(lambda each: each[::-1])),
    ("a chunk without messages", in_chunk(lambda _each: [])),
    ("a chunk's times are wrong", changed(CHUNK, message_start_time=more)),
    ("a chunk's times are wrong", changed(CHUNK, message_end_time=more)),
    ("the footer's summary start is wrong", changed(FOOTER, summary_start=more)),
    ("the summary's CRC is wrong", changed(FOOTER, summary_crc=WRONG_CRC)),
    ("the footer's offset start is wrong", changed(FOOTER, summary_offset_start=2**64 - 1)),
    ("records of the summary are not grouped", moved(SCHEMA, -1, OFFSET, 0)),
    ("the summary lacks a channel", without(CHANNEL, -1)),
    ("the summary lacks a schema", without(SCHEMA, -1)),
    ("a channel with messages has no schema in the summary", without(SCHEMA, -1)),
    ("not one statistics", without(STATISTICS)),
    ("not one statistics", twice(STATISTICS)),
    ("chunk indexes", without(CHUNK_INDEX)),
    ("chunk indexes", twice(CHUNK_INDEX)),
    ("chunk indexes", changed(CHUNK_INDEX, chunk_start_offset=more)),
    ("a chunk index differs", changed(CHUNK_INDEX, chunk_length=more)),
    ("a chunk index differs", changed(CHUNK_INDEX, message_start_time=more)),
    ("a chunk index differs", changed(CHUNK_INDEX, message_end_time=more)),
    ("a chunk index differs", changed(CHUNK_INDEX, compression="lz4")),
    ("a chunk index differs", changed(CHUNK_INDEX, compressed_size=more)),
    ("a chunk index differs", changed(CHUNK_INDEX, uncompressed_size=more)),
    ("a message index is not where it should be",
     changed(CHUNK_INDEX, message_index_offsets=first_of(more))),
    ("message indexes differ from the messages",
     changed(MESSAGE_INDEX, records=lambda known: [(at + 1, offset) for at, offset in known])),
    ("message indexes differ from the messages",
     changed(MESSAGE_INDEX, records=lambda known: [(at, offset + 1) for at, offset in known])),
    ("the length of the message indexes is wrong", changed(CHUNK_INDEX, message_index_length=more)),
    ("the count of messages is wrong", changed(STATISTICS, message_count=more)),
    ("a channel's count is wrong", changed(STATISTICS, channel_message_counts=first_of(more))),
    ("the count of chunks is wrong", changed(STATISTICS, chunk_count=more)),
    ("the count of channels is wrong", changed(STATISTICS, channel_count=more)),
    ("the count of schemas is wrong", changed(STATISTICS, schema_count=more)),
    ("the count of metadata is wrong", changed(STATISTICS, metadata_count=more)),
    ("attachments that are not there", changed(STATISTICS, attachment_count=more)),
    ("the start time is wrong", changed(STATISTICS, message_start_time=more)),
    ("the end time is wrong", changed(STATISTICS, message_end_time=more)),
]  # fmt: skip
BYTES_AT = {"no magic": 0, "no magic at the end": -1, "a record is cut": len(MAGIC) + 8}
"""Offset of the byte whose change breaks a rule, by problem."""


@pytest.mark.parametrize(
    ("problem", "damage"), DAMAGES, ids=[f"{each[0]} {n}" for n, each in enumerate(DAMAGES)]
)
def test_mcap_doctor_detects_an_invalid_record(
    whole: bytes, tmp_path: Path, problem: str, damage: Damage
) -> None:
    records = taken_apart(whole)
    assert put_together(records) == whole
    damage(records)
    (tmp_path / "a.mcap").write_bytes(put_together(records))
    assert problem in McapDoctor(tmp_path / "a.mcap").problems


@pytest.mark.parametrize("problem", BYTES_AT)
def test_mcap_doctor_detects_an_invalid_byte(whole: bytes, tmp_path: Path, problem: str) -> None:
    data = bytearray(whole)
    data[BYTES_AT[problem]] ^= 0x7F
    (tmp_path / "a.mcap").write_bytes(data)
    assert problem in McapDoctor(tmp_path / "a.mcap").problems


def test_every_mcap_doctor_rule_has_a_failing_file() -> None:
    said = {
        call.args[1].value
        for call in ast.walk(ast.parse(inspect.getsource(mcap_doctor)))
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr == "_say"
        and isinstance(call.args[1], ast.Constant)
    }
    assert said == {problem for problem, _damage in DAMAGES} | BYTES_AT.keys()
