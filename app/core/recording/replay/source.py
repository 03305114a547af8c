"""Replay thread: reads a recording and delivers the messages of watched topics at their times.

The window queues commands and collects results; neither blocks on the disk. Messages are delivered to
panels only, so this module needs no node.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Literal, Protocol

from app.core.faults import error_text
from app.core.network.mailbox import Batch, Mailbox
from app.core.recording.opener import LocalOpener, RecordingOpener
from app.core.recording.replay.opening import OpenedRecording, open_recording
from nep.errors import NepError, RecordingError
from nep.messages.codecs import content_of
from nep.messages.message import Message, new_message
from nep.recordings.formats.index import CorruptRange
from nep.recordings.player import DueMessages, Playback, PlayerStatus
from nep.recordings.reader import Recording

RATE_WINDOW_S = 2.0
STATISTICS_INTERVAL_S = 0.5
TOPICS_PER_STATS_READ = 100
STATS_PAUSE_FACTOR = 10.0
"""Minimum pause between two readings of statistics, as a multiple of the duration of the last reading."""
HISTORY_S = (5.0, 20.0, 60.0, 180.0)
"""Durations in seconds before the playhead that are read for topics with history, tried in this order."""
HISTORY_TIMEOUT_S = 0.25
"""Time limit in seconds for reading history."""
MAX_HISTORY_MESSAGES = 8192
MAX_COPIED_BYTES = 65_536
"""Maximum size in bytes of messages that are copied.

A reference to a small message would keep a whole chunk of the file in memory.
"""

ReplayStage = Literal["reading", "there", "failed"]
PlaybackChange = Callable[[Playback], object]
Forward = Callable[[Sequence[Message], Sequence[float]], object]
"""Callback for played messages and their delays in seconds. Called in the replay thread."""


class ImageSink(Protocol):
    """Receiver of images, which decodes them in another thread.

    Its methods are called in the replay thread.
    """

    def offer(self, messages: Sequence[Message]) -> None:
        """Add images, oldest first."""

    def reset(self, topics: Sequence[str]) -> None:
        """Discard the images of all topics except ``topics``. Called after a seek."""


@dataclass(frozen=True, slots=True)
class ReplayStatus:
    """Status of a replay.

    Attributes:
        progress: Progress of opening the file, 0 to 1.
        message: Reason for a failure, or "".
        player: Playback status; None before the file is open.
        corruption: Damaged ranges of the file that were found up to now.
    """

    stage: ReplayStage
    progress: float = 0.0
    message: str = ""
    player: PlayerStatus | None = None
    corruption: Sequence[CorruptRange] = ()


@dataclass(frozen=True, slots=True)
class ReplayStats:
    """Statistics of a topic at the playhead; None if unknown.

    Attributes:
        rate_hz: Message rate in the time before the playhead.
        newest_ns: Time of the newest message before the playhead; None if there is none.
    """

    rate_hz: float | None
    newest_ns: int | None


@dataclass(slots=True)
class ReplayResults:
    """Result of one call of `ReplaySource.pop_results`. The fields must be applied in their order.

    Attributes:
        seek_messages: Newest message of each topic after a seek; None if there was no seek.
        history: Earlier messages of topics with history, by topic.
        batches: Messages played after that, by topic.
        stats: Statistics by topic.
    """

    seek_messages: Sequence[Message] | None = None
    history: dict[str, Sequence[Message]] = field(default_factory=dict)
    batches: Mapping[str, Batch] = field(default_factory=dict)
    stats: dict[str, ReplayStats] = field(default_factory=dict)


class ReplaySource:
    """Source of messages from one recording, which a thread reads.

    No method blocks, except `close`.
    """

    def __init__(
        self,
        path: Path,
        image_sink: ImageSink,
        *,
        clock: Callable[[], float] = time.monotonic,
        opener: RecordingOpener | None = None,
    ) -> None:
        # Tests call `open` and `process` instead of `start`. `opener` is closed at the end.
        self.path = path
        self._opener: RecordingOpener = LocalOpener() if opener is None else opener
        self.opened_recording: OpenedRecording | None = None
        self._image_sink, self._clock = image_sink, clock
        self._changed = threading.Condition()
        self._queued_changes: list[tuple[str, PlaybackChange]] = []
        self._watched_topics: set[str] = set()
        self._history_capacities: dict[str, int] = {}
        self._panel_topics: frozenset[str] = frozenset()
        self._forwarded_topics: frozenset[str] = frozenset()
        self._played_topics: frozenset[str] = frozenset()
        self._forward: Forward | None = None
        self._mailbox = Mailbox()
        self._results = ReplayResults()
        self._status = ReplayStatus("reading")
        self._is_closing = False
        self._playback: Playback | None = None
        self._pending_stats: list[tuple[int, list[str]]] = []
        self._next_stats_s = self._stats_duration_s = 0.0
        self._thread = threading.Thread(target=self._run, name="studio-replay", daemon=True)

    # -- called by the window ----------------------------------------------------------------------

    @property
    def status(self) -> ReplayStatus:
        """Status after the last cycle of the replay thread."""
        return self._status

    def start(self) -> None:
        """Start the thread, which opens the file and plays it."""
        self._thread.start()

    def queue_change(self, kind: str, change: PlaybackChange) -> None:
        """Queue a change of playback.

        If the last queued change is of the same kind, it is replaced, so that dragging the playhead
        seeks only to the newest position.

        Args:
            kind: Kind of the change.
            change: Function that the replay thread calls to apply the change.
        """
        with self._changed:
            if self._queued_changes and self._queued_changes[-1][0] == kind:
                self._queued_changes[-1] = (kind, change)
            else:
                self._queued_changes.append((kind, change))
            self._changed.notify_all()

    def watch(self, topic: str) -> None:
        """Deliver the messages of the topic with this name in the recording."""
        with self._changed:
            self._watched_topics.add(topic)
        self.queue_change("choose", self._update_selection)

    def unwatch(self, topic: str) -> None:
        """Stop delivering the messages of a topic."""
        with self._changed:
            self._watched_topics.discard(topic)
        self.queue_change("choose", self._update_selection)

    def set_history_capacity(self, topic: str, capacity: int | None) -> None:
        """Request the history of a topic in addition to its newest messages.

        Args:
            topic: Name of the topic.
            capacity: Maximum number of messages per tick; None ends the request.
        """
        with self._changed:
            if capacity is None:
                self._history_capacities.pop(topic, None)
            else:
                self._history_capacities[topic] = capacity
            self._mailbox.set_capacity(topic, capacity)
            is_watched = topic in self._watched_topics
        if capacity is not None and is_watched:  # otherwise its history is read when it is watched
            self.queue_change(f"history {topic}", lambda playback: self._read_history(playback, [topic]))

    def forward(self, topics: Collection[str], callback: Forward | None) -> None:
        """Also pass the played messages of some topics to a callback.

        Messages delivered by a seek are not passed.

        Args:
            topics: Names of the topics.
            callback: Callback; None ends the forwarding.
        """
        with self._changed:
            self._forwarded_topics, self._forward = frozenset(topics), callback
        self.queue_change("choose", self._update_selection)

    def pop_results(self) -> ReplayResults:
        """Return and clear the results collected since the last call."""
        with self._changed:
            results, self._results = self._results, ReplayResults()
            results.batches = self._mailbox.drain()
        return results

    def request_stop(self) -> None:
        """Signal the thread to stop, without waiting for it."""
        with self._changed:
            self._is_closing = True
            self._changed.notify_all()
        self._opener.close()

    @property
    def has_ended(self) -> bool:
        """True if the thread has stopped."""
        return not self._thread.is_alive()

    def close(self, timeout_s: float = 5.0) -> None:
        """Stop the thread, which closes the file; wait at most ``timeout_s`` seconds for it. Idempotent."""
        self.request_stop()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        elif self.opened_recording is not None:
            self.opened_recording.recording.close()

    # -- its thread --------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self.open()
            while True:
                wait_s = self.process()
                with self._changed:
                    if not self._is_closing and not self._queued_changes:
                        self._changed.wait(wait_s)
                    if self._is_closing:
                        return
        except _ClosingError:
            return
        except NepError as error:
            if self._is_closing:
                return
            reason = error.reason if isinstance(error, RecordingError) else str(error)
            self._status = ReplayStatus("failed", message=reason)
        except Exception as error:  # noqa: BLE001  a file may cause any error, which the window reports
            self._status = ReplayStatus("failed", message=error_text(error))
        finally:
            if self.opened_recording is not None:
                self.opened_recording.recording.close()

    def open(self) -> None:
        """Read the index of the file and seek to the first message.

        Raises `RecordingError` if the file can't be read.
        """
        self.opened_recording = opened = open_recording(self.path, self._report_progress, self._opener)
        self._playback = playback = Playback(opened.recording, clock=self._clock, topics=frozenset())
        playback.seek(opened.recording.start_ns)
        self._update_status(playback)

    def _report_progress(self, progress: float) -> None:
        if self._is_closing:
            raise _ClosingError
        self._status = ReplayStatus("reading", progress)

    def process(self) -> float | None:
        """Apply queued changes and play due messages.

        Returns the seconds until the next message is due; None if there is none.
        """
        playback = self._playback
        if playback is None:
            return None
        with self._changed:
            changes, self._queued_changes = self._queued_changes, []
        was_playing = playback.status().is_playing
        for _kind, change in changes:
            change(playback)
        if not was_playing and playback.status().is_playing and self._forwarded_topics:
            start_messages = playback.messages_at_start(self._forwarded_topics)
            self._forward_messages(start_messages, [0.0] * len(start_messages))
        due = playback.advance()
        if due.is_jump:
            self._apply_seek(due.messages)
            self._update_status(playback)
            with self._changed:
                history_topics = frozenset(self._history_capacities)
            self._read_history(playback, history_topics & self._panel_topics)
        else:
            if self._forwarded_topics:
                self._forward_messages(due.messages, delays_of(due, playback.status()))
            self._post_messages([each for each in due.messages if each.topic in self._panel_topics])
            self._update_status(playback)
        is_due = (
            playback.status().is_playing and not self._pending_stats and self._clock() >= self._next_stats_s
        )
        if due.is_jump or is_due:
            self._schedule_stats(playback)
        self._read_next_stats()
        return 0.0 if self._pending_stats else due.wait_s

    def _update_status(self, playback: Playback) -> None:
        damage = self.opened_recording.recording.corruption if self.opened_recording is not None else ()
        self._status = ReplayStatus("there", 1.0, player=playback.status(), corruption=damage)

    def _update_selection(self, playback: Playback) -> None:
        with self._changed:
            watched_topics, history_topics, forwarded_topics = (
                frozenset(self._watched_topics),
                frozenset(self._history_capacities),
                self._forwarded_topics,
            )
        newly_watched = watched_topics - self._panel_topics  # by a panel, from now on
        new_history_topics = newly_watched & history_topics
        newest = list(playback.select_topics(watched_topics | forwarded_topics))
        # topics played only for the network: no panel has their newest message
        forwarded_only = (newly_watched & self._played_topics) - new_history_topics
        if forwarded_only and self.opened_recording is not None:
            newest_entries = self.opened_recording.recording.newest(
                playback.status().position_ns, forwarded_only
            )
            newest += [each.message for each in newest_entries.values()]
        self._post_messages([each for each in newest if each.topic in newly_watched - new_history_topics])
        self._panel_topics, self._played_topics = watched_topics, watched_topics | forwarded_topics
        self._read_history(playback, new_history_topics)

    def _post_messages(self, messages: Sequence[Message]) -> None:
        if not messages:
            return
        copies = [_own_copy(message) for message in messages]
        self._image_sink.offer([each for each in copies if content_of(each.codec) == "image"])
        with self._changed:
            for topic, group in groupby(sorted(copies, key=_topic), key=_topic):
                self._mailbox.post(topic, list(group))

    def _forward_messages(self, messages: Sequence[Message], delays_s: Sequence[float]) -> None:
        with self._changed:
            topics, callback = self._forwarded_topics, self._forward
        forwarded = [each for each in zip(messages, delays_s, strict=True) if each[0].topic in topics]
        if forwarded and callback is not None:
            callback(
                [message for message, _delay_s in forwarded], [delay_s for _message, delay_s in forwarded]
            )

    def _apply_seek(self, messages: Sequence[Message]) -> None:
        copies = [_own_copy(message) for message in messages if message.topic in self._panel_topics]
        images = [each for each in copies if content_of(each.codec) == "image"]
        self._image_sink.reset([each.topic for each in images])
        self._image_sink.offer(images)
        with self._changed:
            self._mailbox = Mailbox()
            for topic, capacity in self._history_capacities.items():
                self._mailbox.set_capacity(topic, capacity)
            self._results = ReplayResults(seek_messages=copies)

    # -- history -----------------------------------------------------------------------------------

    def _read_history(self, playback: Playback, topics: Collection[str]) -> None:
        # Reads messages before the playhead, of topics with history.
        if not topics or self.opened_recording is None:
            return
        recording, at_ns = self.opened_recording.recording, playback.status().position_ns
        history: dict[str, deque[Message]] = {topic: deque() for topic in topics}
        until_ns, start_time_s = at_ns + 1, self._clock()
        for back_s in HISTORY_S:
            from_ns = max(recording.start_ns, at_ns - round(back_s * 1e9))
            if (
                not self._prepend_range(recording, (from_ns, until_ns), history, start_time_s)
                or from_ns <= recording.start_ns
            ):
                break
            until_ns = from_ns
        for topic, entry in recording.newest(
            at_ns, [topic for topic in topics if not history[topic]]
        ).items():
            history[topic].append(_own_copy(entry.message))
        with self._changed:
            self._results.history.update({topic: list(messages) for topic, messages in history.items()})
            for topic in topics:  # the history includes all pending messages
                self._mailbox.discard(topic)

    def _prepend_range(
        self,
        recording: Recording,
        span: tuple[int, int],
        history: dict[str, deque[Message]],
        start_time_s: float,
    ) -> bool:
        # Prepends the messages of a range; returns False when the limits are reached.
        topics = [topic for topic, messages in history.items() if len(messages) < MAX_HISTORY_MESSAGES]
        earlier: dict[str, deque[Message]] = {
            topic: deque(maxlen=MAX_HISTORY_MESSAGES - len(history[topic])) for topic in topics
        }
        for number, entry in enumerate(recording.read(span[0], span[1], topics)):
            earlier[entry.message.topic].append(_own_copy(entry.message))
            if number % 64 == 0 and (
                self._queued_changes or self._clock() - start_time_s > HISTORY_TIMEOUT_S
            ):
                return False  # an incomplete range would be a gap, so it is discarded
        for topic, messages in earlier.items():
            history[topic].extendleft(reversed(messages))
        return bool(topics) and self._clock() - start_time_s <= HISTORY_TIMEOUT_S

    # -- statistics --------------------------------------------------------------------------------

    def _schedule_stats(self, playback: Playback) -> None:
        # Some topics in each cycle, so that no command waits for all.
        if self.opened_recording is None:
            return
        names, at_ns = list(self.opened_recording.recording.topics), playback.status().position_ns
        self._pending_stats = [
            (at_ns, names[k : k + TOPICS_PER_STATS_READ]) for k in range(0, len(names), TOPICS_PER_STATS_READ)
        ]
        self._next_stats_s = self._clock() + max(
            STATISTICS_INTERVAL_S, STATS_PAUSE_FACTOR * self._stats_duration_s
        )
        self._stats_duration_s = 0.0

    def _read_next_stats(self) -> None:
        if not self._pending_stats or self.opened_recording is None:
            return
        start_time_s, recording = self._clock(), self.opened_recording.recording
        at_ns, topics = self._pending_stats.pop(0)
        from_ns = max(recording.start_ns, at_ns - round(RATE_WINDOW_S * 1e9))
        elapsed_s = (at_ns - from_ns) / 1e9
        counts = recording.densities(from_ns, at_ns + 1, 1, topics) if elapsed_s > 0 else {}
        newest_ns = recording.newest_times(at_ns, topics)
        stats = {
            topic: ReplayStats(
                counts.get(topic, (0,))[0] / elapsed_s if elapsed_s > 0 else None, newest_ns.get(topic)
            )
            for topic in topics
        }
        with self._changed:
            self._results.stats.update(stats)
        self._stats_duration_s += self._clock() - start_time_s


class _ClosingError(Exception):
    """Raised in the replay thread when the replay is closed while the file is being opened."""


def delays_of(due: DueMessages, status: PlayerStatus) -> list[float]:
    """Return the delay of each due message in seconds of real time."""
    return [(status.position_ns - at_ns) / 1e9 / status.speed for at_ns in due.log_ns]


def _topic(message: Message) -> str:
    return message.topic


def _own_copy(message: Message) -> Message:
    # Copies small messages, so that they don't keep the chunk of the file.
    if isinstance(message.raw, bytes) or message.size_bytes > MAX_COPIED_BYTES:
        return message
    copy = new_message(Message)
    copy.kind, copy.raw = message.kind, bytes(message.raw)
    copy.stamp_ns, copy.seq, copy.publisher = message.stamp_ns, message.seq, message.publisher
    copy.extension, copy.decoded = message.extension, message.decoded
    return copy
