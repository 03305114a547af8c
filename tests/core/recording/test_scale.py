"""Tests of the visible range of a timeline and the format of its times."""

from __future__ import annotations

import random

import pytest

from app.core.recording.replay.scale import MIN_SPAN_NS, TimeScale, clock_text, duration_text

S = 1_000_000_000
WHOLE = TimeScale.full(100 * S, 860 * S)


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


@pytest.mark.parametrize("seed", range(5))
def test_visible_range_stays_within_the_recording(seed):
    chance, scale = random.Random(seed), WHOLE
    for _ in range(200):
        at_ns = scale.time(chance.uniform(-1, 2))
        assert scale.first_ns <= at_ns <= scale.last_ns
        scale = chance.choice(
            (
                scale.zoomed(chance.choice((0.0, 0.1, 0.7, 1.5, 1e9)), at_ns),
                scale.moved(chance.randint(-900 * S, 900 * S)),
                scale.with_time(chance.randint(100 * S, 860 * S)),
            )
        )
        assert scale.first_ns <= scale.start_ns < scale.end_ns <= scale.last_ns
        assert scale.span_ns >= MIN_SPAN_NS
        assert 1 <= len(list(scale.marks(8))) <= 10


def test_zoom_keeps_the_time_under_the_mouse():
    scale = WHOLE.zoomed(0.25, 400 * S)
    assert scale.relative_position(400 * S) == pytest.approx(WHOLE.relative_position(400 * S))
    assert not scale.is_full
    assert scale.zoomed(100.0, 400 * S).is_full


def test_tick_marks_are_multiples_of_the_step_from_the_recording_start():
    marks = list(WHOLE.marks(8))
    assert [each - 100 * S for each in marks] == [k * 120 * S for k in range(7)]
    inside = WHOLE.zoomed(0.1, 480 * S)
    assert all((each - 100 * S) % round(inside.mark_interval_s(8) * 1e9) == 0 for each in inside.marks(8))


def test_recording_of_a_single_moment_has_a_visible_range():
    scale = TimeScale.full(5 * S, 5 * S)
    assert scale.span_ns == MIN_SPAN_NS
    assert scale.time(0.5) <= scale.last_ns
