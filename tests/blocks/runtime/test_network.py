from __future__ import annotations

import json
import threading

import pytest

import nep
from app.blocks.runtime.network import Network
from app.robots.client.discovery import find_robots
from tests import hostile
from tests.blocks.fakes import until
from tests.blocks.wire_robot import RizeRobot, WireRobot

pytestmark = pytest.mark.usefixtures("patient")


@pytest.fixture
def pepper(master):
    made = WireRobot(master.address)
    yield made
    made.close()


@pytest.fixture
def node(master):
    with nep.node("test", master=master.address) as made:
        yield made


@pytest.fixture
def network(node, pepper):
    made = Network(
        node,
        "program-1",
        [pepper.described],
        parts=[("Pepper", "battery")],
        publishes=["/out"],
        listens=["/in"],
    )
    yield made
    made.close()


def test_invoked_action_returns_its_output(network, pepper):
    pokes: list[int] = []
    network.set_callbacks(lambda: pokes.append(1), lambda _: None)
    call = network.invoke("Pepper", "say", {"text": "Hi"})
    until(lambda: call.done)
    assert (call.state, call.output, call.error) == ("succeeded", {"word": "yes"}, "")
    (command,) = pepper.heard("invoke")
    assert command == {
        "id": call.id, "op": "invoke", "from": "program-1", "action": "say", "input": {"text": "Hi"},
    }  # fmt: skip
    until(lambda: bool(pokes))


def test_replies_from_other_robots_and_invalid_replies_are_ignored(network, pepper, node):
    pepper.slow = {"say"}
    call = network.invoke("Pepper", "say", {"text": "Hi"})
    until(lambda: call.state == "accepted")
    answer = pepper._answer
    told = {"id": call.id, "op": "invoke", "action": "say", "output": {}, "feedback": {}, "error": None}
    for state in ("dancing", None, ["succeeded"], "accepted"):
        answer.publish({**told, "state": state})
    payload = json.dumps({**told, "state": "succeeded"}).encode()
    publisher = answer._spec.id
    network._receive_replies(
        [nep.Message("/Other/answer", payload, "json", "robot/answer", publisher=publisher)]
    )
    answer.publish({"op": "alive", "id": "", "state": "running"})
    until(lambda: call.last_reply_s > 0 and call.state == "accepted")
    answer.publish({**told, "state": "running", "waits_for": "no list"})
    until(lambda: call.state == "running")
    assert call.waits_for == ()
    answer.publish({**told, "state": "succeeded"})
    answer.publish({**told, "state": "failed", "error": "twice"})
    until(lambda: call.done)
    assert (call.state, call.error) == ("succeeded", "")


def test_failed_action_has_the_robot_error_and_cancel_request_is_sent(network, pepper):
    pepper.refuses = {"say": "no voice"}
    pepper.slow = {"turn"}
    refused = network.invoke("Pepper", "say", {"text": "Hi"})
    turning = network.invoke("Pepper", "turn", {})
    until(lambda: refused.done and turning.state == "accepted")
    assert (refused.state, refused.error) == ("failed", "no voice")
    network.cancel(turning)
    until(lambda: bool(pepper.heard("cancel")))
    assert pepper.heard("cancel")[0]["id"] == turning.id


def test_heartbeat_is_sent_automatically(network, pepper):
    until(lambda: len(pepper.heard("alive")) >= 3)
    assert {command["from"] for command in pepper.heard("alive")} == {"program-1"}


def test_sensor_values_events_and_messages_are_received(network, pepper, node):
    events: list[object] = []
    network.on_event("Pepper", "touched", events.append)
    assert network.sensor("Pepper", "battery") is None
    pepper.tell("battery", {"value": 84})
    pepper.tell("touched", {"place": "head"})
    until(lambda: network.sensor("Pepper", "battery") == 84 and events == [{"place": "head"}])
    assert network.sensor("Pepper", "pose") is None  # subscribed at first use

    def told_again() -> bool:  # robots publish sensors several times per second
        pepper.tell("pose", {"x": 1.0, "y": 2.0})
        return network.sensor("Pepper", "pose") == {"x": 1.0, "y": 2.0}

    until(told_again)

    subscriber = node.new_sub("/out")
    network.publish("/out", "tired")
    message = subscriber.receive(30.0)
    assert message is not None
    assert message.payload == "tired"
    with nep.node("other") as other:
        other.new_pub("/in").publish({"name": "Ada"})
        until(lambda: network.newest("/in") == {"name": "Ada"})


def test_stop_waits_for_replies_and_names_silent_robots(network, pepper):
    outside: list[str] = []
    network.set_callbacks(lambda: None, outside.append)
    assert network.stop_robots(60.0) == ()
    pepper.silent = {"stop"}
    assert network.stop_robots(0.05) == ("Pepper",)
    assert outside == []


def test_duplicate_replies_to_own_stop_for_pause_are_not_reported_as_foreign_stop(network, pepper, node):
    pepper.slow = {"say"}
    outside: list[str] = []
    network.set_callbacks(lambda: None, outside.append)
    network._stop_for_pause(pepper.described)
    until(lambda: all(request.is_proven for request in network._stops.requests))
    (stop,) = pepper.heard("stop")
    answer = pepper._answer
    for state in ("succeeded", "failed", "succeeded"):
        answer.publish({"id": stop["id"], "op": "stop", "state": state})
    call = network.invoke("Pepper", "say", {"text": "Hi"})
    answer.publish({"id": call.id, "op": "invoke", "state": "running", "feedback": {"read": "all before"}})
    until(lambda: call.feedback == {"read": "all before"})
    assert outside == []


def test_stop_by_another_program_is_detected(network, pepper, node):
    outside: list[str] = []
    network.set_callbacks(lambda: None, outside.append)
    node.new_pub("/Pepper/command", "robot/command").publish({"id": "s", "op": "stop", "from": "person"})
    until(lambda: outside == ["Pepper"])


def test_rize_robot_receives_commands_in_rize_format(master, node):
    rosie = RizeRobot(master.address)
    network = Network(node, "program-1", [rosie.described])
    try:
        call = network.invoke("Rosie", "say", {"text": "hello"})
        until(lambda: call.done)
        assert call.state == "succeeded"
        (command,) = rosie.commands
        assert (command["node"], command["robots"], command["state"]) == ("action", "Rosie", "idle")
        assert command["primitives"]["primitive"] == "say"
        assert command["primitives"]["input"] == "hello"
        assert network.stop_robots(0.05) == ()  # this robot can't confirm, so the stop doesn't wait for it
    finally:
        network.close()
        rosie.close()


def test_robots_are_found_by_topic_type(master, node, pepper):
    turtle = WireRobot(master.address, "Turtle 2")
    try:
        found = find_robots(node, 60.0, expected=["Pepper", "Turtle 2"])
        assert [robot.name for robot in found.robots] == ["Pepper", "Turtle 2"]
        assert found.owners["Pepper"].node_id == pepper._node.id
        assert [robot.name for robot in find_robots(node, 60.0).robots] == ["Pepper", "Turtle 2"]
        wanted = find_robots(node, 3.0, expected=["NAO"])  # long enough for the others
        assert ([robot.name for robot in wanted.robots], wanted.rejected_claims) == (
            ["Pepper", "Turtle 2"],
            (),
        )
    finally:
        turtle.close()


def test_program_survives_hostile_replies_and_values(network, pepper, node):
    heard: list[object] = []

    def told(payload: object) -> None:
        heard.append(payload)
        raise SystemExit(3)

    network.on_message("/in", told)
    network.on_sensor("Pepper", "battery", heard.append)
    threads = {each for each in threading.enumerate() if each.is_alive()}
    pepper.slow = {"turn"}
    turning = network.invoke("Pepper", "turn", {})
    until(lambda: turning.state == "accepted")
    answer: hostile.Message = {
        "id": turning.id, "op": "invoke", "state": "running", "output": {"a": 1}, "feedback": {"b": 2},
        "error": "x", "waits_for": ["a"],
    }  # fmt: skip
    stop: hostile.Message = {"id": "1", "op": "stop", "state": "failed", "error": "x"}
    strange = node.new_pub("/in")
    for payload in hostile.payloads({"value": 5}):
        strange.publish_bytes(payload)
        pepper._sensors["battery"].publish_bytes(payload)
    for payload in hostile.payloads(answer, stop):
        pepper._answer.publish_bytes(payload)
    until(lambda: len(heard) > 50)

    def is_valid_value_received() -> bool:  # robots publish sensors several times per second
        pepper.tell("battery", {"value": 84})
        return network.sensor("Pepper", "battery") == 84

    until(is_valid_value_received)
    call = network.invoke("Pepper", "say", {"text": "Hi"})
    until(lambda: call.done)
    assert call.state == "succeeded"
    assert [each.name for each in threads if not each.is_alive()] == []
