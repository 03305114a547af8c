"""Rules of `mcap doctor` as in the specification, checked record by record.

No code is shared with the writer of recordings: bytes are parsed here and compared with the results of
the package `mcap`.
"""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.records import Channel, ChunkIndex, MessageIndex, MetadataIndex, Schema, Statistics, SummaryOffset

MAGIC = b"\x89MCAP0\r\n"
KNOWN_PROFILES = {"", "ros1", "ros2"}


class McapDoctor:
    """Checker of one file; what is wrong with it is in `problems`."""

    def __init__(self, path: Path) -> None:
        self.data = path.read_bytes()
        self.problems: list[str] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.summary_schemas: dict[int, Schema] = {}
        self.summary_channels: dict[int, Channel] = {}
        self.counts: dict[int, int] = {}
        self.times: list[int] = []
        self.chunks: dict[int, dict[str, object]] = {}
        self.indexes: list[ChunkIndex] = []
        self.message_indexes: dict[int, MessageIndex] = {}
        self.statistics: list[Statistics] = []
        self.metadata: dict[int, int] = {}
        self.groups: list[tuple[int, int, int]] = []
        self._look()

    def _say(self, is_wrong: object, what: str) -> None:
        if is_wrong:
            self.problems.append(what)

    def _look(self) -> None:
        data = self.data
        self._say(not data.startswith(MAGIC), "no magic")
        self._say(not data.endswith(MAGIC), "no magic at the end")
        at, is_summary, opcodes = 8, False, []
        summary_at = 0
        while at < len(data) - 8:
            opcode, length = struct.unpack_from("<BQ", data, at)
            body = data[at + 9 : at + 9 + length]
            if len(body) != length:
                self._say(True, "a record is cut")
                break
            opcodes.append(opcode)
            if is_summary:
                if not self.groups or self.groups[-1][0] != opcode:
                    self.groups.append((opcode, at, 0))
                self.groups[-1] = (opcode, self.groups[-1][1], at + 9 + length - self.groups[-1][1])
            self._record(opcode, at, body, is_summary)
            at += 9 + length
            if opcode == 0x0F:
                (crc,) = struct.unpack_from("<I", body)
                self._say(crc and zlib.crc32(data[: at - 9 - length]) != crc, "the data's CRC is wrong")
                is_summary, summary_at = True, at
        self._say(opcodes[:1] != [0x01], "the first record is no header")
        self._say(opcodes[-1:] != [0x02], "the last record is no footer")
        self._say(opcodes.count(0x0F) != 1, "not one data end")
        self._end(summary_at)

    def _record(self, opcode: int, at: int, body: bytes, is_summary: bool) -> None:
        stream = ReadDataStream(io.BytesIO(body))
        if opcode == 0x01:
            self._say(stream.read_prefixed_string() not in KNOWN_PROFILES, "unknown profile")
            self._say(not stream.read_prefixed_string(), "no library")
        elif opcode == 0x03:
            self._schema(Schema.read(stream), is_summary)
        elif opcode == 0x04:
            self._channel(Channel.read(stream), is_summary)
        elif opcode == 0x05:
            self._say(True, "a message outside of a chunk")
        elif opcode == 0x06:
            self._chunk(at, body)
        elif opcode == 0x07:
            self.message_indexes[at] = MessageIndex.read(stream)
        elif opcode == 0x08:
            self.indexes.append(ChunkIndex.read(stream))
        elif opcode == 0x0C:
            self.metadata[at] = len(body) + 9
        else:
            self._summary_record(opcode, stream)

    def _summary_record(self, opcode: int, stream: ReadDataStream) -> None:
        if opcode == 0x0B:
            self.statistics.append(Statistics.read(stream))
            told = self.statistics[-1].channel_message_counts.keys()
            needed = told | self.channels.keys() if told else set()
            self._say(needed - self.summary_channels.keys(), "counts before the channels of the summary")
        elif opcode == 0x0D:
            index = MetadataIndex.read(stream)
            self._say(self.metadata.get(index.offset) != index.length, "a metadata index that is wrong")
        elif opcode == 0x0E:
            self._offset(SummaryOffset.read(stream))
        elif opcode not in {0x02, 0x0F}:
            self._say(True, "unknown opcode")

    def _schema(self, schema: Schema, is_summary: bool) -> None:
        known = self.schemas.get(schema.id)
        self._say(schema.id == 0, "a schema 0")
        self._say(not schema.encoding, "a schema without encoding")
        self._say(not is_summary and known is not None, "a schema twice")
        self._say(is_summary and known != schema, "a schema in the summary alone")
        (self.summary_schemas if is_summary else self.schemas)[schema.id] = schema

    def _channel(self, channel: Channel, is_summary: bool) -> None:
        known = self.channels.get(channel.id)
        self._say(channel.schema_id and channel.schema_id not in self.schemas, "a channel without its schema")
        self._say(not is_summary and known is not None, "a channel twice")
        self._say(is_summary and known != channel, "a channel in the summary alone")
        (self.summary_channels if is_summary else self.channels)[channel.id] = channel

    def _chunk(self, at: int, body: bytes) -> None:
        start, end, size, crc, letters = struct.unpack_from("<QQQII", body)
        compression = body[32 : 32 + letters].decode()
        (compressed,) = struct.unpack_from("<Q", body, 32 + letters)
        data = body[40 + letters :]
        self._say(compressed != len(data), "a chunk's data has another length")
        try:
            data = _decompressed(data, compression, size)
        except (zstandard.ZstdError, RuntimeError, ValueError):
            self._say(True, "a chunk that cannot be decompressed")
            return
        self._say(len(data) != size, "a chunk has another size")
        self._say(zlib.crc32(data) != crc, "a chunk's CRC is wrong")
        offset, times, entries = 0, [], {}
        while offset < len(data):
            opcode, length = struct.unpack_from("<BQ", data, offset)
            if opcode != 0x05:
                self._say(True, "another opcode in a chunk")
                offset += 9 + length
                continue
            channel, _sequence, log, _publish = struct.unpack_from("<HIQQ", data, offset + 9)
            self._say(channel not in self.channels, "a message before its channel")
            self._say(self.times and log < self.times[-1], "a message earlier than the one before")
            self.times.append(log)
            times.append(log)
            entries.setdefault(channel, []).append((log, offset))
            self.counts[channel] = self.counts.get(channel, 0) + 1
            offset += 9 + length
        self._say(not times, "a chunk without messages")
        self._say(times and (start, end) != (min(times), max(times)), "a chunk's times are wrong")
        self.chunks[at] = {
            "length": len(body) + 9,
            "start": start,
            "end": end,
            "compression": compression,
            "compressed": compressed,
            "size": size,
            "entries": entries,
        }

    def _offset(self, offset: SummaryOffset) -> None:
        group = (offset.group_opcode, offset.group_start, offset.group_length)
        self._say(group not in self.groups, "a summary offset that is wrong")

    def _end(self, summary_at: int) -> None:
        start, offsets, crc = struct.unpack("<QQI", self.data[-28:-8])
        self._say(start != summary_at, "the footer's summary start is wrong")
        self._say(zlib.crc32(self.data[summary_at:-12]) != crc, "the summary's CRC is wrong")
        self._say(self.data[offsets : offsets + 1] != b"\x0e", "the footer's offset start is wrong")
        opcodes = [opcode for opcode, _at, _length in self.groups]
        self._say(len(opcodes) != len(set(opcodes)), "records of the summary are not grouped")
        self._say(self.channels.keys() != self.summary_channels.keys(), "the summary lacks a channel")
        self._say(self.schemas.keys() != self.summary_schemas.keys(), "the summary lacks a schema")
        used = {self.channels[each].schema_id for each in self.counts if each in self.channels}
        self._say(used - self.summary_schemas.keys(), "a channel with messages has no schema in the summary")
        self._say(len(self.statistics) != 1, "not one statistics")
        self._say(
            sorted(each.chunk_start_offset for each in self.indexes) != sorted(self.chunks), "chunk indexes"
        )
        for index in self.indexes:
            self._index(index)
        if self.statistics:
            self._statistics(self.statistics[0])

    def _index(self, index: ChunkIndex) -> None:
        chunk = self.chunks.get(index.chunk_start_offset)
        if chunk is None:
            return
        told = {
            "length": index.chunk_length,
            "start": index.message_start_time,
            "end": index.message_end_time,
            "compression": index.compression,
            "compressed": index.compressed_size,
            "size": index.uncompressed_size,
        }
        self._say(
            told != {key: value for key, value in chunk.items() if key != "entries"}, "a chunk index differs"
        )
        found = {}
        total = 0
        for channel, offset in index.message_index_offsets.items():
            entry = self.message_indexes.get(offset)
            self._say(
                entry is None or entry.channel_id != channel, "a message index is not where it should be"
            )
            if entry is not None:
                found[channel] = entry.records
                total += 15 + 16 * len(entry.records)
        self._say(found != chunk["entries"], "message indexes differ from the messages")
        self._say(total != index.message_index_length, "the length of the message indexes is wrong")

    def _statistics(self, told: Statistics) -> None:
        self._say(told.message_count != len(self.times), "the count of messages is wrong")
        self._say(told.channel_message_counts != self.counts, "a channel's count is wrong")
        self._say(told.chunk_count != len(self.chunks), "the count of chunks is wrong")
        self._say(told.channel_count != len(self.channels), "the count of channels is wrong")
        self._say(told.schema_count != len(self.schemas), "the count of schemas is wrong")
        self._say(told.metadata_count != len(self.metadata), "the count of metadata is wrong")
        self._say(told.attachment_count, "attachments that are not there")
        if self.times:
            self._say(told.message_start_time != min(self.times), "the start time is wrong")
            self._say(told.message_end_time != max(self.times), "the end time is wrong")


def _decompressed(data: bytes, compression: str, size: int) -> bytes:
    if compression == "zstd":
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    if compression == "lz4":
        return lz4.frame.decompress(data)
    if compression:
        raise ValueError(compression)
    return data
