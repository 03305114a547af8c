"""A real robot that was told to move is named by every Stop until it proves that it stands still."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from app.core.robots.announcements import MOST_ROBOTS
from app.core.robots.fleet import Fleet
from app.core.robots.robot_link import RobotLink
from nep.messages.message import Message
from tests.core.robots.simulated_network import FakeRobot, SimulatedStudio, publisher_of


@pytest.fixture
def studio(tmp_path: Path) -> Iterator[SimulatedStudio]:
    made = SimulatedStudio(tmp_path)
    yield made
    made.close()


def the_link(studio: SimulatedStudio, name: str = "Pepper") -> RobotLink:
    studio.tick()
    link = studio.session.fleet.link(name)
    assert link is not None
    assert link.connected
    assert not link.virtual
    return link


def moved_by_a_form(studio: SimulatedStudio) -> None:
    fleet: Fleet = studio.session.fleet
    fleet.invoke("Pepper", "turn", {"direction": "left", "angle": 90})
    studio.tick()
    link = fleet.link("Pepper")
    assert link is not None
    assert link.running


@pytest.mark.parametrize("how", ["frozen", "frozen and unlisted", "killed", "left", "another program"])
def test_a_robot_that_is_gone_while_moving_is_named_until_it_answers(
    studio: SimulatedStudio, how: str
) -> None:
    pepper = studio.network.add("Pepper")
    link = the_link(studio)
    moved_by_a_form(studio)
    pepper.is_frozen = True
    if how == "frozen and unlisted":
        studio.network.unlisted.add(pepper.node)
    elif how != "frozen":
        studio.network.remove(pepper)
    studio.pass_time(5)
    if how == "another program":
        studio.network.add("Pepper", "thief")
        studio.tick()
        assert link.connected
    elif how != "frozen":  # a frozen one that is listed is "busy": it has time for its action
        assert link.state == "not stopped", "it stays red without any Stop"
    for _press in range(2):
        studio.stop()
        view, report = studio.session.runs.view(), studio.session.runs.state.report
        assert (view.state, view.result_status) == ("unanswered", "error")
        assert report is not None
        assert report.silent == ("Pepper",)
        assert "form" in view.detail, "it is said what moved it"
        assert not view.can_run
        assert link.last_stop_status == "error"
    if how.startswith("frozen"):
        studio.network.unlisted.clear()
        pepper.thaw()
        studio.tick()
        studio.stop()
        assert (studio.session.runs.view().state, studio.session.runs.view().result_status) == (
            "proven",
            "ok",
        )
    else:
        studio.session.runs.confirm_still()
    assert studio.session.fleet.moved.names == ()
    studio.tick()
    assert studio.session.runs.view().can_run
    assert link.state != "not stopped"


def test_a_motion_whose_end_was_seen_is_named_no_more(studio: SimulatedStudio) -> None:
    pepper = studio.network.add("Pepper", ends_actions=True)
    link = the_link(studio)
    studio.session.fleet.invoke("Pepper", "turn", {"direction": "left", "angle": 90})
    assert "Pepper" in studio.session.fleet.moved
    studio.tick()
    assert "Pepper" not in studio.session.fleet.moved
    studio.network.remove(pepper)
    studio.tick()
    assert link.state == "away"


@pytest.mark.parametrize("by", ["shelf", "key", "alarm", "replay", "bridge", "behaviour", "anything"])
def test_whatever_moved_it_is_said(studio: SimulatedStudio, by: str) -> None:
    pepper = studio.network.add("Pepper")
    the_link(studio)
    studio.session.fleet.moved.note(["Pepper"], by)
    studio.network.remove(pepper)
    studio.tick(2)  # health is looked at once a second
    motion = studio.session.fleet.moved.motion("Pepper")
    assert motion is not None
    assert studio.session.alerts.has("moving:Pepper")
    studio.stop()
    assert motion.sentence in studio.session.runs.view().detail
    studio.session.runs.confirm_still()


def test_a_stop_without_robots_is_ready_and_proves_nothing(studio: SimulatedStudio) -> None:
    studio.tick()
    studio.stop()
    view = studio.session.runs.view()
    assert (view.state, view.result_status, view.can_run) == ("ready", "off", True)


def test_a_robot_is_ready_only_when_a_stop_would_arrive(studio: SimulatedStudio) -> None:
    pepper = studio.network.add("Pepper", is_connected=False)
    link = the_link(studio)
    studio.tick()
    assert link.state == "connecting"
    pepper.is_connected = True
    studio.tick()
    assert link.state == "ready"


def test_a_stop_before_the_connection_is_delivered_late_and_reported(studio: SimulatedStudio) -> None:
    pepper = studio.network.add("Pepper", is_connected=False)
    the_link(studio)
    studio.stop()
    view = studio.session.runs.view()
    assert view.state == "unanswered"
    assert "not connected" in view.title
    assert pepper.stops() == 0
    pepper.is_connected = True
    studio.tick()
    studio.tick()
    assert pepper.stops() == 1
    assert studio.session.runs.view().state == "proven"
    report = studio.session.runs.state.report
    assert report is not None
    assert report.robots[0].waited_ms


def test_a_person_who_confirms_gets_no_late_stop(studio: SimulatedStudio) -> None:
    pepper = studio.network.add("Pepper", is_connected=False)
    the_link(studio)
    studio.stop()
    studio.session.runs.confirm_still()
    pepper.is_connected = True
    studio.tick()
    studio.tick()
    assert pepper.stops() == 0
    assert studio.session.runs.view().can_run


# ---- strangers -----------------------------------------------------------------------------------------


def flood(robot: FakeRobot, messages: int) -> None:
    """Thousands of answers of programs that are not the robot."""
    deep = b'{"op":"stop","id":' + b"[" * 1000 + b"]" * 1000 + b',"state":"succeeded"}'
    topic = "/Pepper/answer"
    batch = [Message(topic, deep, "json", "json", publisher=number % 300) for number in range(messages)]
    for wanted, sink in list(robot.network.sinks):
        if wanted == topic:
            sink(batch)


def test_a_flood_of_answers_does_not_displace_the_robots_own(studio: SimulatedStudio) -> None:
    pepper = studio.network.add("Pepper")
    the_link(studio)
    hear = pepper.hear

    def flooded(command: Mapping[str, object]) -> None:
        flood(pepper, 2000)
        hear(command)
        flood(pepper, 2000)

    pepper.hear = flooded  # type: ignore[method-assign]
    studio.stop()
    assert studio.session.runs.view().state == "proven"


class Undecodable(Message):
    """A message that nobody may look into."""

    @property
    def payload(self) -> object:
        raise AssertionError("it was decoded")


@pytest.mark.parametrize("sender", ["evil", "nobody"])
def test_an_answer_of_a_stranger_is_not_decoded(studio: SimulatedStudio, sender: str) -> None:
    pepper = studio.network.add("Pepper", is_connected=False)
    studio.network.strangers.append(("evil", "/Pepper/answer"))
    the_link(studio)
    studio.stop()  # it goes on waiting for the robot
    topic = "/Pepper/answer"
    foreign = Undecodable(topic, b"{}", "json", "json", publisher=publisher_of(sender, topic))
    for wanted, sink in list(studio.network.sinks):
        if wanted == topic:
            sink([foreign] * 100)
    pepper.is_connected = True
    studio.tick()
    studio.tick()
    assert studio.session.runs.view().state == "proven"


@pytest.mark.parametrize("announcing", ["one node", "many nodes"])
@pytest.mark.parametrize("order", ["before", "after"])
def test_invented_descriptions_keep_no_robot_from_a_stop(
    studio: SimulatedStudio, order: str, announcing: str
) -> None:
    invented = [
        ("evil" if announcing == "one node" else f"evil {number}", f"/A{number}/description")
        for number in range(MOST_ROBOTS + 20)
    ]
    if order == "before":
        studio.network.strangers += invented
        studio.tick()
    pepper = studio.network.add("Pepper")
    studio.tick()
    if order == "after":
        studio.network.strangers += invented
        studio.tick()
    for _ in range(2):
        studio.tick()
    studio.stop()
    assert pepper.stops() == 1
    report = studio.session.runs.state.report
    assert report is not None
    assert "Pepper" in report.still


def test_a_robot_that_went_away_after_it_had_answered_is_told_all_the_same(studio: SimulatedStudio) -> None:
    pepper = studio.network.add("Pepper")
    the_link(studio)
    studio.stop()
    studio.network.unlisted.add(pepper.node)  # its lease has ended, and it still hears
    studio.tick()
    studio.stop()
    assert pepper.stops() == 2
    assert studio.session.runs.view().state == "ready", "nobody waits for its answer"


def test_a_stop_is_not_proven_by_what_another_program_sends(studio: SimulatedStudio) -> None:
    pepper = studio.network.add("Pepper")
    the_link(studio)
    pepper.hear = lambda command: studio.network.publish(  # type: ignore[method-assign]
        "/Pepper/answer", json.loads(json.dumps({**command, "state": "succeeded"})), "evil"
    )
    studio.stop()
    assert studio.session.runs.view().state == "unanswered"


def test_a_robot_of_which_only_the_command_topic_is_known_is_told_and_named(studio: SimulatedStudio) -> None:
    unknown = studio.network.add("X")
    studio.network.unlisted.add(unknown.node)  # it announces nothing
    studio.session.fleet.moved.note(["/X/command"], "shelf")
    studio.tick()
    studio.stop()
    assert unknown.stops() == 1
    report = studio.session.runs.state.report
    assert report is not None
    assert report.silent == ("/X/command",)
    studio.session.runs.confirm_still()
    assert studio.session.runs.view().can_run
