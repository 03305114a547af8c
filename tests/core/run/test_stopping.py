from __future__ import annotations

import threading

import psutil
import pytest

import nep
from app.blocks.compiler.compiler import compile_behaviour
from app.core.robots.stop.stopper import RobotStopper
from app.core.run.runner import Runner
from app.robots.client.stop_report import RobotStop, StopReport
from tests.blocks.fakes import until
from tests.blocks.samples import block, number, say, started, workspace
from tests.blocks.wire_robot import RizeRobot, WireRobot

pytestmark = pytest.mark.usefixtures("patient", "patient_robots")
LONG_S = 60.0
SILENT_S = 3.0  # time limit for silent robots, long enough for the others on a busy computer


@pytest.fixture
def robots(master):
    made = [WireRobot(master.address), WireRobot(master.address, "Turtle")]
    yield made
    for each in made:
        each.close()


@pytest.fixture
def stopper(master, robots):
    with nep.node("studio", master=master.address) as node:
        made = RobotStopper(node)
        made.set_robots([each.described for each in robots])
        yield made
        made.close()


def test_stop_is_confirmed_when_all_robots_reply(stopper, robots):
    answered: list[RobotStop] = []
    report = stopper.stop_all(timeout_s=LONG_S, on_answer=answered.append)
    assert report.is_confirmed
    assert {robot.name for robot in report.robots} == {"Pepper", "Turtle"}
    assert all(robot.is_confirmed and robot.elapsed_ms is not None for robot in report.robots)
    assert max(robot.elapsed_ms or 0 for robot in report.robots) <= report.elapsed_ms
    assert sorted(robot.name for robot in answered) == ["Pepper", "Turtle"]
    assert [len(robot.heard("stop")) for robot in robots] == [1, 1]


def test_robot_that_does_not_reply_to_stop_is_named(stopper, robots):
    robots[1].silent = {"stop"}
    answered: list[RobotStop] = []
    report = stopper.stop_all(timeout_s=SILENT_S, on_answer=answered.append)
    assert (report.is_confirmed, report.unconfirmed_names) == (False, ("Turtle",))
    by_name = {robot.name: robot for robot in report.robots}
    assert by_name["Pepper"].is_confirmed
    assert by_name["Turtle"].message == "Turtle didn't reply. Switch it off by hand."
    assert report.elapsed_ms >= SILENT_S * 1000
    assert [robot.name for robot in answered] == [
        "Pepper",
        "Turtle",
    ]  # replies first, missing replies last


def test_only_named_robots_are_stopped(stopper, robots):
    assert [robot.name for robot in stopper.stop_all(["Turtle"], timeout_s=LONG_S).robots] == ["Turtle"]
    assert robots[0].heard("stop") == []


def test_unknown_robot_name_is_reported_as_unconfirmed(stopper, robots):
    report = stopper.stop_all(["Turtle", "Nobody"], timeout_s=LONG_S)
    assert (report.is_confirmed, report.unconfirmed_names) == (False, ("Nobody",))
    assert report.robots[1].message == "Stop wasn't sent to Nobody. Switch it off by hand."


def test_stop_without_robots_is_not_confirmed(stopper):
    stopper.set_robots(())
    report = stopper.stop_all()
    assert (report.robots, report.is_confirmed, report.status) == ((), False, "off")


def test_failed_stop_is_reported_with_robot_message(stopper, robots):
    say_ = robots[0]._say
    robots[0]._say = lambda command, state, error="": say_(command, "failed", "the brake is stuck")
    report = stopper.stop_all(["Pepper"], timeout_s=LONG_S)
    assert (report.is_confirmed, report.robots[0].has_failed) == (False, True)
    assert report.robots[0].message == "Pepper may still move: the brake is stuck. Switch it off by hand."


def test_replies_for_another_robot_and_duplicate_replies_do_not_confirm_a_stop(stopper, robots):
    pepper, turtle = robots
    turtle.silent = {"stop"}
    say_ = pepper._say

    def lies(command, state, error=""):
        """Reply on Pepper's topic to the stop of Turtle, then twice to Pepper's own."""
        with turtle.changed:
            assert turtle.changed.wait_for(lambda: turtle.heard("stop"), LONG_S)
        for asked in (turtle.heard("stop")[0], command, command):
            say_(asked, state, error)

    pepper._say = lies
    report = stopper.stop_all(timeout_s=SILENT_S)
    assert [(robot.name, robot.is_confirmed) for robot in report.robots] == [
        ("Pepper", True),
        ("Turtle", False),
    ]
    assert (report.is_confirmed, report.unconfirmed_names) == (False, ("Turtle",))


def test_robots_can_be_added_and_removed(stopper, robots):
    stopper.set_robots([robots[0].described])
    assert stopper.robots == ("Pepper",)
    stopper.set_robots([each.described for each in robots])
    assert stopper.stop_all(timeout_s=LONG_S).is_confirmed
    assert stopper.robots == ("Pepper", "Turtle")


def test_rize_robot_cannot_confirm_stop(master, stopper):
    rosie = RizeRobot(master.address)
    try:
        stopper.set_robots([rosie.described])
        report = stopper.stop_all(timeout_s=LONG_S)
        assert report.robots[0].message == "Rosie: Stop sent; this robot can't confirm"
        assert (report.is_confirmed, report.unconfirmed_names) == (True, ())
        assert report.elapsed_ms < LONG_S * 1000  # without waiting for a reply
        until(lambda: bool(rosie.commands))
        assert rosie.commands[0]["node"] == "cancel"
    finally:
        rosie.close()


def test_stop_over_closed_node_is_reported(master, robots):
    with nep.node("studio", master=master.address) as node:
        stopper = RobotStopper(node)
        stopper.set_robots([robots[0].described])
    report = stopper.stop_all(timeout_s=SILENT_S)
    assert not report.is_confirmed
    assert report.robots[0].message.startswith("Stop can't be sent to Pepper: ")


def test_stop_names_the_program_to_end(stopper, robots):
    stopper.send_stop(program_key="program-1")
    stopper.stop_all(program_key="program-2")
    stopper.stop_all()
    for robot in robots:
        assert [stop.get("ends") for stop in robot.heard("stop")] == ["program-1", "program-2", None]


def test_two_simultaneous_stops_both_receive_replies(stopper):
    reports: list[StopReport] = []
    threads = [threading.Thread(target=lambda: reports.append(stopper.stop_all())) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LONG_S)
    assert [report.is_confirmed for report in reports] == [True, True]


@pytest.mark.parametrize("how", ["obeys", "computes for ever", "was killed"])
def test_robots_stay_stopped_regardless_of_the_program(master, stopper, robots, how):
    """A program whose robot has confirmed the stop must not move it again."""
    robots[0].slow = {"say"} if how == "obeys" else set()
    power = number(9)
    for _ in range(3):
        power = block("values_arithmetic", A=number(9), SIGN="**", B=power)
    hard = block("control_repeat", TIMES=power, BODY=[])
    program = compile_behaviour(workspace(started(say("Hi"), hard)), [robots[0].described])
    runner = Runner(lambda event: None)
    runner.start(program, [robots[0].described.source], master.address)
    with robots[0].changed:
        assert robots[0].changed.wait_for(lambda: bool(robots[0].heard("invoke")), LONG_S)
    if how == "was killed":
        psutil.Process(runner.pid).kill()  # kill() works on Windows, too
    stopper.send_stop()
    runner.stop()
    report = stopper.stop_all()
    runner.close()
    assert report.is_confirmed
    operations = [command["op"] for command in robots[0].commands]
    assert operations[-1] == "stop"
    assert "invoke" not in operations[operations.index("stop") :]
