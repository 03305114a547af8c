"""Tests of the six states of the run bar."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.core.run.view import RunState, duration_text, stop_text, view_of
from app.robots.client.stop_report import RobotStop, StopReport

PEPPER = RobotStop("Pepper", True, 38.2)
TURTLE = RobotStop("Turtle", True, 41.4)
SILENT = RobotStop("Turtle", False, None)
RIZE = RobotStop("Nao", False, None, can_confirm=False)


def after(*robots: RobotStop, elapsed_ms: float = 41.4, **values: object) -> RunState:
    good = all(robot.is_confirmed or not robot.can_confirm for robot in robots)
    state = RunState("proven" if good else "unanswered", "Greeting", report=StopReport(robots, elapsed_ms))
    return replace(state, **values)


def test_ready_state_names_the_robots() -> None:
    view = view_of(RunState(), ["Pepper", "Turtle"], 0)
    assert (view.title, view.detail) == ("Ready", "Pepper and Turtle are connected")
    assert (view.can_run, view.can_pause, view.can_step, view.is_stop_filled) == (True, False, True, True)
    assert view_of(RunState(), ["Pepper"], 0).detail == "Pepper is connected"
    alone = view_of(RunState(), [], 0)
    assert (alone.detail, alone.is_stop_filled) == ("No robot is connected", False)


def test_running_state_shows_elapsed_time_and_activity() -> None:
    run = RunState("running", "Greeting", description="Pepper says “Touch my head.”", started_s=100.0)
    view = view_of(run, ["Pepper"], 114.9)
    assert (view.title, view.detail) == ("Running, 14 s", "Pepper says “Touch my head.”")
    assert view.compact_text == "Greeting is running, 14 s"
    assert (view.can_run, view.can_pause, view.can_step) == (False, True, True)
    early = view_of(replace(run, is_started=False, description=""), ["Pepper"], 100.1)
    assert (early.title, early.detail, early.compact_text) == ("Starting", "", "Greeting is starting")
    assert (early.state, early.can_pause) == ("running", True)
    elsewhere = view_of(replace(run, is_started=False), ["Pepper"], 100.1, is_elsewhere=True)
    assert elsewhere.title == "Greeting is starting"


def test_paused_state_warns_of_actions_that_resume_will_skip() -> None:
    said = "Rover doesn't report how much of “drive” is left; Resume skips it"
    run = RunState("paused", "Greeting", paused_at="drive 2 m", warning=said)
    assert view_of(run, ["Rover"], 1.0).detail == said
    run = replace(run, warning="")
    assert view_of(run, ["Rover"], 1.0).detail == "Robots and timers are paused"


def test_elapsed_time_stops_while_paused() -> None:
    run = RunState("paused", "Greeting", paused_at="wait 2 s", started_s=100.0, pause_start_s=110.0)
    view = view_of(run, ["Pepper"], 200.0)
    assert (view.title, view.detail) == ("Paused at “wait 2 s”", "Robots and timers are paused")
    assert (view.run_label, view.can_run, view.can_step) == ("Resume", True, True)
    assert run.elapsed(200.0) == 10.0


def test_stopping_state_appears_after_100_ms_and_counts_replies() -> None:
    run = RunState(
        "stopping", "Greeting", stop_pressed_s=10.0, robots_to_stop=("Pepper", "Turtle"), elapsed_s=14.0
    )
    assert view_of(run, [], 10.05).stop_label == "Stop"
    run = replace(run, replies=(PEPPER,))
    view = view_of(run, [], 10.2)
    assert (view.title, view.detail) == ("Stopping", "Waiting for Turtle, 0.2 s")
    assert (view.stop_label, view.result) == ("Stopping", "1 of 2 robots stopped")
    assert not view.can_run


def test_repeated_stop_is_shown_as_stopping_at_once() -> None:
    run = RunState(
        "stopping", "Greeting", stop_pressed_s=10.0, robots_to_stop=("Pepper",), is_stop_repeated=True
    )
    view = view_of(run, [], 10.01)
    assert (view.state, view.title, view.stop_label) == ("stopping", "Stopping", "Stopping")


def test_confirmed_stop_shows_its_duration() -> None:
    view = view_of(after(PEPPER, TURTLE, elapsed_s=14.0, has_stopped_blocks=True), [], 0)
    assert (view.title, view.detail) == ("Stopped after 14 s", "It stopped at the dashed block")
    assert (view.result, view.result_status) == ("all 2 robots stopped (41 ms)", "ok")
    assert view.can_run
    assert view_of(after(PEPPER), [], 0).result == "Pepper stopped (41 ms)"


def test_reply_below_one_millisecond_is_not_shown_as_zero() -> None:
    assert view_of(after(PEPPER, elapsed_ms=0.2), [], 0).result == "Pepper stopped (1 ms)"


def test_unanswered_stop_names_the_robot_and_manual_action() -> None:
    view = view_of(after(PEPPER, SILENT), [], 0)
    assert (view.title, view.detail) == (
        "Turtle didn't reply",
        "Pepper stopped (38 ms). Switch Turtle off by hand.",
    )
    assert (view.result, view.result_status) == ("1 of 2 robots stopped", "error")
    assert (view.stop_label, view.confirm_label) == ("Stop again", "Turtle isn't moving")
    assert view.compact_text == "Turtle didn't reply; switch it off by hand"
    assert (view.can_run, view.can_pause, view.can_step) == (False, False, False)


def test_robot_message_is_shown_first() -> None:
    stuck = RobotStop("Arm", False, 9.0, error="Arm may still move: the brake is stuck", has_failed=True)
    view = view_of(after(PEPPER, stuck, SILENT), [], 0)
    assert view.title == "Arm may still move: the brake is stuck; Turtle didn't reply"
    assert view.detail == "Pepper stopped (38 ms). Switch Arm and Turtle off by hand."
    assert view.confirm_label == "Arm and Turtle aren't moving"
    twin = RobotStop("Arm", False, 9.0, error=stuck.error, has_failed=True, program="arm 2")
    assert view_of(after(twin), [], 0).title == "Arm may still move: the brake is stuck (from “arm 2”)"
    assert stop_text(stuck, "8:40") == "Arm may still move: the brake is stuck, at 8:40"


def test_long_list_of_silent_robots_is_shortened() -> None:
    many = [RobotStop("Pepper", False, None, program=f"copy {number}") for number in range(30)]
    title = view_of(after(*many), [], 0).title
    assert title.endswith("Pepper (“copy 3”) and 26 more didn't reply")
    refused = [
        RobotStop(f"R{n}", False, 1.0, error=f"R{n} may still move: no", has_failed=True) for n in range(9)
    ]
    assert view_of(after(*refused), [], 0).title.endswith("R3 may still move: no; 5 more may still move")


def test_confirm_button_is_shortened_for_long_names() -> None:
    long = RobotStop("The old blue robot in the entrance hall", False, None)
    view = view_of(after(PEPPER, long), [], 0)
    assert (view.title, view.confirm_label) == (f"{long.name} didn't reply", "It isn't moving")
    assert view_of(after(long, SILENT), [], 0).confirm_label == "They aren't moving"


def test_stop_result_counts_robots_not_their_programs() -> None:
    twin = RobotStop("Pepper", False, None, program="pepper 2")
    view = view_of(after(PEPPER, twin, TURTLE), [], 0)
    assert view.title == "Pepper (“pepper 2”) didn't reply"
    assert view.result == "1 of 2 robots stopped"
    assert view.detail == "Turtle stopped (41 ms). Switch Pepper off by hand."
    ears = RobotStop("Pepper", False, None, can_confirm=False, program="nep-topic-echo")
    view = view_of(after(PEPPER, ears), [], 0)
    assert view.result == "Pepper stopped (41 ms); Pepper (“nep-topic-echo”) can't confirm"
    both = RobotStop("Pepper", True, 3.0, program="pepper 2")
    assert view_of(after(PEPPER, both), [], 0).result == "Pepper stopped (41 ms)"


def test_robot_is_not_shown_as_stopped_while_its_other_program_is_pending() -> None:
    run = RunState("stopping", "Greeting", stop_pressed_s=10.0, robots_to_stop=("Pepper",))
    run = replace(run, replies=(replace(PEPPER, is_waiting=True),))
    view = view_of(run, [], 10.2)
    assert (view.detail, view.result) == ("Waiting for Pepper, 0.2 s", "Stop not confirmed")
    run = replace(run, replies=(*run.replies, RobotStop("Pepper", True, 90.0, program="pepper 2")))
    assert view_of(run, [], 10.2).result == "1 robot stopped"


def test_rize_robot_is_never_shown_as_stopped() -> None:
    view = view_of(after(RIZE), [], 0)
    assert view.result == "stop sent; Nao can't confirm"
    both = view_of(after(PEPPER, RIZE), [], 0)
    assert both.result == "Pepper stopped (41 ms); Nao can't confirm"


def test_finished_and_failed_programs_are_distinguished() -> None:
    assert view_of(after(PEPPER, is_finished=True, elapsed_s=3.0), [], 0).title == "Finished after 3 s"
    view = view_of(after(PEPPER, errors={"a": "“turn” needs a number."}, elapsed_s=3.0), [], 0)
    assert (view.title, view.detail) == ("Stopped after 3 s because of an error", "“turn” needs a number.")


def test_last_stop_stays_visible_while_running() -> None:
    run = RunState("running", "Greeting", last_stop_text="Pepper stopped (41 ms)")
    assert view_of(run, ["Pepper"], 1).last_stop == "Pepper stopped (41 ms)"


@pytest.mark.parametrize(
    ("value", "words"), [(0.9, "0 s"), (14.99, "14 s"), (60, "1 min 0 s"), (125, "2 min 5 s")]
)
def test_seconds_are_formatted(value: float, words: str) -> None:
    assert duration_text(value) == words


def test_stop_results_are_formatted() -> None:
    assert stop_text(PEPPER, "8:40") == "confirmed in 38 ms, at 8:40"
    assert stop_text(SILENT, "8:40") == "not confirmed, at 8:40"
    assert stop_text(RIZE, "8:40") == "sent at 8:40; this robot can't confirm"


@pytest.mark.parametrize(
    ("robots", "status"),
    [
        ((), "off"),
        ((PEPPER, TURTLE), "ok"),
        ((PEPPER, SILENT), "error"),
        ((RobotStop("Rosie", False, None, can_confirm=False),), "off"),
        ((PEPPER, RobotStop("Rosie", False, None, can_confirm=False)), "off"),
        ((PEPPER, RobotStop("Pepper", False, None, can_confirm=False, program="motor box")), "ok"),
    ],
)
def test_stop_report_status_is_ok_only_if_every_robot_confirmed(
    robots: tuple[RobotStop, ...], status: str
) -> None:
    assert StopReport(robots, 41.0).status == status


def test_program_without_robots_shows_its_end_without_stop_result() -> None:
    run = RunState("ready", "Greeting", elapsed_s=3.0, is_finished=True, report=StopReport((), 0.0))
    view = view_of(run, [], 0)
    assert (view.state, view.title, view.result, view.result_status) == (
        "ready",
        "Finished after 3 s",
        None,
        "off",
    )
