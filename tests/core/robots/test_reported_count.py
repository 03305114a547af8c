"""Counts in a robot's signs of life; a robot may send anything."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.core.robots.simulated_network import SimulatedStudio, publisher_of

from app.core.robots.reported_count import GROWING_S, MAX_COUNT, ReportedCount


@pytest.fixture
def studio(tmp_path: Path) -> Iterator[SimulatedStudio]:
    made = SimulatedStudio(tmp_path)
    yield made
    made.close()


@pytest.mark.parametrize(
    "hostile",
    [None, True, -1, 3.0, "4", [5], {"count": 6}, MAX_COUNT + 1, 10**400, float("nan"), float("inf")],
)
def test_anything_but_a_count_is_ignored(hostile: object) -> None:
    count = ReportedCount()
    count.take(hostile, 1.0)
    assert (count.value, count.is_growing(1.0)) == (0, False)
    count.take(7, 2.0)
    count.take(hostile, 3.0)
    assert (count.value, count.grew_s) == (7, 2.0)


def test_count_of_a_restarted_driver_begins_anew() -> None:
    count = ReportedCount()
    count.take(7, 1.0)
    count.take(0, 2.0)
    assert (count.value, count.is_growing(2.0)) == (0, False)
    count.take(1, 3.0)
    assert count.is_growing(3.0)
    assert not count.is_growing(3.0 + GROWING_S)


def test_signs_of_life_bring_the_counts_of_the_robots_own_program(studio: SimulatedStudio) -> None:
    pepper = studio.network.add("Pepper")
    studio.tick()

    def alive(node: str = pepper.node, **counts: object) -> None:
        told: dict[str, object] = {
            "op": "alive",
            "id": "",
            "action": "",
            "state": "running",
            "not_ended": [],
            "error": None,
        }
        data = json.dumps({**told, **counts}).encode()
        studio.network.publish_bytes("/Pepper/answer", data, publisher_of(node, "/Pepper/answer"))
        studio.tick()

    link = studio.session.fleet.link("Pepper")
    assert link is not None
    alive(rejected=12, errors=3)
    assert (link.rejected.value, link.errors.value) == (12, 3)
    alive(rejected="many", errors=[1])
    alive("stranger", rejected=99, errors=99)
    assert (link.rejected.value, link.errors.value) == (12, 3)
    assert link.rejected.is_growing(studio.clock.now)
    alive()
    assert (link.rejected.value, link.errors.value) == (0, 0)
    alive(rejected=5)
    studio.network.remove(pepper)
    studio.network.add("Pepper", "pepper-2")
    studio.tick()
    assert link.rejected.value == 0, "another program"
