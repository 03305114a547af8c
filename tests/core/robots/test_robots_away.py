"""Tests of the eviction of robots that left; robots that a Stop must name are kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest

from app.core.alerts.alerts import Alerts
from app.core.network.topics import Topics
from app.core.network.watches import Watches
from app.core.robots.fleet import Fleet
from app.core.robots.health import RESTART_TIMEOUT_S, Health
from app.core.robots.robot_link import MAX_DISCONNECTED, RobotLink
from app.robots.client.stop_report import RobotStop, StopReport
from app.robots.description.description import RobotTopics, topic_of
from app.robots.identity import Identity
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from tests.blocks.samples import robot
from tests.core.robots.stop_model.clock import SimulatedClock
from tests.core.robots.stop_model.lab import SimulatedLab

ANY = robot("Any")


class CountingPublisher:
    """Publisher that counts how many publishers of its topic are open."""

    def __init__(self, open_topics: Counter[str], topic: str) -> None:
        self._open, self._topic = open_topics, topic
        open_topics[topic] += 1

    def close(self) -> None:
        self._open[self._topic] -= 1


class Strangers:
    """Fleet with a fake network of invented robots."""

    def __init__(self) -> None:
        self.clock, self.watched, self.published = SimulatedClock(), set[str](), Counter[str]()
        self.jobs: list[Callable[[Node], None]] = []
        self.fleet = Fleet(Watches(self.watched.add, self.watched.remove), self._submit, self.clock.now)
        self._revision = 0

    def _submit(self, _what: str, job: Callable[[Node], None]) -> None:
        self.jobs.append(job)

    def new_pub(self, topic: str, *_args: object, **_how: object) -> CountingPublisher:
        return CountingPublisher(self.published, topic)

    def run_jobs(self) -> None:
        jobs, self.jobs = self.jobs, []
        for job in jobs:
            job(cast("Node", self))

    def come(self, name: str) -> RobotLink:
        """Announce a robot of this name and return its link."""
        topics = RobotTopics(*(topic_of(name, leaf) for leaf in ("description", "command", "answer")))
        made = replace(ANY, name=name, title=name, virtual=False, sensors=(), events=(), topics=topics)
        self.fleet.connect(made, topics.description, Identity(f"node of {name}", name, "elsewhere", 1))
        link = self.fleet.link(name)
        assert link is not None
        return link

    def leave(self) -> None:
        """Remove all robots from the graph."""
        self.clock.move_to(self.clock.now() + 1)
        self._revision += 1
        self.fleet.update(GraphView(1, self._revision))

    def pass_by(self, count: int, *, runs_jobs: bool = True) -> None:
        """Connect ``count`` robots with new names and remove them, a hundred at a time."""
        for number in range(count):
            self.come(f"Invented{self._revision}x{number}")
            if number % 100 == 99:
                if runs_jobs:
                    self.run_jobs()
                self.leave()
        self.run_jobs()

    @property
    def names(self) -> set[str]:
        return {link.name for link in self.fleet.links}

    @property
    def open_publishers(self) -> list[str]:
        return sorted(topic for topic, count in self.published.items() if count)


@pytest.fixture
def strangers() -> Strangers:
    return Strangers()


def test_disconnected_robots_beyond_the_limit_are_evicted_and_their_resources_closed(
    strangers: Strangers,
) -> None:
    strangers.pass_by(1000)
    assert len(strangers.fleet.links) == MAX_DISCONNECTED
    assert len(strangers.fleet._names_by_topic) == MAX_DISCONNECTED
    assert strangers.watched == set()
    assert strangers.open_publishers == sorted(topic_of(name, "command") for name in strangers.names)
    strangers.pass_by(500)
    assert len(strangers.fleet.links) == MAX_DISCONNECTED


def test_publishers_still_opening_for_evicted_robots_are_closed(strangers: Strangers) -> None:
    strangers.pass_by(400, runs_jobs=False)
    assert strangers.open_publishers == sorted(topic_of(name, "command") for name in strangers.names)


def test_disconnected_robot_that_was_moved_remains_a_stop_target(strangers: Strangers) -> None:
    strangers.come("Pepper")
    strangers.fleet.moved.record_command(["Pepper"], "form")
    strangers.leave()
    strangers.pass_by(1000)
    fleet = strangers.fleet
    assert fleet.unresponsive_robots == ("Pepper",)
    assert "Pepper" in fleet.stoppable_robots
    (target,) = (each for each in fleet.stop_targets if each.robot.name == "Pepper")
    assert target.is_expected
    link = fleet.link("Pepper")
    assert link is not None
    fleet.add({})
    assert link.state == "not stopped"


@pytest.mark.parametrize("why", ["proven", "chosen", "used", "being stopped", "not stopped"])
def test_stopped_selected_or_used_robots_are_not_evicted(strangers: Strangers, why: str) -> None:
    fleet = strangers.fleet
    link = strangers.come("Pepper")
    if why == "proven":
        report = StopReport((RobotStop("Pepper", True, 41.0),), 41.0)
        fleet.apply_stop({"Pepper": ("41 ms", "ok")}, report)
        assert link.has_confirmed_stop
    elif why == "chosen":
        fleet.select("Pepper")
    elif why == "used":
        fleet.robots_in_use = lambda: ("Pepper",)
    elif why == "being stopped":
        fleet.mark_stopping(["Pepper"])
    else:
        link.stop_problem = "Pepper may still move"
    strangers.leave()
    strangers.pass_by(1000)
    assert fleet.link("Pepper") is link
    assert len(fleet.links) == MAX_DISCONNECTED + 1


def test_robots_that_replied_are_evicted_last(strangers: Strangers) -> None:
    strangers.come("Pepper").last_reply_s = 1.0
    strangers.come("Silent")
    strangers.leave()
    strangers.pass_by(1000)
    assert "Pepper" in strangers.names
    assert "Silent" not in strangers.names


def test_evicted_robot_that_returns_is_new(strangers: Strangers) -> None:
    before = strangers.come("Rover")
    strangers.leave()
    strangers.pass_by(300)
    assert strangers.fleet.link("Rover") is None
    after = strangers.come("Rover")
    strangers.run_jobs()
    assert after is not before
    assert after.publisher is not None
    assert strangers.published["/Rover/command"] == 1


def test_alerts_of_evicted_robots_are_resolved(strangers: Strangers) -> None:
    alerts = Alerts()
    health = Health(Topics(), strangers.fleet, alerts, strangers.clock.now)
    strangers.come("Rover")
    strangers.leave()
    health.check()
    strangers.clock.move_to(strangers.clock.now() + RESTART_TIMEOUT_S)
    health.check()
    assert alerts.has("robot:Rover")
    strangers.pass_by(300)
    health.check()
    assert not alerts.has("robot:Rover")
    assert len(health._gone_since_s) == MAX_DISCONNECTED


def test_running_program_reports_its_robots_to_the_fleet(tmp_path: Path) -> None:
    lab = SimulatedLab(tmp_path)
    try:
        runs, fleet = lab.studio.session.runs, lab.studio.session.fleet
        runs._used_robots = ("Pepper",)
        assert fleet.robots_in_use() == ()
        runs._run = replace(runs.state, state="running")
        assert fleet.robots_in_use() == ("Pepper",)
        runs._run = replace(runs.state, state="ready")
    finally:
        lab.close()
