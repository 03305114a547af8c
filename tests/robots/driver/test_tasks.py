"""Tests of the scheduling of a robot's tasks (order, queue, replacement, stop) without a network."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from app.clock import VirtualClock
from app.robots.driver.call import Canceled
from app.robots.driver.task import Task, TaskReply
from app.robots.driver.tasks import Tasks
from tests.robots.conftest import eventually


class World:
    """Tasks of a robot that run until the test releases them, and the replies to each."""

    def __init__(self) -> None:
        self.began: list[str] = []
        self.answers: dict[str, list[TaskReply]] = {}
        self.let_go: dict[str, threading.Event] = {}
        self.tasks = Tasks(
            "Bot", lambda: None, VirtualClock(advances_alone=False), within_s=0.1, watchdog_s=None
        )
        self.tasks.start()

    def ask(self, name: str, uses: tuple[str, ...], *, obeys: bool = True, **more: Any) -> None:
        """Submit an action that runs until it is released or, with `obeys`, until it is canceled."""
        gone = self.let_go[name] = threading.Event()
        told = self.answers[name] = []

        def run(call: Any) -> None:
            self.began.append(name)
            while not gone.wait(0.002):
                if obeys and call.canceled:
                    raise Canceled

        task = Task(name, name, run, told.append, uses, **more)
        self.tasks.call_soon(lambda: self.tasks.submit(task))
        eventually(lambda: told)

    def states(self, name: str) -> list[str]:
        return [answer.state for answer in self.answers[name]]


@pytest.fixture
def world() -> Iterator[World]:
    made = World()
    yield made
    for gone in made.let_go.values():
        gone.set()
    made.tasks.close()


def ran(world: World, *names: str) -> Callable[[], bool]:
    return lambda: world.began == [*names]


def test_task_does_not_overtake_a_task_that_waits_for_more_resources(world: World) -> None:
    world.ask("wave", ("arm",))
    eventually(ran(world, "wave"))
    world.ask("dance", ("arm", "legs"))
    world.ask("walk", ("legs",))  # the legs are free, but "dance" waits for them
    assert world.states("walk") == ["accepted"]
    world.ask("blink", ("eyes",))
    eventually(ran(world, "wave", "blink"))
    world.let_go["wave"].set()
    eventually(ran(world, "wave", "blink", "dance"))
    assert world.states("walk") == ["accepted"]
    world.let_go["dance"].set()
    eventually(ran(world, "wave", "blink", "dance", "walk"))


def test_non_cancellable_task_is_not_replaced(world: World) -> None:
    world.ask("kick", ("legs",), cancellable=False)
    eventually(ran(world, "kick"))
    world.ask("walk", ("legs",), on_busy="replace")
    (accepted,) = world.answers["walk"]
    assert (accepted.waits_for, accepted.replaces) == (("kick",), ())
    world.let_go["kick"].set()
    eventually(ran(world, "kick", "walk"))
    assert world.states("kick") == ["accepted", "running", "succeeded"]


def test_cancel_of_a_running_non_cancellable_task_is_rejected(world: World) -> None:
    world.ask("kick", ("legs",), cancellable=False)
    eventually(ran(world, "kick"))
    errors: list[str | None] = []
    world.tasks.call_soon(lambda: errors.append(world.tasks.cancel(lambda _task: True)))
    eventually(lambda: errors)
    assert errors == ["kick can't be cancelled; it ends on its own"]
    world.let_go["kick"].set()
    eventually(lambda: world.states("kick") == ["accepted", "running", "succeeded"])


def test_full_queue_rejects_a_task_with_a_message(world: World) -> None:
    world.ask("first", ("arm",))
    eventually(ran(world, "first"))
    for number in range(50):
        world.ask(f"n{number}", ("arm",))
    world.ask("last", ("arm",))
    assert world.states("last") == ["failed"]
    assert world.answers["last"][0].error == "last: 50 other actions are already waiting"
    assert world.states("n49") == ["accepted"]


def test_number_of_running_tasks_without_resources_is_limited(world: World) -> None:
    for number in range(50):
        world.ask(f"n{number}", ())
    eventually(lambda: len(world.began) == 50)
    world.ask("last", ())
    assert world.answers["last"][0].error == "last: 50 other actions are already running"
    world.let_go["n7"].set()
    eventually(lambda: world.states("n7")[-1] == "succeeded")
    world.ask("later", ())
    eventually(lambda: world.states("later") == ["accepted", "running"])


def test_stop_is_answered_only_after_the_running_task_has_ended(world: World) -> None:
    world.ask("kick", ("legs",), cancellable=False, obeys=False)
    eventually(ran(world, "kick"))
    stopped: list[TaskReply] = []
    world.tasks.call_soon(lambda: world.tasks.stop(stopped.append))
    world.ask("after", ("arm",))
    eventually(lambda: world.states("after")[-1] in {"failed", "accepted", "running"})
    assert stopped == []
    world.let_go["kick"].set()
    eventually(lambda: stopped)
    assert stopped[0].state == "succeeded"
