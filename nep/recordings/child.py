"""A recorder in a process of its own: `python -m nep.recordings.child`.

Orders come as lines of JSON on the standard input, and what happens is told as lines on the standard output:

    {"op": "record", "path": "a.mcap", "topics": ["/camera", "/arm/*"], "left_out": [], "note": ""}
    {"op": "note", "text": "it fell"}                        a bookmark in the recording
    {"op": "stop"}
    {"op": "ring", "folder": "ring", "seconds": 60, "size_bytes": 2000000000, "topics": [], "left_out": []}
    {"op": "keep", "path": "b.mcap", "seconds": 60, "note": "it fell"}
    {"op": "end_ring"}

    {"event": "ready"}
    {"event": "recording", "path": ...}      {"event": "ended", "path": ..., "status": {...}}
    {"event": "ring"}                        {"event": "ring_ended", "status": {...}}
    {"event": "kept", "path": ..., "message_count": ..., "duration_s": ..., "note": ...}
    {"event": "figures", "recording": {...} or null, "ring": {...} or null, "free_bytes": ...}
                                             once a second
    {"event": "problem", "op": ..., "sentence": ..., "path": ...}

What ends by itself, such as on a full disk, is told in the same way: its status has the "problem". When its
input ends, so does it: what was recorded is finished first.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
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

__all__ = ["RecorderService", "main"]

FIGURES_S = 1.0
_LONGEST_LINE = 1_000_000
_MOST_KEEPING = 4
"""Copies of the ring that are made at the same time: each reads and writes as fast as the disk can."""
Tell = Callable[[Mapping[str, object]], object]


class RecorderService:
    """Carries out orders; `tell` is given what happens, from any thread, one at a time."""

    def __init__(self, node: Node, tell: Tell, *, figures_s: float = FIGURES_S) -> None:
        """The node stays the caller's."""
        self._node, self._tell_one = node, tell
        self._tell_lock = threading.Lock()
        self._lock = threading.RLock()
        """Held while something begins or ends."""
        self._recording: tuple[RecordingWriter, Recorder, str] | None = None
        self._ring: tuple[FlightRecorder, Recorder] | None = None
        self._keeping: list[threading.Thread] = []
        self._is_ending = False
        self._look_now = threading.Event()
        self._orders: Mapping[str, Callable[[Mapping[str, Any]], None]] = {
            "record": self._record,
            "stop": self._stop,
            "note": self._note,
            "ring": self._begin_ring,
            "keep": self._keep,
            "end_ring": self._end_ring,
        }
        self._figures_s = figures_s
        self._thread = threading.Thread(target=self._tell_figures, name="recorder-figures", daemon=True)
        self._thread.start()

    def order(self, line: bytes) -> None:
        """Carry out one line. What goes wrong is told, never raised."""
        try:
            order = orjson.loads(line)
        except orjson.JSONDecodeError:
            order = None
        op = order.get("op") if isinstance(order, dict) else None
        carry_out = self._orders.get(op) if isinstance(op, str) else None
        if carry_out is None or not isinstance(order, dict):
            self._problem(str(op), _("that is no order"))
            return
        path = order.get("path")
        with self._lock:
            self._guarded(str(op), path if isinstance(path, str) else "", lambda: carry_out(order))

    def _guarded(self, op: str, path: str, work: Callable[[], object]) -> None:
        try:
            work()
        except (NepError, OSError) as error:
            self._problem(op, str(error), path)
        except (TypeError, ValueError, KeyError, OverflowError) as error:
            words = _("the order cannot be understood: {error}").format(error=error)
            self._problem(op, words, path)

    def close(self) -> None:
        """End all of it, and finish what was recorded. What goes wrong is told, never raised."""
        self._is_ending = True
        self._look_now.set()
        self._thread.join()
        for thread in self._keeping:
            thread.join()
        with self._lock:
            self._guarded("stop", "", lambda: self._stop({}))
            self._guarded("end_ring", "", lambda: self._end_ring({}))

    def tell(self, event: str, **content: object) -> None:
        """Tell what happens."""
        with self._tell_lock:
            self._tell_one({"event": event, **content})

    def _problem(self, op: str, sentence: str, path: str = "") -> None:
        self.tell("problem", op=op, sentence=sentence, path=path)

    def _has_failed(self, _reason: str) -> None:
        """Told by a thread that writes, which cannot wait for its own end."""
        self._look_now.set()

    # ---- orders

    def _record(self, order: Mapping[str, Any]) -> None:
        path = _text(order, "path")
        if self._recording is not None:
            self._problem("record", _("a recording is being made already"), path)
            return
        selection = _selection(order)
        writer = RecordingWriter(
            path,
            note=_text(order, "note", ""),
            on_problem=self._has_failed,
        )
        try:
            recorder = Recorder(self._node, writer, selection)
        except BaseException:
            writer.close()
            with suppress(OSError):  # it has nothing
                Path(path).unlink()
            raise
        self._recording = (writer, recorder, path)
        self.tell("recording", path=path)

    def _stop(self, _order: Mapping[str, Any]) -> None:
        if self._recording is None:
            return
        (writer, recorder, path), self._recording = self._recording, None
        recorder.close()
        self.tell("ended", path=path, status=_plain(writer.close()))

    def _note(self, order: Mapping[str, Any]) -> None:
        if self._recording is not None:
            self._recording[0].say("notes", {"text": _text(order, "text")})

    def _begin_ring(self, order: Mapping[str, Any]) -> None:
        if self._ring is not None:
            self._problem("ring", _("the flight recorder is on already"))
            return
        selection = _selection(order)
        ring = FlightRecorder(
            _text(order, "folder"),
            seconds=float(order.get("seconds", 60.0)),
            size_bytes=int(order.get("size_bytes", 2_000_000_000)),
            on_problem=self._has_failed,
        )
        try:
            recorder = Recorder(self._node, ring, selection)
        except BaseException:
            ring.close()
            raise
        self._ring = (ring, recorder)
        self.tell("ring")

    def _keep(self, order: Mapping[str, Any]) -> None:
        """In a thread of its own: orders go on meanwhile."""
        path = _text(order, "path")
        if self._ring is None:
            self._problem("keep", _("the flight recorder is off"), path)
            return
        self._keeping = [each for each in self._keeping if each.is_alive()]
        if len(self._keeping) >= _MOST_KEEPING:
            self._problem("keep", _("the last seconds are being kept already"), path)
            return
        ring = self._ring[0]
        seconds, note = float(order.get("seconds", 60.0)), _text(order, "note", "")

        def copy() -> None:
            kept = ring.keep(path, seconds, note)
            self.tell(
                "kept", path=path, message_count=kept.message_count, duration_s=kept.duration_s, note=note
            )

        work = partial(self._guarded, "keep", path, copy)
        self._keeping.append(threading.Thread(target=work, name="recorder-keep", daemon=True))
        self._keeping[-1].start()

    def _end_ring(self, _order: Mapping[str, Any]) -> None:
        if self._ring is None:
            return
        (ring, recorder), self._ring = self._ring, None
        for thread in self._keeping:
            thread.join()
        recorder.close()
        ring.close()
        self.tell("ring_ended", status=_plain(ring.status))

    # ---- once a second

    def _tell_figures(self) -> None:
        while True:
            self._look_now.wait(self._figures_s)
            self._look_now.clear()
            if self._is_ending:
                return
            self._end_what_failed()
            recording, ring = self._recording, self._ring
            if recording is not None or ring is not None:
                self.tell(
                    "figures",
                    recording=None if recording is None else _plain(recording[0].status),
                    ring=None if ring is None else _plain(ring[0].status),
                    free_bytes=None if recording is None else _free_bytes(recording[2]),
                )

    def _end_what_failed(self) -> None:
        with self._lock:
            if self._recording is not None and self._recording[0].problem:
                self._guarded("stop", self._recording[2], lambda: self._stop({}))
            if self._ring is not None and self._ring[0].status.problem:
                self._guarded("end_ring", "", lambda: self._end_ring({}))


def _free_bytes(path: str) -> int | None:
    """What is free on the disk of a file; None when that does not tell."""
    with suppress(OSError):
        return shutil.disk_usage(Path(path).parent).free
    return None


def _plain(status: RecordingStatus | RingStatus) -> dict[str, object]:
    return asdict(status)


def _selection(order: Mapping[str, Any]) -> TopicSelection:
    return TopicSelection(_texts(order, "topics"), _texts(order, "left_out"))


def _texts(order: Mapping[str, Any], key: str) -> tuple[str, ...]:
    given = order.get(key, [])
    if not isinstance(given, list) or not all(isinstance(each, str) for each in given):
        raise TypeError(key)
    return tuple(given)


def _text(order: Mapping[str, Any], key: str, default: str | None = None) -> str:
    given = order.get(key, default)
    if not isinstance(given, str):
        raise TypeError(key)
    return given


def _lines(stream: IO[bytes]) -> Iterator[bytes]:
    """Lines; one that is longer than an order can be comes as an empty one, which is none."""
    is_inside = False
    while line := stream.readline(_LONGEST_LINE):
        is_end = line.endswith(b"\n")
        if not is_inside:
            yield line if is_end or len(line) < _LONGEST_LINE else b""
        is_inside = not is_end


def main(arguments: list[str] | None = None) -> None:
    """Carry out what comes on the standard input until it ends."""
    parser = argparse.ArgumentParser(prog="nep.recordings.child")
    parser.add_argument("--master", default=None)
    parser.add_argument("--transport", default="zeromq")
    given = parser.parse_args(arguments)
    out = sys.stdout.buffer

    def tell(event: Mapping[str, object]) -> None:
        try:
            out.write(orjson.dumps(event) + b"\n")
            out.flush()
        except OSError:  # nobody listens any more: the input ends, too
            return

    node = Node(f"nep-recorder-{os.getpid()}", given.transport, master=given.master, wait_s=None)
    service = RecorderService(node, tell)
    service.tell("ready")
    try:
        for line in _lines(sys.stdin.buffer):
            service.order(line)
    except KeyboardInterrupt:
        pass
    finally:
        service.close()
        node.close()


if __name__ == "__main__":
    main()
