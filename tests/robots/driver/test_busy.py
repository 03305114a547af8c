"""Tests of busy robots: the policies queue, replace and reject, and cancel and stop of queued actions."""

from __future__ import annotations

from tests.robots.conftest import Ears, eventually


def first_answer(ears: Ears, wanted: str) -> dict[str, object]:
    eventually(lambda: ears.answers(wanted))
    return ears.answers(wanted)[0]


def test_queue_waits_for_running_and_queued_actions(turtle) -> None:
    body, ears, _ = turtle
    ears.invoke("1", "say", text="one")
    ears.invoke("2", "say", text="two")
    ears.invoke("3", "say", text="three")
    assert "waits_for" not in first_answer(ears, "1")
    assert first_answer(ears, "2")["waits_for"] == ["say"]
    assert first_answer(ears, "3")["waits_for"] == ["say"]
    body.go_on.set()
    assert ears.final("3")["state"] == "succeeded"
    assert [text for _, text in body.done] == ["one", "two", "three"]
    assert ears.states("2") == ["accepted", "running", "succeeded"]


def test_replace_cancels_the_running_action_and_both_replies_report_the_replacement(turtle) -> None:
    body, ears, _ = turtle
    ears.invoke("1", "move", distance=1)
    eventually(lambda: body.moving)
    ears.invoke("2", "move", distance=0.5)
    assert first_answer(ears, "2")["replaces"] == ["move"]
    ended = ears.final("1")
    assert (ended["state"], ended["error"]) == ("canceled", "replaced by move")
    body.go_on.set()
    assert ears.final("2")["output"] == {"moved": 0.5}
    assert body.done == [("move", 0.5)]


def test_replace_also_cancels_queued_actions(turtle) -> None:
    body, ears, _ = turtle
    ears.invoke("1", "ignore")  # ignores its cancellation, so later actions are queued
    eventually(lambda: ears.states("1") == ["accepted", "running"])
    ears.invoke("2", "ignore")
    ears.invoke("3", "move", distance=1)
    assert first_answer(ears, "2")["waits_for"] == ["ignore"]
    assert ears.final("2") == {**ears.final("2"), "state": "canceled", "error": "replaced by move"}
    assert ears.states("2") == ["accepted", "canceled"]  # the queued action never ran
    body.go_on.set()
    assert ears.final("3")["state"] == "succeeded"


def test_rejection_names_the_action_that_keeps_the_robot_busy(turtle) -> None:
    body, ears, _ = turtle
    ears.invoke("1", "move", distance=1)
    eventually(lambda: body.moving)
    ears.invoke("2", "dig", times=2)
    refused = ears.final("2")
    assert (refused["state"], refused["error"]) == ("failed", "dig: Turtle is busy with move")
    assert ears.states("2") == ["failed"]
    body.go_on.set()
    assert ears.final("1")["state"] == "succeeded"
    ears.invoke("3", "dig", times=2)
    assert ears.final("3")["state"] == "succeeded"


def test_queued_action_is_canceled_without_running(turtle) -> None:
    body, ears, _ = turtle
    ears.invoke("1", "say", text="one")
    ears.invoke("2", "say", text="two")
    ears.invoke("3", "say", text="three")
    first_answer(ears, "3")
    ears.command(id="2", op="cancel")
    assert ears.final("2")["state"] == "canceled"
    body.go_on.set()
    assert ears.final("3")["state"] == "succeeded"
    assert [text for _, text in body.done] == ["one", "three"]


def test_stop_clears_the_queue(turtle) -> None:
    body, ears, _ = turtle
    for wanted in ("1", "2", "3"):
        ears.invoke(wanted, "say", text=wanted)
    first_answer(ears, "3")
    ears.command(id="s", op="stop")
    assert ears.final("s", "stop")["state"] == "succeeded"
    assert [ears.final(wanted)["state"] for wanted in "123"] == ["canceled"] * 3
    body.go_on.set()
    ears.invoke("4", "say", text="4")
    assert ears.final("4")["state"] == "succeeded"
    assert body.done == [("say", "4")]


def test_timeout_starts_when_the_action_runs_and_not_while_queued(turtle) -> None:
    body, ears, clock = turtle
    ears.invoke("1", "ignore")
    ears.invoke("2", "ignore")
    first_answer(ears, "2")
    clock.advance(5.1)  # beyond the first one's timeout; it ignores its cancellation
    ears.invoke("3", "light")
    ears.final("3")
    clock.advance(1.1)  # so the driver replies for the action
    assert ears.final("1")["error"] == (
        "Turtle may still move: ignore is still running (ignore took longer than 5 s)"
    )
    assert ears.states("2") == ["accepted"]
    body.go_on.set()
    assert ears.final("2")["state"] == "succeeded"


def test_heartbeat_is_sent_only_while_an_action_runs(turtle) -> None:
    body, ears, clock = turtle

    def beats() -> int:
        return sum(1 for answer in list(ears.heard["answer"]) if answer["op"] == "alive")

    ears.invoke("1", "say", text="one")
    eventually(lambda: beats() == 1)
    clock.advance(0.6)
    eventually(lambda: beats() == 2)
    body.go_on.set()
    ears.final("1")
    told = beats()
    clock.advance(5)
    ears.invoke("2", "light")
    ears.final("2")
    assert beats() <= told + 1


# ---- program heartbeats ----------------------------------------------------------------------------


def test_missing_heartbeat_of_an_idle_program_does_not_stop_the_robot(turtle) -> None:
    body, ears, clock = turtle
    ears.invoke("1", "light", program="tried")
    ears.final("1")
    ears.invoke("2", "move", program="running", distance=1)
    eventually(lambda: body.moving)
    for number in range(20):
        clock.advance(0.2)
        ears.command(op="alive", id=f"a{number}", **{"from": "running"})
        ears.invoke(f"l{number}", "light")
        ears.final(f"l{number}")  # the robot has checked the clock
    assert body.stops == 0
    body.go_on.set()
    assert ears.final("2")["state"] == "succeeded"


def test_missing_heartbeat_of_a_program_with_a_running_action_stops_the_robot(turtle) -> None:
    body, ears, clock = turtle
    ears.invoke("1", "move", program="running", distance=1)
    eventually(lambda: body.moving)
    clock.advance(1.1)
    ended = ears.final("1")
    assert (ended["state"], ended["error"]) == ("canceled", "its program hasn't responded for 1 s")
    eventually(lambda: body.stops >= 1)
