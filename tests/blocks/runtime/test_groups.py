"""Tests of groups of scripts: they are held, resumed, ended and fail separately."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.robot_handle import RobotHandle
from app.blocks.runtime.scheduler import Scheduler, ScriptGroup, current_script
from app.blocks.runtime.trace import BlockEnded, BlockInterrupted, BlockResumed
from app.clock import VirtualClock
from app.robots import simulated
from app.robots.description.description import parse, thing_description
from tests.blocks.fakes import FakeLink, Play, until
from tests.blocks.samples import block, number, robot, started, workspace


class Pages:
    """Scheduler in virtual time with a goal and a reaction, and a log of what their scripts did."""

    def __init__(self) -> None:
        self.clock = VirtualClock(0.0)
        self.scheduler = Scheduler(self.clock)
        self.goal = self.scheduler.new_group("goal", ends_program=False)
        self.reaction = self.scheduler.new_group("reaction", ends_program=False)
        self.did: list[tuple[str, float]] = []

    def start(self, group: ScriptGroup, work: Callable[[], None]) -> Callable[[], None]:
        """Start a script of a group and return a function that waits for its end."""

        def body() -> None:
            self.scheduler.start_run()
            work()

        thread = group.start(group.name, body)

        def join() -> None:
            thread.join(60)
            assert not thread.is_alive()

        return join

    def log(self, what: str) -> None:
        self.did.append((what, round(self.clock.now(), 3)))


@pytest.fixture
def pages() -> Iterator[Pages]:
    made = Pages()
    yield made
    made.scheduler.stop()


def test_held_group_stops_at_its_next_block_while_another_group_runs(pages: Pages) -> None:
    def goal() -> None:
        for index in range(4):
            pages.scheduler.step(f"g{index}")
            pages.log(f"g{index}")
            pages.scheduler.wait(1.0)

    def reaction() -> None:
        pages.scheduler.wait(1.5)
        pages.goal.hold()
        assert pages.goal.state == "held"
        pages.scheduler.wait(10.0)
        pages.log("reacted")
        pages.goal.resume()

    with pages.scheduler.defer_turns():
        joins = [pages.start(pages.goal, goal), pages.start(pages.reaction, reaction)]
    for join in joins:
        join()
    # Half of the second wait was over: the rest of it follows the hold.
    assert pages.did == [("g0", 0.0), ("g1", 1.0), ("reacted", 11.5), ("g2", 12.0), ("g3", 13.0)]
    assert pages.goal.state == "running"


@pytest.mark.parametrize("condition", [False, True])
def test_resumed_group_repeats_its_interrupted_wait_if_it_restarts_blocks(
    pages: Pages, condition: bool
) -> None:
    def goal() -> None:
        pages.scheduler.step("wait")
        if condition:
            assert not pages.scheduler.wait_until(lambda: False, 4.0)
        else:
            pages.scheduler.wait(4.0)
        pages.log("waited")
        pages.scheduler.step("again")
        pages.scheduler.wait(1.0)
        pages.log("end")

    def reaction() -> None:
        pages.scheduler.wait(3.0)
        pages.goal.hold(restarts_blocks=True)
        pages.scheduler.wait(1.0)
        pages.goal.resume()

    with pages.scheduler.defer_turns():
        joins = [pages.start(pages.goal, goal), pages.start(pages.reaction, reaction)]
    for join in joins:
        join()
    assert pages.did == [("waited", 8.0), ("end", 9.0)]


def test_ended_group_ends_its_scripts_only(pages: Pages) -> None:
    def goal() -> None:
        pages.scheduler.step("wait")
        pages.scheduler.wait(60.0)
        pages.log("never")

    def reaction() -> None:
        pages.scheduler.wait(1.0)
        pages.goal.end()
        pages.scheduler.wait(1.0)
        pages.log("reacted")

    def wait_for_event() -> None:
        while True:
            pages.scheduler.wait_for(lambda: False, idle=True)

    with pages.scheduler.defer_turns():
        joins = [pages.start(pages.goal, goal), pages.start(pages.goal, wait_for_event)]
        joins.append(pages.start(pages.reaction, reaction))
    for join in joins:
        join()
    assert pages.did == [("reacted", 2.0)]
    assert (pages.goal.state, pages.reaction.state) == ("ended", "running")
    assert BlockEnded(1.0, 1, "wait", "canceled") in pages.scheduler.take_trace()


def test_300_waiting_scripts_of_a_group_are_held_resumed_and_ended(pages: Pages) -> None:
    ended: list[int] = []

    def member(index: int) -> None:
        try:
            pages.scheduler.step(f"m{index}")
            pages.scheduler.wait(10.0)
            pages.scheduler.step(f"n{index}")
            pages.scheduler.wait(60.0)
            pages.log("never")
        finally:
            ended.append(index)

    def reaction() -> None:
        pages.scheduler.wait(5.0)
        pages.goal.hold()
        pages.scheduler.wait(100.0)
        assert not ended
        pages.goal.resume()
        pages.scheduler.wait(15.0)
        pages.goal.end()

    with pages.scheduler.defer_turns():
        joins = [pages.start(pages.goal, partial(member, index)) for index in range(300)]
        joins.append(pages.start(pages.reaction, reaction))
    for join in joins:
        join()
    assert pages.did == []
    assert sorted(ended) == list(range(300))
    assert pages.clock.now() == 120.0


def test_single_step_and_pause_leave_a_held_group_alone(pages: Pages) -> None:
    def work() -> None:
        script = current_script()
        assert script is not None
        for each in ("1", "2"):
            pages.scheduler.step(script.group.name + each)
            pages.log(script.group.name + each)

    scheduler = pages.scheduler
    scheduler.pause()
    pages.goal.hold()
    pages.start(pages.goal, work)
    until(lambda: scheduler.snapshot().blocks == ("goal1",))
    pages.start(pages.reaction, work)
    until(lambda: scheduler.snapshot().blocks == ("goal1", "reaction1"))
    assert scheduler.snapshot().next_block == "reaction1"
    scheduler.step_once()
    until(lambda: scheduler.snapshot().is_paused and len(pages.did) == 1)
    scheduler.resume()
    until(lambda: len(pages.did) == 2)
    assert [what for what, _ in pages.did] == ["reaction1", "reaction2"]
    assert scheduler.snapshot().blocks == ("goal1",)
    pages.goal.resume()
    until(lambda: len(pages.did) == 4)


def test_stop_others_ends_scripts_of_the_same_group_only(pages: Pages) -> None:
    def wait(name: str) -> Callable[[], None]:
        def work() -> None:
            pages.scheduler.wait(5.0)
            pages.log(name)

        return work

    def stop_others() -> None:
        pages.scheduler.wait(1.0)
        pages.scheduler.end_other_runs()

    with pages.scheduler.defer_turns():
        joins = [pages.start(pages.goal, wait("goal")), pages.start(pages.goal, stop_others)]
        joins.append(pages.start(pages.reaction, wait("reaction")))
    for join in joins:
        join()
    assert pages.did == [("reaction", 5.0)]


class Stage:
    """Running program in which a test starts further groups."""

    def __init__(self) -> None:
        self.link = FakeLink()
        pepper = robot()
        forever = started(block("control_wait", "always", SECONDS=number(1000)))
        self.play = Play(compile_behaviour(workspace(forever), [pepper]), (pepper,), self.link).start()
        self.runtime = self.play.runtime
        self.errors: list[str] = []

    def start(self, group: ScriptGroup, work: Callable[[], None]) -> None:
        def body() -> None:
            self.runtime.scheduler.start_run()
            self.runtime.scheduler.step(group.name)
            work()

        group.start(group.name, self.runtime._with_error_reporting(body))


@pytest.fixture
def stage() -> Iterator[Stage]:
    made = Stage()
    yield made
    made.play.stop()


def test_error_ends_only_its_group_unless_the_group_ends_the_program(stage: Stage) -> None:
    scheduler = stage.runtime.scheduler

    def fail() -> None:
        raise BehaviourError("no paper")

    page = scheduler.new_group("page", ends_program=False)
    stage.start(page, fail)
    until(lambda: page.state == "failed")
    assert str(page.error) == "no paper"
    until(lambda: stage.link.groups == [("end", "page")])
    assert (stage.runtime.error, stage.runtime.finished.is_set()) == (None, False)
    ended = [each for each in scheduler.take_trace() if isinstance(each, BlockEnded)]
    assert [(each.block, each.cause, each.text) for each in ended] == [("page", "failed", "no paper")]
    stage.start(scheduler.new_group("whole"), fail)
    stage.play.end()
    assert stage.runtime.error is not None
    assert scheduler.main_group.state == "running", "it didn't fail itself"


@pytest.mark.parametrize("restarts", [False, True])
def test_action_of_held_group_is_canceled_and_executed_again(stage: Stage, restarts: bool) -> None:
    stage.link.held = {"say"}
    page = stage.runtime.scheduler.new_group("page")
    stage.start(page, lambda: RobotHandle("Pepper", stage.runtime).do("say", text="Hi"))
    until(lambda: len(stage.link.calls) == 1)
    stage.runtime.hold_group(page, restarts_blocks=restarts)
    until(lambda: stage.link.canceled == stage.link.calls)
    stage.link.calls[0].has_started = True
    stage.link.answer(stage.link.calls[0], "canceled")
    records: list[object] = []

    def interrupted() -> bool:
        records.extend(stage.runtime.scheduler.take_trace())
        return any(isinstance(each, BlockInterrupted) and each.cause == "hold" for each in records)

    until(interrupted)
    assert len(stage.link.calls) == 1
    stage.runtime.resume_group(page)
    until(lambda: len(stage.link.calls) == 2)
    assert stage.link.invoked[1] == ("Pepper", "say", {"text": "Hi"})
    assert stage.link.groups == [("hold", "page"), ("resume", "page")]
    stage.link.answer(stage.link.calls[1], "succeeded")
    until(lambda: not interrupted() or any(isinstance(each, BlockResumed) for each in records))


def test_action_of_held_group_that_restarts_blocks_is_executed_in_full() -> None:

    pepper = parse(thing_description(simulated.ROBOT.thing_model, "Pepper"))
    for restarts, distance in ((False, 0.4), (True, 1.0)):
        link = FakeLink()
        link.held = {"walk"}
        walk = block("robot_pepper_do_walk", "w", ROBOT="Pepper", DISTANCE=number(1), SPEED=number(0.3))
        play = Play(compile_behaviour(workspace(started(walk)), [pepper]), (pepper,), link).start()
        until(lambda link=link: len(link.calls) == 1)
        link.calls[0].has_started, link.calls[0].feedback = True, {"to_go": 0.4}
        group = play.runtime.scheduler.main_group
        play.runtime.hold_group(group, restarts_blocks=restarts)
        until(lambda link=link: bool(link.canceled))
        link.answer(link.calls[0], "canceled")
        play.runtime.resume_group(group)
        until(lambda link=link: len(link.calls) == 2)
        assert link.invoked[1][2]["distance"] == distance
        link.answer(link.calls[1], "succeeded")
        play.end()
