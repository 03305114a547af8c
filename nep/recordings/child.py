"""Recorder process: `python -m nep.recordings.child`.

Commands are lines of JSON on standard input, events are lines of JSON on standard output:

    {"op": "record", "path": "a.mcap", "topics": ["/camera", "/arm/*"], "left_out": [], "note": "",
     "seconds": 1800, "size_bytes": 8000000000}              limits are optional
    {"op": "note", "text": "it fell"}                        bookmark in the recording
    {"op": "stop"}
    {"op": "say", "role": "runs", "value": {...}}            event for the recording and the ring;
                                                             with "to": "ring" or "recording" for one of them
    {"op": "ring", "folder": "ring", "seconds": 60, "size_bytes": 2000000000, "topics": [], "left_out": []}
    {"op": "keep", "path": "b.mcap", "seconds": 60, "note": "it fell"}
    {"op": "end_ring"}

    {"event": "ready"}
    {"event": "recording", "path": ...}      {"event": "ended", "path": ..., "status": {...},
                                              "limit": "time", "size" or ""}
    {"event": "ring"}                        {"event": "ring_ended", "status": {...}}
    {"event": "kept", "path": ..., "message_count": ..., "duration_s": ..., "note": ...}
    {"event": "figures", "recording": {...} or null, "ring": {...} or null, "free_bytes": ...}
                                             once a second
    {"event": "problem", "op": ..., "sentence": ..., "path": ...}

A recording that stops because of an error, such as a full disk, reports the same events, with the error as
"problem" in its status. When standard input ends, the process finishes the recording and exits.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any

import orjson

from nep.errors import NepError
from nep.i18n import _
from nep.nodes.node import Node
from nep.recordings.recorder import Recorder, TopicSelection
from nep.recordings.ring import FlightRecorder, RingStatus
from nep.recordings.writer import RecordingStatus, RecordingWriter

STATS_INTERVAL_S = 1.0
_MAX_LINE_BYTES = 1_000_000
_MAX_SECONDS = 1e9
_RUN_ROLES = ("runs", "alarms")
"""Roles that the command "say" accepts. Entries of other roles are written by the recorder itself."""
_MAX_COPIES = 4
"""Maximum number of concurrent copies of the ring, each of which reads and writes at full disk speed."""
EventCallback = Callable[[Mapping[str, object]], object]


@dataclass(frozen=True)
class _ActiveRecording:
    """Current recording.

    Attributes:
        writer: Writer of the recording.
        recorder: Recorder that passes messages to the writer.
        path: File of the recording.
        stop_at: Time at which the recording stops (clock of the service); None for no limit.
        max_bytes: File size at which the recording stops; None for no limit.
    """

    writer: RecordingWriter
    recorder: Recorder
    path: str
    stop_at: float | None
    max_bytes: int | None

    def reached_limit(self, now: float) -> str:
        # "time", "size" or "".
        if self.stop_at is not None and now >= self.stop_at:
            return "time"
        is_full = self.max_bytes is not None and self.writer.status.size_bytes >= self.max_bytes
        return "size" if is_full else ""


class RecorderService:
    """Executor of the commands of another process.

    Args:
        node: Node that subscribes to the topics; stays open.
        report: Called with events, one at a time, in any thread.
        stats_interval_s: Interval between "figures" events in seconds.
        clock: Monotonic clock in seconds.
    """

    def __init__(
        self,
        node: Node,
        report: EventCallback,
        *,
        stats_interval_s: float = STATS_INTERVAL_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Start the thread that reports the state of recordings. The node stays open after `close`."""
        self._clock = clock
        self._node, self._report = node, report
        self._report_lock = threading.Lock()
        self._lock = threading.RLock()
        """Lock that is held while a recording or the ring starts or stops."""
        self._recording: _ActiveRecording | None = None
        self._ring: tuple[FlightRecorder, Recorder] | None = None
        self._copy_threads: list[threading.Thread] = []
        self._is_ending = False
        self._check_now = threading.Event()
        self._commands: Mapping[str, Callable[[Mapping[str, Any]], None]] = {
            "record": self._record,
            "stop": self._stop,
            "note": self._add_note,
            "say": self._write_entry,
            "ring": self._start_ring,
            "keep": self._save_ring,
            "end_ring": self._stop_ring,
        }
        self._stats_interval_s = stats_interval_s
        self._thread = threading.Thread(target=self._report_stats, name="recorder-figures", daemon=True)
        self._thread.start()

    def execute(self, line: bytes) -> None:
        """Execute the command in a line of JSON. Errors are reported as events, not raised."""
        try:
            command = orjson.loads(line)
        except orjson.JSONDecodeError:
            command = None
        op = command.get("op") if isinstance(command, dict) else None
        handler = self._commands.get(op) if isinstance(op, str) else None
        if handler is None or not isinstance(command, dict):
            self._report_problem(str(op), _("unknown command"))
            return
        path = command.get("path")
        with self._lock:
            self._report_errors(str(op), path if isinstance(path, str) else "", lambda: handler(command))

    def _report_errors(self, op: str, path: str, function: Callable[[], object]) -> None:
        try:
            function()
        except (NepError, OSError) as error:
            self._report_problem(op, str(error), path)
        except (TypeError, ValueError, KeyError, OverflowError) as error:
            message = _("the command is invalid: {error}").format(error=error)
            self._report_problem(op, message, path)

    def close(self) -> None:
        """Stop the recording and the ring, and finish the file. Errors are reported as events, not raised."""
        self._is_ending = True
        self._check_now.set()
        self._thread.join()
        for thread in self._copy_threads:
            thread.join()
        with self._lock:
            self._report_errors("stop", "", lambda: self._stop({}))
            self._report_errors("end_ring", "", lambda: self._stop_ring({}))

    def report(self, event: str, **content: object) -> None:
        """Send an event to the parent process. Thread-safe.

        Args:
            event: Name of the event.
            content: Further fields of the event.
        """
        with self._report_lock:
            self._report({"event": event, **content})

    def _report_problem(self, op: str, message: str, path: str = "") -> None:
        self.report("problem", op=op, sentence=message, path=path)

    def _wake_on_failure(self, _reason: str) -> None:
        # Called by a writer thread, which can't join itself.
        self._check_now.set()

    # ---- commands

    def _record(self, command: Mapping[str, Any]) -> None:
        path = _text(command, "path")
        if self._recording is not None:
            self._report_problem("record", _("a recording is already running"), path)
            return
        selection = _selection(command)
        seconds, max_bytes = command.get("seconds"), command.get("size_bytes")
        stop_at = None if seconds is None else self._clock() + _check_duration_s(seconds)
        if max_bytes is not None and (type(max_bytes) is not int or max_bytes < 1):
            raise ValueError("size_bytes")
        writer = RecordingWriter(
            path,
            note=_text(command, "note", ""),
            on_problem=self._wake_on_failure,
        )
        try:
            recorder = Recorder(self._node, writer, selection)
        except BaseException:
            writer.close()
            with suppress(OSError):  # the file is empty
                Path(path).unlink()
            raise
        self._recording = _ActiveRecording(writer, recorder, path, stop_at, max_bytes)
        self._check_now.set()  # the limit may be reached before the next figures
        self.report("recording", path=path)

    def _stop(self, _order: Mapping[str, Any], limit: str = "") -> None:
        if self._recording is None:
            return
        recording, self._recording = self._recording, None
        recording.recorder.close()
        self.report(
            "ended", path=recording.path, status=_status_to_plain(recording.writer.close()), limit=limit
        )

    def _add_note(self, command: Mapping[str, Any]) -> None:
        if self._recording is not None:
            self._recording.writer.write_entry("notes", {"text": _text(command, "text")})

    def _write_entry(self, command: Mapping[str, Any]) -> None:
        # Discarded while nothing is recorded.
        role, value, target = _text(command, "role"), command["value"], _text(command, "to", "")
        if role not in _RUN_ROLES or not isinstance(value, dict) or target not in {"", "ring", "recording"}:
            raise ValueError(role)
        if self._recording is not None and target != "ring":
            self._recording.writer.write_entry(role, value)
        if self._ring is not None and target != "recording":
            self._ring[0].write_entry(role, value)

    def _start_ring(self, command: Mapping[str, Any]) -> None:
        if self._ring is not None:
            self._report_problem("ring", _("the flight recorder is already on"))
            return
        selection = _selection(command)
        ring = FlightRecorder(
            _text(command, "folder"),
            seconds=float(command.get("seconds", 60.0)),
            size_bytes=int(command.get("size_bytes", 2_000_000_000)),
            on_problem=self._wake_on_failure,
        )
        try:
            recorder = Recorder(self._node, ring, selection)
        except BaseException:
            ring.close()
            raise
        self._ring = (ring, recorder)
        self.report("ring")

    def _save_ring(self, command: Mapping[str, Any]) -> None:
        # Copies in a thread, so that commands are still served.
        path = _text(command, "path")
        if self._ring is None:
            self._report_problem("keep", _("the flight recorder is off"), path)
            return
        self._copy_threads = [each for each in self._copy_threads if each.is_alive()]
        if len(self._copy_threads) >= _MAX_COPIES:
            self._report_problem("keep", _("the last seconds are already being saved"), path)
            return
        ring = self._ring[0]
        seconds, note = float(command.get("seconds", 60.0)), _text(command, "note", "")

        def copy() -> None:
            saved = ring.save(path, seconds, note)
            self.report(
                "kept", path=path, message_count=saved.message_count, duration_s=saved.duration_s, note=note
            )

        target = partial(self._report_errors, "keep", path, copy)
        self._copy_threads.append(threading.Thread(target=target, name="recorder-keep", daemon=True))
        self._copy_threads[-1].start()

    def _stop_ring(self, _order: Mapping[str, Any]) -> None:
        if self._ring is None:
            return
        (ring, recorder), self._ring = self._ring, None
        for thread in self._copy_threads:
            thread.join()
        recorder.close()
        ring.close()
        self.report("ring_ended", status=_status_to_plain(ring.status))

    # ---- once a second

    def _report_stats(self) -> None:
        while True:
            self._check_now.wait(self._wait_s())
            self._check_now.clear()
            if self._is_ending:
                return
            self._stop_finished()
            recording, ring = self._recording, self._ring
            if recording is not None or ring is not None:
                self.report(
                    "figures",
                    recording=None if recording is None else _status_to_plain(recording.writer.status),
                    ring=None if ring is None else _status_to_plain(ring[0].status),
                    free_bytes=None if recording is None else _free_bytes(recording.path),
                )

    def _wait_s(self) -> float:
        # Until the next figures, or the end of the recording if that is earlier.
        recording = self._recording
        if recording is None or recording.stop_at is None:
            return self._stats_interval_s
        return max(0.0, min(self._stats_interval_s, recording.stop_at - self._clock()))

    def _stop_finished(self) -> None:
        # Stops what has failed or reached its limit.
        with self._lock:
            recording = self._recording
            if recording is not None:
                limit = recording.reached_limit(self._clock())
                if limit or recording.writer.problem:
                    self._report_errors("stop", recording.path, lambda: self._stop({}, limit))
            if self._ring is not None and self._ring[0].status.problem:
                self._report_errors("end_ring", "", lambda: self._stop_ring({}))


def _free_bytes(path: str) -> int | None:
    # None if unknown.
    with suppress(OSError):
        return shutil.disk_usage(Path(path).parent).free
    return None


def _status_to_plain(status: RecordingStatus | RingStatus) -> dict[str, object]:
    return asdict(status)


def _check_duration_s(seconds: object) -> float:
    # Raises `ValueError`.
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not 0.0 < seconds < _MAX_SECONDS:
        raise ValueError(_("{given} isn't a valid duration in seconds").format(given=seconds))
    return float(seconds)


def _selection(command: Mapping[str, Any]) -> TopicSelection:
    return TopicSelection(_text_list(command, "topics"), _text_list(command, "left_out"))


def _text_list(command: Mapping[str, Any], key: str) -> tuple[str, ...]:
    value = command.get(key, [])
    if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
        raise TypeError(key)
    return tuple(value)


def _text(command: Mapping[str, Any], key: str, default: str | None = None) -> str:
    value = command.get(key, default)
    if not isinstance(value, str):
        raise TypeError(key)
    return value


def _read_lines(stream: IO[bytes]) -> Iterator[bytes]:
    # A line longer than any command is replaced by an empty one, which is not a command.
    is_inside_long_line = False
    while line := stream.readline(_MAX_LINE_BYTES):
        is_end = line.endswith(b"\n")
        if not is_inside_long_line:
            yield line if is_end or len(line) < _MAX_LINE_BYTES else b""
        is_inside_long_line = not is_end


def _stop_on_signals() -> None:
    # SIGTERM and SIGHUP end the process as Ctrl+C does, so that the recording is finished.
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)


def main(arguments: list[str] | None = None) -> None:
    """Run the recorder process: execute commands from standard input until the input ends."""
    parser = argparse.ArgumentParser(prog="nep.recordings.child")
    parser.add_argument("--master", default=None)
    parser.add_argument("--transport", default="zeromq")
    options = parser.parse_args(arguments)
    out = sys.stdout.buffer

    def write_event(event: Mapping[str, object]) -> None:
        try:
            out.write(orjson.dumps(event) + b"\n")
            out.flush()
        except OSError:  # the parent process has ended, and the input ends, too
            return

    node = Node(f"nep-recorder-{os.getpid()}", options.transport, master=options.master, wait_s=None)
    service = RecorderService(node, write_event)
    _stop_on_signals()
    service.report("ready")
    try:
        for line in _read_lines(sys.stdin.buffer):
            service.execute(line)
    except KeyboardInterrupt:
        pass
    finally:
        service.close()
        node.close()


if __name__ == "__main__":
    main()
