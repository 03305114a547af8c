"""Replay of a recording for the panels: topics, images, series, log, and playback controls."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from app.core.alerts.alerts import Alerts
from app.core.messages.image_streams import Images
from app.core.network.mailbox import Batch
from app.core.network.topics import Topics
from app.core.network.watches import Watch
from app.core.recording.opener import RecordingOpener
from app.core.recording.replay.density import Densities
from app.core.recording.replay.opening import OpenedRecording
from app.core.recording.replay.sending import ReplaySending
from app.core.recording.replay.source import ReplayResults, ReplaySource, ReplayStatus
from app.core.run.acting.acting import SessionActing
from app.core.world.console import CAPACITY
from app.core.world.world import World
from app.intents import ShowRecordingFile
from nep.i18n import _, number
from nep.messages.message import Message
from nep.nodes.log_handler import LAST_ERRORS_TOPIC, LOG_TOPIC
from nep.protocol.graph_view import GraphView, PublisherInfo, TopicInfo
from nep.recordings.bookmarks import Bookmark
from nep.recordings.formats.damage import corruption_text
from nep.recordings.formats.message_counts import TopicStats
from nep.recordings.player import SPEED_MAX, SPEED_MIN, Playback, PlayerStatus
from nep.recordings.reader import RecordedTopic

FAILED, NOT_CLOSED, DAMAGED = "recording:failed", "recording:not-closed", "recording:damaged"
"""Ids of the alerts of a replay."""
LOG_TOPICS = (LOG_TOPIC, LAST_ERRORS_TOPIC)
STEP_NS = 1_000_000_000


class Replay(World):
    """Recording as a world, without nodes and other networks. Not thread-safe; use it from the main thread.

    Attributes:
        selected_topic: Topic whose messages `step` steps through; "" for none.
    """

    def __init__(
        self,
        path: Path,
        alerts: Alerts,
        *,
        clock: Callable[[], float] = time.monotonic,
        acting: SessionActing | None = None,
        opener: RecordingOpener | None = None,
    ) -> None:
        # `opener` opens the file, by default in this process; it is closed with the replay. Without `acting`
        # nothing can be sent.
        self.path = path
        self.opened_recording: OpenedRecording | None = None
        images = Images(self.watch, clock)
        self.source = ReplaySource(path, images, clock=clock, opener=opener)
        super().__init__(topics=Topics(("", 0)), images=images, clock=clock, now_ns=self._position_ns)
        self.densities: Densities | None = None
        self.selected_topic = ""
        self.sending = ReplaySending(acting) if acting is not None else None
        if self.sending is not None:
            self.sending.on_change = self._update_forwarding
        self._log_watches: list[Watch] = []
        self._alerts, self._has_failed, self._known_damage_count = alerts, False, 0
        for id in (FAILED, NOT_CLOSED, DAMAGED):
            alerts.resolve(id)

    def start(self) -> None:
        """Open the file in a background thread."""
        self.source.start()

    def request_stop(self) -> None:
        """Stop publishing and signal the threads to stop, without waiting for them; `close` waits."""
        if self.sending is not None:
            self.sending.stop()
        self.source.request_stop()

    @property
    def has_ended(self) -> bool:
        """True if the replay thread has stopped. All other resources are closed then."""
        if self.source.has_ended:
            self.close()
        return self.source.has_ended

    def close(self) -> None:
        """Stop the threads and wait for them. Idempotent."""
        self.source.close()
        if self.densities is not None:
            self.densities.close()
        self.images.close()

    # -- state -------------------------------------------------------------------------------------

    @property
    def status(self) -> ReplayStatus:
        """Status of opening the file and of playback."""
        return self.source.status

    @property
    def player(self) -> PlayerStatus | None:
        """Playback status; None before the file is open and after a failure."""
        return self.source.status.player

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.path.name

    @property
    def start_ns(self) -> int:
        """Time of the first message in ns since 1970; 0 while unknown."""
        return self.opened_recording.recording.start_ns if self.opened_recording is not None else 0

    @property
    def end_ns(self) -> int:
        """Time of the last message in ns since 1970; 0 while unknown."""
        return self.opened_recording.recording.end_ns if self.opened_recording is not None else 0

    @property
    def recorded_topics(self) -> Mapping[str, RecordedTopic]:
        """Topics in the file."""
        return self.opened_recording.recording.topics if self.opened_recording is not None else {}

    @property
    def stats(self) -> Mapping[str, TopicStats]:
        """Statistics written by the recorder, by topic, for topics with known statistics."""
        return self.opened_recording.stats if self.opened_recording is not None else {}

    @property
    def lost(self) -> int:
        """Number of messages missing in the recording, for topics with known statistics."""
        return sum((each.lost or 0) + each.unkept for each in self.stats.values())

    @property
    def bookmarks(self) -> Sequence[Bookmark]:
        """Bookmarks, in order of time."""
        return self.opened_recording.bookmarks.all if self.opened_recording is not None else ()

    def _position_ns(self) -> int:
        player = self.source.status.player
        return player.position_ns if player is not None else self.start_ns

    # -- commands of the user ----------------------------------------------------------------------

    def play(self) -> None:
        """Start playing. At the end, playback restarts at the beginning of the loop or recording."""
        player = self.player
        if player is not None and player.is_at_end:
            self.seek(player.loop[0] if player.loop is not None else self.start_ns)
        self.source.queue_change("play", lambda playback: playback.play())

    def pause(self) -> None:
        """Pause playback."""
        self.source.queue_change("play", lambda playback: playback.pause())

    def toggle(self) -> None:
        """Pause or resume playback."""
        if self.player is not None and self.player.is_playing:
            self.pause()
        else:
            self.play()

    def seek(self, at_ns: int) -> None:
        """Move the playhead to a time, limited to the range of the recording."""
        at_ns = max(self.start_ns, min(at_ns, self.end_ns))
        self.source.queue_change("seek", lambda playback: playback.seek(at_ns))

    def move(self, by_ns: int) -> None:
        """Move the playhead by a duration in ns, which may be negative."""
        self.source.queue_change(
            "move", lambda playback: playback.seek(playback.status().position_ns + by_ns)
        )

    def step(self, *, forward: bool) -> None:
        """Pause, and move the playhead to the next or previous message of the chosen topic.

        Has no effect if no topic is chosen.
        """
        topic = self.selected_topic
        if topic in self.recorded_topics:
            self.source.queue_change("step", lambda playback: playback.step(topic, forward=forward))

    def select_topic(self, topic: str) -> None:
        """Choose the topic whose messages `step` steps through. Topics that aren't recorded are ignored."""
        if topic in self.recorded_topics:
            self.selected_topic = topic

    def set_speed(self, speed: float) -> None:
        """Set the playback speed, limited to the supported range."""
        clamped = max(SPEED_MIN, min(SPEED_MAX, speed)) if speed == speed else 1.0  # noqa: PLR0124  excludes NaN

        def change(playback: Playback) -> None:
            playback.speed = clamped

        self.source.queue_change("speed", change)

    def loop(self, start_ns: int | None = None, end_ns: int | None = None) -> None:
        """Play a range in a loop; without arguments, the whole recording. An empty range is ignored."""
        if start_ns is not None and end_ns is not None:
            start_ns, end_ns = max(start_ns, self.start_ns), min(end_ns, self.end_ns)
            if start_ns >= end_ns:
                return
        self.source.queue_change("loop", lambda playback: playback.loop(start_ns, end_ns))

    def end_loop(self) -> None:
        """Stop looping. Playback continues after the end of the range."""
        self.source.queue_change("loop", lambda playback: playback.clear_loop())

    def toggle_loop(self) -> None:
        """Stop looping, or start to loop the whole recording."""
        player = self.player
        if player is not None and player.is_looping:
            self.end_loop()
        else:
            self.loop()

    def set_loop_edge(self, *, is_start: bool) -> None:
        """Set the start or the end of the loop to the playhead."""
        player = self.player
        if player is None:
            return
        start_ns, end_ns = player.loop or (self.start_ns, self.end_ns)
        at_ns = player.position_ns
        if is_start:
            self.loop(at_ns, end_ns if end_ns > at_ns else self.end_ns)
        else:
            self.loop(start_ns if start_ns < at_ns else self.start_ns, at_ns)

    def skip(self, *, forward: bool) -> None:
        """Move the playhead to the next or previous mark, or to an end of the recording.

        Marks are bookmarks and the starts of alarms and runs.
        """
        if self.opened_recording is None:
            return
        at_ns, marks = self._position_ns(), [mark.at_ns for mark in self.bookmarks]
        marks += self.densities.spans.starts() if self.densities is not None else []
        if forward:
            self.seek(min((mark for mark in marks if mark > at_ns), default=self.end_ns))
        else:
            self.seek(max((mark for mark in marks if mark < at_ns), default=self.start_ns))

    def current_bookmark(self) -> Bookmark | None:
        """Return the bookmark at the playhead; None if there is none."""
        at_ns = self._position_ns()
        return next((mark for mark in self.bookmarks if mark.at_ns == at_ns), None)

    def bookmark(self, name: str = "") -> Bookmark | None:
        """Add and return a bookmark at the playhead; return None before the file is open.

        Raises `RecordingError` if the bookmark can't be saved.
        """
        return (
            self.opened_recording.bookmarks.add(self._position_ns(), name)
            if self.opened_recording is not None
            else None
        )

    def rename_bookmark(self, bookmark: Bookmark, name: str) -> None:
        """Rename a bookmark.

        Raises:
            RecordingError: The change can't be saved.
            ValueError: The bookmark is part of the recording.
        """
        if self.opened_recording is not None:
            self.opened_recording.bookmarks.rename(bookmark, name)

    def restore_bookmark(self, bookmark: Bookmark) -> None:
        """Restore a removed bookmark. Raises `RecordingError` if the change can't be saved."""
        if self.opened_recording is not None:
            self.opened_recording.bookmarks.add(bookmark.at_ns, bookmark.name)

    def remove_bookmark(self, bookmark: Bookmark) -> None:
        """Remove a bookmark.

        Raises:
            RecordingError: The change can't be saved.
            ValueError: The bookmark is part of the recording.
        """
        if self.opened_recording is not None:
            self.opened_recording.bookmarks.remove(bookmark)

    # -- tick --------------------------------------------------------------------------------------

    def tick(self) -> None:
        """Apply the messages read since the last tick."""
        if (
            self.opened_recording is None
            and self.source.opened_recording is not None
            and self.player is not None
        ):
            self._on_opened(self.source.opened_recording)
        self._alert_problems()
        results = self.source.pop_results()
        if results.seek_messages is not None:
            self._apply_seek(results.seek_messages)
        self._apply_history(results)
        for topic, batch in results.batches.items():
            if topic in LOG_TOPICS:
                self.console.add_messages(batch.messages, batch.dropped)
            self.add(topic, batch)
        self.series.dispatch(results.batches)
        if results.stats:
            self.topics.set_stats({name: (x.rate_hz, x.newest_ns) for name, x in results.stats.items()})
        self.topics.update_ages(self._clock(), self._position_ns())
        if self.player is None or not self.player.is_playing:
            self.images.restart_silence()
        if self.sending is not None:
            self.sending.tick()

    def _update_forwarding(self) -> None:
        if self.sending is not None:
            outbox = self.sending.outbox
            self.source.forward({topic.route.recorded for topic in outbox.active_topics}, outbox.offer)

    def _on_opened(self, opened: OpenedRecording) -> None:
        self.opened_recording = opened
        self.revision += 1  # its topics and start time are available from now on
        recording = opened.recording
        self.series.origin_ns = recording.start_ns
        if self.sending is not None:
            self.sending.set_recording(opened)
        self.graph = create_graph(recording.topics, opened.stats)
        self.topics.update(self.graph, self._clock())
        self.selected_topic = next(iter(recording.topics), "")
        self.densities = Densities(recording)
        for topic in LOG_TOPICS:
            if topic in recording.topics:
                self.source.set_history_capacity(topic, CAPACITY)
                self._log_watches.append(self.watch(topic))

        self._alert_not_closed(opened)

    def _alert_problems(self) -> None:
        status = self.status
        reason = status.message if status.stage == "failed" else ""
        if not reason and self.densities is not None:
            reason = self.densities.problem
        if reason and not self._has_failed:
            self._has_failed = True
            title = _("{name} can't be played.").format(name=self.name)
            message = f"{reason[:1].upper()}{reason[1:]}."
            self._alerts.raise_alert(
                FAILED,
                "error",
                title,
                message,
                button=_("Show the file"),
                intent=ShowRecordingFile(self.path),
            )
        if len(status.corruption) > self._known_damage_count:
            self._known_damage_count = len(status.corruption)
            title = _("{name} is damaged.").format(name=self.name)
            detail = corruption_text(status.corruption, self.start_ns)
            self._alerts.raise_alert(DAMAGED, "warn", title, f"{detail[:1].upper()}{detail[1:]}.")

    def _alert_not_closed(self, opened: OpenedRecording) -> None:
        # Of a file that was cut off, or whose program was killed.
        recording = opened.recording
        if recording.is_complete:
            return
        title = _("{name} wasn't closed properly. Everything up to {seconds} s was recovered.").format(
            name=self.name, seconds=number(recording.duration_s, ".1f")
        )
        detail = _("To create a repaired copy, run: nep recording repair {file}").format(file=self.path)
        self._alerts.raise_alert(NOT_CLOSED, "info", title, detail)

    def _apply_seek(self, messages: Sequence[Message]) -> None:
        self.topics.reset()
        self.series.reset()
        self.console.reset()
        for message in messages:
            self.add(message.topic, Batch([message]))

    def _apply_history(self, results: ReplayResults) -> None:
        log_messages = [message for topic in LOG_TOPICS for message in results.history.get(topic, ())]
        self.console.add_messages(sorted(log_messages, key=lambda message: message.stamp_ns or 0))
        for topic, messages in results.history.items():
            batch = Batch(list(messages))
            self.add(topic, Batch(batch.messages[-2:]))
            self.series.reset([topic])
            self.series.dispatch({topic: batch})

    def subscribe(self, topic: str) -> None:
        """Play the messages of a topic."""
        self.source.watch(topic)

    def unsubscribe(self, topic: str) -> None:
        """Stop playing the messages of a topic."""
        self.source.unwatch(topic)

    def set_capacity(self, topic: str, count: int | None) -> None:
        """Set how many messages of a topic are kept, also from the time before the playhead."""
        self.source.set_history_capacity(topic, count)


def create_graph(topics: Mapping[str, RecordedTopic], stats: Mapping[str, TopicStats]) -> GraphView:
    """Return a graph that represents a recording: its topics, their publisher counts, and losses."""
    infos = {}
    for name, topic in topics.items():
        topic_stats = stats.get(name)
        publishers = tuple(
            PublisherInfo(number or 0, "", (), False, topic.message_count, 0, 0, None, None, None)
            for number in topic.publishers or (None,)
        )
        lost = topic_stats.lost if topic_stats is not None else None
        sent_count = topic_stats.received + lost if topic_stats is not None and lost is not None else 0
        ratio = lost / sent_count if lost is not None and sent_count else None
        infos[name] = TopicInfo(name, topic.msg_type, topic.codec, publishers, lost=lost, loss_ratio=ratio)
    return GraphView(1, 1, topics=infos)
