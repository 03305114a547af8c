"""Tests that commands, alarms, bridges, recorders and servers survive hostile messages."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import nep
from nep.cli.graph import log as log_command
from nep.messages.message import Message
from nep.nodes.log_handler import LAST_ERRORS_TOPIC, LAST_ERRORS_TYPE, LOG_TOPIC, LOG_TYPE, LogRecord
from nep.patterns.parameters.node_parameters import parameters_topic
from nep.programs.alarms.rule import NUMBER_KINDS, VALUE_KINDS
from nep.programs.blackboard.server import BlackboardServer
from nep.programs.bridges.trail import TRAIL_KEY
from nep.recordings.export import export
from nep.recordings.reader import Recording
from nep.recordings.recorder import Recorder, TopicSelection
from nep.recordings.writer import RecordingWriter
from tests import hostile
from tests.nep.alarms.scene import Scene, rule
from tests.nep.bridges.joined import bridged, nets, route, settled, topic
from tests.nep.cli.conftest import type_in
from tests.nep.programs import eventually
from tests.nep.recordings.messages import limits

__all__ = ["type_in"]

RECORD: hostile.Message = {
    "level": "error", "text": "x", "name": "n", "node": "m", "stamp_ns": 5, "file": "f", "line": 3, "pid": 7,
}  # fmt: skip
POSE: hostile.Message = {"pose": {"x": 1.0, "joints": [1, 2]}, "name": "a"}
PAYLOADS = tuple(hostile.payloads(POSE, share=3))
SMALL = tuple(each for each in PAYLOADS if len(each) < 1_000_000)
"""Payloads without the 5 MB texts, which take seconds to format."""


@contextmanager
def publishing(master: str, topic: str, msg_type: str, payloads: tuple[bytes, ...]) -> Iterator[None]:
    """Publish the payloads in a thread as soon as the topic has a subscriber."""
    with nep.node("evil", master=master) as node:
        publisher, ended = node.new_pub(topic, msg_type), threading.Event()

        def publish() -> None:
            eventually(lambda: publisher.subscribers > 0 or ended.is_set())
            for payload in payloads:
                publisher.publish_bytes(payload)

        thread = threading.Thread(target=publish)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()


@pytest.mark.parametrize("words", [(), ("--json",), ("pose.x", "pose.joints[0]", "name", "--csv")], ids=str)
def test_echo_shows_every_hostile_message(master, type_in, words):
    payloads = PAYLOADS if words == ("--json",) else SMALL
    with publishing(master.address, "/pose", "json", payloads):
        done = type_in(
            "topic", "echo", "/pose", *words, "-n", str(len(payloads)), "--timeout", "120",
            "--master", master.address,
        )  # fmt: skip
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    if words == ("--json",):
        assert len([json.loads(line) for line in done.stdout.splitlines()]) == len(PAYLOADS)


def test_log_command_shows_hostile_records_and_the_next_valid_record(master, type_in, capfd):
    honest = json.dumps({"level": "info", "text": "honest", "node": "honest"}).encode()
    payloads = (*hostile.payloads(RECORD), honest)
    with (
        nep.node("errors", master=master.address) as node,
        publishing(master.address, LOG_TOPIC, LOG_TYPE, payloads),
    ):
        latched = node.new_pub(LAST_ERRORS_TOPIC, LAST_ERRORS_TYPE, latched=True)
        latched.publish_bytes(
            json.dumps([RECORD] * 2).replace('"x"', hostile.VALUES["lone surrogate"]).encode()
        )
        done = type_in("log", "--level", "debug", "--node", "honest", "-n", "1", "--master", master.address)
    assert done.returncode == 0
    assert "honest" in done.stdout
    for payload in payloads:
        message = Message(LOG_TOPIC, payload, "json", LOG_TYPE, stamp_ns=1)
        try:
            record = LogRecord.from_plain(message.payload, message.stamp_ns)
        except nep.DecodeError:
            continue
        log_command._show_record(record)
        assert len(record.text) < 10_000
    assert capfd.readouterr().out


def test_alarm_is_raised_after_hostile_values():
    kinds = sorted(VALUE_KINDS)
    rules = [
        rule(kind, "/pose", path=path, limit=3.0 if kind in NUMBER_KINDS else "a", id=f"{kind} {path}")
        for kind in kinds
        for path in ("pose.x", "name", "pose.joints[1]")
    ]
    scene = Scene(*rules)
    scene.graph(("/pose",), ("a",))
    for payload in PAYLOADS:
        scene.send("/pose", payload)
        scene.wait(0.1)
    for _again in range(3):
        scene.send("/pose", {"pose": {"x": 1.0, "joints": [1, 1]}, "name": "b"})
        scene.wait(10.0)
    assert "on" in {
        kind for kind, _seen in scene.send("/pose", {"pose": {"x": 9.0, "joints": [1, 9]}, "name": "a"})
    }


def test_bridge_forwards_the_next_message_after_hostile_messages():
    with nets("memory", "memory") as (a, b), bridged(a, b, topic("/pose", direction="both")) as bridge:
        publisher, subscriber = a.node("evil").new_pub("/pose"), b.node("ears").new_sub("/pose")
        for payload in PAYLOADS:
            publisher.publish_bytes(payload)
        for each in hostile.VALUES.values():
            publisher.publish_bytes(json.dumps({"a": 1}).encode(), {TRAIL_KEY: each})
        publisher.publish({"honest": True})
        counts = settled(route(bridge, "a", "/pose"), len(PAYLOADS))
        assert counts.sent
        eventually(lambda: {"honest": True} in [payload for _is, payload in [subscriber.listen()]])


def test_recorder_and_exports_keep_the_next_message_after_hostile_messages(tmp_path):
    payloads = [each for each in hostile.payloads(POSE, share=5) if len(each) < 1_000_000]
    with (
        nep.node("recorder", "memory", master="hostile") as node,
        nep.node("evil", "memory", master="hostile") as evil,
        RecordingWriter(tmp_path / "a.mcap", limits=limits()) as writer,
        Recorder(node, writer, TopicSelection(("/pose", LOG_TOPIC)), poll_interval_s=0.05),
    ):
        for publisher in (evil.new_pub("/pose"), evil.new_pub(LOG_TOPIC, LOG_TYPE)):
            eventually(lambda publisher=publisher: publisher.subscribers > 0)
            for payload in payloads:
                publisher.publish_bytes(payload)
            publisher.publish({"honest": True})
        eventually(lambda: writer.flush() and writer.status.message_count >= 2 * (len(payloads) + 1))
    with Recording(tmp_path / "a.mcap") as recording:
        (written, _log) = export(recording, "csv", tmp_path / "csv")
    assert "honest" in written.path.read_text(encoding="utf-8")


def test_blackboard_keeps_the_next_perception_after_hostile_messages():
    with nep.node("watcher", "memory", master="hostile") as node:
        board = nep.Blackboard(node)
        board.watch("/blackboard")
        board.watch("/people", key="human.{id}")
        told: hostile.Message = {"primitive": "touched", "input": {"head": 1}, "robot": "Pepper"}
        people: hostile.Message = {"id": 1, "position": [1, 2], "stamp": 5}
        for topic_name, message in (("/blackboard", told), ("/people", people)):
            publisher = node.new_pub(topic_name)
            for payload in hostile.payloads(message, share=2):
                publisher.publish_bytes(payload)
        node.new_pub("/blackboard").publish({"primitive": "honest", "input": {"head": 5}, "robot": "Pepper"})
        assert board.wait_for("honest.head", timeout_s=30.0) == 5


def test_servers_reply_after_hostile_requests():
    asked: dict[str, hostile.Message] = {
        "blackboard/set": {"key": "human.1", "value": {"a": 1}, "lives_s": 5},
        "blackboard/get": {"key": "human.1", "max_age_s": 5},
        "blackboard/keys": {"pattern": "**"},
    }
    with (
        nep.node("served", "memory", master="hostile") as node,
        nep.Blackboard(node) as board,
        BlackboardServer(node, board),
        nep.node("asker", "memory", master="hostile") as asker,
    ):
        node.parameters.declare("speed", 0.5)
        asked[parameters_topic(node.id)] = {"set": {"speed": 1.5}}
        spinning = threading.Thread(target=node.spin)
        spinning.start()
        for service, request in asked.items():
            client = asker.new_client(service, timeout_s=30.0)
            for payload in hostile.in_every_field(request, share=2):
                try:
                    client.call(json.loads(payload))
                except (ValueError, RecursionError, nep.NepError):
                    continue
            assert client.call(request) is not None
        assert board["human.1.a"] == 1
        assert node.parameters["speed"] == 1.5
        node.stop_spin()
        spinning.join()
