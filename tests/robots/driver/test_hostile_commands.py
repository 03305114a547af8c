"""Tests that a robot stops and replies to the next command after any hostile message."""

from __future__ import annotations

import asyncio
import ctypes
import json
import threading

import pytest

import nep
from app.robots.client.heartbeat import Heartbeat
from app.robots.description.inputs import Parameter, input_problems
from app.robots.driver.driver import Driver, EventLoop
from app.robots.driver.receiver import MAX_COMMAND_BYTES
from tests import hostile
from tests.robots.conftest import TURTLE, Ears, eventually

COMMAND = {"id": "h", "op": "invoke", "action": "say", "from": "p", "input": {"text": "hi"}, "ends": "key"}
RIZE = {
    "node": "action",
    "robots": ["Turtle", "Ann"],
    "state": "idle",
    "primitives": [{"primitive": "say", "input": "hi", "options": {"contextual": True}}],
}


def stops(ears: Ears, wanted: str) -> bool:
    ears.command(id=wanted, op="stop")
    return ears.final(wanted, "stop")["state"] == "succeeded"


def test_robot_stops_and_runs_an_action_after_hostile_messages(turtle, node):
    """Issue 26: one message of 2 kB with 1000 levels ended the thread that executes stops."""
    body, ears, _clock = turtle
    threads = set(threading.enumerate())
    senders = {
        node.new_pub("/Turtle/command", "robot/command"): hostile.payloads(COMMAND),
        node.new_pub("robot_action", "json"): hostile.payloads(RIZE),
    }
    body.go_on.set()
    for sender, payloads in senders.items():
        for number, payload in enumerate(payloads):
            sender.publish_bytes(payload)
            if number % 20 == 0:
                assert stops(ears, f"s{number} {sender.topic}")
    assert stops(ears, "last")
    ears.invoke("1", "dig")
    assert ears.final("1")["state"] == "succeeded"
    assert threads <= set(threading.enumerate())


def test_moving_robot_can_be_stopped_after_a_deeply_nested_command(turtle, node):
    body, ears, _clock = turtle
    ears.invoke("1", "move")
    eventually(lambda: body.moving)
    deep = b'{"op":"invoke","id":"z","from":"e","action":' + b"[" * 1000 + b"]" * 1000 + b"}"
    node.new_pub("/Turtle/command", "robot/command").publish_bytes(deep)
    assert stops(ears, "s")
    assert not body.moving


def test_deeply_nested_rize_message_does_not_disable_the_robots_named_in_its_header(node, clock):
    deep = (
        b'{"node":"action","robots":["Ann","Bob"],"state":"idle","primitives":{"primitive":'
        + b"[" * 1000
        + b"]" * 1000
        + b"}}"
    )
    with (
        nep.node("listener", "memory") as other,
        Driver(TURTLE, "Ann", node, clock=clock),
        Driver(TURTLE, "Bob", node, clock=clock),
    ):
        ann, bob = Ears(other, "Ann"), Ears(other, "Bob")
        node.new_pub("robot_action", "json").publish_bytes(deep)
        assert stops(ann, "1")
        assert stops(bob, "2")


def test_command_of_more_than_64_kb_is_rejected_with_a_message(turtle, caplog):
    body, ears, _clock = turtle
    ears.invoke("1", "say", text="a" * MAX_COMMAND_BYTES)
    assert ears.final("1")["error"] == "the message is 64 kB in size; the limit is 64 kB"
    ears.rize({"node": "action", "robots": "Turtle", "primitives": [], "pad": "x" * MAX_COMMAND_BYTES})
    assert stops(ears, "s")
    assert len([record for record in caplog.records if "rejected" in record.getMessage()]) == 1
    assert body.done == []


def test_unknown_input_names_beyond_a_limit_are_reported_as_a_number():
    """Issue 26: the search for a similar name for each of 200 000 names took 3.5 s."""
    parameters = (Parameter("text", "text", "text"),)
    given = {"text": "hi"} | {f"text{number}": 1 for number in range(20_000)}
    problems = input_problems(parameters, given)
    assert len(problems) < 10
    assert problems[-1].message == "19995 more names are unknown"
    assert input_problems(parameters, {"txt": "hi"})[0].message == "unknown name “txt”; did you mean “text”?"


@pytest.fixture
def busy(node, clock):
    """Moving turtle whose command thread is blocked, its listener, and the event that unblocks the thread."""
    go_on = threading.Event()
    with nep.node("listener", "memory") as other, Driver(TURTLE, "Turtle", node, clock=clock) as driver:
        ears = Ears(other, "Turtle")
        ears.invoke("1", "move")
        eventually(lambda: driver.body.moving)
        driver._tasks.call_soon(go_on.wait)
        yield driver, ears, go_on
        go_on.set()
        driver.body.go_on.set()


def test_stop_is_executed_while_the_command_thread_is_busy(busy):
    driver, ears, go_on = busy
    ears.command(id="s", op="stop")
    eventually(lambda: driver.body.stops >= 1 and not driver.body.moving)
    go_on.set()
    assert ears.final("s", "stop")["state"] == "succeeded"


@pytest.mark.parametrize("how", ["native", "action", "rize"])
def test_commands_received_before_a_stop_are_not_run_after_the_stop(busy, how):
    driver, ears, go_on = busy
    for number in range(100):
        ears.invoke(f"q{number}", "light")
    if how == "native":
        ears.command(id="s", op="stop")
    elif how == "action":
        ears.invoke("s", "stop")
    else:
        ears.rize({"node": "action", "robots": "Turtle", "id": "r", "primitives": {"primitive": "leds"}})
        stop = {"primitive": "stop", "input": "", "options": "none"}
        ears.rize({"node": "action", "robots": ["Turtle"], "id": "s", "primitives": stop})
    eventually(lambda: driver.body.stops >= 1 and not driver.body.moving)
    go_on.set()
    answers = [ears.final(f"q{number}") for number in range(100)]
    if how != "rize":  # messages on different topics have no common order
        assert {answer["state"] for answer in answers} == {"canceled"}
        assert driver.body.done == []
        assert ears.final("s", "stop" if how == "native" else "invoke")["state"] == "succeeded"
    else:
        answered = ears.heard["action_state"]
        eventually(lambda: ("s", "success") in [(each["id"], each["state"]) for each in answered])
        assert ("r", "success") not in [(each["id"], each["state"]) for each in answered]
    eventually(lambda: ears.invoke("after", "light") or "succeeded" in ears.states("after"))


def test_command_after_a_stop_is_run(turtle):
    body, ears, _clock = turtle
    ears.command(id="s", op="stop")
    assert ears.final("s", "stop")["state"] == "succeeded"
    ears.invoke("1", "light")
    assert ears.final("1")["state"] == "succeeded"
    assert len(body.done) == 1


@pytest.mark.parametrize("order", [("id", "op", "ends"), ("ends", "op", "id")], ids=" ".join)
def test_large_stop_command_is_executed(busy, order):
    driver, ears, go_on = busy
    stop = {"id": "s", "op": "stop", "ends": "z" * 1_000_000}
    ears.command(**{name: stop[name] for name in order})
    eventually(lambda: driver.body.stops >= 1 and not driver.body.moving)
    go_on.set()
    assert ears.final("s", "stop")["state"] == "succeeded"


def test_stop_is_confirmed_only_by_a_stop_call_that_began_after_the_last_action(turtle):
    """An action that outlives the stop function may have moved the robot again."""
    body, ears, _clock = turtle
    ears.invoke("1", "ignore")
    eventually(lambda: "running" in ears.states("1"))
    ears.command(id="s", op="stop")
    eventually(lambda: body.stops == 1)
    assert ears.states("s") == []
    body.go_on.set()
    assert ears.final("s", "stop")["state"] == "succeeded"
    assert body.stops == 2


def test_stop_function_that_runs_while_an_action_ends_is_called_again(turtle):
    """The action may have moved the robot after the function had stopped its motors."""
    body, ears, _clock = turtle
    ears.invoke("1", "ignore")
    eventually(lambda: "running" in ears.states("1"))
    body.may_stop.clear()
    ears.command(id="s", op="stop")
    eventually(lambda: body.stop_calls == 1)
    body.go_on.set()
    assert ears.final("1")["state"] == "canceled"
    assert ears.states("s") == []
    body.may_stop.set()
    assert ears.final("s", "stop")["state"] == "succeeded"
    assert (body.stop_calls, body.stops) == (2, 2)


# ---- ended threads


def kill(name: str) -> threading.Thread:
    """Raise SystemExit in the thread with this name and return the thread."""
    thread = next(each for each in threading.enumerate() if each.name == name)
    assert ctypes.pythonapi.PyThreadState_SetAsyncExc(
        ctypes.c_ulong(thread.ident or 0), ctypes.py_object(SystemExit)
    )
    return thread


def test_killed_command_thread_stops_the_robot_and_restarts(turtle, caplog):
    body, ears, _clock = turtle
    ears.invoke("1", "move")
    eventually(lambda: body.moving)
    for count in range(1, 4):
        kill("Turtle commands")
        ears.command(id="wake", op="alive")  # the exception is raised when the thread's wait ends
        eventually(lambda count=count: body.stops >= count)
        assert ears.final("1")["error"] == "its driver had an internal error"
        assert stops(ears, f"s{count}")
    assert not body.moving
    ears.invoke("2", "dig")
    assert ears.final("2")["state"] == "succeeded"
    assert "Turtle commands failed (1 so far)" in caplog.text


def test_stop_works_after_the_thread_of_the_stop_function_was_killed(turtle):
    body, ears, _clock = turtle
    for count in range(1, 3):
        kill("Turtle stop")
        assert stops(ears, f"s{count}")
        assert body.stops >= count


def test_stops_from_many_threads_are_each_answered_once(node, clock):
    with Driver(TURTLE, "Other", node, clock=clock) as driver:
        answers: list[str] = []

        def stop() -> None:
            for _count in range(50):
                driver._tasks.stop(lambda answer: answers.append(answer.state))

        threads = [threading.Thread(target=stop) for _thread in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        eventually(lambda: len(answers) == 400)
        assert set(answers) == {"succeeded"}


@pytest.mark.parametrize("error", [ValueError(), RecursionError(), MemoryError(), SystemExit(3)], ids=repr)
def test_exception_in_a_queued_call_is_counted_and_the_next_call_runs(node, clock, error, caplog):
    with Driver(TURTLE, "Other", node, clock=clock) as driver:

        def fail() -> None:
            raise error

        other = Ears(node, "Other")
        count = 20 if isinstance(error, ValueError | RecursionError) else 3  # others restart the thread
        for _count in range(count):
            driver._tasks.call_soon(fail)
        eventually(lambda: driver._tasks.failures == count)
        assert stops(other, "s")
        assert len([record for record in caplog.records if record.exc_info]) == 1 + (count >= 10)
        other.invoke("1", "move")
        eventually(lambda: driver.body.moving)
        driver.body.go_on.set()
        assert other.final("1")["state"] == "succeeded"


def test_reply_callback_that_raises_does_not_block_other_stop_replies(node):
    with Driver(TURTLE, "Other", node) as driver:
        told: list[object] = []

        def fail(_answer: object) -> None:
            raise RuntimeError("no way back")

        driver._tasks.stop(fail)
        driver._tasks.stop(told.append)
        driver._tasks.stop(fail)
        eventually(lambda: told)


def test_async_stop_works_after_a_coroutine_ended_the_event_loop():
    loop = EventLoop("Bot")

    async def exit_program() -> None:
        raise SystemExit(3)

    async def act() -> None:
        spawned.append(asyncio.get_running_loop().create_task(exit_program()))

    async def stop() -> str:
        return "stopped"

    spawned: list[asyncio.Task[None]] = []
    loop.run(act())
    eventually(spawned[0].done)
    assert loop.run(stop(), within_s=30.0) == "stopped"
    loop.close()
    with pytest.raises(SystemExit):
        spawned[0].result()


def test_heartbeat_survives_a_publisher_that_raises():
    told = threading.Event()
    failures: list[BaseException] = [SystemExit(3), MemoryError(), ValueError()]

    def publish(_message: object) -> None:
        if failures:
            raise failures.pop()
        told.set()

    heart = Heartbeat("p", "heartbeat of the test")
    heart.start("Turtle", publish)
    assert told.wait(30.0)
    heart.close()


def test_world_message_that_makes_a_driver_raise_does_not_end_its_thread(node, clock):
    with Driver(TURTLE, "Turtle", node, clock=clock) as driver:
        heard: list[object] = []

        def changed(message: object) -> None:
            heard.append(message)
            raise SystemExit(3)

        driver.on_world(changed)
        world = node.new_pub("/Turtle/world", "json")
        for number in range(3):
            world.publish({"number": number})
        world.publish_bytes(json.dumps("n" * hostile.LONG_NAME_BYTES).encode())
        world.publish({"number": 3})
        eventually(lambda: len(heard) == 4)
        assert stops(Ears(node, "Turtle"), "s")
