"""`RecordingWriter`: accepts messages from any thread and writes them to a file in a background thread.

`post` never blocks. The queue is limited in bytes and messages; dropped messages are counted, and the counts
are recorded. Chunks are written at 1 MB or after half a second: if the process is killed, less than a second
is lost, and the file ends with whole records.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import orjson

from nep.errors import ClosedError, RecordingError
from nep.i18n import _
from nep.messages.message import Message, MessageKind
from nep.recordings.formats.channels import (
    Encoding,
    Role,
    definition_of,
    encoding_of,
    recorder_channel,
)
from nep.recordings.formats.destination import (
    DEFAULT_LIMITS,
    Destination,
    SingleFile,
    WriterLimits,
    disk_error,
)
from nep.recordings.formats.mcap_file import CHUNK_BYTES, FileWriter
from nep.recordings.formats.message_counts import MAX_TOPICS, TopicCounter, TopicStats, changed_counters

if TYPE_CHECKING:
    from typing_extensions import Self


MAX_PUBLISHER_CHANNELS = 10_000
"""Number of channels above which new publishers share one channel per topic."""
_CLOSE_TIMEOUT_S = 30.0
_MAX_CACHED_KINDS = 10_000
_MAX_LATCHED, _MAX_LATCHED_BYTES = 1_000, 16_000_000
_OTHER_TOPICS = ""
"""Key of the counter shared by all topics above the maximum number of topics."""
_log = logging.getLogger("nep.recordings")


class LogClock:
    """Clock for times of receipt in ns since 1970.

    The clock starts with the system time and then runs monotonically, so that the times in a recording
    never jump, even if the system clock is set.
    """

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def __call__(self) -> int:
        """Return the current time in ns since 1970."""
        return time.monotonic_ns() + self._offset_ns


@dataclass(frozen=True)
class RecordingStatus:
    """State of a writer.

    Attributes:
        message_count: Number of messages in the file.
        size_bytes: Size of the file.
        duration_s: Time since the first message in seconds.
        queued_bytes: Size of the messages that wait to be written.
        unkept: Number of received messages that were not recorded because writing was too slow.
        topics: Message counts by topic.
        problem: Error that stopped the writer, or "".
    """

    message_count: int
    size_bytes: int
    duration_s: float
    queued_bytes: int
    unkept: int
    topics: Mapping[str, TopicStats] = field(default_factory=dict)
    problem: str = ""


@dataclass
class _CachedKind:
    """Counter and channels of the messages with the same `MessageKind` and publisher, looked up once."""

    kind: MessageKind
    publisher: int | None
    counter: TopicCounter
    channels: dict[tuple[str, bool, bool], int] = field(default_factory=dict)


class _Entry:
    """Queued entry that the recorder itself writes, such as a note."""

    __slots__ = ("role", "text")

    def __init__(self, role: Role, text: bytes) -> None:
        self.role = role
        self.text = text


@dataclass
class _Part:
    """State of the current file of a split recording."""

    number: int = 1
    messages_before: int = 0
    bytes_before: int = 0
    repeated_count: int = 0
    """Number of latched messages in this file that were repeated from earlier files."""
    stats_before: Mapping[str, TopicStats] = field(default_factory=dict)
    """Message counts by topic at the start of the file."""
    latched: dict[tuple[str, int | None], Message] = field(default_factory=dict)
    latched_bytes: int = 0

    def store_latched(self, message: Message) -> None:
        # A latched message is repeated in the next file; bounded.
        key = (message.topic, message.publisher)
        old = self.latched.get(key)
        growth_bytes = message.size_bytes - (old.size_bytes if old is not None else 0)
        if old is None and len(self.latched) >= _MAX_LATCHED:
            return
        if self.latched_bytes + growth_bytes <= _MAX_LATCHED_BYTES:
            self.latched[key] = message
            self.latched_bytes += growth_bytes

    def stats_of_part(self, stats_by_topic: Mapping[str, TopicStats]) -> dict[str, TopicStats]:
        no_stats = TopicStats()
        return {
            topic: each.difference(self.stats_before.get(topic, no_stats))
            for topic, each in stats_by_topic.items()
        }

    def next_part(self, stats_by_topic: Mapping[str, TopicStats], messages: int, size_bytes: int) -> _Part:
        return _Part(
            self.number + 1,
            messages,
            size_bytes,
            0,
            dict(stats_by_topic),
            self.latched,
            self.latched_bytes,
        )


class RecordingWriter:
    """Writer of a recording.

    Thread-safe; usable as a context manager.

        with RecordingWriter("tour.mcap", note="first floor") as writer, Recorder(node, writer):
            time.sleep(60.0)
    """

    def __init__(
        self,
        path: str | os.PathLike[str] | Destination,
        *,
        note: str = "",
        clock: Callable[[], int] | None = None,
        limits: WriterLimits = DEFAULT_LIMITS,
        on_problem: Callable[[str], object] | None = None,
    ) -> None:
        """Create the file and start the writer's thread.

        Args:
            path: File to create, which must not exist, or a destination.
            note: Text for the metadata.
            clock: Clock for times of receipt in ns since 1970, which must not decrease; None for a
                `LogClock`.
            limits: Limits of the queue, the disk and times.
            on_problem: Called once in the writer's thread with the reason if an error stops the writer.

        Raises:
            RecordingError: The file can't be created.
            RecordingsUnavailableError: Packages for recordings are not installed.
        """
        self._note = note
        self._clock = LogClock() if clock is None else clock
        self._started_ns = self._clock()
        if isinstance(path, str | os.PathLike):
            file_path = Path(path)
            try:
                self._destination: Destination = SingleFile(FileWriter(file_path), limits.min_free_bytes)
            except FileExistsError:
                raise RecordingError(
                    str(file_path), _("the file already exists; choose another name")
                ) from None
            except OSError as error:
                raise disk_error(file_path, error) from error
        else:
            self._destination = path
        self._limits = limits
        self._on_problem = on_problem
        self._lock = threading.Condition()
        self._queue: deque[tuple[int, Sequence[Message]] | _Entry] = deque()
        self._queued_bytes = self._queued_messages = 0
        self._dropped_counts: dict[tuple[str, int | None], list[int]] = {}
        self._last_requested_flush = self._last_completed_flush = 0
        self._is_closing = self._has_ended = False
        self._problem = ""
        self._last_ns = 0
        self._counters: dict[str, TopicCounter] = {}
        self._kind_cache: dict[int, _CachedKind] = {}
        self._stats: dict[str, TopicStats] = {}
        self._first_ns: int | None = None
        self._own_sequence = 0
        self._part = _Part()
        self._own_channels: set[int] = set()
        self._unwritten_batches: list[Sequence[Message]] = []
        """Batches taken from the queue whose messages were not added to the file when writing failed."""
        self._message_count = self._size_bytes = 0
        self._thread = threading.Thread(target=self._run, name="recording-writer", daemon=True)
        self._thread.start()

    # ---- any thread

    def post(self, messages: Sequence[Message]) -> None:
        """Queue messages that were just received, in this order.

        Never blocks or raises; usable as `sink` of `Node.new_sub`.
        """
        now = self._clock()
        size = sum([each.size_bytes for each in messages])
        with self._lock:
            is_full = (
                self._queued_bytes + size > self._limits.queue_bytes
                or self._queued_messages + len(messages) > self._limits.queue_messages
            )
            if self._is_closing or self._problem or is_full:
                self._post_part_locked(messages, now, can_accept=not (self._is_closing or self._problem))
                return
            self._queue.append((now, messages))
            self._queued_bytes += size
            self._queued_messages += len(messages)
            self._lock.notify_all()

    def _post_part_locked(self, messages: Sequence[Message], now: int, *, can_accept: bool) -> None:
        # Called with the lock held, when there is not room for all.
        accepted = []
        for message in messages:
            size = message.size_bytes
            has_room = (
                self._queued_bytes + size <= self._limits.queue_bytes
                and self._queued_messages < self._limits.queue_messages
            )
            if can_accept and has_room:
                accepted.append(message)
                self._queued_bytes += size
                self._queued_messages += 1
                continue
            key = (message.topic, message.publisher)
            if key not in self._dropped_counts and len(self._dropped_counts) >= MAX_TOPICS:
                key = (_OTHER_TOPICS, None)
            totals = self._dropped_counts.setdefault(key, [0, 0])
            totals[0] += 1
            totals[1] += size
        if accepted:
            self._queue.append((now, accepted))
            self._lock.notify_all()

    def write_entry(self, role: Role, value: object) -> None:
        """Queue an entry of the recorder itself, which is written as JSON. Never blocks.

        The entry is dropped if the queue is full or the writer has stopped.

        Args:
            role: Role of the entry, such as "alerts" or "notes".
            value: JSON-serializable value.
        """
        text = orjson.dumps(value, option=orjson.OPT_NON_STR_KEYS)
        with self._lock:
            if (
                not (self._is_closing or self._problem)
                and self._queued_messages < self._limits.queue_messages
            ):
                self._queue.append(_Entry(role, text))
                self._queued_bytes += len(text)
                self._queued_messages += 1
                self._lock.notify_all()

    def flush(self, timeout_s: float = 10.0) -> bool:
        """Wait until all messages posted so far are in the file.

        Args:
            timeout_s: Maximum time in seconds to wait.

        Returns:
            False if the time limit has passed or an error has stopped the writer.
        """
        with self._lock:
            self._last_requested_flush += 1
            flush_number = self._last_requested_flush
            self._lock.notify_all()
            is_done = self._lock.wait_for(
                lambda: self._last_completed_flush >= flush_number or self._has_ended or bool(self._problem),
                timeout_s,
            )
            return is_done and not self._problem

    @property
    def status(self) -> RecordingStatus:
        """Current state of the writer. The counts by topic are at most a second old."""
        with self._lock:
            first = self._first_ns
            unreported_count = sum(count for count, _size in self._dropped_counts.values())
            return RecordingStatus(
                self._message_count,
                self._size_bytes,
                0.0 if first is None else max(0, self._last_ns - first) / 1e9,
                self._queued_bytes,
                unreported_count + sum(each.unkept for each in self._stats.values()),
                dict(self._stats),
                self._problem,
            )

    @property
    def problem(self) -> str:
        """Error that stopped the writer, or ""."""
        return self._problem

    def close(self, timeout_s: float = _CLOSE_TIMEOUT_S) -> RecordingStatus:
        """Write queued messages and finish the file. Idempotent.

        Args:
            timeout_s: Maximum time in seconds to wait for the disk.

        Returns:
            The final state, with the error if one has stopped the writer.

        Raises:
            ClosedError: The disk did not respond within the time limit.
        """
        with self._lock:
            self._is_closing = True
            self._lock.notify_all()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            raise ClosedError(_("the recording (its disk doesn't respond)"))
        return self.status

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    # ---- writer thread

    def _run(self) -> None:
        try:
            self._write_until_closed()
            self._finish()
        except OSError as error:
            self._fail(disk_error(self._destination.file.path, error))
        except RecordingError as error:
            self._finish_early(error)
        except Exception as error:  # noqa: BLE001 - any error must be reported as the end of the recording
            _log.exception("a recording stopped because of an internal error")
            self._fail(
                RecordingError(
                    str(self._destination.file.path),
                    _(
                        "recording stopped because of an internal error, {error}; everything recorded "
                        "before is saved"
                    ).format(error=repr(error)),
                )
            )
        finally:
            with self._lock:
                self._has_ended = True
                self._lock.notify_all()

    def _write_until_closed(self) -> None:
        flush_at = time.monotonic() + self._limits.flush_interval_s
        stats_at = time.monotonic() + self._limits.stats_interval_s
        while True:
            with self._lock:
                if (
                    not self._queue
                    and not self._is_closing
                    and self._last_completed_flush >= self._last_requested_flush
                ):
                    self._lock.wait(max(0.0, min(flush_at, stats_at) - time.monotonic()))
                batch = list(self._queue)
                self._queue.clear()
                is_closing, flush_number = self._is_closing, self._last_requested_flush
            self._write_batch(batch)
            now = time.monotonic()
            if flush_number > self._last_completed_flush or now >= flush_at:
                self._flush()
                flush_at = now + self._limits.flush_interval_s
                with self._lock:
                    self._last_completed_flush = flush_number
                    self._lock.notify_all()
            if now >= stats_at:
                stats_at = now + self._limits.stats_interval_s
                self._write_stats()
                self._destination.check_file()
            if is_closing and not self._queue:
                return

    def _write_batch(self, batch: Sequence[tuple[int, Sequence[Message]] | _Entry]) -> None:
        for number, item in enumerate(batch):
            if isinstance(item, _Entry):
                self._write_recorder_entry(item.role, item.text)
                size, count = len(item.text), 1
            else:
                now, messages = item
                size, count = 0, len(messages)
                for index, message in enumerate(messages):
                    size += message.size_bytes
                    try:
                        self._write_message(message, self._log_ns(message, now))
                    except Exception:
                        self._unwritten_batches = [
                            messages[index + 1 :],
                            *(each[1] for each in batch[number + 1 :] if not isinstance(each, _Entry)),
                        ]
                        raise
            with self._lock:
                self._queued_bytes -= size
                self._queued_messages -= count

    def _log_ns(self, message: Message, now: int) -> int:
        # Messages arrive in batches; if the publisher's clock is known, their time stamps are more precise.
        difference = message.kind.clock.difference
        log_ns = now
        if difference is not None and message.stamp_ns is not None:
            log_ns = min(now, message.stamp_ns + difference.offset_ns)
        log_ns = self._last_ns = max(self._last_ns, log_ns)
        if self._first_ns is None:
            # a latched message may be as old as its publisher; the recording starts at its receipt
            self._first_ns = self._last_ns = log_ns = max(log_ns, self._started_ns)
        return log_ns

    def _write_message(self, message: Message, log_ns: int) -> None:
        cached = self._kind_cache.get(id(message.kind))
        if cached is None or cached.publisher != message.publisher:
            cached = self._cache_kind(message)
        encoding = encoding_of(message, log_ns)
        key = (encoding.form, message.seq is None, message.stamp_ns is None)
        channel = cached.channels.get(key)
        if channel is None:
            channel, encoding = self._channel(message, encoding, log_ns)
            if channel is None:
                cached.counter.count_dropped(message.publisher, 1, message.size_bytes)
                return
            if not encoding.is_self_contained:
                cached.channels[key] = channel
        if message.kind.is_latched:
            self._part.store_latched(message)
        file = self._destination.file
        file.add(channel, (log_ns, encoding.publish_ns), encoding.sequence, encoding.prefix, message.raw)
        cached.counter.add(
            message.publisher, message.seq, message.size_bytes, is_decodable=encoding.is_decodable
        )
        if file.pending_bytes >= CHUNK_BYTES:
            self._flush()

    def _cache_kind(self, message: Message) -> _CachedKind:
        if len(self._kind_cache) >= _MAX_CACHED_KINDS:
            self._kind_cache.clear()
        cached = _CachedKind(message.kind, message.publisher, self._counter(message.topic))
        self._kind_cache[id(message.kind)] = cached  # `cached` keeps the kind alive, so its id stays unique
        return cached

    def _counter(self, topic: str) -> TopicCounter:
        if topic not in self._counters and len(self._counters) >= MAX_TOPICS:
            topic = _OTHER_TOPICS
        return self._counters.setdefault(topic, TopicCounter())

    def _channel(self, message: Message, encoding: Encoding, log_ns: int) -> tuple[int | None, Encoding]:
        # With too many publishers it is shared, and the record has all properties.
        table = self._destination.file.table
        definition = definition_of(message, encoding)
        if len(table.definitions) < MAX_PUBLISHER_CHANNELS or table.has(definition):
            return table.channel_id(definition), encoding
        encoding = encoding_of(message, log_ns, is_self_contained=True)
        return table.channel_id(definition_of(message, encoding)), encoding

    def _write_recorder_entry(self, role: Role, text: bytes) -> None:
        self._own_sequence += 1
        now = self._last_ns = max(self._last_ns, self._clock())
        file = self._destination.file
        number = file.table.channel_id(recorder_channel(role))
        if number is not None:
            self._own_channels.add(number)
            file.add(number, (now, now), self._own_sequence & 0xFFFFFFFF, b"", text)

    def _flush(self) -> None:
        file = self._destination.file
        file.flush()
        self._update_counts(file)
        self._destination.on_flushed()
        if self._destination.is_full:
            self._start_next_file()

    def _start_next_file(self) -> None:
        # The counts of the full file are written before it is finished.
        self._write_stats(is_final=True)
        file = self._destination.file
        self._add_metadata(file, "")
        self._destination.next_file()
        self._update_counts(file)
        self._part = self._part.next_part(self._stats, self._message_count, self._size_bytes)
        for message in self._part.latched.values():  # each file must be playable alone
            encoding = encoding_of(message, self._last_ns)
            number, encoding = self._channel(message, encoding, self._last_ns)
            if number is not None:
                times = (self._last_ns, encoding.publish_ns)
                self._destination.file.add(number, times, encoding.sequence, encoding.prefix, message.raw)
                self._part.repeated_count += 1

    def _write_stats(self, *, is_final: bool = False) -> None:
        with self._lock:
            dropped, self._dropped_counts = self._dropped_counts, {}
        for (topic, publisher), (count, size) in dropped.items():
            self._counter(topic).count_dropped(publisher, count, size)
        counters = dict(self._counters) if is_final else dict(changed_counters(self._counters))
        if not counters:
            return
        stats_by_topic = {topic: counter.stats() for topic, counter in counters.items()}
        for counter in counters.values():
            counter.is_changed = False
        with self._lock:
            self._stats = {**self._stats, **stats_by_topic}
        part_stats = {
            topic: each.to_plain() for topic, each in self._part.stats_of_part(stats_by_topic).items()
        }
        self._write_recorder_entry("figures", orjson.dumps({"topics": part_stats, "is_final": is_final}))

    # ---- finishing

    def _finish(self, reason: str = "") -> None:
        self._write_stats(is_final=True)
        file = self._destination.file
        file.flush()
        self._update_counts(file)
        self._destination.on_flushed()
        file = self._destination.file
        self._add_metadata(file, reason)
        self._destination.finish()
        self._update_counts(file)

    def _add_metadata(self, file: FileWriter, reason: str) -> None:
        values = {
            "started_ns": str(self._started_ns),
            "ended_ns": str(self._last_ns or self._started_ns),
            "note": self._note,
            "end": reason,
        }
        if self._part.number > 1 or self._destination.is_full:
            values["part"] = str(self._part.number)
        file.add_metadata("nep.recording", values)
        encoded_stats = {
            topic: orjson.dumps(each.to_plain()).decode()
            for topic, each in sorted(self._part.stats_of_part(self._stats).items())
        }
        if encoded_stats:
            file.add_metadata("nep.figures", encoded_stats)
        self._update_counts(file)

    def _update_counts(self, file: FileWriter) -> None:
        part = self._part
        own_count = sum(file.counts.get(each, 0) for each in self._own_channels)
        with self._lock:
            self._message_count = part.messages_before + max(
                0, file.message_count - own_count - part.repeated_count
            )
            self._size_bytes = part.bytes_before + file.size_bytes

    def _finish_early(self, error: RecordingError) -> None:
        # Stops, but the file can be finished.
        self._stop(error.reason)
        try:
            self._finish(error.reason)
        except (OSError, RecordingError):
            self._close_after_error()

    def _fail(self, error: RecordingError) -> None:
        # Nothing more can be written: the file ends with its last whole record.
        file = self._destination.file
        with self._lock:
            for messages in self._unwritten_batches:
                self._count_dropped_locked(messages)
            for number, count in file.pending_counts.items():  # received, but only in memory
                definition = file.table.definitions[number]
                dropped = self._dropped_counts.setdefault((definition.topic, None), [0, 0])
                dropped[0] += 0 if number in self._own_channels else count
        self._update_counts(file)
        self._close_after_error()
        self._stop(error.reason)

    def _close_after_error(self) -> None:
        with suppress(OSError):  # a further error doesn't matter
            self._destination.abort()

    def _stop(self, reason: str) -> None:
        with self._lock:
            self._problem = reason
            for item in self._queue:
                if not isinstance(item, _Entry):
                    self._count_dropped_locked(item[1])
            self._queue.clear()
            self._queued_bytes = self._queued_messages = 0
            self._lock.notify_all()
        if self._on_problem is not None:
            self._on_problem(reason)

    def _count_dropped_locked(self, messages: Sequence[Message]) -> None:
        self._post_part_locked(messages, 0, can_accept=False)
