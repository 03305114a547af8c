"""Tests of the ruler of a timeline: round times, and labels that don't overlap."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.timeline.ruler import Ruler
from app.core.timeline.scale import TimeScale
from tests.core.timeline.test_scale import WHOLE, S, scales

GAP_PX, CHARACTER_PX = 3.0, 7.5
RULERS = st.builds(Ruler, scales(), st.floats(1, 4000), st.floats(20, 200), st.booleans())


def width(text: str) -> float:
    return CHARACTER_PX * len(text)


@given(RULERS)
def test_labels_overlap_neither_each_other_nor_the_edges(ruler):
    ticks = list(ruler.ticks(width, GAP_PX))
    labels = [(tick.x, tick.x + GAP_PX + width(tick.text)) for tick in ticks if tick.text]
    assert all(left >= 0 and right <= ruler.width_px for left, right in labels)
    assert all(end <= start for (_left, end), (start, _right) in itertools.pairwise(labels))


@given(RULERS)
def test_ticks_are_visible_and_spaced(ruler):
    ticks, scale = list(ruler.ticks(width, GAP_PX)), ruler.scale
    assert all(scale.start_ns <= tick.at_ns <= scale.end_ns for tick in ticks)
    min_spacing = min(ruler.spacing_px, ruler.width_px / 2) * (1 - 1e-6)
    assert all(second.x - first.x >= min_spacing for first, second in itertools.pairwise(ticks))
    assert len(ticks) <= max(2, ruler.width_px / ruler.spacing_px) + 1


def test_ticks_are_multiples_of_the_interval_from_the_start():
    ruler = Ruler(WHOLE, 8 * 78.0, 78.0)
    assert [at_ns - 100 * S for at_ns in ruler.times()] == [k * 120 * S for k in range(7)]
    inside = Ruler(WHOLE.zoomed(0.1, 480 * S), 8 * 78.0, 78.0)
    step_ns = round(inside.interval_s * 1e9)
    assert all((at_ns - 100 * S) % step_ns == 0 for at_ns in inside.times())


def test_ticks_by_clock_are_multiples_of_the_interval_in_local_time():
    scale = TimeScale.full(1_790_000_000_123_456_789, 1_790_000_600_123_456_789)
    ticks = list(Ruler(scale, 800.0, 78.0, by_clock=True).ticks(width, GAP_PX))
    assert ticks
    assert all(tick.text.endswith(":00") for tick in ticks if tick.text)


@pytest.mark.parametrize(("length_ns", "texts"), [(0, ["0:00.000"]), (2 * S, ["0:00", "0:01"])])
def test_label_without_room_at_the_right_is_left_out(length_ns, texts):
    ruler = Ruler(TimeScale.full(0, length_ns), 150.0, 78.0)
    assert [tick.text for tick in ruler.ticks(width, GAP_PX) if tick.text] == texts
