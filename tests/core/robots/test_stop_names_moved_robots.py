"""Tests of Stop naming each commanded real robot until the robot confirms that it stands still."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.core.session import CHECK_INTERVAL_S
from app.robots.client.limits import MAX_ROBOTS
from nep.messages.message import Message
from tests.core.robots.stop_model.lab import SimulatedLab
from tests.core.robots.stop_model.network import LEASE_S
from tests.core.robots.stop_model.robots import TURN_S, SimulatedRobot, Stranger
from tests.core.robots.stop_model.studio import GRAPH_POLL_S

FIRST_UNKNOWN_PUBLISHER = 1 << 20  # no node has a publisher with this id


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[SimulatedLab]:
    lab = SimulatedLab(tmp_path)
    yield lab
    lab.close()


def start_unreachable_robot(lab: SimulatedLab) -> SimulatedRobot:
    """Start a robot that Studio sees and whose command subscriber isn't connected yet."""
    pepper = lab.start_robot("Pepper")
    pepper.node.is_subscribing = True
    lab.wait_for_link("Pepper")
    return pepper


def connect(lab: SimulatedLab, robot: SimulatedRobot) -> None:
    robot.node.is_subscribing = False
    lab.advance(GRAPH_POLL_S)


def silence(robot: SimulatedRobot, how: str) -> None:
    match how:
        case "hung":  # the thread that renews its lease keeps running
            robot.node.is_held = True
        case "frozen":
            robot.node.halt(is_dead=False)
        case "left":
            robot.node.close()
        case _:
            robot.node.halt(is_dead=True)


def recover(robot: SimulatedRobot) -> None:
    robot.node.is_held = False
    robot.thaw()


@pytest.mark.parametrize("how", ["hung", "frozen", "killed", "left", "replaced"])
def test_robot_lost_while_moving_is_named_until_it_replies_or_the_user_confirms(
    lab: SimulatedLab, how: str
) -> None:
    pepper = lab.start_robot("Pepper")
    link, runs, moved = lab.wait_for_link("Pepper"), lab.studio.session.runs, lab.studio.session.fleet.moved
    lab.studio.move("Pepper", "turn")
    lab.settle()
    assert link.running_invocations
    silence(pepper, how)
    lab.advance(LEASE_S + CHECK_INTERVAL_S)
    if how == "replaced":
        lab.start_robot("Pepper")
        lab.wait_for_link("Pepper")
    elif how != "hung":  # a hung robot stays listed, and “busy” for as long as its action may take
        assert link.state == "not stopped", "it stays red without any Stop"
    for _press in range(2):
        lab.stop()
        view, report = runs.view(), runs.state.report
        assert (view.state, view.result_status) == ("unanswered", "error")
        assert report is not None
        assert report.unconfirmed_names == ("Pepper",)
        assert "form" in view.detail, "what moved it is said"
        assert not view.can_run
        assert link.last_stop_status == "error"
    if how in {"hung", "frozen"}:
        recover(pepper)
        lab.advance(GRAPH_POLL_S)
        lab.stop()
        assert (runs.view().state, runs.view().result_status) == ("proven", "ok")
    else:
        runs.confirm_stopped()
    assert moved.names == ()
    lab.advance(GRAPH_POLL_S)
    assert runs.view().can_run
    assert link.state != "not stopped"


def test_robot_that_reported_the_end_of_its_motion_is_not_named(lab: SimulatedLab) -> None:
    pepper = lab.start_robot("Pepper")
    link, moved = lab.wait_for_link("Pepper"), lab.studio.session.fleet.moved
    lab.studio.move("Pepper", "turn")
    assert "Pepper" in moved
    lab.advance(TURN_S + GRAPH_POLL_S)
    assert "Pepper" not in moved
    pepper.node.close()
    lab.advance(GRAPH_POLL_S)
    assert link.state == "away"


@pytest.mark.parametrize("by", ["shelf", "key", "alarm", "replay", "bridge", "behaviour", "anything"])
def test_stop_names_the_cause_of_motion(lab: SimulatedLab, by: str) -> None:
    pepper, session = lab.start_robot("Pepper"), lab.studio.session
    lab.wait_for_link("Pepper")
    session.fleet.moved.record_command(["Pepper"], by)
    pepper.node.close()
    lab.advance(2 * CHECK_INTERVAL_S)
    motion = session.fleet.moved.motion("Pepper")
    assert motion is not None
    assert session.alerts.has("moving:Pepper")
    lab.stop()
    assert motion.reason in session.runs.view().detail


def test_stop_without_robots_ends_ready_without_confirmation(lab: SimulatedLab) -> None:
    lab.stop()
    view = lab.studio.session.runs.view()
    assert (view.state, view.result_status, view.can_run) == ("ready", "off", True)


def test_robot_is_ready_only_when_stop_can_be_delivered(lab: SimulatedLab) -> None:
    pepper = start_unreachable_robot(lab)
    link = lab.wait_for_link("Pepper")
    assert link.state == "connecting"
    connect(lab, pepper)
    assert link.state == "ready"


def test_stop_pressed_before_the_connection_is_delivered_late_and_reported(lab: SimulatedLab) -> None:
    pepper, runs = start_unreachable_robot(lab), lab.studio.session.runs
    lab.stop()
    view = runs.view()
    assert view.state == "unanswered"
    assert "isn't connected" in view.title
    assert lab.stops_received(pepper) == 0
    connect(lab, pepper)
    assert lab.stops_received(pepper) == 1
    assert runs.view().state == "proven"
    report = runs.state.report
    assert report is not None
    assert report.robots[0].waited_ms


def test_stop_is_not_delivered_late_after_the_user_confirmed(lab: SimulatedLab) -> None:
    pepper, runs = start_unreachable_robot(lab), lab.studio.session.runs
    lab.stop()
    runs.confirm_stopped()
    connect(lab, pepper)
    assert lab.stops_received(pepper) == 0
    assert runs.view().can_run


# ---- foreign programs ----------------------------------------------------------------------------------


def flood(lab: SimulatedLab, topic: str) -> None:
    """Deliver 2000 replies of programs that are not the robot to the stopper."""
    deep = b'{"op":"stop","id":' + b"[" * 1000 + b"]" * 1000 + b',"state":"succeeded"}'
    publishers = (FIRST_UNKNOWN_PUBLISHER + number % 300 for number in range(2000))
    batch = [Message(topic, deep, "json", "json", publisher=publisher) for publisher in publishers]
    lab.studio.hand_to_stopper(topic, batch)


def test_flood_of_foreign_replies_does_not_evict_the_reply_of_the_robot(lab: SimulatedLab) -> None:
    pepper, runs = lab.start_robot("Pepper"), lab.studio.session.runs
    topic = lab.wait_for_link("Pepper").robot.topics.reply
    pepper.node.is_held = True
    runs.stop()
    lab.settle()
    flood(lab, topic)
    pepper.node.is_held = False
    assert lab.network.deliver(), "Stop reaches the robot"
    lab.clock.settle()
    assert lab.network.deliver(), "its answer reaches Studio"
    flood(lab, topic)
    lab.settle()
    assert runs.view().state == "proven"


class Undecodable(Message):
    """Message that fails the test when it is decoded."""

    @property
    def payload(self) -> object:
        raise AssertionError("it was decoded")


@pytest.mark.parametrize("sender", ["known", "unknown"])
def test_stopper_does_not_decode_foreign_replies(lab: SimulatedLab, sender: str) -> None:
    topic = "/Pepper/answer"
    stranger = lab.stranger.node.new_pub(topic, "robot/answer")
    pepper = start_unreachable_robot(lab)
    lab.stop()  # the stop waits until the robot is connected
    publisher = stranger.id if sender == "known" else FIRST_UNKNOWN_PUBLISHER
    foreign = Undecodable(topic, b"{}", "json", "json", publisher=publisher)
    lab.studio.hand_to_stopper(topic, [foreign] * 100)
    connect(lab, pepper)
    assert lab.studio.session.runs.view().state == "proven"


@pytest.mark.parametrize("announcing", ["one node", "many nodes"])
@pytest.mark.parametrize("order", ["before", "after"])
def test_fake_robots_do_not_prevent_stop_of_a_real_robot(
    lab: SimulatedLab, order: str, announcing: str
) -> None:
    invented = [f"A{number}" for number in range(MAX_ROBOTS + 20)]
    strangers = [
        Stranger(lab.network) for _each in (invented if announcing == "many nodes" else invented[:1])
    ]

    def announce() -> None:
        for number, name in enumerate(invented):
            strangers[number % len(strangers)].announce(name)
        lab.advance(GRAPH_POLL_S)

    if order == "before":
        announce()
    pepper = lab.start_robot("Pepper")
    lab.advance(GRAPH_POLL_S)
    if order == "after":
        announce()
    lab.stop()
    assert lab.stops_received(pepper) == 1
    report = lab.studio.session.runs.state.report
    assert report is not None
    assert "Pepper" in report.stopped_names


def test_robot_whose_lease_expired_after_its_reply_still_receives_stop(lab: SimulatedLab) -> None:
    pepper = lab.start_robot("Pepper")
    lab.wait_for_link("Pepper")
    lab.stop()
    pepper.node.unlist()  # still receives messages
    lab.advance(GRAPH_POLL_S)
    lab.stop()
    assert lab.stops_received(pepper) == 2
    assert lab.studio.session.runs.view().state == "ready", "nobody waits for its answer"


def test_reply_of_another_program_does_not_confirm_a_stop(lab: SimulatedLab) -> None:
    pepper, runs = lab.start_robot("Pepper"), lab.studio.session.runs
    lab.wait_for_link("Pepper")
    pepper.node.is_held = True
    runs.stop()
    lab.settle()
    assert lab.stop_ids
    lab.stranger.answer("Pepper", lab.stop_ids, times=1)
    lab.wait_for_report()
    assert runs.view().state == "unanswered"


def test_robot_known_only_by_its_command_topic_receives_stop_and_is_named(lab: SimulatedLab) -> None:
    unknown, runs = lab.start_robot("X"), lab.studio.session.runs
    unknown.node.unlist()  # not listed by the master
    lab.studio.session.fleet.moved.record_command(["/X/command"], "shelf")
    lab.advance(GRAPH_POLL_S)
    lab.stop()
    assert lab.stops_received(unknown) == 1
    report = runs.state.report
    assert report is not None
    assert report.unconfirmed_names == ("/X/command",)
    runs.confirm_stopped()
    assert runs.view().can_run
