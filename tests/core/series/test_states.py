"""Tests of states that change often: statistics match the runs, drawing is limited by the pixels."""

from __future__ import annotations

from itertools import pairwise

import pytest

from app.core.series.states import States


def dense(count: int) -> States:
    """Return states that change ``count`` times, a thousand times per second, then stay true for 50 s."""
    states = States()
    for place in range(count):
        states.add(place / 1000, "true" if place % 2 else "false")
    states.add(count / 1000 + 50, "true")
    return states


def test_states_that_change_within_a_step_are_reduced_to_a_single_state() -> None:
    states = dense(8000)
    every = list(states.runs(-1, 100))
    assert len(every) == 8000
    few = list(states.runs(-1, 100, step_s=0.5, excluded_values=("false",)))
    assert len(few) <= 20
    assert {run.value for run in few} == {"true"}
    assert all(run in every for run in few)
    assert few[-1].end_s == states.last_s
    assert all(later.start_s - sooner.start_s < 0.51 for sooner, later in pairwise(few))
    assert states.values_in(0, 0.0005) == {"false"}
    assert states.values_in(-1, 100) == {"true", "false"}


def test_unknown_states_are_skipped_only_on_request() -> None:
    states = States()
    states.add(1.0, "")
    states.add(2.0, None)
    states.add(3.0, "up")
    assert [run.value for run in states.runs(0, 9)] == ["", None, "up"]
    assert [run.value for run in states.runs(0, 9, excluded_values=())] == ["", "up"]
    assert states.values_in(0, 9) == {"", "up"}
    assert list(States().runs(0, 9, step_s=1.0)) == []


@pytest.mark.parametrize(
    ("begin_s", "end_s"), [(-1.0, 100.0), (0.01, 0.0205), (0.05, 0.05), (90.0, 95.0), (-9.0, -8.0)]
)
def test_change_count_and_duration_match_the_runs(begin_s: float, end_s: float) -> None:
    states = dense(100)
    runs = list(states.runs(begin_s, end_s))
    assert states.change_count(begin_s, end_s) == max(0, len(runs) - 1)
    lasted = [min(run.end_s, end_s) - max(run.start_s, begin_s) for run in runs if run.value == "true"]
    assert states.duration_s("true", begin_s, end_s) == pytest.approx(sum(max(0.0, each) for each in lasted))
