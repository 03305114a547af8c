"""Tests of the counts in a robot's heartbeats, which may contain any value."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.core.robots.reported_count import GROWTH_WINDOW_S, MAX_COUNT, ReportedCount
from tests.core.robots.stop_model.lab import SimulatedLab
from tests.core.robots.stop_model.network import SimulatedNode
from tests.core.robots.stop_model.studio import GRAPH_POLL_S


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[SimulatedLab]:
    lab = SimulatedLab(tmp_path)
    yield lab
    lab.close()


@pytest.mark.parametrize(
    "hostile",
    [None, True, -1, 3.0, "4", [5], {"count": 6}, MAX_COUNT + 1, 10**400, float("nan"), float("inf")],
)
def test_value_that_is_not_a_count_is_ignored(hostile: object) -> None:
    count = ReportedCount()
    count.update(hostile, 1.0)
    assert (count.value, count.is_growing(1.0)) == (0, False)
    count.update(7, 2.0)
    count.update(hostile, 3.0)
    assert (count.value, count.last_increase_s) == (7, 2.0)


def test_count_of_restarted_driver_starts_over() -> None:
    count = ReportedCount()
    count.update(7, 1.0)
    count.update(0, 2.0)
    assert (count.value, count.is_growing(2.0)) == (0, False)
    count.update(1, 3.0)
    assert count.is_growing(3.0)
    assert not count.is_growing(3.0 + GROWTH_WINDOW_S)


def test_counts_are_read_only_from_heartbeats_of_the_robot_program(lab: SimulatedLab) -> None:
    pepper = lab.start_robot("Pepper")
    link = lab.wait_for_link("Pepper")

    def send_alive(node: SimulatedNode = pepper.node, **counts: object) -> None:
        alive = {"op": "alive", "id": "", "action": "", "state": "running", "not_ended": [], "error": None}
        publisher = node.new_pub("/Pepper/answer", "robot/answer")
        lab.advance(GRAPH_POLL_S)  # until the publisher is listed and connected
        publisher.publish({**alive, **counts})
        lab.settle()

    send_alive(rejected=12, errors=3)
    assert (link.rejected_messages.value, link.driver_exceptions.value) == (12, 3)
    send_alive(rejected="many", errors=[1])
    send_alive(lab.stranger.node, rejected=99, errors=99)
    assert (link.rejected_messages.value, link.driver_exceptions.value) == (12, 3)
    assert link.rejected_messages.is_growing(lab.clock.now())
    send_alive()
    assert (link.rejected_messages.value, link.driver_exceptions.value) == (0, 0)
    send_alive(rejected=5)
    pepper.node.close()
    lab.start_robot("Pepper")
    lab.wait_for_link("Pepper")
    assert link.rejected_messages.value == 0, "another program"
