"""Publishing of recorded topics on the live network, after the user has chosen and armed them.

Messages are published with their recorded bytes and types; the topic may be renamed. Late messages are
dropped and counted, never sent in a burst. Messages skipped by a seek are not sent.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from app.core.faults import error_text
from app.core.network.source import Job
from app.core.recording.replay.opening import OpenedRecording
from app.core.robots.motion.gate import MotionGate
from app.core.run.acting.acting import SessionActing
from app.core.run.acting.arming import MAX_TARGETS, Arming, Target
from app.core.storage.background_worker import BackgroundWorker
from nep.errors import BadTopicError, NepError
from nep.i18n import _, ngettext
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher
from nep.programs.robots.moving import MovingTopics
from nep.protocol.wire import check_topic
from nep.recordings.player import latched_topics, moving_topics, published_type
from nep.recordings.reader import Recording

MAX_DELAY_S = 0.1
"""Delay in seconds beyond which a message is dropped."""
MAX_TYPES = 10
"""Maximum number of message types of a topic in one recording; messages of further types are dropped."""
Submit = Callable[[str, Job], None]


class ReplayRoute(NamedTuple):
    """Topic of a recording and the topic on which it is published.

    Attributes:
        recorded: Name of the topic in the recording.
        name: Name of the topic on the live network.
    """

    recorded: str
    name: str

    @property
    def target(self) -> Target:
        """Target of the arming: the topic on the live network."""
        return Target("topic", self.name)


@dataclass(slots=True, eq=False)
class SentTopic:
    """Topic of a recording that is being published.

    Attributes:
        turn: Number of the arming under which the topic is published.
        is_latched: True if the topic is latched in the recording.
        publishers: Open publishers, by message type.
        is_ready: True if messages can be sent.
        count: Number of sent messages.
        dropped_count: Number of dropped messages.
        problem: Reason why the topic can't be published, or "".
    """

    route: ReplayRoute
    turn: int
    is_latched: bool
    publishers: dict[str, Publisher] = field(default_factory=dict)
    requested_types: set[str] = field(default_factory=set)
    node: Node | None = None
    checked_subscriber_counts: dict[Publisher, int] = field(default_factory=dict)
    is_ready: bool = False
    count: int = 0
    dropped_count: int = 0
    problem: str = ""

    @property
    def subscriber_count(self) -> int:
        """Number of subscribers."""
        return sum(publisher.subscribers for publisher in self.publishers.values())


class ReplayOutbox:
    """Publisher of a replay's messages while publishing is armed.

    `offer` is called in the replay thread; the other methods are thread-safe.
    """

    def __init__(self, arming: Arming, submit: Submit, gate: MotionGate | None = None) -> None:
        # `submit` runs a job with Studio's live node. Without `gate` messages that move robots are not
        # checked.
        self._arming, self._submit, self._gate = arming, submit, gate
        self._lock = threading.Lock()
        self._active_topics: dict[str, SentTopic] = {}

    @property
    def active_topics(self) -> tuple[SentTopic, ...]:
        """Topics that are currently published."""
        with self._lock:
            return tuple(self._active_topics.values())

    def start(self, route: ReplayRoute, turn: int, msg_type: str, *, is_latched: bool) -> None:
        """Open a publisher for a topic and publish the topic once the publisher is ready.

        Args:
            route: Topic in the recording and on the live network.
            turn: Number of the arming, after whose end nothing is published.
            msg_type: Message type of the publisher.
            is_latched: True if the topic is latched in the recording.
        """
        sent = SentTopic(route, turn, is_latched)
        with self._lock:
            previous = self._active_topics.get(route.recorded)
            self._active_topics[route.recorded] = sent
        if previous is not None:
            self._submit_close(previous)
        self._create_publisher(sent, msg_type)

    def stop(self, recorded: str) -> SentTopic | None:
        """Stop publishing a topic; return its final state, or None if it wasn't published."""
        with self._lock:
            stopped = self._active_topics.pop(recorded, None)
        if stopped is not None:
            self._submit_close(stopped)
        return stopped

    def offer(self, messages: Sequence[Message], delays_s: Sequence[float]) -> None:
        """Publish messages that were just played, if their topics are active.

        Args:
            messages: Messages in order of time.
            delays_s: Delay of each message in seconds. Messages later than `MAX_DELAY_S` are dropped.
        """
        with self._lock:
            active_topics = dict(self._active_topics)
        for message, delay_s in zip(messages, delays_s, strict=True):
            sent = active_topics.get(message.topic)
            if sent is not None and sent.is_ready and not sent.problem:
                self._send(sent, message, delay_s)

    def _send(self, sent: SentTopic, message: Message, delay_s: float) -> None:
        msg_type = published_type(message)
        publisher = sent.publishers.get(msg_type)
        if publisher is None:
            self._create_publisher(sent, msg_type)
        if publisher is None or delay_s > MAX_DELAY_S or self._is_rejected(sent, publisher):
            sent.dropped_count += 1
            return
        data, extension = bytes(message.data), dict(message.extension) or None
        try:
            if self._arming.run_if_armed(
                sent.turn, sent.route.target, lambda: publisher.publish_bytes(data, extension)
            ):
                sent.count += 1
        except Exception as error:  # noqa: BLE001 - other topics, and the panels, continue
            sent.problem = str(error) if isinstance(error, NepError) else error_text(error)

    def _is_rejected(self, sent: SentTopic, publisher: Publisher) -> bool:
        # A robot without permission may have connected just now.
        if self._gate is None or sent.node is None:
            return False
        subscribers, name = publisher.subscribers, sent.route.name
        if subscribers == sent.checked_subscriber_counts.get(publisher):
            return bool(self._gate.rejection_reason(name))
        is_rejected = bool(self._gate.current_rejection_reason(sent.node, name))
        if not is_rejected:
            sent.checked_subscriber_counts[publisher] = subscribers
        return is_rejected

    # ---- in the network thread

    def _create_publisher(self, sent: SentTopic, msg_type: str) -> None:
        if msg_type in sent.requested_types or len(sent.requested_types) >= MAX_TYPES:
            return
        sent.requested_types.add(msg_type)

        def create_job(node: Node) -> None:
            if not self._is_active(sent):
                return
            try:
                publisher = node.new_pub(sent.route.name, msg_type, latched=sent.is_latched)
            except Exception as error:  # noqa: BLE001 - reported as a problem of this topic
                sent.problem = str(error) if isinstance(error, NepError) else error_text(error)
                return
            sent.node = node
            # a new dict, because another thread reads it
            sent.publishers = {**sent.publishers, msg_type: publisher}
            sent.is_ready = True
            if not self._is_active(sent):
                self._close(sent)

        self._submit("", create_job)

    def _is_active(self, sent: SentTopic) -> bool:
        with self._lock:
            return self._active_topics.get(sent.route.recorded) is sent

    def _submit_close(self, sent: SentTopic) -> None:
        self._submit("", lambda _node: self._close(sent))

    @staticmethod
    def _close(sent: SentTopic) -> None:
        for publisher in sent.publishers.values():
            publisher.close()


class ReplaySending:
    """Selection and publishing of a recording's topics on the live network.

    Not thread-safe; use it from the main thread.
    """

    def __init__(self, acting: SessionActing) -> None:
        self._acting = acting
        self.outbox = ReplayOutbox(acting.arming, acting.submit, acting.gate)
        self.routes: dict[str, str] = {}
        """Name under which each chosen topic is published, by its name in the recording."""
        self.revision = 0
        self._opened: OpenedRecording | None = None
        self._moving_topics: MovingTopics | None = None
        self._latched_topics: frozenset[str] = frozenset()
        self._pending_routes: list[ReplayRoute] = []
        self._is_asking = False
        """True while the question about the first pending route is open."""
        self._worker: BackgroundWorker[tuple[MovingTopics, frozenset[str]]] | None = None
        self.on_change: Callable[[], object] = _do_nothing
        """Called when the set of published topics changes."""

    def set_recording(self, opened: OpenedRecording) -> None:
        """Set the recording after it has been opened."""
        self._opened = opened

    @property
    def is_analyzed(self) -> bool:
        """True after `analyze` has determined which topics move robots."""
        return self._moving_topics is not None

    def analyze(self) -> None:
        """Determine in the background which topics move robots."""
        if self._opened is None or self._worker is not None:
            return
        recording = self._opened.recording
        self._worker = BackgroundWorker("studio-moving")
        self._worker.submit("topics", lambda: _moving_and_latched_topics(recording))

    def moves_robot(self, recorded: str, name: str) -> bool:
        """Return True if messages of a topic move a robot.

        Args:
            recorded: Name of the topic in the recording.
            name: Name of the topic on the live network.
        """
        moving_topics = self._moving_topics
        if moving_topics is not None and (
            moving_topics.robots_moved_by(recorded) or moving_topics.robots_moved_by(name)
        ):
            return True
        return bool(self._acting.gate.robots_moved_by(name))

    def select(self, recorded: str, name: str | None) -> str:
        """Choose a topic for publishing. Chosen topics are published once they are armed.

        Nothing happens if no recording is open or the recording has no such topic.

        Args:
            recorded: Name of the topic in the recording.
            name: Name on the live network; "" for the recorded name, None to deselect the topic.

        Returns:
            Reason why the topic can't be chosen, or "".
        """
        if self._opened is None or recorded not in self._opened.recording.topics:
            return ""
        self.revision += 1
        if name is None:
            self.routes.pop(recorded, None)
            return ""
        target = name.strip() or recorded
        if recorded not in self.routes and len(self.routes) >= MAX_TARGETS:
            return _("No more topics can be sent. Remove a topic first.")
        try:
            check_topic(target)
        except BadTopicError as error:
            return str(error)
        self.routes[recorded] = target
        return ""

    # ---- switch

    def arm(self) -> str:
        """Arm the chosen topics, which are then published as they are played.

        For each topic that moves robots, the user is asked first (`SessionActing.question`). Topics
        that are no longer chosen are stopped.

        Returns:
            Reason why publishing isn't possible, or "", also while the user is being asked.
        """
        opened = self._opened
        if opened is None or not self.routes:
            return _("Choose a topic first.")
        if not self.is_analyzed:
            return _("Still checking which topics move robots. Try again in a moment.")
        problem = self._acting.arm(for_replay=True)
        if problem:
            return problem
        routes = [ReplayRoute(recorded, name) for recorded, name in self.routes.items()]
        for sent in self.outbox.active_topics:
            if sent.route not in routes:
                self._stop(sent)
                self._acting.deny(sent.route.target)
        self._acting.recorded_commands |= {
            route.name for route in routes if self.moves_robot(route.recorded, route.name)
        }
        active_routes = {sent.route for sent in self.outbox.active_topics}
        new_routes = [route for route in routes if route not in active_routes]
        self._pending_routes = sorted(
            new_routes, key=lambda route: self._acting.needs_confirmation(route.target)
        )
        return self._start_next()

    def _start_next(self) -> str:
        self._is_asking = False
        while self._pending_routes:
            route, turn = self._pending_routes[0], self._acting.arming.turn
            problem = self._acting.prepare(route.target, self._start_next)
            if problem:
                self._pending_routes = []
                return problem
            if problem is not None:
                self._is_asking = bool(self._pending_routes)
                break
            self._pending_routes.remove(route)
            self._start(route, turn)
        return ""

    def _start(self, route: ReplayRoute, turn: int) -> None:
        opened = self._opened
        if opened is None:
            return
        topic = opened.recording.topics[route.recorded]
        self._acting.notify_moved(route.target, "replay")
        self.outbox.start(route, turn, topic.msg_type, is_latched=route.recorded in self._latched_topics)
        self._log(route, _("sent during playback"))
        self._mark_changed()

    def stop(self) -> None:
        """Stop publishing all topics, and disarm if any topic was published or pending.

        Called when the recording is closed.
        """
        if self.outbox.active_topics or self._pending_routes:
            self._acting.disarm()
        self._stop_all()
        if self._worker is not None:
            self._worker.close()

    def _stop_all(self) -> None:
        self._pending_routes = []
        for sent in self.outbox.active_topics:
            self._stop(sent)

    def _stop(self, sent: SentTopic) -> None:
        if self.outbox.stop(sent.route.recorded) is not None:
            text = ", ".join(filter(None, (sent.problem, sent_text(sent))))
            self._log(sent.route, text, sent.count, is_error=bool(sent.problem))
            self._mark_changed()

    def _mark_changed(self) -> None:
        self.revision += 1
        self.on_change()

    def _log(self, route: ReplayRoute, text: str, sent_count: int = 0, *, is_error: bool = False) -> None:
        if route.name != route.recorded:
            text = _("{topic} of the recording, {what}").format(topic=route.recorded, what=text)
        self._acting.log("warn" if is_error else "info", route.target, text, sent_count)

    def tick(self) -> None:
        """Stop publishing topics that are no longer allowed, or that now move a different robot.

        Called at each tick.
        """
        self._apply_result()
        arming = self._acting.arming
        if not arming.is_on:
            self._pending_routes = []
        for sent in self.outbox.active_topics:
            target = sent.route.target
            if sent.problem or sent.turn != arming.turn or not arming.allows(target):
                self._stop(sent)
            elif not self._acting.may_continue(target):
                self._stop(sent)
                self._pending_routes.append(sent.route)
        if self._pending_routes and not self._acting.is_asking:
            if self._is_asking:  # the answer was no
                del self._pending_routes[0]
            self._start_next()

    def _apply_result(self) -> None:
        if self._worker is None or self._moving_topics is not None or self._opened is None:
            return
        try:
            result = self._worker.pop_result("topics")
        except NepError:  # unreadable: every topic may move a robot
            result = (MovingTopics(unidentified=self._opened.recording.topics), frozenset())
        if result is not None:
            self._moving_topics, self._latched_topics = result
            self.revision += 1


def _moving_and_latched_topics(recording: Recording) -> tuple[MovingTopics, frozenset[str]]:
    return moving_topics(recording), latched_topics(recording, recording.topics)


def sent_text(sent: SentTopic) -> str:
    """Format the message counts of a topic, such as "412 sent, 3 late messages skipped"."""
    text = ngettext("{count} sent", "{count} sent", sent.count).format(count=sent.count)
    return f"{text}, {late_text(sent.dropped_count)}" if sent.dropped_count else text


def late_text(count: int) -> str:
    """Format the number of dropped messages, such as "3 late messages skipped"."""
    template = ngettext("{count} late message skipped", "{count} late messages skipped", count)
    return template.format(count=count)


def _do_nothing() -> None: ...
