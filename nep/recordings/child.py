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
    {"event": "ring"}                        {"event": "kept", "path": ..., "message_count": ..., ...}
    {"event": "figures", "recording": {...} or null, "ring": {...} or null}     once a second
    {"event": "problem", "op": ..., "sentence": ...}

When its input ends, so does it: what was recorded is finished first.
"""

from __future__ import annotations

import argparse
import os
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import IO, Any

import orjson

from nep.errors import NepError
from nep.i18n import _
from nep.nodes.node import Node
from nep.recordings.recorder import Recorder, TopicSelection
from nep.recordings.ring import FlightRecorder, KeptRecording
from nep.recordings.writer import RecordingStatus, RecordingWriter

__all__ = ["RecorderService", "main"]

FIGURES_S = 1.0
_LONGEST_LINE = 1_000_000
Tell = Callable[[Mapping[str, object]], object]


class RecorderService:
    """Carries out orders; `tell` is given what happens, from any thread, one at a time."""

    def __init__(self, node: Node, tell: Tell, *, figures_s: float = FIGURES_S) -> None:
        """The node stays the caller's."""
        self._node, self._tell_one = node, tell
        self._lock = threading.Lock()
        self._recording: tuple[RecordingWriter, Recorder, str] | None = None
        self._ring: tuple[FlightRecorder, Recorder] | None = None
        self._keeping: list[threading.Thread] = []
        self._end = threading.Event()
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
        try:
            carry_out(order)
        except (NepError, OSError) as error:
            self._problem(str(op), str(error))
        except (TypeError, ValueError, KeyError) as error:
            self._problem(str(op), _("the order cannot be understood: {error}").format(error=error))

    def close(self) -> None:
        """End all of it, and finish what was recorded."""
        self._end.set()
        self._thread.join()
        for thread in self._keeping:
            thread.join()
        self._stop({})
        self._end_ring({})

    def tell(self, event: str, **content: object) -> None:
        """Tell what happens."""
        with self._lock:
            self._tell_one({"event": event, **content})

    def _problem(self, op: str, sentence: str) -> None:
        self.tell("problem", op=op, sentence=sentence)

    # ---- orders

    def _record(self, order: Mapping[str, Any]) -> None:
        if self._recording is not None:
            self._problem("record", _("a recording is being made already"))
            return
        selection = _selection(order)
        path = _text(order, "path")
        writer = RecordingWriter(
            path,
            note=_text(order, "note", ""),
            on_problem=lambda sentence: self._problem("record", sentence),
        )
        try:
            recorder = Recorder(self._node, writer, selection)
        except BaseException:
            writer.close()
            os.unlink(path)  # noqa: PTH108 - it has nothing
            raise
        self._recording = (writer, recorder, path)
        self.tell("recording", path=path)

    def _stop(self, _order: Mapping[str, Any]) -> None:
        if self._recording is None:
            return
        writer, recorder, path = self._recording
        recorder.close()
        status = writer.close()
        self._recording = None
        self.tell("ended", path=path, status=_plain(status))

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
            on_problem=lambda sentence: self._problem("ring", sentence),
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
        if self._ring is None:
            self._problem("keep", _("the flight recorder is off"))
            return
        ring, path = self._ring[0], _text(order, "path")
        seconds, note = float(order.get("seconds", 60.0)), _text(order, "note", "")

        def copy() -> None:
            try:
                kept: KeptRecording = ring.keep(path, seconds, note)
            except NepError as error:
                self._problem("keep", str(error))
            else:
                self.tell(
                    "kept", path=path, message_count=kept.message_count, duration_s=kept.duration_s, note=note
                )

        self._keeping = [each for each in self._keeping if each.is_alive()]
        self._keeping.append(threading.Thread(target=copy, name="recorder-keep", daemon=True))
        self._keeping[-1].start()

    def _end_ring(self, _order: Mapping[str, Any]) -> None:
        if self._ring is None:
            return
        ring, recorder = self._ring
        for thread in self._keeping:
            thread.join()
        recorder.close()
        ring.close()
        self._ring = None

    # ---- once a second

    def _tell_figures(self) -> None:
        while not self._end.wait(self._figures_s):
            recording, ring = self._recording, self._ring
            if recording is not None or ring is not None:
                self.tell(
                    "figures",
                    recording=None if recording is None else _plain(recording[0].status),
                    ring=None if ring is None else asdict(ring[0].status),
                )


def _plain(status: RecordingStatus) -> dict[str, object]:
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


def _lines(stream: IO[bytes]) -> Any:  # noqa: ANN401 - an iterator of bytes
    """Lines, none longer than an order can be: of a longer one nothing is taken."""
    while line := stream.readline(_LONGEST_LINE):
        yield line


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
