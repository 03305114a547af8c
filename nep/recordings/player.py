"""Replay of recordings with their original timing.

`Playback` computes the timing, with an injected clock and without waiting. `Player` is a thread that passes
due messages to a sink. Neither publishes messages; a sink may. The module also contains functions for sinks
that publish, such as `moving_topics`.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nep.errors import NepError
from nep.i18n import _
from nep.messages.codecs import codec_for
from nep.messages.message import UNDECODED, Message, MessageKind, new_message
from nep.programs.robots.moving import (
    COMMAND_TYPE,
    DESCRIPTION_TYPE,
    MovingTopics,
    RobotControls,
    parse_controls,
    robot_name_of,
)
from nep.recordings.reader import RecordedMessage, Recording

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = [
    "SPEED_MAX",
    "SPEED_MIN",
    "DueMessages",
    "Playback",
    "Player",
    "PlayerStatus",
    "latched_topics",
    "moving_topics",
    "published_type",
]

SPEED_MIN, SPEED_MAX = 0.1, 10.0
_MAX_LAG_S = 0.25
"""Maximum delay in seconds that a slow sink may cause.

When it is exceeded, playback slows down (see `PlayerStatus.measured_speed`) instead of catching up with a
burst.
"""
_MAX_BATCH_MESSAGES = 2_000
_MAX_WAIT_S = 0.05
_SPEED_WINDOW_S = 1.0
_MAX_CACHED_KINDS = 10_000
_COMMAND_TYPES = frozenset({COMMAND_TYPE, "geometry_msgs/Twist", "geometry_msgs/TwistStamped"})
"""Message types of commands to a robot or a ROS base (docs/robots.md)."""
_MAX_DESCRIPTIONS = 10_000


@dataclass(frozen=True)
class PlayerStatus:
    """State of a playback.

    Attributes:
        position_ns: Position in ns since 1970.
        is_playing: True while playing.
        is_at_end: True if the position is at the end of the selected part or of the recording.
        speed: Requested speed factor.
        measured_speed: Measured speed factor over the last second; None while paused or unknown.
        loop: Start and end of the selected part in ns since 1970; None for the whole recording.
        is_looping: True if the part is repeated.
    """

    position_ns: int
    is_playing: bool
    is_at_end: bool
    speed: float
    measured_speed: float | None
    loop: tuple[int, int] | None
    is_looping: bool


@dataclass(frozen=True)
class DueMessages:
    """Messages that are due now.

    Attributes:
        messages: Messages in order of their log times.
        is_jump: True after a seek, when the messages are the newest of each topic instead of the next ones.
        wait_s: Seconds until the next call; None while paused.
        log_ns: Time of receipt of each message in ns since 1970; empty for a jump.
    """

    messages: Sequence[Message]
    is_jump: bool
    wait_s: float | None
    log_ns: Sequence[int] = ()


class Playback:
    """Position and timing of a replay. Not thread-safe."""

    def __init__(
        self,
        recording: Recording,
        *,
        clock: Callable[[], float] = time.monotonic,
        topics: Collection[str] | None = None,
        remap: Mapping[str, str] | None = None,
    ) -> None:
        """Initialize the playback, paused before the first message.

        Args:
            recording: Recording to play.
            clock: Monotonic clock in seconds.
            topics: Names of the topics to play; None for all.
            remap: New names of topics, by recorded name.
        """
        self._recording, self._clock = recording, clock
        self._topics = topics
        self._remap = dict(remap or {})
        self._kinds: dict[int, tuple[MessageKind, MessageKind]] = {}
        self._speed = 1.0
        self._is_playing = self._is_looping = False
        self._loop_range_ns: tuple[int, int] | None = None
        self._position_ns = recording.start_ns
        self._anchor = (clock(), self._position_ns)
        self._progress: deque[tuple[float, int]] = deque()
        self._jump_messages: list[Message] | None = None
        self._shown_ns = recording.start_ns
        self._from_ns = recording.start_ns
        """Time in ns from which messages have not been returned yet."""
        self._upcoming: Iterator[RecordedMessage] = iter(())
        self._next_message: RecordedMessage | None = None
        self._read_from(recording.start_ns)

    # ---- controls

    def play(self) -> None:
        """Start playing; from the beginning if the position is at the end."""
        if not self._is_playing:
            if self._is_at_end():
                self.rewind()
            self._is_playing = True
            self._set_anchor()

    def pause(self) -> None:
        """Pause the playback at the current position."""
        if self._is_playing:
            self._is_playing = False
            self._set_anchor()

    def seek(self, at_ns: int) -> None:
        """Move to a time in ns since 1970, clamped to the recording.

        The newest message of each topic at or before that time becomes due at once.
        """
        at_ns = max(self._recording.start_ns, min(at_ns, self._recording.end_ns))
        self._jump_to(at_ns, at_ns)

    def _jump_to(self, shown_ns: int, at_ns: int) -> None:
        # The state at `shown_ns` becomes due at once, later messages at their time.
        self._position_ns, self._shown_ns = at_ns, shown_ns
        newest = self._recording.newest(shown_ns, self._topics)
        self._jump_messages = [
            self._rename_topic(each.message) for each in sorted(newest.values(), key=_log_ns)
        ]
        self._read_from(shown_ns + 1)
        self._set_anchor()

    def step(self, topic: str, *, forward: bool = True) -> bool:
        """Pause, and move to the next or previous message of a topic; return False if there is none."""
        find = self._recording.after if forward else self._recording.before
        record = find(self._position_ns, topic)
        self.pause()
        if record is None:
            return False
        self.seek(record.log_ns)
        return True

    def select_topics(self, topics: Collection[str]) -> Sequence[Message]:
        """Replace the topics to play.

        Returns:
            The newest message of each added topic; empty while a jump is due, because the jump includes
            them.
        """
        added_topics = set(topics) if self._topics is None else set(topics).difference(self._topics)
        self._topics = frozenset(topics)
        if self._jump_messages is not None:
            self._jump_to(self._shown_ns, self._position_ns)
            return ()
        self._read_from(self._from_ns)
        newest = self._recording.newest(self._from_ns - 1, added_topics) if added_topics else {}
        return [self._rename_topic(each.message) for each in sorted(newest.values(), key=_log_ns)]

    @property
    def speed(self) -> float:
        """Requested speed factor, 0.1 to 10."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if not SPEED_MIN <= speed <= SPEED_MAX:
            raise ValueError(
                _("{speed:g} isn't a valid speed; use {least:g} to {most:g}").format(
                    speed=speed, least=SPEED_MIN, most=SPEED_MAX
                )
            )
        self._speed = speed
        self._set_anchor()

    def loop(self, start_ns: int | None = None, end_ns: int | None = None) -> None:
        """Repeat a part of the recording, or the whole recording.

        Args:
            start_ns: Start of the part in ns since 1970; None for the whole recording.
            end_ns: End of the part in ns since 1970; None for the whole recording.

        Raises:
            ValueError: The part is empty or outside the recording.
        """
        if start_ns is None or end_ns is None:
            self._loop_range_ns = None
        else:
            start_ns = max(start_ns, self._recording.start_ns)
            end_ns = min(end_ns, self._recording.end_ns)
            if start_ns >= end_ns:
                raise ValueError(_("the start of the part must be before its end and within the recording"))
            self._loop_range_ns = (start_ns, end_ns)
            if not start_ns <= self._position_ns <= end_ns:
                self.seek(start_ns)
        self._is_looping = True

    def clear_loop(self) -> None:
        """Stop repeating and deselect the part; playback continues beyond its end."""
        self._is_looping, self._loop_range_ns = False, None

    def play_once(self) -> None:
        """Stop repeating; playback stops at the end of the part."""
        self._is_looping = False

    def rewind(self) -> None:
        """Move before the first message of the part, without a jump."""
        self._position_ns, self._jump_messages = self._first_ns(), None
        self._read_from(self._position_ns)
        self._set_anchor()

    # ---- timing

    def status(self) -> PlayerStatus:
        """Return the current state of the playback."""
        return PlayerStatus(
            self._position_ns,
            self._is_playing,
            self._is_at_end(),
            self._speed,
            self._measured_speed(),
            self._loop_range_ns,
            self._is_looping,
        )

    def advance(self) -> DueMessages:
        """Return the messages that are due.

        Must be called again within `DueMessages.wait_s` seconds unless that is None. After a seek,
        returns the messages at the new position, even while paused.
        """
        if self._jump_messages is not None:
            messages, self._jump_messages = self._jump_messages, None
            return DueMessages(messages, is_jump=True, wait_s=0.0 if self._is_playing else None)
        if not self._is_playing:
            return DueMessages((), is_jump=False, wait_s=None)
        target = min(self._target_ns(), self._last_ns())
        due = self._pop_due(target)
        if (
            len(due) >= _MAX_BATCH_MESSAGES
            and self._next_message is not None
            and self._next_message.log_ns <= target
        ):
            self._position_ns = due[-1].log_ns
            self._set_anchor(is_measured=False)
        else:
            self._position_ns = target
        self._record_progress()
        if self._position_ns >= self._last_ns():
            self._handle_end()
        messages = [self._rename_topic(each.message) for each in due]
        return DueMessages(messages, False, self._wait_s(), [each.log_ns for each in due])

    def messages_at_start(self, topics: Collection[str]) -> Sequence[Message]:
        """Return the first messages of the part if a jump has already returned them, else an empty list.

        For sinks that ignore jumps: these messages are not due again, so that such a sink would miss them
        when playing from the beginning.

        Args:
            topics: Names of the topics.
        """
        first_ns = self._first_ns()
        if self._position_ns != first_ns or self._from_ns != first_ns + 1:
            return ()
        messages = self._recording.read(first_ns, first_ns + 1, topics)
        return [self._rename_topic(each.message) for each in messages]

    def _target_ns(self) -> int:
        now = self._clock()
        started, from_ns = self._anchor
        target = from_ns + int((now - started) * self._speed * 1e9)
        limit = self._position_ns + int(_MAX_LAG_S * self._speed * 1e9)
        if target > limit:
            self._anchor = (now, limit)
            return limit
        return max(target, self._position_ns)

    def _pop_due(self, until_ns: int) -> list[RecordedMessage]:
        due: list[RecordedMessage] = []
        while (
            self._next_message is not None
            and self._next_message.log_ns <= until_ns
            and len(due) < _MAX_BATCH_MESSAGES
        ):
            due.append(self._next_message)
            self._next_message = next(self._upcoming, None)
        if self._next_message is None or self._next_message.log_ns > until_ns:
            returned_ns = until_ns
        else:  # several messages with the same time; a cut between them repeats some
            returned_ns = due[-1].log_ns - (self._next_message.log_ns == due[-1].log_ns)
        self._from_ns = max(self._from_ns, returned_ns + 1)
        return due

    def _handle_end(self) -> None:
        if self._is_looping and self._last_ns() > self._first_ns():
            self._jump_to(self._first_ns() - 1, self._first_ns())
        elif self._next_message is None or self._next_message.log_ns > self._last_ns():
            self._is_playing = False
            self._progress.clear()

    def _wait_s(self) -> float | None:
        if not self._is_playing:
            return None
        if self._jump_messages is not None:
            return 0.0
        next_ns = (
            self._last_ns() if self._next_message is None else min(self._next_message.log_ns, self._last_ns())
        )
        return max(0.0, min(_MAX_WAIT_S, (next_ns - self._position_ns) / 1e9 / self._speed))

    def _first_ns(self) -> int:
        return self._recording.start_ns if self._loop_range_ns is None else self._loop_range_ns[0]

    def _last_ns(self) -> int:
        return self._recording.end_ns if self._loop_range_ns is None else self._loop_range_ns[1]

    def _is_at_end(self) -> bool:
        return self._position_ns >= self._last_ns() and (
            self._next_message is None or self._next_message.log_ns > self._last_ns()
        )

    def _read_from(self, at_ns: int) -> None:
        self._from_ns = at_ns
        self._upcoming = self._recording.read(at_ns, None, self._topics)
        self._next_message = next(self._upcoming, None)

    def _set_anchor(self, *, is_measured: bool = True) -> None:
        self._anchor = (self._clock(), self._position_ns)
        if is_measured:
            self._progress.clear()

    def _record_progress(self) -> None:
        now = self._clock()
        self._progress.append((now, self._position_ns))
        while len(self._progress) > 2 and self._progress[0][0] < now - _SPEED_WINDOW_S:
            self._progress.popleft()

    def _measured_speed(self) -> float | None:
        if len(self._progress) < 2:
            return None
        (started, from_ns), (now, to_ns) = self._progress[0], self._progress[-1]
        return (to_ns - from_ns) / 1e9 / (now - started) if now > started else None

    def _rename_topic(self, message: Message) -> Message:
        # Applies `remap`.
        new_topic = self._remap.get(message.topic)
        if new_topic is None:
            return message
        cached = self._kinds.get(id(message.kind))
        if cached is None:
            if len(self._kinds) >= _MAX_CACHED_KINDS:
                self._kinds.clear()
            cached = self._kinds[id(message.kind)] = (message.kind, message.kind._replace(topic=new_topic))
        copy = new_message(Message)
        copy.kind = cached[1]
        copy.raw, copy.stamp_ns, copy.seq = message.raw, message.stamp_ns, message.seq
        copy.publisher, copy.extension, copy.decoded = message.publisher, message.extension, UNDECODED
        return copy


def _log_ns(record: RecordedMessage) -> int:
    return record.log_ns


def moving_topics(recording: Recording) -> MovingTopics:
    """Return the topics that move robots, according to descriptions, message types and names.

    Names are used because a robot that receives commands may not be described in the recording.
    """
    description_topics = {
        each.name for each in recording.topics.values() if each.msg_type == DESCRIPTION_TYPE
    }
    robots = dict[RobotControls, None]()
    for _at, message in recording.read(topics=description_topics) if description_topics else ():
        with suppress(NepError):
            controls = parse_controls(message.payload, robot_name_of(message.topic))
            if controls is not None and len(robots) < _MAX_DESCRIPTIONS:
                robots[controls] = None
    command_topics = (each.name for each in recording.topics.values() if each.msg_type in _COMMAND_TYPES)
    return MovingTopics(robots, unidentified=command_topics, matches_command_names=True)


def latched_topics(recording: Recording, topics: Iterable[str]) -> frozenset[str]:
    """Return the subset of `topics` whose newest message in the recording is latched."""
    newest = recording.newest(recording.end_ns, list(topics))
    return frozenset(each.message.topic for each in newest.values() if each.message.is_latched)


def published_type(message: Message) -> str:
    """Return the message type with which to publish a recorded message.

    If the recorded type would use another codec, the name of the codec is returned, so that the bytes are
    decoded as before.
    """
    return message.msg_type if codec_for(message.msg_type).name == message.codec else message.codec


class Player:
    """Thread that plays a recording into a sink. Thread-safe; usable as a context manager.

    Slow callbacks slow down the playback; no message is lost.

    Args:
        playback: Playback to run. From now on, change it only with `apply`.
        sink: Called in the player's thread with batches of messages in order.
        on_jump: Called with the newest message of each topic after a seek. Default: `sink`.
        on_end: Called at the end, and after an exception of a callback or of the recording, which is stored
            in `problem`.
    """

    def __init__(
        self,
        playback: Playback,
        sink: Callable[[Sequence[Message]], object],
        *,
        on_jump: Callable[[Sequence[Message]], object] | None = None,
        on_end: Callable[[], object] | None = None,
    ) -> None:
        self._playback, self._sink = playback, sink
        self._on_jump = sink if on_jump is None else on_jump
        self._on_end = on_end
        self._lock = threading.Condition()
        self._is_closed = False
        self.problem: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="recording-player", daemon=True)
        self._thread.start()

    def apply(self, change: Callable[[Playback], object]) -> PlayerStatus:
        """Apply a change to the playback and return the new state.

        Args:
            change: Function of the playback, such as `Playback.play`. Its exceptions propagate.
        """
        with self._lock:
            change(self._playback)
            self._lock.notify_all()
            return self._playback.status()

    @property
    def status(self) -> PlayerStatus:
        """Current state of the playback."""
        with self._lock:
            return self._playback.status()

    def _run(self) -> None:
        try:
            self._play_until_closed()
        except Exception as error:  # noqa: BLE001 - stored in `problem`
            with self._lock:
                self.problem = error
                self._playback.pause()
            if self._on_end is not None:
                self._on_end()

    def _play_until_closed(self) -> None:
        while True:
            with self._lock:
                if self._is_closed:
                    return
                was_playing = self._playback.status().is_playing
                due = self._playback.advance()
                is_playing = self._playback.status().is_playing
                has_ended = was_playing and not is_playing and self._playback.status().is_at_end
                if not due.messages and not has_ended:
                    self._lock.wait(due.wait_s)
            if due.messages:
                (self._on_jump if due.is_jump else self._sink)(due.messages)
            if has_ended and self._on_end is not None:
                self._on_end()

    def close(self, timeout_s: float = 10.0) -> None:
        """Stop the thread. The recording stays open. Idempotent.

        Args:
            timeout_s: Maximum time in seconds to wait for the thread.
        """
        with self._lock:
            self._is_closed = True
            self._lock.notify_all()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()
