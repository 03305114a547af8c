"""Tests of robots that die, hang, send false replies or flood the network, and of the recovery from it.

The robots, the programs and the master are real processes and threads; only the window is missing.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType

import pytest

import nep
from app.core.network.mailbox import MAX_MESSAGES_PER_TOPIC
from app.core.robots.robot_link import Invocation, RobotLink
from app.core.session import Session
from app.robots.description.description import thing_description
from app.robots.turtle import ROBOT
from nep.masters.master import Master
from tests.blocks.samples import block, number, started, workspace
from tests.blocks.wire_robot import usual_time_limits
from tests.core.waiting import stop_unanswered, tick_until

ROOT = Path(__file__).parents[3]
FOUND_S = 60.0
SAID_S = 60.0  # silence is detected after 2 s; the rest is for busy computers

pytestmark = pytest.mark.skipif(os.name != "posix", reason="processes are frozen by signals of POSIX")


class Turtles:
    """Turtle robots in processes of their own."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._environment = {**os.environ, "NEP_MASTER": address, "PYTHONPATH": str(ROOT)}
        self._processes: list[subprocess.Popen[bytes]] = []

    def start(self) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "app.robots.turtle", "--name", "Turtle"]
        made = subprocess.Popen(command, cwd=ROOT, env=self._environment, stderr=subprocess.DEVNULL)
        self._processes.append(made)
        return made

    def close(self) -> None:
        for process in self._processes:
            process.kill()
            process.wait(SAID_S)


@pytest.fixture
def turtles(master: Master) -> Iterator[Turtles]:
    made = Turtles(master.address)
    yield made
    made.close()


def there(session: Session) -> RobotLink:
    def link() -> RobotLink | None:
        found = session.fleet.link("Turtle")
        ready = found is not None and found.is_connected and found.publisher is not None
        ready = ready and found.publisher.subscribers > 0
        return found if ready and session.stopper is not None and session.stopper.robots else None

    tick_until(session, link, FOUND_S)
    found = link()
    assert found is not None
    return found


def turns_for_long(session: Session) -> None:
    turn = block("robot_diffdrive_do_turn", "x", ROBOT="Turtle", ANGLE=number(360))
    again = block("robot_diffdrive_do_turn", "y", ROBOT="Turtle", ANGLE=number(-360))
    session.document.apply_edit(workspace(started(turn, again)))


def runs(session: Session, turtles: Turtles) -> None:
    turns_for_long(session)
    with nep.node("listener", master=turtles.address) as node:
        answers = node.new_sub("/Turtle/answer", "robot/answer")
        session.runs.run()
        tick_until(session, lambda: session.runs.running_blocks == ("x",), FOUND_S)
        tick_until(session, lambda: answers.listen()[0])  # without a first reply, the error message differs
    moving = lambda: "turns 360" in session.runs.view().detail  # noqa: E731
    tick_until(session, moving)


def says_so_at_the_block(session: Session) -> None:
    tick_until(session, lambda: session.runs.block_errors, SAID_S)
    assert session.runs.block_errors == {"x": "Turtle stopped responding. Start the virtual robot again."}


def well_again(session: Session, turtles: Turtles) -> None:
    """Confirm as a user that the robot stands still, then check that it can be used again."""
    there(session)
    session.runs.confirm_stopped()
    runs(session, turtles)
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state == "proven")
    assert session.runs.view().result_status == "ok"


def test_robot_killed_during_an_action_is_reported(session: Session, turtles: Turtles) -> None:
    process = turtles.start()
    there(session)
    runs(session, turtles)
    process.kill()
    with usual_time_limits():
        says_so_at_the_block(session)
        # A virtual robot is only a process: once it has ended, there is nothing to switch off.
        tick_until(session, lambda: session.runs.view().state == "ready", SAID_S)
    tick_until(session, lambda: not session.fleet.connected, FOUND_S)
    turtles.start()
    well_again(session, turtles)


def test_robot_that_hangs_during_an_action_is_reported(session: Session, turtles: Turtles) -> None:
    process = turtles.start()
    link = there(session)
    runs(session, turtles)
    process.send_signal(signal.SIGSTOP)
    with usual_time_limits():
        says_so_at_the_block(session)
        tick_until(session, lambda: session.runs.view().state == "unanswered", SAID_S)
        tried = session.fleet.invoke("Turtle", "light", {})  # an action from the panel fails, too
        tick_until(session, lambda: not tried.is_running, SAID_S)
    told = ("not responding", "disconnected", "can't be reached")  # depends on when the master notices
    assert any(words in (tried.error or "") for words in told)
    if link.is_connected:
        assert link.chip_text == "virtual, not responding"
    process.send_signal(signal.SIGCONT)
    tick_until(session, lambda: there(session).state == "ready", FOUND_S)
    with session.fleet.watch_sensors("Turtle"):  # the robot was stopped, so its action isn't resumed
        tick_until(session, lambda: link.drawing is not None and not link.drawing["moving"])
    well_again(session, turtles)


# ---- robot that sends wrong replies ----------------------------------------------------------------


class Liar:
    """Fake robot that announces itself as a Turtle and sends the replies of the test."""

    def __init__(self, address: str) -> None:
        self.node = nep.node("liar", master=address)
        self.answers = self.node.new_pub("/Turtle/answer", "robot/answer")
        self._description = self.node.new_pub("/Turtle/description", "robot/description", latched=True)
        self._description.publish(thing_description(ROBOT.thing_model, "Turtle"))
        self.commands: list[Mapping[str, object]] = []
        self.node.new_sub("/Turtle/command", "robot/command", sink=self._take)

    def _take(self, messages: Sequence[nep.Message]) -> None:
        for message in messages:
            command = message.payload
            assert isinstance(command, dict)
            if command["op"] in ("invoke", "cancel"):
                self.commands.append(command)

    def say(self, made: Invocation, state: object, **more: object) -> None:
        told = {"id": made.id, "op": "invoke", "action": made.action, "state": state, "output": {}}
        self.answers.publish({**told, "feedback": {}, "error": None, **more})


@pytest.fixture
def liar(master: Master) -> Iterator[Liar]:
    made = Liar(master.address)
    yield made
    made.node.close()


@pytest.fixture
def tried(session: Session, liar: Liar) -> Invocation:
    """Start a move and wait until the fake robot has received its command."""
    there(session)
    made = session.fleet.invoke("Turtle", "move", {"distance": 0.5})
    tick_until(session, lambda: liar.commands)
    return made


def test_duplicate_and_foreign_replies_are_ignored(session: Session, liar: Liar, tried: Invocation) -> None:
    for other in ("somebody else's", "", None, 7):
        liar.answers.publish({"id": other, "op": "invoke", "state": "succeeded", "output": {}})
    for state in ("dancing", None, 7, ["succeeded"]):
        liar.say(tried, state)
    liar.say(tried, "running")
    tick_until(session, lambda: tried.state == "running")
    liar.say(tried, "succeeded", output={"moved": 0.5})
    liar.say(tried, "failed", error="no, it did not")
    liar.say(tried, "running")
    tick_until(session, lambda: not tried.is_running)
    again = session.fleet.invoke("Turtle", "light", {})
    liar.say(again, "succeeded")
    tick_until(session, lambda: again.state == "succeeded")  # in order, so the earlier replies were read
    assert (tried.state, tried.error, tried.output) == ("succeeded", "", {"moved": 0.5})


def test_malformed_replies_are_ignored(session: Session, liar: Liar, tried: Invocation) -> None:
    for junk in (b"{not json", b"\xff\xfe", b"", b"[" * 5000):
        liar.answers.publish_bytes(junk)
    for odd in (None, 7, "text", [1, 2], {"id": tried.id}):
        liar.answers.publish(odd)
    liar.say(tried, "succeeded")
    tick_until(session, lambda: tried.state == "succeeded")


MAX_CALLS_A_TICK = 64 * MAX_MESSAGES_PER_TOPIC
"""Limit of function calls per tick for the replies of a full topic, about 48 each, on any machine."""


def calls_of(function: Callable[[], object]) -> int:
    """Return the number of function calls in this thread while ``function`` runs, a timeless measure."""
    count = 0

    def called(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal count
        count += event in {"call", "c_call"}

    sys.setprofile(called)
    try:
        function()
    finally:
        sys.setprofile(None)
    return count


def test_feedback_flood_is_processed_with_bounded_work_per_tick(
    session: Session, liar: Liar, tried: Invocation
) -> None:
    liar.say(tried, "running")
    tick_until(session, lambda: tried.state == "running")
    ended = threading.Event()

    def flood() -> None:
        number = 0
        while not ended.is_set():
            for _ in range(200):
                number += 1
                liar.say(tried, "running", feedback={"moved": number, "to_go": "x" * 1000})
            ended.wait(0.01)

    thread = threading.Thread(target=flood)
    thread.start()
    most = 0
    try:
        for _ in range(30):
            most = max(most, calls_of(session.tick))
            ended.wait(0.02)
        assert tried.is_running
        assert tried.feedback
    finally:
        ended.set()
        thread.join()
    assert most < MAX_CALLS_A_TICK
    liar.say(tried, "succeeded")
    tick_until(session, lambda: not tried.is_running)


def test_robot_that_never_replies_is_reported(session: Session, liar: Liar, tried: Invocation) -> None:
    with usual_time_limits():
        tick_until(session, lambda: not tried.is_running, SAID_S)
    assert tried.error == "Turtle isn't responding. Check that it is switched on."
    assert session.fleet.link("Turtle").state == "not stopped"  # type: ignore[union-attr]
    tick_until(session, lambda: liar.commands[-1]["op"] == "cancel")
    stop_unanswered(session)
    assert session.runs.view().title == "Turtle didn't reply"


def test_robot_that_falls_silent_during_an_action_is_reported(
    session: Session, liar: Liar, tried: Invocation
) -> None:
    liar.say(tried, "running")
    tick_until(session, lambda: tried.state == "running")
    with usual_time_limits():
        tick_until(session, lambda: not tried.is_running, SAID_S)
    assert tried.error is not None
    assert "stopped responding" in tried.error
