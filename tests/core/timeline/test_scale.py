"""Tests of the visible range of a timeline and the format of its times."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.timeline.scale import MIN_SPAN_NS, TimeScale
from app.core.timeline.times import clock_text, duration_text

S = 1_000_000_000
YEAR_NS = 365 * 86_400 * S
WHOLE = TimeScale.full(100 * S, 860 * S)
LENGTHS_NS = st.one_of(st.sampled_from([0, 1, MIN_SPAN_NS, 10 * YEAR_NS]), st.integers(0, 10 * YEAR_NS))
POSITIONS = st.floats(0, 1)


@st.composite
def scales(draw: st.DrawFn) -> TimeScale:
    """Return the scale of contents from 0 ns to 10 years, zoomed and moved."""
    first_ns = draw(st.integers(0, 60 * YEAR_NS))
    scale = TimeScale.full(first_ns, first_ns + draw(LENGTHS_NS))
    for _ in range(draw(st.integers(0, 4))):
        scale = scale.zoomed(draw(st.floats(1e-9, 1e9)), scale.time(draw(POSITIONS)))
        scale = scale.moved(draw(st.integers(-YEAR_NS, YEAR_NS)))
    return scale


@pytest.mark.parametrize(
    ("ns", "digits", "words"),
    [
        (0, 0, "0:00"),
        (446_412_999_999, 3, "7:26.412"),
        (761 * S, 0, "12:41"),
        (3723 * S, 0, "1:02:03"),
        (-1_500_000_000, 3, "-0:01.500"),
    ],
)
def test_durations_are_formatted(ns, digits, words):
    assert duration_text(ns, digits=digits) == words


def test_clock_time_has_milliseconds():
    assert clock_text(1_790_000_000_412_999_999).endswith(".412")


@given(scales(), POSITIONS, st.floats(1e-300, 1e300), st.integers(-(10**30), 10**30))
def test_visible_range_stays_within_the_contents(scale, position, factor, by_ns):
    at_ns = scale.time(position)
    for changed in (scale, scale.zoomed(factor, at_ns), scale.moved(by_ns), scale.with_time(at_ns)):
        assert changed.first_ns <= changed.start_ns < changed.end_ns <= changed.last_ns
        assert changed.span_ns >= MIN_SPAN_NS
    assert scale.start_ns <= at_ns <= scale.end_ns


@given(scales(), POSITIONS)
def test_times_and_positions_are_inverse(scale, position):
    at_ns = scale.time(position)
    assert abs(scale.relative_position(at_ns) - position) <= 1 / scale.span_ns + 2**-52
    assert abs(scale.time(scale.relative_position(at_ns)) - at_ns) <= 1 + scale.span_ns * 2**-52


@given(scales(), POSITIONS, st.floats(1e-3, 1))
def test_zoom_keeps_the_time_under_the_pointer(scale, position, factor):
    at_ns = scale.time(position)
    inside = scale.zoomed(factor, at_ns)
    outside = inside.zoomed(scale.span_ns / inside.span_ns, at_ns)
    for zoomed in (inside, outside):
        assert zoomed.relative_position(at_ns) == pytest.approx(scale.relative_position(at_ns), abs=2e-6)


@given(scales(), st.floats(1e-9, 1e9), POSITIONS)
def test_time_of_the_playhead_becomes_visible(scale, factor, position):
    at_ns = scale.first_ns + round(position * (scale.last_ns - scale.first_ns))
    at_ns = min(at_ns, scale.last_ns)
    shown = scale.zoomed(factor, scale.start_ns).with_time(at_ns)
    assert shown.start_ns <= at_ns <= shown.end_ns


def test_zoom_ends_at_the_whole_contents_and_at_one_millisecond():
    scale = WHOLE.zoomed(0.25, 400 * S)
    assert scale.relative_position(400 * S) == pytest.approx(WHOLE.relative_position(400 * S))
    assert not scale.is_full
    assert scale.zoomed(100.0, 400 * S).is_full
    assert scale.zoomed(1e-300, 400 * S).span_ns == MIN_SPAN_NS


@pytest.mark.parametrize("length_ns", [0, 1, MIN_SPAN_NS - 1])
def test_contents_of_a_single_moment_have_a_visible_range(length_ns):
    scale = TimeScale.full(5 * S, 5 * S + length_ns)
    assert scale.span_ns == MIN_SPAN_NS
    assert scale.time(0.5) <= scale.last_ns


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite_are_rejected(number):
    with pytest.raises(ValueError, match="finite"):
        WHOLE.time(number)
    with pytest.raises(ValueError, match="zoom factor"):
        WHOLE.zoomed(number, 400 * S)
    with pytest.raises(TypeError):
        TimeScale.full(0, number)
    with pytest.raises(TypeError):
        TimeScale.full(number, 1)


@pytest.mark.parametrize("factor", [0.0, -1.0])
def test_zoom_factors_that_are_not_positive_are_rejected(factor):
    with pytest.raises(ValueError, match="zoom factor"):
        WHOLE.zoomed(factor, 400 * S)
