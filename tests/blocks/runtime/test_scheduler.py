from __future__ import annotations

import threading

import pytest

from app.blocks.runtime.scheduler import Scheduler
from app.clock import ThreadClock, VirtualClock
from tests.blocks.fakes import until


class Stage:
    """Scheduler, and a log of what its scripts did."""

    def __init__(self, clock: ThreadClock | None = None) -> None:
        self.scheduler = Scheduler(clock)
        self.did: list[str] = []
        self.threads: list[threading.Thread] = []

    def script(self, name: str, work) -> None:
        def body() -> None:
            self.scheduler.start_run()
            work(name)

        self.threads.append(self.scheduler.start(name, body))

    def steps(self, *blocks: str):
        def work(_name: str) -> None:
            for block in blocks:
                self.scheduler.step(block)
                self.did.append(block)

        return work

    def join(self) -> None:
        for thread in self.threads:
            thread.join(60)
            assert not thread.is_alive()


@pytest.fixture
def stage():
    made = Stage()
    yield made
    made.scheduler.stop()
    made.join()


def test_scripts_take_turns_block_by_block(stage):
    stage.scheduler.pause()  # until both scripts wait at their first block
    stage.script("a", stage.steps("a1", "a2", "a3"))
    until(lambda: stage.scheduler.snapshot().blocks == ("a1",))
    stage.script("b", stage.steps("b1", "b2", "b3"))
    until(lambda: stage.scheduler.snapshot().blocks == ("a1", "b1"))
    stage.scheduler.resume()
    stage.join()
    assert stage.did == ["a1", "b1", "a2", "b2", "a3", "b3"]


def test_only_one_script_executes_at_a_time(stage):
    inside, most = [0], [0]

    def work(_name: str) -> None:
        for _ in range(200):
            stage.scheduler.step("x")
            inside[0] += 1
            most[0] = max(most[0], inside[0])
            sum(range(50))
            inside[0] -= 1

    for name in "abc":
        stage.script(name, work)
    stage.join()
    assert most == [1]


def test_pause_suspends_script_before_its_next_block_and_step_runs_one_block(stage):
    stage.scheduler.pause()
    stage.script("a", stage.steps("a1", "a2"))
    until(lambda: stage.scheduler.snapshot().is_paused)
    snapshot = stage.scheduler.snapshot()
    assert (snapshot.next_block, snapshot.is_paused, stage.did) == ("a1", True, [])
    stage.scheduler.step_once()
    until(lambda: stage.scheduler.snapshot().is_paused and stage.did == ["a1"])
    assert stage.scheduler.snapshot().next_block == "a2"
    stage.scheduler.step_once()
    stage.join()
    assert stage.did == ["a1", "a2"]


def test_step_runs_one_block_of_longest_waiting_script(stage):
    stage.scheduler.pause()
    stage.script("a", stage.steps("a1", "a2"))
    until(lambda: "a1" in stage.scheduler.snapshot().blocks and stage.scheduler.snapshot().is_paused)
    stage.script("b", stage.steps("b1", "b2"))
    until(lambda: len(stage.scheduler.snapshot().blocks) == 2 and stage.scheduler.snapshot().is_paused)
    for expected in (["a1"], ["a1", "b1"], ["a1", "b1", "a2"]):
        stage.scheduler.step_once()
        until(lambda expected=expected: stage.did == expected and stage.scheduler.snapshot().is_paused)


def test_wait_clock_stops_while_paused(stage):
    def work(_name: str) -> None:
        stage.scheduler.step("wait")
        stage.scheduler.wait(1.0)
        stage.did.append("waited")

    stage.scheduler.pause()
    stage.script("a", work)
    until(lambda: stage.scheduler.snapshot().next_block == "wait" and stage.scheduler.snapshot().is_paused)
    stage.scheduler.resume()
    stage.scheduler.pause()
    threading.Event().wait(1.2)
    assert stage.did == []
    until(lambda: stage.scheduler.snapshot().is_paused)
    stage.scheduler.resume()
    stage.join()
    assert stage.did == ["waited"]


def test_step_runs_wait_to_its_end(stage):
    def work(_name: str) -> None:
        stage.scheduler.step("wait")
        stage.scheduler.wait(0.03)
        stage.did.append("waited")
        stage.scheduler.step("next")
        stage.did.append("next")

    stage.scheduler.pause()
    stage.script("a", work)
    until(lambda: stage.scheduler.snapshot().is_paused)
    stage.scheduler.step_once()
    until(lambda: stage.scheduler.snapshot().next_block == "next" and stage.scheduler.snapshot().is_paused)
    assert stage.did == ["waited"]


def test_step_during_a_wait_completes_the_remaining_wait(stage):
    def work(_name: str) -> None:
        stage.scheduler.step("wait")
        stage.scheduler.wait(3.0)
        stage.did.append("waited")
        stage.scheduler.step("next")

    stage.script("a", work)
    until(lambda: stage.scheduler.snapshot().blocks == ("wait",))
    stage.scheduler.pause()
    until(lambda: stage.scheduler.snapshot().is_paused)
    assert stage.scheduler.snapshot().next_block == "wait"
    stage.scheduler.step_once()
    until(lambda: stage.scheduler.snapshot().next_block == "next" and stage.scheduler.snapshot().is_paused)
    assert stage.did == ["waited"]


def test_other_scripts_run_while_one_waits(stage):
    done = threading.Event()

    def work(_name: str) -> None:
        assert stage.scheduler.wait_until(done.is_set, None)
        stage.did.append("waited")

    stage.script("a", work)
    stage.script("b", stage.steps("b1", "b2"))
    until(lambda: stage.did == ["b1", "b2"])
    done.set()
    stage.join()
    assert stage.did == ["b1", "b2", "waited"]


def test_wait_returns_false_after_its_timeout(stage):
    found = []
    stage.script("a", lambda _: found.append(stage.scheduler.wait_until(lambda: False, 0.03)))
    stage.join()
    assert found == [False]


def test_wake_from_another_thread_ends_the_wait(stage):
    arrived = []

    def work(_name: str) -> None:
        assert stage.scheduler.wait_for(lambda: bool(arrived), 60)
        stage.did.append("got it")

    stage.script("a", work)
    until(lambda: not stage.scheduler.snapshot().is_paused)
    arrived.append(1)
    stage.scheduler.wake_scripts()
    stage.join()
    assert stage.did == ["got it"]


def test_pause_takes_effect_only_after_running_robot_action(stage):
    answered = []

    def work(_name: str) -> None:
        stage.scheduler.step("move")
        stage.scheduler.wait_for(lambda: bool(answered), 60)
        stage.scheduler.step("next")

    stage.script("a", work)
    until(lambda: stage.scheduler.snapshot().blocks == ("move",))
    stage.scheduler.pause()
    assert not stage.scheduler.snapshot().is_paused
    answered.append(1)
    stage.scheduler.wake_scripts()
    until(lambda: stage.scheduler.snapshot().is_paused)
    assert stage.scheduler.snapshot().next_block == "next"


@pytest.mark.parametrize("where", ["step", "wait", "wait_until", "wait_for", "idle"])
def test_stop_ends_script_at_any_point(stage, where):
    def work(_name: str) -> None:
        while True:
            stage.did.append("here")
            if where == "step":
                stage.scheduler.step("x")
            elif where == "wait":
                stage.scheduler.wait(60)
            elif where == "wait_until":
                stage.scheduler.wait_until(lambda: False, None)
            else:
                stage.scheduler.wait_for(lambda: False, 60, idle=where == "idle")

    stage.script("a", work)
    until(lambda: bool(stage.did))
    stage.scheduler.stop()
    stage.join()


def test_stop_ends_paused_script(stage):
    stage.scheduler.pause()
    stage.script("a", stage.steps("a1"))
    until(lambda: stage.scheduler.snapshot().is_paused)
    stage.scheduler.stop()
    stage.join()
    assert stage.did == []


def test_conditions_are_not_checked_while_paused(stage):
    looked = []

    def body() -> None:
        while True:
            stage.scheduler.acquire_turn()
            looked.append(1)
            stage.scheduler.finish_run()

    stage.scheduler.pause()
    stage.threads.append(stage.scheduler.start("hat", body))
    threading.Event().wait(0.05)
    assert stage.scheduler.snapshot().is_paused
    assert looked == []
    stage.scheduler.resume()
    until(lambda: len(looked) > 3)


def test_step_outside_script_raises(stage):
    with pytest.raises(RuntimeError, match="only works in a script"):
        stage.scheduler.step("x")


def test_slow_motion_delays_each_block_while_other_scripts_run():
    clock = VirtualClock(0.0)
    stage = Stage(clock)
    stage.scheduler.set_pace(0.5)
    with stage.scheduler.defer_turns():
        stage.script("a", stage.steps("a1", "a2"))
        stage.script("b", stage.steps("b1", "b2"))
    stage.join()
    assert stage.did == ["a1", "b1", "a2", "b2"]
    assert clock.now() == 1.0  # both scripts together: their delays are simultaneous


def test_slow_motion_ends_immediately_when_disabled(stage):
    stage.scheduler.set_pace(60.0)
    stage.script("a", stage.steps("a1", "a2", "a3"))
    until(lambda: stage.scheduler.snapshot().blocks == ("a1",))
    stage.scheduler.pause()  # before the change of pace, after which the block would run
    stage.scheduler.set_pace(0.0)
    until(lambda: stage.scheduler.snapshot().is_paused)
    assert stage.did == []
    stage.scheduler.step_once()  # a step doesn't wait for the remaining delay of a minute
    until(lambda: stage.scheduler.snapshot().is_paused and stage.did == ["a1"])
    stage.scheduler.resume()
    stage.join()
    assert stage.did == ["a1", "a2", "a3"]


def test_interrupted_action_stays_paused_until_resume_or_step(stage):
    def work(_name: str) -> None:
        stage.scheduler.step("drive")
        stage.scheduler.wait_for(stage.scheduler.is_script_paused)
        stage.did.append("held")
        stage.scheduler.wait_while_paused()
        stage.did.append("rest")
        stage.scheduler.step("next")
        stage.did.append("next")

    stage.script("a", work)
    until(lambda: "drive" in stage.scheduler.snapshot().blocks)
    stage.scheduler.pause()
    until(lambda: stage.did == ["held"] and stage.scheduler.snapshot().is_paused)
    assert stage.scheduler.snapshot().next_block == "drive"
    stage.scheduler.step_once()
    until(lambda: stage.did == ["held", "rest"] and stage.scheduler.snapshot().is_paused)
    assert stage.scheduler.snapshot().next_block == "next"
    stage.scheduler.resume()
    stage.join()
    assert stage.did == ["held", "rest", "next"]
