"""Tests of hostile messages: the console, the fleet, the alarms and watched topics still work after them."""

from __future__ import annotations

import threading
from itertools import zip_longest

import pytest

import nep
from app.core.session import Session
from app.core.world.console import ConsoleRecord
from app.errors import DescriptionError
from app.robots.description.description import parse_announcement, thing_description
from app.robots.description.model import Robot
from app.robots.driver.driver import Driver
from app.robots.virtual.room_map import TOPIC as ROOM_TOPIC
from nep.errors import DecodeError
from nep.messages.message import Message
from nep.nodes.log_handler import LAST_ERRORS_TOPIC, LAST_ERRORS_TYPE, LOG_TOPIC, LOG_TYPE
from nep.programs.alarms import AlarmAction, AlarmCondition, AlarmRule
from tests import hostile
from tests.core.test_session import LAMP
from tests.core.waiting import tick_until

RECORD = {
    "level": "error",
    "text": "x",
    "name": "n",
    "node": "m",
    "stamp_ns": 5,
    "file": "f",
    "line": 3,
    "pid": 7,
}
ANSWER = {
    "id": "1", "op": "invoke", "action": "blink", "state": "running", "output": {"a": 1},
    "feedback": {"b": 2},
    "error": "x", "waits_for": ["a"], "replaces": ["b"], "not_ended": ["c"],
}  # fmt: skip
ROOM = {"things": [{"name": "ball", "kind": "ball", "x": 1.0, "y": 1.0, "changed_ns": 2**62, "gone": False}]}
BEAT = {"op": "alive", "not_ended": ["c"], "error": "x", "rejected": 1, "errors": 1}
MESSAGES: dict[tuple[str, str], list[hostile.Message]] = {
    (LOG_TOPIC, LOG_TYPE): [RECORD],
    (LAST_ERRORS_TOPIC, LAST_ERRORS_TYPE): [[RECORD, RECORD]],
    ("/Lamp/answer", "robot/answer"): [ANSWER, BEAT, {**ANSWER, "op": "stop", "state": "succeeded"}],
    ("/Lamp/state", "json"): [{"moving": True, "x": 1.0}],
    ("rize_event", "json"): [{"robot": "ready", "name": "x"}],
    ("action_state", "json"): [{"state": "success", "id": "1", "primitives": [{"primitive": "say"}]}],
    (ROOM_TOPIC, "json"): [ROOM],
    ("/watched", "json"): [{"pose": {"x": 1.0}, "name": "a"}],
}


@pytest.fixture
def evil(master):
    with nep.node("evil") as node:
        yield node


def test_session_survives_every_hostile_message(session: Session, evil: nep.Node, caplog) -> None:
    watches = [session.live.watch("/watched"), session.live.watch("/Lamp/state")]
    condition = AlarmCondition("above", "/watched", "pose.x", 3.0)
    session.alarms.set_rule(AlarmRule("1", condition, (AlarmAction("show"),)))
    publishers = [evil.new_pub(topic, msg_type) for topic, msg_type in MESSAGES]
    with nep.node("lamp") as node, Driver(LAMP, "Lamp", node):
        tick_until(session, lambda: session.fleet.connected and publishers[-1].subscribers)
        threads = {each for each in threading.enumerate() if each.is_alive()}
        generated = [hostile.payloads(*messages) for messages in MESSAGES.values()]
        for number, row in enumerate(zip_longest(*generated)):
            for publisher, payload in zip(publishers, row, strict=True):
                if payload is not None:
                    publisher.publish_bytes(payload)
            if number % 20 == 0:
                session.tick()
                assert all(isinstance(record, ConsoleRecord) for record in session.console.records)
        node.log.error("an honest record")
        tick_until(session, lambda: any(each.text == "an honest record" for each in session.console.records))
        link = session.fleet.link("Lamp")
        tick_until(session, lambda: link.publisher is not None and link.publisher.subscribers)
        blink = session.fleet.invoke("Lamp", "blink", {})
        tick_until(session, lambda: not blink.is_running)
        assert blink.state == "succeeded"
        stopped = session.stopper.stop_all(["Lamp"])
        assert [each.is_confirmed for each in stopped.robots] == [True]
    assert [record for record in caplog.records if record.exc_info] == []
    assert [each.name for each in threads if not each.is_alive() and "lamp" not in each.name.lower()] == []
    for watch in watches:
        watch.close()


def test_hostile_robot_descriptions_are_parsed_or_rejected_with_a_reason():
    described = thing_description(LAMP.thing_model, "Lamp")
    sentences: list[str] = []
    seen: set[type] = set()
    for payload in hostile.payloads(described, share=7):
        try:
            robot = parse_announcement(Message("/Lamp/description", payload, "json", "robot/description"))
        except (DescriptionError, DecodeError) as error:
            sentences.append(str(error))
            seen.add(type(error))
        else:
            assert repr(robot)
            assert not [action.name for action in robot.actions if len(action.check({})) > 9]
            seen.add(Robot)
    assert seen == {DescriptionError, DecodeError, Robot}
    assert min(map(len, sentences)) > 0
    assert max(map(len, sentences)) < 20_000
