"""Tests of invoking actions by hand: replies, waiting, timeouts, silent robots and foreign replies."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from app.core.robots.invocations import ManualInvocations
from app.core.robots.robot_link import MAX_PAST_INVOCATIONS, Invocation, RobotLink
from app.robots.client.limits import ACTION_MARGIN_S, FIRST_REPLY_TIMEOUT_S
from app.robots.client.reply import Payload, parse_reply
from app.robots.description.description import Action, Robot, parse, thing_description
from app.robots.turtle import ROBOT


@dataclass
class Bench:
    """Manual invocations on one robot, with a fake clock and a log of sent commands."""

    now: float = 100.0
    sent: list[Payload] = field(default_factory=list)
    rested: list[str] = field(default_factory=list)
    reachable: bool = True

    def __post_init__(self) -> None:
        robot: Robot = parse(thing_description(ROBOT.thing_model, "Turtle"))
        self.link = RobotLink("Turtle", robot)
        self.tries = ManualInvocations(self.send, self.rested.append, lambda: self.now, lambda: 1e9)

    def send(self, _link: RobotLink, command: Payload) -> bool:
        self.sent.append(command)
        return self.reachable

    def action(self, name: str) -> Action:
        found = self.link.robot.action(name)
        assert found is not None
        return found

    def begin(self, name: str = "move", **given: object) -> Invocation:
        return self.tries.start(self.link, self.action(name), given)

    def answer(self, made: Invocation, state: str, **more: object) -> None:
        told = {"id": made.id, "op": "invoke", "action": made.action, "state": state}
        self.receive({**told, **more})

    def receive(self, payload: Payload) -> None:
        reply = parse_reply(payload)
        assert reply is not None
        self.tries.apply_reply(self.link, reply)

    def pass_time(self, seconds: float, *, alive: bool = False) -> None:
        self.now += seconds
        if alive:
            self.receive({"op": "alive", "id": "", "state": "running"})
        self.tries.check_timeouts([self.link])


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_invocation_passes_through_its_states_and_is_recorded(bench) -> None:
    made = bench.begin("move", distance=0.5)
    assert bench.sent[0]["input"] == {"distance": 0.5}
    assert made.state == "sent"
    bench.answer(made, "accepted", replaces=["turn"])
    assert (made.state, made.replaces, made.remaining_s) == ("accepted", ("turn",), None)
    bench.answer(made, "running")
    bench.now += 4
    bench.answer(made, "running", feedback={"moved": 0.2})
    assert made.feedback == {"moved": 0.2}
    assert made.remaining_s == 56.0
    bench.answer(made, "succeeded", output={"moved": 0.5})
    assert (made.state, made.output, made.elapsed_s) == ("succeeded", {"moved": 0.5}, 4.0)
    assert not made.is_running
    assert bench.rested == ["Turtle"]
    assert list(bench.link.past_invocations) == [made]


def test_only_the_newest_invocations_are_kept(bench) -> None:
    for _ in range(MAX_PAST_INVOCATIONS + 5):
        bench.answer(bench.begin("light"), "succeeded")
    assert len(bench.link.past_invocations) == MAX_PAST_INVOCATIONS


def test_invocation_fails_after_three_seconds_without_reply(bench) -> None:
    made = bench.begin()
    bench.pass_time(FIRST_REPLY_TIMEOUT_S - 0.1)
    assert made.is_running
    bench.pass_time(0.2)
    assert (made.state, made.error) == ("failed", "Turtle isn't responding. Check that it is switched on.")
    assert bench.sent[-1]["op"] == "cancel"  # in case the robot responds again
    assert (bench.link.state, bench.link.chip_text) == ("silent", "virtual, not responding")
    bench.receive({"op": "alive", "id": ""})
    assert bench.link.state == "ready"


def test_invocation_fails_two_seconds_after_the_robot_falls_silent(bench) -> None:
    made = bench.begin()
    bench.answer(made, "accepted")
    bench.answer(made, "running")
    for _ in range(20):
        bench.pass_time(0.5, alive=True)  # heartbeats arrive and the action continues
    assert made.is_running
    bench.pass_time(2.1)
    assert made.state == "failed"
    assert made.error is not None
    assert "stopped responding" in made.error
    assert bench.sent[-1] == {"id": made.id, "op": "cancel", "from": "studio", "action": "move"}


def test_invocation_of_robot_without_heartbeat_waits_until_the_time_limit(bench) -> None:
    bench.link.robot = replace(bench.link.robot, heartbeat_interval_s=None)
    made = bench.begin()
    bench.answer(made, "running")
    bench.pass_time(59.0)
    assert made.is_running
    bench.pass_time(1.0 + ACTION_MARGIN_S / 2)
    assert made.is_running  # grace period in which the robot may report the timeout itself
    bench.pass_time(ACTION_MARGIN_S)
    assert (made.state, made.error) == ("failed", "move took longer than 60 s")
    assert bench.sent[-1]["op"] == "cancel"
    bench.answer(made, "succeeded")
    assert made.state == "failed"  # late replies are ignored


def test_time_in_robot_queue_does_not_count_towards_time_limit(bench) -> None:
    made = bench.begin()
    bench.answer(made, "accepted", waits_for=["turn", "turn"])
    for _ in range(200):
        bench.pass_time(0.5, alive=True)
    assert (made.state, made.waits_for) == ("accepted", ("turn", "turn"))


@pytest.mark.parametrize(
    "answer",
    [
        {"id": "somebody else's", "op": "invoke", "state": "succeeded"},
        {"op": "invoke", "state": "succeeded"},
        {"op": "cancel", "state": "failed", "mine": True},
        {"op": "stop", "state": "succeeded", "mine": True},
        {"op": "invoke", "state": "dancing", "mine": True},
        {"op": "invoke", "state": None, "mine": True},
        {"op": "invoke", "state": ["succeeded"], "mine": True},
    ],
)
def test_foreign_and_invalid_replies_do_not_end_an_invocation(bench, answer) -> None:
    made = bench.begin()
    bench.answer(made, "running")
    bench.receive({**answer, "id": made.id} if answer.get("mine") else answer)
    assert made.state == "running"


def test_second_final_reply_is_ignored(bench) -> None:
    made = bench.begin()
    bench.answer(made, "succeeded")
    bench.answer(made, "failed", error="no")
    assert (made.state, made.error) == ("succeeded", "")


def test_invocation_of_unreachable_robot_fails_at_once(bench) -> None:
    bench.reachable = False
    made = bench.begin()
    assert (made.state, made.error) == ("failed", "Turtle can't be reached; check that it is switched on")


def test_cancel_is_sent_while_running_and_never_after_the_end(bench) -> None:
    made = bench.begin()
    bench.tries.cancel(bench.link, "move")
    assert bench.sent[-1]["op"] == "cancel"
    bench.answer(made, "canceled")
    count = len(bench.sent)
    bench.tries.cancel(bench.link, "move")
    bench.tries.cancel(bench.link, "turn")
    assert len(bench.sent) == count


def test_two_invocations_of_one_action_both_end(bench) -> None:
    first, second = bench.begin(), bench.begin()
    bench.answer(first, "accepted")
    bench.answer(second, "accepted", replaces=["move"])
    bench.answer(first, "canceled", error="replaced by move")
    assert (first.state, second.state) == ("canceled", "accepted")
    assert bench.rested == []  # the second invocation keeps the robot awake
    bench.answer(second, "succeeded")
    assert bench.rested == ["Turtle"]


def test_error_message_of_the_robot_is_shortened_and_sanitized(bench) -> None:
    made = bench.begin("move", distance=0.5)
    bench.answer(made, "failed", error="\u202ethe brake\x1b[2J\nis stuck" + "!" * 100_000)
    assert made.error is not None
    assert made.error.startswith("the brake[2J\nis stuck!")
    assert len(made.error) < 1100
