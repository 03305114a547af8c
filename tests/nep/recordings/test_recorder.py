"""Tests of the recorder: each selected message is recorded once, also the first one of a later topic."""

from __future__ import annotations

import io
import json
import os
import random
import signal
import subprocess
import sys
from collections.abc import Sequence
from functools import partial

import pytest

import nep
from nep.errors import BadTopicError
from nep.protocol.topic_glob import glob_matches, widened_pattern
from nep.protocol.topic_pattern import matches
from nep.recordings import child
from nep.recordings.child import RecorderService
from nep.recordings.reader import Recording
from nep.recordings.recorder import Recorder, TopicSelection
from nep.recordings.ring import FlightRecorder
from nep.recordings.writer import RecordingWriter
from tests.nep.programs import eventually as until
from tests.nep.recordings.messages import limits


class Heard:
    """Destination that stores the messages and entries of a recorder."""

    def __init__(self) -> None:
        self.messages: list[nep.Message] = []
        self.said: list[tuple[str, object]] = []

    def post(self, messages: Sequence[nep.Message]) -> None:
        self.messages.extend(messages)

    def write_entry(self, role: str, value: object) -> None:
        self.said.append((role, value))

    def of(self, topic: str) -> list[object]:
        return [each.payload["n"] for each in self.messages if each.topic == topic]


@pytest.mark.parametrize(
    ("topics", "left_out", "subscriptions", "chosen", "others"),
    [
        ((), (), ("**",), ["/a", "b", "/a/b/c"], []),
        (("/a", "/a", "/b"), (), ("/a", "/b"), ["/a", "/b"], ["/c"]),
        (("/arm*",), ("/arm2",), ("/*",), ["/arm1", "/arm"], ["/arm2", "/leg", "/arm/x"]),
        (("/a/b", "/a/*", "/**"), (), ("/**",), ["/a/b", "/x"], ["x"]),
        (("**", "*/**"), (), ("**",), ["x", "/x"], []),
        (("*/**", "**"), (), ("**/**",), ["x", "/x"], []),
        ((), ("**/camera",), ("**",), ["/x"], ["/x/camera", "camera"]),
    ],
)
def test_topic_selection_matches_selected_topics_only(topics, left_out, subscriptions, chosen, others):
    selection = TopicSelection(topics, left_out)
    assert selection.subscriptions == subscriptions
    for topic in (*chosen, *others):
        assert selection.has(topic) == (topic in chosen)
        if topic in chosen:
            assert any(matches(each, topic) for each in selection.subscriptions)
    with pytest.raises(BadTopicError):
        TopicSelection(("two words",))


@pytest.mark.parametrize("pattern", ["/a*/b", "?", "*", "*/*", "/x/*y*/**", "**/cam?", "/plain"])
def test_widened_pattern_matches_every_topic_of_the_original_pattern(pattern):
    topics = ["/a/b", "/ab/b", "q", "/x/y", "/x/ayb/c/d", "/cam1", "cams", "/r/cam2", "/plain", "/a/b/c"]
    for topic in topics:
        if glob_matches(pattern, topic):
            assert matches(widened_pattern(pattern), topic)


def test_each_message_is_recorded_once_including_the_first_of_later_topics(make):
    node, heard = make("recorder"), Heard()
    before = make("before").new_pub("/arm/joints")
    selection = TopicSelection(("/arm/*", "/arm/joints", "/cam*"), ("/arm/secret",))
    with Recorder(node, heard, selection, poll_interval_s=0.05):
        later = make("later")
        publishers = {
            topic: later.new_pub(topic) for topic in ("/camera", "/other", "/arm/secret", "/arm/leg")
        }
        for n in range(20):
            for publisher in (before, *publishers.values()):
                publisher.publish({"n": n})
        wanted = ("/arm/joints", "/camera", "/arm/leg")
        until(lambda: all(19 in heard.of(topic) for topic in wanted))
        for topic in wanted:
            got = heard.of(topic)
            assert got == sorted(set(got))
            if topic == "/arm/joints" or node._backend.has_patterns:
                assert got == list(range(20))
        assert {each.topic for each in heard.messages} == set(wanted)
    before.publish({"n": 99})
    assert 99 not in heard.of("/arm/joints")


@pytest.mark.usefixtures("patient")
def test_robot_descriptions_and_alerts_are_recorded_for_any_selection(master):
    heard = Heard()
    with (
        nep.node("recorder", master=master.address) as node,
        nep.node("robot", master=master.address) as robot,
    ):
        robot.new_pub("/pepper/description", "robot/description", latched=True).publish({"n": 1})
        robot.new_pub("/twice", "json")
        robot.new_pub("/twice", "string")  # two types on one topic are an alert
        with Recorder(node, heard, TopicSelection(("/other",)), poll_interval_s=0.05):
            until(lambda: heard.of("/pepper/description") == [1])
            until(lambda: any(role == "alerts" and "/twice" in json.dumps(each) for role, each in heard.said))
        descriptions = [each for each in heard.messages if each.topic == "/pepper/description"]
        assert [(each.msg_type, each.is_latched) for each in descriptions] == [("robot/description", True)]
        assert {each.topic for each in heard.messages} == {"/pepper/description"}


@pytest.mark.usefixtures("patient")
def test_recorded_messages_equal_received_messages_byte_for_byte(master, tmp_path):
    path = tmp_path / "a.mcap"
    with (
        nep.node("recorder", master=master.address) as node,
        nep.node("robot", master=master.address) as robot,
    ):
        live: list[nep.Message] = []
        subscriber = node.new_sub("**", sink=live.extend)
        with RecordingWriter(path, limits=limits()) as writer, Recorder(node, writer):
            publishers = [
                robot.new_pub(f"/{kind}", kind) for kind in ("json", "string", "bytes", "msgpack", "image")
            ]
            import numpy as np

            frame = np.arange(27, dtype=np.uint8).reshape(3, 3, 3)
            for n in range(10):
                for publisher, payload in zip(
                    publishers, ({"n": n}, f"ñ{n}", b"\0" * n, {"b": b"\1", "n": n}, frame), strict=True
                ):
                    publisher.publish(payload)
            until(lambda: len(live) >= 50 and writer.flush() and writer.status.message_count >= 50)
        subscriber.close()

    def all_of(each: nep.Message) -> tuple[object, ...]:
        return (
            each.topic, bytes(each.data), each.codec, each.msg_type, each.seq, each.stamp_ns, each.publisher,
            each.is_latched, repr(dict(each.extension)),
        )  # fmt: skip

    with Recording(path) as recording:
        found = sorted(all_of(each.message) for each in recording.read())
        figures = recording.stats()
    assert found == sorted(all_of(each) for each in live)
    assert {(each.received, each.lost, each.late) for each in figures.values()} == {(10, 0, 0)}


@pytest.mark.usefixtures("patient")
def test_recorder_service_records_and_keeps_on_command_and_rejects_malformed_commands(master, tmp_path):
    events: list[dict[str, object]] = []

    def seen(kind: str) -> list[dict[str, object]]:
        return [each for each in events if each["event"] == kind]

    def order(**content: object) -> None:
        service.execute(json.dumps(content).encode())

    with (
        nep.node("recorder", master=master.address) as node,
        nep.node("robot", master=master.address) as robot,
    ):
        service = RecorderService(node, lambda event: events.append(dict(event)), stats_interval_s=0.01)
        publisher = robot.new_pub("/a")
        order(op="ring", folder=str(tmp_path / "ring"), seconds=60)
        order(op="record", path=str(tmp_path / "a.mcap"), note="first", topics=["/a"])
        order(op="record", path=str(tmp_path / "b.mcap"))
        for n in range(5):
            publisher.publish({"n": n})
        until(lambda: any((each["recording"] or {}).get("message_count") == 5 for each in seen("figures")))
        until(lambda: service._ring[0]._writer.status.message_count >= 5)
        order(op="note", text="it fell")
        order(op="say", role="runs", value={"id": "1", "name": "Greeting"})
        order(op="say", role="alarms", value={"id": "2"}, to="ring")
        order(op="keep", path=str(tmp_path / "kept.mcap"), seconds=60, note="the fall")
        until(lambda: seen("kept"))
        order(op="stop")
        for wrong in (
            b"",
            b"[]",
            b'{"op":7}',
            b'{"op":"none"}',
            b'{"op":"record"}',
            b'{"op":"keep"}',
            b'{"op":"say","role":"figures","value":{}}',
            b'{"op":"say","role":"runs","value":3}',
            b"\xff",
        ):
            service.execute(wrong)
        order(op="record", path=str(tmp_path / "nowhere" / "a.mcap"))
        order(op="record", path=str(tmp_path / "c.mcap"), topics=["two words"])
        service.close()
    assert [each["op"] for each in seen("problem")][:1] == ["record"]
    assert len(seen("problem")) == 12
    (ended,) = seen("ended")
    assert ended["status"]["message_count"] == 5
    with Recording(tmp_path / "a.mcap") as recording:
        assert [each.message.payload for each in recording.read()] == [{"n": n} for n in range(5)]
        assert recording.recorder_metadata["note"] == "first"
        assert [value for _at, value in recording.entries("notes")] == [{"text": "it fell"}]
        assert [value for _at, value in recording.entries("runs")] == [{"id": "1", "name": "Greeting"}]
        assert list(recording.entries("alarms")) == []
    with Recording(tmp_path / "kept.mcap") as recording:
        assert [value for _at, value in recording.entries("alarms")] == [{"id": "2"}]
        assert [value for _at, value in recording.entries("runs")] == [{"id": "1", "name": "Greeting"}]
        assert (recording.topics["/a"].message_count, recording.recorder_metadata["note"]) == (5, "the fall")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.mcap", "kept.mcap", "ring"]
    assert not list((tmp_path / "ring").iterdir())


@pytest.mark.parametrize(("limit", "ends"), [("time", {"seconds": 5}), ("size", {"size_bytes": 1000})])
@pytest.mark.usefixtures("patient")
def test_recording_stops_at_its_duration_or_size_limit(master, tmp_path, limit, ends):
    events: list[dict[str, object]] = []
    now = [100.0]
    with (
        nep.node("recorder", master=master.address) as node,
        nep.node("robot", master=master.address) as robot,
    ):
        service = RecorderService(
            node, lambda event: events.append(dict(event)), stats_interval_s=0.01, clock=lambda: now[0]
        )
        publisher = robot.new_pub("/a")
        for wrong in ({"seconds": 0}, {"seconds": "x"}, {"seconds": float("inf")}, {"size_bytes": 0}):
            path = tmp_path / "none.mcap"
            service.execute(json.dumps({"op": "record", "path": str(path), **wrong}).encode())
            assert not path.exists()
        assert [each["event"] for each in events] == ["problem"] * 4
        service.execute(json.dumps({"op": "record", "path": str(tmp_path / "a.mcap"), **ends}).encode())
        publisher.publish({"n": random.Random(1).randbytes(2000).hex()})

        def written() -> int:
            told = [each["recording"] for each in events if each["event"] == "figures" and each["recording"]]
            return told[-1]["message_count"] if told else 0

        def is_over() -> bool:
            return any(each["event"] == "ended" for each in events)

        if limit == "time":
            until(lambda: written() == 1)
            assert not is_over()
            now[0] += 5.0
        until(is_over)
        service.close()
    (ended,) = [each for each in events if each["event"] == "ended"]
    assert (ended["limit"], ended["status"]["problem"]) == (limit, "")
    with Recording(tmp_path / "a.mcap") as recording:
        assert recording.is_complete
        assert recording.message_count == 1


@pytest.mark.skipif(os.name == "nt", reason="Windows removes no file that is open")
def test_recording_that_ends_unexpectedly_is_reported_and_another_recording_can_start(
    master, tmp_path, monkeypatch
):
    events: list[dict[str, object]] = []

    def seen(kind: str) -> list[dict[str, object]]:
        return [each for each in events if each["event"] == kind]

    def order(**content: object) -> None:
        service.execute(json.dumps(content).encode())

    soon = limits(stats_interval_s=0.001)
    monkeypatch.setattr(child, "RecordingWriter", partial(RecordingWriter, limits=soon))
    full = limits(stats_interval_s=0.001, min_free_bytes=2**62)
    monkeypatch.setattr(child, "FlightRecorder", partial(FlightRecorder, limits=full))
    path = tmp_path / "a.mcap"
    with nep.node("recorder", master=master.address) as node:
        service = RecorderService(node, lambda event: events.append(dict(event)), stats_interval_s=1000.0)
        order(op="record", path=str(path))
        path.unlink()
        until(lambda: seen("ended"))
        assert "moved or deleted" in seen("ended")[0]["status"]["problem"]
        order(op="ring", folder=str(tmp_path / "ring"))
        until(lambda: seen("ring_ended"))
        assert seen("ring_ended")[0]["status"]["problem"] == "the disk is full"
        order(op="keep", path=str(tmp_path / "b.mcap"))
        order(op="record", path=str(path))
        order(op="stop")
        assert [each["status"]["problem"] for each in seen("ended")][1:] == [""]
        service.close()
    assert [(each["op"], each["path"]) for each in seen("problem")] == [("keep", str(tmp_path / "b.mcap"))]


def test_too_long_input_line_is_discarded(monkeypatch):
    monkeypatch.setattr(child, "_MAX_LINE_BYTES", 10)
    lines = child._read_lines(io.BytesIO(b'{"a":1}\n' + b"x" * 25 + b'{"op":1}\n\n{"b":2}'))
    assert list(lines) == [b'{"a":1}\n', b"", b"\n", b'{"b":2}']


@pytest.mark.parametrize(
    "is_told", [False, pytest.param(True, marks=pytest.mark.skipif(os.name == "nt", reason="needs POSIX"))]
)
def test_recorder_process_finishes_on_end_of_input_or_termination_signal(master, tmp_path, is_told):
    path = tmp_path / "a.mcap"
    child = subprocess.Popen(
        [sys.executable, "-m", "nep.recordings.child", "--master", master.address],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    with child, nep.node("robot", master=master.address) as robot:
        publisher = robot.new_pub("/a")
        assert json.loads(child.stdout.readline()) == {"event": "ready"}
        child.stdin.write(json.dumps({"op": "record", "path": str(path)}).encode() + b"\n")
        child.stdin.flush()
        assert json.loads(child.stdout.readline())["event"] == "recording"
        until(lambda: publisher.subscribers)
        for n in range(100):
            publisher.publish({"n": n})
        while True:
            event = json.loads(child.stdout.readline())
            if (
                event["event"] == "figures"
                and event["recording"]["topics"].get("/a", {}).get("received") == 100
            ):
                break
        if is_told:
            child.send_signal(signal.SIGTERM)
            out = child.stdout.read()
        else:
            out, _err = child.communicate()
    events = [json.loads(line) for line in out.splitlines()]
    assert events[-1]["event"] == "ended"
    with Recording(path) as recording:
        assert recording.is_complete
        assert [each.message.payload["n"] for each in recording.read(topics=("/a",))] == list(range(100))
