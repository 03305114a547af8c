"""Tests of requests to start a virtual robot.

A request waits until the running robots are known, and until a running robot of that name has ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO

import pytest

import nep
from app.core.network.watches import Watches
from app.core.robots.fleet import Fleet
from app.core.robots.launcher import FIRST_GRAPH_TIMEOUT_S, REQUEST_LIFETIME_S, STARTUP_TIMEOUT_S, Launcher
from app.core.session import Session
from app.core.storage.settings import Settings
from app.robots import simulated
from app.robots.driver.driver import Driver
from nep.masters.master import Master
from nep.protocol.graph_view import GraphView, PublisherInfo, TopicInfo
from tests.core.waiting import tick_until
from tests.ui.fakes.processes import Process


class World:
    """Launcher with a fake clock, a settable state of the existing robot, and the started processes."""

    def __init__(self) -> None:
        self.now = 100.0
        self.there: bool | None = False
        self.started: list[Sequence[str]] = []
        self.processes: list[Process] = []
        self.events: list[object] = []
        self.launcher = Launcher(
            "127.0.0.1:1", self.events.append, lambda _name: self.there, lambda: self.now, self._start
        )

    def _start(self, command: Sequence[str], _environment: Mapping[str, str], log: IO[bytes]) -> Process:
        self.started.append(command[2:5])
        self.processes.append(Process(log))
        return self.processes[-1]

    def after(self, seconds: float) -> None:
        self.now += seconds
        self.launcher.start_requested_robots()


@pytest.fixture
def world() -> Iterator[World]:
    made = World()
    yield made
    made.launcher.close()


def test_virtual_robot_that_is_not_running_is_started_at_once(world: World) -> None:
    world.launcher.start_virtual_robot("Turtle", "diffdrive")
    assert world.started == [["app.robots.turtle", "--name", "Turtle"]]
    world.processes[0].die(b"", 1)
    world.after(0.1)
    assert len(world.started) == 1  # its exit is reported, but doesn't start another


def test_virtual_robot_is_started_after_the_existing_robot_has_ended(world: World) -> None:
    world.there = True
    world.launcher.start_virtual_robot()
    world.after(REQUEST_LIFETIME_S - 1)
    assert not world.started
    world.there = False
    world.after(0.03)
    assert world.started == [["app.robots.simulated", "--name", "Pepper"]]
    world.after(0.03)
    assert len(world.started) == 1


def test_start_request_expires_while_existing_robot_stays(world: World) -> None:
    world.there = True
    world.launcher.start_virtual_robot()
    world.after(REQUEST_LIFETIME_S)
    world.there = False
    world.after(0.03)
    assert not world.started


def test_start_waits_until_running_robots_are_known(world: World) -> None:
    world.there = None
    world.launcher.start_virtual_robot()
    world.after(FIRST_GRAPH_TIMEOUT_S - 0.1)
    assert not world.started
    world.there = True
    world.after(1.0)
    assert not world.started


def test_start_does_not_wait_when_no_master_ran_before(world: World) -> None:
    world.there = None
    world.launcher.start_virtual_robot()
    assert not world.started
    world.launcher._master.is_first_master = True
    world.after(0.03)
    assert len(world.started) == 1


def test_start_waits_for_first_graph_at_most_until_timeout(world: World) -> None:
    world.there = None
    world.launcher.start_virtual_robot()
    world.after(FIRST_GRAPH_TIMEOUT_S)
    assert len(world.started) == 1


@pytest.mark.parametrize("end", [Launcher.stop_virtual_robot, lambda some, _name: some.close()])
def test_canceled_start_request_starts_no_robot(world: World, end: Callable[[Launcher, str], None]) -> None:
    world.there = True
    world.launcher.start_virtual_robot()
    end(world.launcher, "Pepper")
    world.there = False
    world.after(0.03)
    assert not world.started


def test_restart_does_not_add_a_second_start_request(world: World) -> None:
    world.there = True
    world.launcher.start_virtual_robot()
    world.launcher.restart_virtual_robot("Pepper")
    world.there = False
    world.processes[0].die(b"", 1)
    world.after(0.03)
    assert len(world.started) == 1


def test_second_studio_uses_the_running_pepper(master: Master, tmp_path: Path) -> None:
    with nep.node("first", master=master.address) as node, Driver(simulated.ROBOT, "Pepper", node):
        second = Session(
            Settings(tmp_path), address=master.address, journal_folder=tmp_path / "j", start_processes=False
        )
        second.start()
        try:
            second.launcher.start_virtual_robot()  # before the first graph, when no robot is known
            assert second.live.graph is None
            tick_until(second, lambda: second.fleet.connected)
            assert second.launcher._robots == {}
        finally:
            second.close()


def test_running_robots_are_known_after_the_first_graph() -> None:
    fleet = Fleet(Watches(lambda _topic: None, lambda _topic: None), lambda _what, _job: None)
    assert fleet.is_present("Pepper") is None
    fleet.update(GraphView(1, 1))
    assert fleet.is_present("Pepper") is False
    fleet.update(GraphView(1, 2, topics={"/Pepper/description": _described()}))
    assert fleet.is_present("Pepper") is True  # announced, although its description hasn't arrived yet
    assert fleet.is_present("Turtle") is False
    fleet.update(GraphView(1, 3))
    assert fleet.is_present("Pepper") is False


def _described() -> TopicInfo:
    publisher = PublisherInfo(1, "n1", ("tcp://127.0.0.1:2",), True, 1, 100, 1, None, None, None)
    return TopicInfo("/Pepper/description", "robot/description", "json", (publisher,))


def test_robot_is_starting_until_connected_or_failed(world: World) -> None:
    launcher = world.launcher
    world.there = None
    launcher.start_virtual_robot("Pepper")
    assert launcher.starting_robots == ("Pepper",), "also while it is not known whether one is there"
    world.there = False
    world.after(0.1)
    assert launcher.starting_robots == ("Pepper",)
    launcher.on_started("Pepper")
    assert launcher.starting_robots == ()
    launcher.restart_virtual_robot("Pepper")
    assert launcher.starting_robots == ("Pepper",)
    world.processes[-1].die(b"out of order", 1)
    launcher.check()
    assert launcher.starting_robots == (), "it ended by itself"
    launcher.start_virtual_robot("Turtle", "diffdrive")
    world.after(STARTUP_TIMEOUT_S)
    assert launcher.starting_robots == (), "it never came"
