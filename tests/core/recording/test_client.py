"""Tests of the client of the recorder process: commands, statistics and alerts."""

from __future__ import annotations

import queue
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

import nep
from app.core.alerts.alerts import Alerts
from app.core.recording import client as client_module
from app.core.recording.client import RecorderClient, RecorderEvent, RecorderExited, RingChoice
from nep.recordings.reader import Recording
from tests.nep.programs import eventually


class OrdersOnly:
    """Fake recorder process that stores commands and doesn't execute them."""

    def __init__(self) -> None:
        self.orders: list[Mapping[str, object]] = []
        self.is_full = False
        self.is_closed = False

    def send_command(self, content: Mapping[str, object]) -> bool:
        self.orders.append(content)
        return not self.is_full

    def close(self, wait_s: float) -> None:
        self.is_closed = True


class DrivenRecorder:
    """Recorder client with fake processes, whose events a test posts."""

    def __init__(self) -> None:
        self.alerts, self.lines, self.now = Alerts(), list[OrdersOnly](), 100.0
        self.client = RecorderClient("here:1", self.alerts, print, start=self._start, clock=lambda: self.now)

    def _start(self, number: int, address: str, _post: Callable[[object], object]) -> OrdersOnly:
        assert (number, address) == (len(self.lines) + 1, "here:1")
        self.lines.append(OrdersOnly())
        return self.lines[-1]

    def say(self, event: str, **content: object) -> None:
        self.client.on_event(RecorderEvent(len(self.lines), {"event": event, **content}))

    def end(self, detail: str = "") -> None:
        self.client.on_event(RecorderExited(len(self.lines), detail))

    def told(self) -> dict[str, tuple[str, str]]:
        return {each.id: (each.severity, each.title) for each in self.alerts.active}


def status(**more: object) -> dict[str, object]:
    figures = {"received": 5, "lost": 2, "late": 0, "undecodable": 0, "unkept": 1, "size_bytes": 9}
    topics = {"/a": figures, "/broken": {"received": "x"}}
    plain = {"message_count": 4, "size_bytes": 900, "duration_s": 1.5, "unkept": 0, "problem": ""}
    return {**plain, "topics": topics, **more}


@pytest.fixture
def made() -> DrivenRecorder:
    return DrivenRecorder()


def test_recorder_process_is_not_started_without_a_recording_or_flight_recorder(made):
    made.client.stop()
    made.client.add_bookmark("x")
    made.client.check()
    assert not made.client.save_last(Path("a.mcap"), 60.0)
    made.client.close()
    assert not made.lines


def test_recording_starts_reports_stats_and_ends(made):
    client = made.client
    assert client.record(Path("a.mcap"), ("/a",), ("/b",), "first")
    assert not client.record(Path("b.mcap"))
    assert made.lines[0].orders == [
        {"op": "record", "path": "a.mcap", "topics": ["/a"], "left_out": ["/b"], "note": "first"}
    ]
    assert client.state.phase == "starting"
    made.say("ready")
    made.say("recording", path="a.mcap")
    assert client.state.phase == "recording"
    client.add_bookmark("it fell")
    made.say("figures", recording=status(), ring=None, free_bytes=5_000_000_000)
    state = client.state
    assert (state.message_count, state.size_bytes, state.duration_s, state.lost) == (4, 900, 1.5, 2)
    assert list(state.topics) == ["/a"]
    assert not made.told()
    before = client.revision
    made.say("figures", recording=status(), ring=None, free_bytes=5_000_000_000)
    assert client.revision == before
    client.stop()
    client.stop()
    assert [each["op"] for each in made.lines[0].orders] == ["record", "note", "stop"]
    made.say("ended", path="a.mcap", status=status(message_count=7))
    assert (client.state.phase, client.state.message_count, client.state.last_path) == ("", 7, Path("a.mcap"))
    assert not made.told()
    client.close()
    assert made.lines[0].is_closed


def test_events_are_sent_only_while_a_recording_or_the_flight_recorder_runs(made):
    client = made.client
    client.add_event("runs", {"id": "1"})
    assert not made.lines
    client.record(Path("a.mcap"))
    client.add_event("runs", {"id": "2"})
    made.say("ended", path="a.mcap", status=status())
    client.add_event("runs", {"id": "3"})
    client.set_ring(RingChoice(Path("ring")))
    client.add_event("runs", {"id": "3"}, "recording")
    made.lines[0].is_full = True  # the event is sent again after a second, so this is no error
    client.add_event("alarms", {"id": "4"})
    said = [(each["role"], each["value"]) for each in made.lines[0].orders if each["op"] == "say"]
    assert said == [("runs", {"id": "2"}), ("alarms", {"id": "4"})]
    assert not made.told()


def test_disk_alerts_appear_and_are_resolved(made):
    made.client.record(Path("a.mcap"))
    made.say("recording")
    for _each in range(3):
        made.say("figures", recording=status(unkept=3), ring=None, free_bytes=900_000_000)
    assert made.told() == {
        "recorder:low": ("warn", "The disk is nearly full."),
        "recorder:unkept": ("warn", "3 messages weren't recorded: the disk is too slow."),
    }
    made.say("figures", recording=status(unkept=3), ring=None, free_bytes=2_000_000_000)
    assert "recorder:low" not in made.told()
    made.say(
        "ended", path="a.mcap", status=status(problem="the disk is full; everything recorded before is saved")
    )
    assert made.told()["recorder:ended"] == (
        "error",
        "The recording stopped: the disk is full; everything recorded before is saved.",
    )
    assert made.client.state.phase == ""
    made.client.record(Path("b.mcap"))
    assert not made.told()
    made.say("problem", op="record", sentence="no such folder", path="b.mcap")
    assert made.told()["recorder:ended"][1] == "Nothing is being recorded."
    assert made.client.record(Path("c.mcap"))


def test_dead_recorder_is_reported_and_replaced(made):
    made.client.record(Path("a.mcap"))
    made.say("recording")
    made.end("killed")
    assert made.client.state.phase == ""
    assert made.alerts.active[0].detail == "killed"
    assert "Everything up to a second before that is saved" in made.told()["recorder:ended"][1]
    assert made.client.record(Path("b.mcap"))
    made.client.on_event(RecorderEvent(1, {"event": "ended", "status": status()}))  # of the first process
    assert (len(made.lines), made.client.state.phase) == (2, "starting")


def test_flight_recorder_saves_last_seconds_and_is_restarted(made):
    client, choice = made.client, RingChoice(Path("ring"), 60.0, 10**9, ("/a",))
    client.set_ring(choice)
    client.set_ring(choice)
    assert [each["op"] for each in made.lines[0].orders] == ["ring"]
    made.say("ring")
    made.say("figures", recording=None, ring={"seconds": 41.0, "size_bytes": 7}, free_bytes=None)
    assert (client.state.ring_s, client.state.ring_bytes) == (41.0, 7)
    assert client.save_last(Path("a.mcap"), 60.0, "it fell")
    assert client.save_last(Path("b.mcap"), 60.0)
    made.say("kept", path="a.mcap")
    made.say("problem", op="keep", path="b.mcap", sentence="the disk is full")
    assert (client.state.pending_saves, client.state.last_path) == ((), Path("a.mcap"))
    assert "recorder:keep" in made.told()
    waits = []
    for _each in range(6):
        made.end("gone")
        assert client.state.ring_s is None
        assert "recorder:ring" in made.told()
        started = made.now
        while client._process is None:
            made.now += 1.0
            client.check()
        waits.append(made.now - started)
    assert waits == [2.0, 4.0, 8.0, 16.0, 30.0, 30.0]
    made.say("ring")
    assert "recorder:ring" not in made.told()
    made.say("ring_ended", status={"problem": "the disk is full"})
    assert client.state.ring_s is None
    client.check()
    assert len(made.lines) == 7
    client.set_ring(choice)
    client.set_ring(None)
    assert [each["op"] for each in made.lines[-1].orders][-2:] == ["ring", "end_ring"]
    made.say("ring_ended", status={"problem": ""})
    assert not client.save_last(Path("c.mcap"), 60.0)


def test_unresponsive_recorder_is_reported_and_invalid_events_are_ignored(made):
    made.client.set_ring(RingChoice(Path("ring")))
    made.lines[0].is_full = True
    assert made.client.record(Path("a.mcap"))
    assert made.client.state.phase == ""
    assert "recorder:ended" in made.told()
    for event in ("ready", "recording", "figures", "ended", "ring", "ring_ended", "kept", "problem", "x"):
        for value in (None, 5, "x", [], {}, -1, 2**70, {"problem": 7, "topics": [], "duration_s": "x"}):
            made.say(event, recording=value, ring=value, status=value, path=value, op=value, free_bytes=value)
    made.client.on_event(RecorderEvent(1, {}))


def test_real_recorder_process_records_saves_and_finishes(master, tmp_path):
    events: queue.SimpleQueue[object] = queue.SimpleQueue()
    client = RecorderClient(master.address, Alerts(), events.put)

    def until(is_met: Callable[[], bool]) -> None:
        def look() -> bool:
            while not events.empty():
                client.on_event(events.get())
            return is_met()

        eventually(look)

    with nep.node("robot", master=master.address) as robot:
        publisher = robot.new_pub("/a")
        client.set_ring(RingChoice(tmp_path / "ring"))
        assert client.record(tmp_path / "a.mcap", ("/a",), note="first")
        until(lambda: client.state.phase == "recording" and client.state.ring_s is not None)
        until(lambda: publisher.subscribers > 0)
        for n in range(20):
            publisher.publish({"n": n})
        until(lambda: client.state.topics.get("/a") is not None and client.state.topics["/a"].received == 20)
        assert client.save_last(tmp_path / "kept.mcap", 60.0, "it fell")
        until(lambda: not client.state.pending_saves)
        client.close(30.0)  # as when Studio exits: the recording is finished
    assert not [each.title for each in client._alerts.active]
    with Recording(tmp_path / "a.mcap") as recording, Recording(tmp_path / "kept.mcap") as kept:
        assert recording.is_complete
        assert [each.message.payload["n"] for each in recording.read()] == list(range(20))
        assert (kept.recorder_metadata["note"], kept.topics["/a"].message_count) == ("it fell", 20)


def test_recorder_start_failure_is_reported(monkeypatch):
    events: queue.SimpleQueue[object] = queue.SimpleQueue()
    monkeypatch.setattr(client_module, "module_command", lambda _module: ["/nothing/of/the/kind"])
    client = RecorderClient("127.0.0.1:1", Alerts(), events.put)
    client.record(Path("a.mcap"))
    gone = events.get(timeout=30.0)
    assert isinstance(gone, RecorderExited)
    client.on_event(gone)
    assert client.state.phase == ""
    assert client._alerts.has("recorder:ended")
