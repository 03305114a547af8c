"""Tests of reporting command publishers of robots that can't be opened or closed."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from app.core.robots.command_publishers import CommandPublishers


@pytest.mark.parametrize("name", ["Pepper", "{0}", "a {error} b", "}{"])
def test_failure_to_open_or_close_a_publisher_is_reported_with_robot_and_reason(name: str) -> None:
    reports: list[str] = []
    publishers = CommandPublishers(lambda what, _job: reports.append(what))
    link = SimpleNamespace(
        name=name, publisher=None, world_publisher=None, is_opening=False, robot=SimpleNamespace(topics=None)
    )
    publishers.open(link)  # type: ignore[arg-type]
    link.publisher = SimpleNamespace(close=lambda: None)
    publishers.close_outdated(link)  # type: ignore[arg-type]
    assert [each.format(error="no room") for each in reports] == [
        f"Can't connect to {name}: no room",
        f"Can't close the old publishers of {name}: no room",
    ]
