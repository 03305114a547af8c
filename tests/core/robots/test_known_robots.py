"""Tests of the list of known robots, which is saved with the time each was last seen."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from app.core.network.watches import Watches
from app.core.robots.fleet import Fleet
from app.core.robots.known_robots import MAX_ROBOTS, KnownRobot, KnownRobots
from app.core.storage.settings import Settings
from app.robots.client import rize


def robot(name: str, *, virtual: bool = False):
    return replace(rize.robot(name), virtual=virtual)


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(tmp_path)


def test_known_robots_are_sorted_by_last_seen_and_persist(settings, tmp_path) -> None:
    now = iter([100.0, 200.0, 300.0])
    known = KnownRobots(settings, lambda: next(now))
    known.record([robot("NAO")])
    known.record([robot("Rover")])
    known.record([robot("NAO")])
    again = KnownRobots(Settings(tmp_path))
    assert again.robots == (KnownRobot("NAO", 300.0), KnownRobot("Rover", 200.0))


def test_virtual_robots_are_not_saved_as_known(settings) -> None:
    known = KnownRobots(settings)
    known.record([robot("Pepper", virtual=True)])
    assert known.robots == ()


def test_removed_known_robot_is_added_again_when_it_returns(settings) -> None:
    known = KnownRobots(settings, lambda: 1.0)
    known.record([robot("NAO"), robot("Rover")])
    known.discard("NAO")
    assert [one.name for one in known.robots] == ["Rover"]
    known.record([robot("NAO")])
    assert {one.name for one in known.robots} == {"NAO", "Rover"}


def test_invalid_entries_of_known_robots_are_ignored(settings) -> None:
    entries = ["NAO", {"name": 3, "seen_s": 1}, {"name": "A", "seen_s": True}, {"name": "B", "seen_s": 2}]
    settings.path.write_text(json.dumps({Settings.known_robots.key: entries}))
    assert KnownRobots(Settings(settings.path.parent)).robots == (KnownRobot("B", 2.0),)


def test_number_of_known_robots_is_limited(settings) -> None:
    known = KnownRobots(settings, lambda: 1.0)
    known.record([robot(f"R{number}") for number in range(MAX_ROBOTS + 3)])
    assert len(known.robots) == MAX_ROBOTS


def test_robot_that_joins_the_fleet_is_saved_as_known(settings) -> None:
    fleet = Fleet(Watches(lambda _t: None, lambda _t: None), lambda _what, _job: None, settings=settings)
    fleet.connect(robot("NAO"), "robot_action NAO")
    assert [one.name for one in KnownRobots(settings).robots] == ["NAO"]
