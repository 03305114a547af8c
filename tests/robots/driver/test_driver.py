"""Tests of the driver kit with a robot whose functions return when the test allows it."""

from __future__ import annotations

import threading

import pytest

import nep
from app.core.run.control import STOP_TIMEOUT_S
from app.robots.driver.driver import Driver
from app.robots.driver.task import ProgramId, Task
from app.robots.driver.tasks import STOP_REPLY_TIMEOUT_S, Watchdog
from app.robots.identity import program_of
from app.robots.kit import Failed
from tests.robots.conftest import TURTLE, Ears, eventually


def test_late_subscriber_receives_the_description_and_the_rize_ready_message(turtle, node):
    _, _, _ = turtle
    with nep.node("late", "memory") as late:
        message = late.new_sub("/Turtle/description", "robot/description").receive(30.0)
        assert message is not None
        assert message.payload["title"] == "Turtle"
        assert late.graph().topics["/Turtle/description"].msg_type == "robot/description"
        ready = late.new_sub("rize_event").receive(30.0)
        assert ready is not None
        assert ready.payload == {"robot": "ready", "name": "Turtle"}


def test_action_is_accepted_runs_and_succeeds(turtle):
    body, ears, _ = turtle
    ears.invoke("1", "move", distance=1)
    eventually(lambda: {"moved": 0.0} in [a["feedback"] for a in ears.answers("1")])
    assert ears.states("1") == ["accepted", "running", "running"]
    body.go_on.set()
    answer = ears.final("1")
    assert answer == {
        "id": "1", "op": "invoke", "action": "move", "state": "succeeded",
        "output": {"moved": 1.0}, "feedback": {}, "error": None,
    }  # fmt: skip
    assert body.done == [("move", 1.0)]
    assert isinstance(body.done[0][1], float)


def test_invalid_commands_are_rejected_without_calling_a_function(turtle):
    body, ears, _ = turtle
    ears.invoke("1", "move", distance=3)
    assert ears.final("1")["error"] == "move: distance must be between -2 and 2 m"
    ears.invoke("2", "mov")
    assert ears.final("2")["error"] == "Turtle can't “mov”; did you mean “move”?"
    ears.command(id="3", op="dance")
    assert ears.final("3", "dance")["error"].startswith("unknown operation “dance”")
    ears.command(id="4", op="invoke", action="say", input="text")
    assert ears.final("4")["error"] == "say: the input must be an object with named values"
    assert body.done == []
    assert ears.states("1") == ["failed"]


def test_malformed_messages_on_the_command_topic_are_ignored(turtle, node):
    _, ears, _ = turtle
    noise = node.new_pub("/Turtle/command", "robot/command")
    for payload in (None, 5, [], "x", {}, {"id": 5, "op": "invoke"}, {"id": "x" * 300, "op": "invoke"}):
        noise.publish(payload)
    node.new_pub("/Turtle/command", "string").publish("{no json")
    ears.invoke("1", "dig")
    assert ears.final("1")["state"] == "succeeded"


def test_exception_in_a_function_is_reported_as_failure(turtle, caplog):
    body, ears, _clock = turtle
    ears.invoke("1", "fail")
    assert (ears.final("1")["state"], ears.final("1")["error"]) == ("failed", "no fuel")
    body.breaks = ValueError("no file 'a\udcff'")
    ears.invoke("3", "fail", how="broken")
    assert ears.final("3")["error"] == "fail failed: no file 'a\\udcff'"
    body.breaks = ZeroDivisionError()
    ears.invoke("2", "fail", how="broken")
    assert ears.final("2")["error"] == "fail failed: ZeroDivisionError"


def test_cancel_ends_running_and_queued_actions(turtle):
    body, ears, _ = turtle
    ears.invoke("1", "say", text="a")
    ears.invoke("2", "say", text="b")
    eventually(lambda: ears.states("2") == ["accepted"] and "running" in ears.states("1"))
    ears.command(id="2", op="cancel")
    assert ears.final("2")["state"] == "canceled"
    ears.command(id="1", op="cancel")
    assert ears.final("1")["state"] == "canceled"
    ears.command(id="9", op="cancel")
    assert ears.final("9", "cancel")["error"] == "no running task has this id"
    assert body.done == []


def test_action_that_exceeds_its_timeout_fails(turtle):
    _, ears, clock = turtle
    ears.invoke("1", "move")
    eventually(lambda: "running" in ears.states("1"))
    clock.advance(5.1)
    assert ears.final("1")["error"] == "move took longer than 5 s"


def test_action_that_ignores_its_timeout_fails_and_keeps_its_resource_until_it_ends(turtle):
    body, ears, clock = turtle
    ears.invoke("1", "ignore")
    eventually(lambda: "running" in ears.states("1"))
    clock.advance(5.1)
    eventually(lambda: clock.advance(0.2) or "failed" in ears.states("1"))
    ears.invoke("2", "dig")  # its resource is still in use
    assert ears.final("2")["error"] == "dig: Turtle is busy with ignore"
    body.go_on.set()
    eventually(lambda: ears.invoke("3", "dig") or "succeeded" in ears.states("3"))
    assert ears.states("1").count("failed") == 1


def test_busy_policies_queue_replace_and_reject(turtle):
    body, ears, _ = turtle
    ears.invoke("1", "say", text="one")
    ears.invoke("2", "say", text="two")
    ears.invoke("3", "move")
    eventually(lambda: "running" in ears.states("3") and "running" in ears.states("1"))
    assert ears.states("2") == ["accepted"]
    ears.invoke("4", "dig")
    assert ears.final("4")["error"] == "dig: Turtle is busy with move"
    ears.invoke("5", "move", distance=1)
    replaced = ears.final("3")
    assert (replaced["state"], replaced["error"]) == ("canceled", "replaced by move")
    eventually(lambda: "running" in ears.states("5"))
    body.go_on.set()
    assert ears.final("2")["state"] == "succeeded"
    assert [entry for entry in body.done if entry[0] == "say"] == [("say", "one"), ("say", "two")]


def test_omitted_parameter_has_its_default_value(turtle):
    body, ears, _ = turtle
    ears.invoke("1", "light", colour="#102030")
    assert ears.final("1")["state"] == "succeeded"
    assert body.done == [("light", "#102030", True)]


def test_duplicate_command_runs_once(turtle):
    body, ears, _ = turtle
    ears.invoke("1", "say", text="once")
    ears.invoke("1", "say", text="once")
    body.go_on.set()
    ears.final("1")
    ears.invoke("2", "dig")
    ears.final("2")
    assert body.done.count(("say", "once")) == 1


def test_queued_actions_beyond_the_limit_are_rejected(turtle):
    _, ears, _ = turtle
    for number in range(60):
        ears.invoke(str(number), "say", text="x")
    assert "other actions are already waiting" in str(ears.final("59")["error"])


# ---- stop -----------------------------------------------------------------------------------------


def test_stop_is_answered_only_after_the_robot_has_stopped(turtle):
    body, ears, _ = turtle
    body.may_stop.clear()
    for wanted, action, given in (
        ("1", "move", {}),
        ("2", "say", {"text": "a"}),
        ("3", "say", {"text": "b"}),
    ):
        ears.invoke(wanted, action, **given)
    eventually(lambda: body.moving)
    ears.command(id="s", op="stop")
    assert [ears.final(wanted)["state"] for wanted in "123"] == ["canceled"] * 3
    assert ears.states("s") == []
    ears.command(id="t", op="stop")
    ears.invoke("4", "move")
    assert ears.final("4")["error"] == "move: Turtle is stopping"
    body.may_stop.set()
    assert ears.final("s", "stop")["state"] == "succeeded"
    assert ears.final("t", "stop")["state"] == "succeeded"
    assert not body.moving
    # Twice if the function began before the last action ended; both stops share the calls.
    assert 1 <= body.stops == body.stop_calls <= 2


def test_stop_that_does_not_end_an_action_is_reported_as_failed(turtle):
    body, ears, clock = turtle
    ears.invoke("1", "ignore")
    eventually(lambda: "running" in ears.states("1"))
    ears.command(id="s", op="stop")
    eventually(lambda: body.stops >= 1)
    clock.advance(STOP_REPLY_TIMEOUT_S + 0.01)
    still = "Turtle may still move: ignore is still running"
    assert ears.final("s", "stop")["error"] == still
    assert (ears.final("1")["state"], ears.final("1")["error"]) == ("failed", still)
    ears.invoke("2", "light")  # needs no busy resource, but is rejected all the same
    assert ears.final("2")["error"] == f"light: {still}"
    beats = [a for a in ears.heard["answer"] if a["op"] == "alive"]
    assert (beats[-1]["not_ended"], beats[-1]["error"]) == (["ignore"], still)
    body.go_on.set()
    eventually(lambda: [a["not_ended"] for a in ears.heard["answer"] if a["op"] == "alive"][-1] == [])
    assert body.stops == 2  # the running action may have moved the robot after the first stop
    ears.invoke("3", "light")
    assert ears.final("3")["state"] == "succeeded"
    ears.command(id="t", op="stop")
    assert ears.final("t", "stop")["state"] == "succeeded"
    assert ears.states("1").count("failed") == 1
    assert len(ears.states("s")) == 1


def test_failing_stop_function_reports_its_reason(turtle, caplog):
    body, ears, _ = turtle
    body.stop_fails = Failed("the brake does not answer")
    ears.command(id="s", op="stop")
    answer = ears.final("s", "stop")
    assert (answer["state"], answer["error"]) == (
        "failed",
        "Turtle may still move: the brake does not answer",
    )
    assert caplog.records == []  # no traceback for an expected failure
    body.stop_fails = None
    ears.command(id="t", op="stop")
    assert ears.final("t", "stop")["state"] == "succeeded"


class SpeechlessError(Exception):
    """Exception whose `__str__` raises."""

    def __str__(self) -> str:
        raise RuntimeError("no words")


@pytest.mark.parametrize(
    "how", [SystemExit(3), KeyboardInterrupt(), GeneratorExit(), SpeechlessError()], ids=repr
)
def test_function_that_exits_the_program_is_reported_and_the_robot_can_be_stopped(turtle, how):
    body, ears, _ = turtle
    body.breaks = how
    ears.invoke("1", "fail", how="broken")
    answer = ears.final("1")
    assert (answer["state"], str(answer["error"]).startswith("fail failed: ")) == ("failed", True)
    body.stop_fails = how
    ears.command(id="s", op="stop")
    assert str(ears.final("s", "stop")["error"]).startswith(
        "Turtle may still move: the stop command failed: "
    )
    body.stop_fails = None
    ears.command(id="t", op="stop")
    assert ears.final("t", "stop")["state"] == "succeeded"


def test_hanging_stop_is_reported_to_each_caller_and_commands_are_rejected(turtle):
    body, ears, clock = turtle
    body.may_stop.clear()
    ears.command(id="s", op="stop")
    eventually(lambda: clock.advance(0.1) or ears.states("s"))
    said = "Turtle may still move: the stop function is still running"
    assert ears.final("s", "stop")["error"] == said
    ears.invoke("1", "light")
    assert ears.final("1")["error"] == f"light: {said}"
    ears.command(id="t", op="stop")
    eventually(lambda: clock.advance(0.1) or ears.states("t"))
    assert ears.final("t", "stop")["error"] == said
    body.may_stop.set()
    eventually(lambda: [a["not_ended"] for a in ears.heard["answer"] if a["op"] == "alive"][-1] == [])
    ears.invoke("2", "light")
    assert ears.final("2")["state"] == "succeeded"


def test_stop_reply_timeout_is_at_most_half_of_the_studio_timeout():
    assert 0 < STOP_REPLY_TIMEOUT_S <= STOP_TIMEOUT_S / 2


def test_late_command_of_a_stopped_program_is_canceled(turtle):
    """A command that was in flight when its program was ended arrives after the stop."""
    body, ears, _ = turtle
    ears.command(id="s", op="stop", ends="key")
    assert ears.final("s", "stop")["state"] == "succeeded"
    ears.invoke("1", "move", program=program_of("key"))
    assert ears.final("1")["state"] == "canceled"
    assert not body.moving
    ears.invoke("2", "say", program="p2", text="hi")
    body.go_on.set()
    assert ears.final("2")["state"] == "succeeded"


def test_stop_with_a_forged_program_name_blocks_no_program(turtle):
    """Program names are public: a name alone, or text similar to it, must not end a program."""
    body, ears, _ = turtle
    name = program_of("key")
    for number, ends in enumerate((name, "studio", "", name[8:], "x" * 100_000)):
        ears.command(id=f"s{number}", op="stop", ends=ends)
        assert ears.final(f"s{number}", "stop")["state"] == "succeeded"
    body.go_on.set()
    for number, program in enumerate((name, "studio")):
        ears.invoke(f"{number}", "say", program=program, text="hi")
        assert ears.final(f"{number}")["state"] == "succeeded"


def test_stop_can_be_invoked_as_an_action(turtle):
    body, ears, _ = turtle
    ears.invoke("1", "stop")
    assert ears.final("1")["state"] == "succeeded"
    assert body.stops == 1


def test_missing_heartbeat_stops_the_robot(turtle):
    body, ears, clock = turtle
    ears.invoke("1", "move", program="p")
    eventually(lambda: body.moving)
    for number in range(4):  # with heartbeats, nothing happens
        clock.advance(0.6)
        ears.command(op="alive", **{"from": "p"})
        ears.invoke(f"d{number}", "fail")  # its reply proves that the heartbeat was processed
        ears.final(f"d{number}")
    assert body.stops == 0
    clock.advance(1.1)
    assert ears.final("1")["error"] == "its program hasn't responded for 1 s"
    eventually(lambda: body.stops >= 1)
    assert not body.moving


def told_of_itself(ears):
    """Return `not_ended` and `error` of the newest heartbeat, or None before the first."""
    signs = [a for a in list(ears.heard["answer"]) if a["op"] == "alive"]
    return (signs[-1]["not_ended"], signs[-1]["error"]) if signs else None


def test_failed_watchdog_stop_is_reported_until_a_stop_succeeds(turtle, caplog):
    """A watchdog stop has no caller to reply to, so its failure is reported in the heartbeats."""
    body, ears, clock = turtle
    body.stop_fails = Failed("the brake does not answer")
    ears.invoke("1", "move", program="p")
    eventually(lambda: body.moving)
    clock.advance(1.1)
    still = (["the stop function"], "Turtle may still move: the brake does not answer")
    eventually(lambda: told_of_itself(ears) == still)
    assert [record.getMessage() for record in caplog.records] == [still[1]]
    count = len(ears.heard["answer"])
    eventually(lambda: clock.advance(0.1) or len(ears.heard["answer"]) > count + 1)  # for late subscribers
    assert told_of_itself(ears) == still
    body.stop_fails = Failed("the brake is stuck")
    ears.command(id="s", op="stop")
    assert ears.final("s", "stop")["error"] == "Turtle may still move: the brake is stuck"
    eventually(lambda: told_of_itself(ears) == (still[0], "Turtle may still move: the brake is stuck"))
    body.stop_fails = None
    ears.command(id="t", op="stop")
    assert ears.final("t", "stop")["state"] == "succeeded"
    eventually(lambda: told_of_itself(ears) == ([], None))


def test_hanging_watchdog_stop_is_reported(turtle):
    body, ears, clock = turtle
    body.may_stop.clear()
    ears.invoke("1", "move", program="p")
    eventually(lambda: body.moving)
    clock.advance(1.1)
    still = (["the stop function"], "Turtle may still move: the stop function is still running")
    eventually(lambda: clock.advance(0.1) or told_of_itself(ears) == still)
    body.may_stop.set()
    eventually(lambda: told_of_itself(ears) == ([], None))


def test_stop_that_hangs_and_then_fails_is_reported(turtle):
    body, ears, clock = turtle
    body.may_stop.clear()
    ears.command(id="s", op="stop")
    eventually(lambda: clock.advance(0.1) or ears.states("s"))
    body.stop_fails = Failed("the brake is stuck")
    body.may_stop.set()
    still = (["the stop function"], "Turtle may still move: the brake is stuck")
    eventually(lambda: told_of_itself(ears) == still)


def test_failed_stop_on_driver_close_is_logged(node, caplog):
    with Driver(TURTLE, "Turtle", node) as driver:
        driver.body.stop_fails = Failed("the brake is stuck")
    assert [record.getMessage() for record in caplog.records] == ["Turtle may still move: the brake is stuck"]


def test_forged_heartbeat_does_not_keep_the_robot_moving(turtle, node):
    body, ears, clock = turtle
    attacker = node.new_pub("/Turtle/command", "robot/command")
    ears.invoke("1", "move", program="p")
    eventually(lambda: body.moving)
    for number in range(3):
        clock.advance(0.4)
        attacker.publish({"op": "alive", "id": f"a{number}", "from": "p"})
        attacker.publish({"op": "invoke", "id": f"i{number}", "action": "fail", "input": {}, "from": "p"})
        ears.final(f"i{number}")  # the forged heartbeat was processed before it
    assert ears.final("1")["error"] == "its program hasn't responded for 1 s"
    eventually(lambda: body.stops >= 1)
    assert not body.moving


def test_forged_heartbeat_does_not_prevent_the_watchdog_stop_after_an_action():
    """A motion that continues after its action belongs to the program that started it, not to its name."""
    dog = Watchdog(1.0)
    program, forger = ProgramId("p", 1), ProgramId("p", 2)
    drive = Task(
        "1",
        "drive",
        lambda _call: None,
        lambda _answer: None,
        ("base",),
        program=program,
        continues_after_success=True,
    )
    dog.record_heartbeat(program, 0.0, watch=True)
    dog.record_success(drive)
    dog.record_heartbeat(forger, 0.9, watch=True)
    assert not dog.check_expired(0.95, [])
    assert dog.check_expired(1.0, [])


def test_another_program_cannot_cancel_an_action_but_can_stop_the_robot(turtle, node):
    body, ears, _ = turtle
    attacker = node.new_pub("/Turtle/command", "robot/command")
    ears.invoke("1", "move", program="p")
    eventually(lambda: body.moving)
    attacker.publish({"op": "cancel", "id": "1", "action": "move", "from": "p"})
    refused = ears.final("1", "cancel")
    assert (
        refused["error"]
        == "only the program that started “move” can cancel it; any program can stop the robot"
    )
    assert body.moving
    attacker.publish({"op": "stop", "id": "s"})
    assert ears.final("s", "stop")["state"] == "succeeded"
    assert not body.moving


def test_command_backlog_is_bounded_and_a_stop_is_still_executed(node, clock):
    gate = threading.Event()
    with nep.node("listener", "memory") as other, Driver(TURTLE, "Turtle", node, clock=clock) as driver:
        ears = Ears(other, "Turtle")
        tasks = driver._tasks
        tasks.call_soon(gate.wait)
        for number in range(2500):
            ears.command(op="alive", id=f"a{number}")
        assert tasks.backlog <= 2001
        for number in range(2500):
            ears.command(op="stop", id=f"s{number}")
        assert tasks.backlog <= 4001
        gate.set()
        assert ears.final("s0", "stop")["state"] == "succeeded"
        assert driver.body.stops >= 1


def test_watchdog_ignores_programs_without_running_actions_and_stopped_programs(turtle):
    body, ears, clock = turtle
    ears.command(op="alive", **{"from": "looker"})
    ears.invoke("1", "dig", program="p")
    ears.final("1")
    ears.command(id="s", op="stop", **{"from": "p"})
    ears.final("s", "stop")
    clock.advance(10)
    ears.invoke("2", "dig")
    ears.final("2")
    assert body.stops == 1


def test_driver_close_stops_the_robot_and_cancels_the_running_action_with_the_reason(node, clock):
    with nep.node("listener", "memory") as other:
        ears = Ears(other, "Turtle")
        driver = Driver(TURTLE, "Turtle", node, clock=clock)
        driver.start()
        body = driver.body
        ears.invoke("1", "move")
        eventually(lambda: body.moving)
        driver.close()
        driver.close()
        assert ears.final("1")["error"] == "the driver is shutting down"
        assert (body.moving, body.stops >= 1, body.is_closed) == (False, True, True)
        eventually(lambda: not other.graph().topics["/Turtle/answer"].publishers)


# ---- sensors and events ---------------------------------------------------------------------------


def test_sensors_and_events_are_published_with_blackboard_entries(turtle):
    body, ears, _ = turtle
    bumps = ears.listen("bumped")
    board = ears.listen("board", topic="/blackboard")
    body.link.sense("battery", 84)
    assert ears.listen("battery") is not None  # latched: received although published earlier
    body.link.happen("bumped", side="left")
    eventually(lambda: bumps and board and ears.heard["battery"])
    assert ears.heard["battery"] == [{"value": 84}]
    assert bumps == [{"side": "left"}]
    assert board == [{"primitive": "bumpers", "input": {"left": 1}, "robot": "Turtle"}]
    with pytest.raises(KeyError):
        body.link.sense("speed", 1)
