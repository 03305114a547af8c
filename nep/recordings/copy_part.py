"""Copying of a part of a recording, with unchanged channels, data, sequence numbers and times.

Recordings of other programs keep their encodings and schemas, and get no message counts. For recordings of
nep, lost and late messages within the part are counted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path

import orjson

from nep.errors import RecordingError
from nep.i18n import _
from nep.recordings.formats.channels import ChannelDecoder, encoding_of, recorder_channel
from nep.recordings.formats.mcap_file import CHUNK_BYTES, FileWriter
from nep.recordings.formats.message_counts import TopicCounter, changed_counters
from nep.recordings.formats.records import RawMessage
from nep.recordings.reader import Recording

_MAX_ENTRIES = 100_000
_COPIED_ROLES = frozenset({"notes", "runs", "alarms", "alerts"})
_FLUSH_INTERVAL_NS = 500_000_000
_STATS_INTERVAL_NS = 1_000_000_000
_RECORDER_METADATA = frozenset({"nep.recording", "nep.figures"})


def copy_part(
    recording: Recording,
    path: Path,
    span: tuple[int | None, int | None],
    topics: Collection[str],
    on_copied: Callable[[], object],
) -> int:
    """Write a part of a recording to a new, complete file; return the number of messages written.

    Args:
        recording: Recording to copy from.
        path: File to write; an existing file is overwritten.
        span: Start (inclusive) and end (exclusive) in ns since 1970; None for no limit.
        topics: Names of the topics to copy; topics without messages are included.
        on_copied: Called after each message, to report progress.

    Raises:
        RecordingError: There are too many channels.
        OSError: The file can't be written.
    """
    writer = FileWriter(path, is_new=False, profile=recording.info.profile)
    try:
        copy = _PartCopier(recording, writer, topics, on_copied)
        for raw in recording.file.read_raw(*span, copy.channels):
            copy.add(raw)
        copy.finish()
    except BaseException:
        writer.close()
        raise
    return copy.count


class _PartCopier:
    def __init__(
        self,
        recording: Recording,
        writer: FileWriter,
        topics: Collection[str],
        on_copied: Callable[[], object],
    ) -> None:
        self._recording, self._writer, self._on_copied = recording, writer, on_copied
        self._path = writer.path
        self.count = 0
        self._roles: dict[int, str] = {}
        self._channel_ids: dict[int, int] = {}
        for channel, definition in recording.info.channels.items():
            role = dict(definition.metadata).get("nep.role")
            if role in _COPIED_ROLES:
                self._roles[channel] = role
            elif role is None and definition.topic in topics:
                self._channel_ids[channel] = self._channel_id(channel)
        self.channels = frozenset((*self._roles, *self._channel_ids))
        writer.write_channels(dict.fromkeys(self._channel_ids.values()))
        self._stats_counter = _StatsCounter(recording) if recording.stats() else None
        self._last_entries: dict[tuple[str, str], object] = {}
        self._entry_count = 0
        self._chunk_start_ns: int | None = None
        self._last_ns = 0

    def _channel_id(self, channel: int) -> int:
        number = self._writer.table.channel_id(self._recording.info.channels[channel])
        if number is None:
            raise RecordingError(str(self._path), _("the recording has too many channels"))
        return number

    def add(self, raw: RawMessage) -> None:
        if raw.channel in self._roles:
            self._copy_entry(raw)
            return
        self._last_ns = raw.log_ns
        self._write_message(self._channel_ids[raw.channel], raw)
        self.count += 1
        self._on_copied()
        if self._stats_counter is not None:
            self._stats_counter.add(raw)
            self._write_stats(raw.log_ns)

    def _write_message(self, number: int, raw: RawMessage) -> None:
        self._writer.add(number, (raw.log_ns, raw.publish_ns), raw.sequence, b"", bytes(raw.data))
        if self._chunk_start_ns is None:
            self._chunk_start_ns = raw.log_ns
        if (
            self._writer.pending_bytes >= CHUNK_BYTES
            or raw.log_ns - self._chunk_start_ns >= _FLUSH_INTERVAL_NS
        ):
            self._writer.flush()
            self._chunk_start_ns = None

    def _copy_entry(self, raw: RawMessage) -> None:
        # Repeated values, such as a running behaviour, are copied only when they change.
        role = self._roles[raw.channel]
        try:
            value = orjson.loads(raw.data)
        except orjson.JSONDecodeError:
            return
        id = value.get("id") if isinstance(value, Mapping) else None
        if isinstance(id, str):
            if self._last_entries.get((role, id)) == value:
                return
            self._last_entries[role, id] = value
        if self._entry_count < _MAX_ENTRIES:
            self._entry_count += 1
            self._write_message(self._channel_id(raw.channel), raw)

    def _write_stats(self, at_ns: int, *, is_final: bool = False) -> None:
        record = (
            None
            if self._stats_counter is None
            else self._stats_counter.encode_changes(at_ns, is_final=is_final)
        )
        number = None if record is None else self._writer.table.channel_id(recorder_channel("figures"))
        if record is not None and number is not None:
            self._writer.add(number, (at_ns, at_ns), 0, b"", record)

    def finish(self) -> None:
        recording, writer = self._recording, self._writer
        self._write_stats(self._last_ns, is_final=True)
        writer.flush()
        if self._stats_counter is not None or recording.recorder_metadata:
            metadata = {
                "started_ns": str(writer.start_ns or 0),
                "ended_ns": str(writer.end_ns),
                "note": recording.recorder_metadata.get("note", ""),
                "end": "",
            }
            writer.add_metadata("nep.recording", metadata)
        if self._stats_counter is not None:
            writer.add_metadata("nep.figures", self._stats_counter.to_plain())
        for name, values in recording.info.metadata:
            if name not in _RECORDER_METADATA:
                writer.add_metadata(name, values)
        writer.finish()


class _StatsCounter:
    """Counter of the lost and late messages within the part."""

    def __init__(self, recording: Recording) -> None:
        self._decoders = {number: ChannelDecoder(each) for number, each in recording.info.channels.items()}
        self._counters: dict[str, TopicCounter] = {}
        self._next_ns: int | None = None

    def add(self, raw: RawMessage) -> None:
        decoder = self._decoders[raw.channel]
        message = decoder.message(raw)
        counter = self._counters.setdefault(decoder.topic, TopicCounter())
        is_decodable = encoding_of(message, raw.log_ns).is_decodable
        counter.add(message.publisher, message.seq, message.size_bytes, is_decodable=is_decodable)

    def encode_changes(self, at_ns: int, *, is_final: bool) -> bytes | None:
        # Changed counts once a second; all of them at the end.
        if self._next_ns is None:
            self._next_ns = at_ns + _STATS_INTERVAL_NS
        if not is_final and at_ns < self._next_ns:
            return None
        self._next_ns = at_ns + _STATS_INTERVAL_NS
        counters = dict(self._counters) if is_final else dict(changed_counters(self._counters))
        stats_by_topic = {topic: counter.stats().to_plain() for topic, counter in counters.items()}
        for counter in counters.values():
            counter.is_changed = False
        return orjson.dumps({"topics": stats_by_topic, "is_final": is_final})

    def to_plain(self) -> dict[str, str]:
        return {
            topic: orjson.dumps(each.stats().to_plain()).decode()
            for topic, each in sorted(self._counters.items())
        }
