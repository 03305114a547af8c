"""Client of the recorder process: start and stop recordings, save the flight recorder, report problems.

The process runs `nep.recordings.child`. A busy window doesn't slow it down, and it finishes a recording
even after Studio has exited. Background threads write commands and read replies, so that the window
never blocks.
"""

from __future__ import annotations

import queue
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Protocol

import orjson

from app.core.alerts.alerts import Alerts
from app.core.reports.own_process import module_command
from nep.i18n import _, ngettext
from nep.masters.process import NO_CONSOLE
from nep.recordings.formats.message_counts import TopicStats, parse_stats

LOW_DISK_BYTES = 1_000_000_000
"""Free disk space in bytes below which the user is warned. The recorder itself stops at 200 MB."""
RETRY_S, MAX_RETRY_S = 2.0, 30.0
"""Initial and maximum pause before a flight recorder whose process ended is restarted; doubled each time."""
EXIT_TIMEOUT_S = 2.0
MAX_QUEUED_COMMANDS = 1000
MAX_PENDING_SAVES = 100
_TAIL_BYTES = 2000


@dataclass(frozen=True, slots=True)
class RecorderEvent:
    """Event sent by a recorder process.

    Attributes:
        process: Number of the process, counted by `RecorderClient` (not the PID).
        content: Content of the event, as described in `nep.recordings.child`.
    """

    process: int
    content: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class RecorderExited:
    """Event: a recorder process has ended or could not be started.

    Attributes:
        process: Number of the process, counted by `RecorderClient` (not the PID).
        detail: Last line of the output of the process, or the reason why it could not be started; may be
            empty.
    """

    process: int
    detail: str


@dataclass(frozen=True, slots=True)
class RingChoice:
    """Topic selection, folder and limits of the flight recorder."""

    folder: Path
    seconds: float = 60.0
    size_bytes: int = 2_000_000_000
    topics: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RecorderState:
    """State of the recorder.

    Attributes:
        phase: "" (idle), "starting", "recording" or "ending".
        lost: Number of lost messages, determined from sequence numbers.
        unwritten_count: Number of messages that could not be written.
        free_bytes: Free space on the disk; None while unknown.
        ring_s: Duration of the flight recorder's content in seconds; None while the flight recorder is
            off.
        ring_bytes: Size of the flight recorder's content.
        pending_saves: Files that are being saved from the flight recorder.
        last_path: Last finished file.
        reached_limit: Limit that ended this file: "time", "size", or "" if it was stopped.
    """

    phase: str = ""
    path: Path | None = None
    message_count: int = 0
    size_bytes: int = 0
    duration_s: float = 0.0
    lost: int = 0
    unwritten_count: int = 0
    free_bytes: int | None = None
    topics: Mapping[str, TopicStats] = field(default_factory=dict)
    ring_s: float | None = None
    ring_bytes: int = 0
    pending_saves: tuple[Path, ...] = ()
    last_path: Path | None = None
    reached_limit: str = ""


class CommandChannel(Protocol):
    """Interface of a running recorder process, as used by `RecorderClient`."""

    def send_command(self, content: Mapping[str, object]) -> bool:
        """Send a command; return False if the queue is full. Never blocks."""

    def close(self, wait_s: float) -> None:
        """Close the input and wait at most ``wait_s`` seconds for the process to exit.

        The process finishes its work even if that takes longer.
        """


StartRecorder = Callable[[int, str, Callable[[object], object]], CommandChannel]
"""Function that starts a recorder process, given its number, the master's address, and an event callback.

The callback is called in any thread.
"""


class RecorderProcess:
    """Recorder process and its pipes (see `StartRecorder`)."""

    def __init__(self, number: int, address: str, post_event: Callable[[object], object]) -> None:
        # Starts in a thread; posts `RecorderEvent` events, and finally a `RecorderExited`.
        self._number, self._address, self._post_event = number, address, post_event
        self._commands: queue.Queue[bytes | None] = queue.Queue(MAX_QUEUED_COMMANDS)
        self._has_ended = threading.Event()
        threading.Thread(target=self._run, name="recorder-process", daemon=True).start()

    def send_command(self, content: Mapping[str, object]) -> bool:
        """Queue a command; return False if the queue is full."""
        try:
            self._commands.put_nowait(orjson.dumps(content) + b"\n")
        except queue.Full:
            return False
        return True

    def close(self, wait_s: float) -> None:
        """Close the input and wait at most ``wait_s`` seconds for the process to exit."""
        with suppress(queue.Full):  # the process does not read its input and will end with this process
            self._commands.put_nowait(None)
        self._has_ended.wait(wait_s)

    def _run(self) -> None:
        detail = ""
        try:
            with tempfile.TemporaryFile() as error_output:
                try:
                    detail = self._run_process(error_output)
                finally:
                    detail = detail or _read_tail(error_output)
        except OSError as error:
            detail = str(error)
        finally:
            self._has_ended.set()
            self._post_event(RecorderExited(self._number, detail))

    def _run_process(self, error_output: IO[bytes]) -> str:
        process = subprocess.Popen(
            [*module_command("nep.recordings.child"), "--master", self._address],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=error_output,
            creationflags=NO_CONSOLE,
            start_new_session=True,  # Ctrl+C in a terminal is for Studio, which stops it properly
        )
        writer = threading.Thread(target=self._write, args=(process,), name="recorder-orders", daemon=True)
        writer.start()
        with process:
            for line in process.stdout or ():
                with suppress(orjson.JSONDecodeError):
                    content = orjson.loads(line)
                    if isinstance(content, dict):
                        self._post_event(RecorderEvent(self._number, content))
            code = process.wait()
            with suppress(queue.Full):
                self._commands.put_nowait(None)  # ends the thread that waits for commands
            writer.join(EXIT_TIMEOUT_S)
        return (
            ""
            if code == 0
            else _read_tail(error_output) or _("the recorder exited with code {code}").format(code=code)
        )

    def _write(self, process: subprocess.Popen[bytes]) -> None:
        if process.stdin is None:
            return
        with suppress(OSError):  # the process has ended, which the other thread reports
            while (line := self._commands.get()) is not None:
                process.stdin.write(line)
                process.stdin.flush()
        with suppress(OSError):
            process.stdin.close()


def _read_tail(output: IO[bytes]) -> str:
    # Last line of the output.
    size = output.seek(0, 2)
    output.seek(max(0, size - _TAIL_BYTES))
    lines = output.read().decode("utf-8", "replace").split("\n")
    return next((each.strip() for each in reversed(lines) if each.strip()), "")


class RecorderClient:
    """Client that sends commands to the recorder process and tracks its state.

    Not thread-safe; use it from the main thread.
    """

    def __init__(
        self,
        address: str,
        alerts: Alerts,
        post_event: Callable[[object], object],
        *,
        start: StartRecorder = RecorderProcess,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        # `post_event` passes events of the process's threads to `on_event`.
        self._address, self._alerts, self._post_event = address, alerts, post_event
        self._start, self._clock = start, clock
        self._process: CommandChannel | None = None
        self._number = 0
        self._ring: RingChoice | None = None
        self._retry_at_s, self._backoff_s = 0.0, RETRY_S
        self._handlers: Mapping[str, Callable[[Mapping[str, object]], None]] = {
            "recording": self._on_recording,
            "figures": self._on_stats,
            "ended": self._on_ended,
            "ring": self._on_ring,
            "ring_ended": self._on_ring_ended,
            "kept": self._on_saved,
            "problem": self._on_problem,
        }
        self.state = RecorderState()
        self.revision = 0
        """Counter that increases with each change of the state."""

    # ---- commands of the user

    def record(
        self,
        path: Path,
        topics: Sequence[str] = (),
        excluded: Sequence[str] = (),
        note: str = "",
        *,
        seconds: float | None = None,
        max_bytes: int | None = None,
    ) -> bool:
        """Start a recording; return False if one is already in progress.

        Args:
            path: File to write.
            topics: Topics or patterns to record; empty for all topics.
            excluded: Patterns of topics that are not recorded.
            note: Note stored in the file.
            seconds: Maximum duration in seconds; None for no limit.
            max_bytes: Maximum size of the file in bytes; None for no limit.
        """
        if self.state.phase:
            return False
        self._alerts.resolve_all("recorder:")
        previous = self.state
        self._set_state(
            RecorderState(
                "starting",
                path,
                ring_s=previous.ring_s,
                ring_bytes=previous.ring_bytes,
                pending_saves=previous.pending_saves,
                last_path=previous.last_path,
            )
        )
        limits = {"seconds": seconds, "size_bytes": max_bytes}
        end_limits = {name: limit for name, limit in limits.items() if limit is not None}
        self._send(
            op="record", path=str(path), topics=list(topics), left_out=list(excluded), note=note, **end_limits
        )
        return True

    def stop(self) -> None:
        """Stop the recording. The file is complete once ``phase`` is "" again."""
        if self.state.phase in {"starting", "recording"}:
            self._set_state(replace(self.state, phase="ending"))
            self._send(op="stop")

    def add_bookmark(self, text: str) -> None:
        """Add a bookmark with this text to the recording. Has no effect unless the recorder is recording."""
        if self.state.phase == "recording":
            self._send(op="note", text=text)

    def add_event(self, role: str, value: Mapping[str, object], to: str = "") -> None:
        """Add an event to the recording and to the flight recorder, if they are on.

        Args:
            role: Channel of the event: "runs" or "alarms".
            value: JSON content of the event.
            to: "recording" or "ring" to add the event only there; "" for both.
        """
        has_receiver = (self.state.phase and to != "ring") or (self._ring is not None and to != "recording")
        if self._process is not None and has_receiver:
            self._process.send_command({"op": "say", "role": role, "value": dict(value), "to": to})

    def set_ring(self, choice: RingChoice | None) -> None:
        """Switch the flight recorder on with these settings, or off with None.

        After a failure, the flight recorder is restarted automatically.
        """
        if choice == self._ring:
            return
        was_on, self._ring = self._ring is not None, choice
        self._retry_at_s, self._backoff_s = 0.0, RETRY_S
        self._alerts.resolve("recorder:ring")
        if was_on and self._process is not None:
            self._send(op="end_ring")
        if choice is not None:
            self._start_ring(choice)

    def save_last(self, path: Path, seconds: float, note: str = "") -> bool:
        """Save the newest content of the flight recorder to a file.

        Args:
            path: File to write.
            seconds: Duration to save.
            note: Note stored in the file.

        Returns:
            False if the flight recorder is off or is already saving too many files.
        """
        if self._ring is None or self._process is None or len(self.state.pending_saves) >= MAX_PENDING_SAVES:
            return False
        self._set_state(replace(self.state, pending_saves=(*self.state.pending_saves, path)))
        self._send(op="keep", path=str(path), seconds=seconds, note=note)
        return True

    def check(self) -> None:
        """Restart the flight recorder if its process ended unexpectedly. Called once a second."""
        if self._ring is not None and self._process is None and self._clock() >= self._retry_at_s:
            self._start_ring(self._ring)

    def close(self, wait_s: float = EXIT_TIMEOUT_S) -> None:
        """Close the input of the process, and wait at most ``wait_s`` seconds while it finishes its work."""
        channel, self._process = self._process, None
        if channel is not None:
            channel.close(wait_s)

    # ---- events of the process

    def on_event(self, event: RecorderEvent | RecorderExited) -> None:
        """Apply an event of the recorder process. Events of earlier processes are ignored."""
        if event.process != self._number or self._process is None:
            return
        if isinstance(event, RecorderExited):
            self._on_exited(event.detail)
            return
        handler = self._handlers.get(str(event.content.get("event")))
        if handler is not None:
            handler(event.content)

    def _on_recording(self, _content: Mapping[str, object]) -> None:
        if self.state.phase == "starting":
            self._set_state(replace(self.state, phase="recording"))

    def _on_stats(self, content: Mapping[str, object]) -> None:
        state = self.state
        recording, ring = content.get("recording"), content.get("ring")
        if isinstance(recording, Mapping) and state.phase:
            state = replace(
                _with_status(state, recording), free_bytes=_non_negative_int(content.get("free_bytes"))
            )
        if isinstance(ring, Mapping) and self._ring is not None:
            seconds = ring.get("seconds")
            state = replace(
                state,
                ring_s=float(seconds) if isinstance(seconds, int | float) else 0.0,
                ring_bytes=_non_negative_int(ring.get("size_bytes")) or 0,
            )
        self._set_state(state)
        self._warn_about_disk()

    def _on_ended(self, content: Mapping[str, object]) -> None:
        status = content.get("status")
        status = status if isinstance(status, Mapping) else {}
        path = self.state.path
        ended = replace(_with_status(self.state, status), phase="", last_path=path, free_bytes=None)
        self._set_state(replace(ended, reached_limit=str(content.get("limit", ""))))
        self._alerts.resolve("recorder:low")
        problem = status.get("problem")
        if isinstance(problem, str) and problem:
            self._alerts.raise_alert(
                "recorder:ended",
                "error",
                _("The recording stopped: {reason}.").format(reason=problem),
                _path_text(path),
            )

    def _on_ring(self, _content: Mapping[str, object]) -> None:
        self._backoff_s = RETRY_S
        self._alerts.resolve("recorder:ring")
        if self._ring is not None:
            self._set_state(replace(self.state, ring_s=self.state.ring_s or 0.0))

    def _on_ring_ended(self, content: Mapping[str, object]) -> None:
        status = content.get("status")
        problem = status.get("problem") if isinstance(status, Mapping) else ""
        if isinstance(problem, str) and problem:
            self._ring = None  # the user switches it on again when there is space
            self._alert_ring_off(problem)
        if self._ring is None:
            self._set_state(replace(self.state, ring_s=None, ring_bytes=0))

    def _on_saved(self, content: Mapping[str, object]) -> None:
        path = _parse_path(content)
        self._set_state(replace(self._without_pending_save(path), last_path=path or self.state.last_path))

    def _on_problem(self, content: Mapping[str, object]) -> None:
        op, message = content.get("op"), str(content.get("sentence", ""))
        if op == "record":
            self._set_state(replace(self.state, phase="", path=None))
            self._alerts.raise_alert("recorder:ended", "error", _("Nothing is being recorded."), message)
        elif op == "keep":
            self._set_state(self._without_pending_save(_parse_path(content)))
            self._alerts.raise_alert(
                "recorder:keep", "error", _("The last seconds couldn't be saved."), message
            )
        elif op == "ring":
            self._ring = None
            self._set_state(replace(self.state, ring_s=None, ring_bytes=0))
            self._alert_ring_off(message)
        elif op == "stop":
            self._set_state(replace(self.state, phase=""))
            self._alerts.raise_alert(
                "recorder:ended", "error", _("The recording couldn't be closed."), message
            )

    def _on_exited(self, detail: str) -> None:
        previous, self._process = self.state, None
        self._retry_at_s = self._clock() + self._backoff_s
        self._backoff_s = min(2 * self._backoff_s, MAX_RETRY_S)
        self._set_state(
            replace(previous, phase="", free_bytes=None, ring_s=None, ring_bytes=0, pending_saves=())
        )
        if previous.phase:
            title = _("The recorder stopped. Everything up to a second before that is saved.")
            self._alerts.raise_alert("recorder:ended", "error", title, detail or _path_text(previous.path))
        if previous.pending_saves:
            title = _("The last seconds couldn't be saved.")
            self._alerts.raise_alert("recorder:keep", "error", title, detail)
        if self._ring is not None:
            self._alert_ring_off(detail)

    # ---- private

    def _alert_ring_off(self, reason: str) -> None:
        title = _("The flight recorder is off: the last seconds can't be saved.")
        self._alerts.raise_alert("recorder:ring", "warn", title, reason)

    def _warn_about_disk(self) -> None:
        state = self.state
        if state.phase and state.free_bytes is not None and state.free_bytes < LOW_DISK_BYTES:
            self._alerts.raise_alert(
                "recorder:low",
                "warn",
                _("The disk is nearly full."),
                _("The recorder stops before the disk is full; everything received until then is saved."),
                count=0,
            )
        else:
            self._alerts.resolve("recorder:low")
        if state.phase and state.unwritten_count:
            title = ngettext(
                "{count} message wasn't recorded: the disk is too slow.",
                "{count} messages weren't recorded: the disk is too slow.",
                state.unwritten_count,
            )
            self._alerts.raise_alert(
                "recorder:unkept", "warn", title.format(count=state.unwritten_count), count=0
            )

    def _start_ring(self, choice: RingChoice) -> None:
        self._send(
            op="ring",
            folder=str(choice.folder),
            seconds=choice.seconds,
            size_bytes=choice.size_bytes,
            topics=list(choice.topics),
            left_out=list(choice.excluded),
        )

    def _send(self, **content: object) -> None:
        if self._process is None:
            self._number += 1
            self._process = self._start(self._number, self._address, self._post_event)
        if not self._process.send_command(content):
            self._on_problem({**content, "sentence": _("the recorder doesn't respond")})

    def _without_pending_save(self, path: Path | None) -> RecorderState:
        return replace(
            self.state, pending_saves=tuple(each for each in self.state.pending_saves if each != path)
        )

    def _set_state(self, state: RecorderState) -> None:
        if state != self.state:
            self.state = state
            self.revision += 1


def _with_status(state: RecorderState, status: Mapping[str, object]) -> RecorderState:
    raw_topics = status.get("topics")
    topic_items = raw_topics.items() if isinstance(raw_topics, Mapping) else ()
    topics = {
        str(topic): each for topic, raw_stats in topic_items if (each := parse_stats(raw_stats)) is not None
    }
    duration_s = status.get("duration_s")
    return replace(
        state,
        message_count=_non_negative_int(status.get("message_count")) or 0,
        size_bytes=_non_negative_int(status.get("size_bytes")) or 0,
        duration_s=float(duration_s) if isinstance(duration_s, int | float) else 0.0,
        lost=sum(each.lost or 0 for each in topics.values()),
        unwritten_count=_non_negative_int(status.get("unkept")) or 0,
        topics=topics,
    )


def _non_negative_int(value: object) -> int | None:
    return value if type(value) is int and value >= 0 else None


def _parse_path(content: Mapping[str, object]) -> Path | None:
    path = content.get("path")
    return Path(path) if isinstance(path, str) and path else None


def _path_text(path: Path | None) -> str:
    return "" if path is None else str(path)
