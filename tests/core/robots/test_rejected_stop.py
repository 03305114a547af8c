"""Tests of a robot that reports that it may still move: the report is shown everywhere."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import nep
from app.blocks.runtime.events import ProgramEnded
from app.core.robots.health_facts import health_items
from app.core.robots.robot_link import RobotLink
from app.core.session import Session
from app.robots.kit import Call, Driver, Failed, Kind, Link, action, safe_stop
from app.run import FAILED, run_file
from app.ui.shell.bars.app_bar import robots_chip
from nep.masters.master import Master
from tests.blocks.samples import block, number, started, workspace
from tests.blocks.wire_robot import WireRobot, usual_time_limits
from tests.core.waiting import stop_unanswered, tick_until

pytestmark = pytest.mark.usefixtures("patient_robots")

LONG_S = 60.0
SAID = "Arm may still move: the brake does not answer"


class ArmBody:
    """Robot arm whose stop fails while ``stuck`` is set."""

    stuck = True

    def __init__(self, link: Link) -> None:
        """Ignore the link: there is no device."""

    @action("wave", category="Movement", icon="hand")
    def wave(self, call: Call) -> None:
        """Wave at once."""

    @safe_stop(watchdog_s=5)
    def stop(self) -> None:
        """Raise `Failed` while the brake is stuck."""
        if self.stuck:
            raise Failed("the brake does not answer")


ARM = Kind("arm", "Arm", ArmBody)


@pytest.fixture
def arm(master: Master) -> Iterator[Driver]:
    with nep.node("arm", master=master.address) as node, Driver(ARM, "Arm", node) as driver:
        yield driver


def the_link(session: Session, name: str = "Arm") -> RobotLink:
    def ready() -> bool:
        """Whether Stop knows the robot and would reach it."""
        link = session.fleet.link(name)
        known = session.stopper is not None and name in session.stopper.robots
        return known and link is not None and link.state == "ready"

    tick_until(session, ready, LONG_S)
    link = session.fleet.link(name)
    assert link is not None
    return link


def test_rejected_stop_is_shown_in_run_bar_chips_health_alert_and_console(
    session: Session, arm: Driver
) -> None:
    link = the_link(session)
    assert link.chip_text == ("virtual, ready" if link.is_virtual else "ready")
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state == "unanswered")
    view = session.runs.view()
    assert "the brake does not answer" in view.title
    assert view.title.startswith("Arm may still move")
    assert view.detail == "Switch Arm off by hand."
    assert (view.result_status, view.confirm_label) == ("error", "Arm isn't moving")
    assert "didn't reply" not in f"{view}"
    assert (link.state, link.chip_text.removeprefix("virtual, ")) == ("not stopped", "may still move")
    words, status = robots_chip(session)
    assert (words, status) == ("Arm: may still move", "error")
    (fact,) = (each for each in health_items(link, session.live.topics, 0.0, str) if each.title == "Stop")
    assert fact.status == "error"
    assert "the brake does not answer" in fact.text
    (alert,) = (each for each in session.alerts.active if each.id == "stop")
    assert (alert.severity, "the brake does not answer" in alert.title) == ("error", True)
    assert any("the brake does not answer" in record.text for record in session.console.records)
    arm.body.stuck = False  # type: ignore[attr-defined]
    session.runs.stop()
    assert session.runs.view().title == "Stopping"  # at once, without “Ready” in between
    tick_until(session, lambda: session.runs.view().state == "proven")
    tick_until(session, lambda: link.chip_text.removeprefix("virtual, ") == "ready")
    assert not session.alerts.has("stop")


def test_user_can_confirm_that_robot_stands_still_after_rejected_stop(session: Session, arm: Driver) -> None:
    link = the_link(session)
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state == "unanswered")
    session.runs.confirm_stopped()
    assert link.state == "ready"


def test_neither_disconnection_nor_new_program_of_same_name_confirms_a_stop(
    session: Session, master: Master
) -> None:
    with nep.node("arm", master=master.address) as node, Driver(ARM, "Arm", node):
        link = the_link(session)
        session.runs.stop()
        tick_until(session, lambda: session.runs.view().state == "unanswered")
    tick_until(session, lambda: not link.is_connected)
    assert (link.state, link.chip_text.removeprefix("virtual, ")) == ("not stopped", "may still move")
    assert robots_chip(session) == ("Arm: may still move", "error")
    before = link.identity
    other = WireRobot(master.address, "Arm")
    try:
        tick_until(session, lambda: link.is_connected and link.identity != before)
        assert link.state == "not stopped", "the first program may still run"
        session.runs.confirm_stopped()
        tick_until(session, lambda: link.state == "ready")
    finally:
        other.close()


def test_stop_includes_a_robot_lost_after_a_rejected_stop_until_the_user_confirms(
    session: Session, master: Master
) -> None:
    with nep.node("arm", master=master.address) as node, Driver(ARM, "Arm", node):
        link = the_link(session)
        session.runs.stop_robot("Arm")
        tick_until(session, lambda: link.stop_problem)
    tick_until(session, lambda: not link.is_connected)
    stop_unanswered(session)
    assert session.runs.view().confirm_label == "Arm isn't moving"
    session.runs.confirm_stopped()
    assert link.state == "away"
    assert robots_chip(session) == ("No robot", "off")


def test_rejected_stop_of_a_single_robot_is_an_alert(session: Session, arm: Driver) -> None:
    link = the_link(session)
    session.runs.stop_robot("Arm")
    tick_until(session, lambda: session.alerts.has("stop"))
    assert "the brake does not answer" in link.stop_problem


def test_run_prints_the_rejection_message_of_the_robot(master: Master, arm: Driver, tmp_path: Path) -> None:
    path, out = tmp_path / "wave.nepb", io.StringIO()
    wave = workspace(started(block("robot_arm_do_wave", ROBOT="Arm")))
    robots = {"Arm": arm.description}
    content = {"format": "nep-behaviour", "version": 1, "name": "Wave", "workspace": wave, "robots": robots}
    path.write_text(json.dumps(content))
    assert run_file(path, out=out, allow_moving=True) == FAILED
    assert "Arm may still move" in out.getvalue()
    assert "the brake does not answer. Switch it off by hand." in out.getvalue()
    assert "didn't reply" not in out.getvalue()


@pytest.fixture
def patient(session: Session, monkeypatch: pytest.MonkeyPatch) -> Session:
    """Session with stop timeouts longer than any test."""
    monkeypatch.setattr("app.robots.client.limits.STOP_TIMEOUT_S", 120.0)
    monkeypatch.setattr("app.robots.client.limits.MAX_STOP_TIMEOUT_S", 120.0)
    return session


def answers(session: Session, robot: WireRobot, count: int = 1) -> None:
    """Wait until the robot has received ``count`` stops, then send the replies that it withheld."""
    tick_until(session, lambda: len(robot.heard("stop")) >= count, LONG_S)
    for command in robot.heard("stop"):
        robot._say(command, "succeeded")


def test_pending_stop_is_shown_as_stopping_until_the_robot_replies(
    patient: Session, pepper: WireRobot
) -> None:
    link = the_link(patient, "Pepper")
    pepper.silent = {"stop"}
    patient.runs.stop()
    tick_until(patient, lambda: link.state == "stopping", LONG_S)
    assert link.chip_text.removeprefix("virtual, ") == "stopping"
    assert robots_chip(patient) == ("Pepper stopping", "running")
    (fact,) = (each for each in health_items(link, patient.live.topics, 0.0, str) if each.title == "Stop")
    assert (fact.status, fact.text) == ("off", "Stop sent; waiting for confirmation")
    answers(patient, pepper)
    tick_until(patient, lambda: patient.runs.view().state == "proven", LONG_S)
    assert link.state == "ready"


def test_first_stop_replies_are_shown_while_others_are_pending(patient: Session, master: Master) -> None:
    robots = {name: WireRobot(master.address, name) for name in ("Good", "Bad", "Deaf")}
    try:
        links = {name: the_link(patient, name) for name in robots}
        bad = robots["Bad"]
        refuse = bad._say
        bad._say = lambda command, state, error="": refuse(command, "failed", "no")  # type: ignore[method-assign]
        robots["Deaf"].silent = {"stop"}
        patient.runs.stop()
        tick_until(patient, lambda: links["Bad"].state == "not stopped", LONG_S)
        tick_until(patient, lambda: links["Good"].last_stop is not None, LONG_S)
        tick_until(patient, lambda: links["Deaf"].state == "stopping", LONG_S)
        assert (links["Good"].state, patient.runs.view().state) == ("ready", "stopping")
        assert robots_chip(patient) == ("Bad: may still move", "error")
        answers(patient, robots["Deaf"])
        tick_until(patient, lambda: patient.runs.view().state == "unanswered", LONG_S)
        assert links["Deaf"].state == "ready"
    finally:
        for robot in robots.values():
            robot.close()


def test_later_stop_includes_robots_that_did_not_reply_to_an_earlier_stop(
    patient: Session, pepper: WireRobot
) -> None:
    link = the_link(patient, "Pepper")
    pepper.silent = {"stop"}
    patient.runs.stop_robot("Pepper")
    patient.runs._stop(())
    assert patient.runs._run.robots_to_stop == ("Pepper",)
    answers(patient, pepper, 2)
    tick_until(patient, lambda: patient.runs.view().state == "proven", LONG_S)
    tick_until(patient, lambda: link.state == "ready", LONG_S)


# ---- late and unsolicited replies ----------------------------------------------------------------------


@pytest.fixture
def pepper(master: Master) -> Iterator[WireRobot]:
    made = WireRobot(master.address)
    yield made
    made.close()


def lives(session: Session, pepper: WireRobot, *not_ended: str) -> None:
    """Publish a heartbeat with the robot parts that are still moving, in the format of the robot kit."""
    tick_until(session, lambda: pepper._answer.subscribers >= 2, LONG_S)  # the fleet and Stop
    error = f"Pepper may still move: {', '.join(not_ended)} has not ended" if not_ended else None
    told = {"op": "alive", "id": "", "action": "", "state": "running"}
    pepper._answer.publish({**told, "not_ended": list(not_ended), "error": error})


def test_ongoing_action_is_shown_until_robot_reports_its_end(session: Session, pepper: WireRobot) -> None:
    link = the_link(session, "Pepper")
    say_ = pepper._say
    said = "Pepper may still move: turn has not ended"
    pepper._say = lambda command, state, error="": say_(command, "failed", said)  # type: ignore[method-assign]
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().title == said)
    lives(session, pepper, "turn")
    tick_until(session, lambda: link.unended_actions == said)
    tick_until(session, lambda: session.alerts.has("moving:Pepper"))
    pepper._say = say_  # type: ignore[method-assign]
    lives(session, pepper)
    tick_until(session, lambda: session.runs.view().state == "proven")  # Stop was sent again
    assert len(pepper.heard("stop")) == 2
    assert link.state == "ready"
    tick_until(session, lambda: not session.alerts.has("moving:Pepper"))


def test_stop_is_repeated_only_once_for_a_robot_whose_stop_is_always_late(
    session: Session, pepper: WireRobot
) -> None:
    link = the_link(session, "Pepper")
    say_ = pepper._say
    pepper._say = lambda command, state, error="": say_(command, "failed", SAID)  # type: ignore[method-assign]
    session.runs.stop()
    for stops in (1, 2, 2, 2):  # replies late, reports the stop as not ended, then ends
        tick_until(session, lambda: session.runs.view().state == "unanswered", LONG_S)
        lives(session, pepper, "the stop function")
        tick_until(session, lambda: link.unended_actions, LONG_S)
        assert len(pepper.heard("stop")) == stops
        lives(session, pepper)
        tick_until(session, lambda: not link.unended_actions, LONG_S)
        session.tick()
    assert (link.state, session.runs.view().confirm_label) == ("not stopped", "Pepper isn't moving")
    session.runs.stop()  # Stop by a person gives the robot another chance
    tick_until(session, lambda: len(pepper.heard("stop")) == 3, LONG_S)
    tick_until(session, lambda: session.runs.view().state == "unanswered", LONG_S)


def test_robot_lost_after_reporting_possible_motion_stays_an_error(session: Session, master: Master) -> None:
    with nep.node("arm", master=master.address) as node, Driver(ARM, "Arm", node) as arm:
        link = the_link(session)
        told = {"op": "alive", "id": "", "action": "", "state": "running", "not_ended": ["the stop function"]}

        def is_told() -> bool:
            arm._publish(arm.robot.topics.reply, {**told, "error": SAID})
            return link.state == "not stopped"

        tick_until(session, is_told)
    tick_until(session, lambda: not link.is_connected)
    assert (link.state, link.stop_problem) == ("not stopped", SAID)
    stop_unanswered(session)
    session.runs.confirm_stopped()
    assert link.state == "away"


def test_disconnected_virtual_robot_is_not_moving(session: Session, pepper: WireRobot) -> None:
    link = the_link(session, "Pepper")
    lives(session, pepper, "turn")
    tick_until(session, lambda: link.state == "not stopped")
    link.robot = replace(link.robot, virtual=True)
    session.fleet._disconnect(link)
    assert link.state == "away"


def test_action_that_ends_after_its_timeout_causes_no_stop(session: Session, pepper: WireRobot) -> None:
    link = the_link(session, "Pepper")
    lives(session, pepper, "turn")
    tick_until(session, lambda: link.state == "not stopped")
    lives(session, pepper)
    tick_until(session, lambda: link.state == "ready")
    session.tick()
    assert pepper.heard("stop") == []


def test_late_stop_reply_updates_the_result(session: Session, pepper: WireRobot) -> None:
    the_link(session, "Pepper")
    pepper.silent = {"stop"}
    stop_unanswered(session)
    assert session.runs.view().title == "Pepper didn't reply"
    tick_until(session, lambda: pepper.heard("stop"))
    pepper._say(pepper.heard("stop")[0], "failed", "the brake is stuck")
    tick_until(session, lambda: session.runs.view().title == "Pepper may still move: the brake is stuck")
    pepper._say(pepper.heard("stop")[0], "succeeded")
    tick_until(session, lambda: session.runs.view().state == "proven")
    assert not session.alerts.has("stop")
    report = session.runs._run.report
    assert report is not None
    assert report.elapsed_ms >= (report.robots[0].elapsed_ms or 0) > 1000


def test_robot_that_did_not_reply_to_the_program_is_named_by_stop(
    session: Session, pepper: WireRobot
) -> None:
    the_link(session, "Pepper")
    pepper.silent = {"stop"}
    session.document.apply_edit(workspace(started(block("control_wait", SECONDS=number(600)))))
    session.runs.run()
    runner = session.runs._runner
    assert runner is not None
    with usual_time_limits():
        session.runs.on_runner_event(ProgramEnded(run=runner.run, unresponsive_robots=("Pepper",)))
        tick_until(session, lambda: session.runs.view().state == "unanswered")
    assert session.runs.view().title == "Pepper didn't reply"
    runner.close()


def test_stop_without_network_names_the_robot_it_was_not_sent_to(session: Session, pepper: WireRobot) -> None:
    the_link(session, "Pepper")
    stopper, session.stopper = session.stopper, None
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state == "unanswered")
    assert session.runs.view().title.startswith("Stop wasn't sent to Pepper: ")
    session.stopper = stopper
