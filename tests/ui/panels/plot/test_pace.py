"""Tests of the refresh rate of plots."""

from __future__ import annotations

import time

import pytest

from app.ui.panels.watch.plot.pace import DRAW_INTERVAL_TICKS, MAX_CPU_SHARE, DrawThrottle


def test_fast_plot_redraws_as_often_as_it_advances_one_pixel() -> None:
    pace = DrawThrottle()
    assert [pace.interval_ticks(pixel_s) for pixel_s in (0.0, 1 / 15, 0.1, 0.2, 1e9)] == [2, 2, 3, 6, 8]


@pytest.mark.parametrize("took_s", [0.004, 0.012, 0.02])
def test_drawing_stays_within_its_cpu_share(took_s: float) -> None:
    pace = DrawThrottle()
    for _turn in range(100):
        pace.add_sample(took_s)
    each_s = pace.interval_ticks(0.0) / 30
    assert took_s / each_s <= MAX_CPU_SHARE * 1.15  # tolerance: whole ticks
    assert pace.interval_ticks(0.0) <= DRAW_INTERVAL_TICKS[1]


def test_slowest_plot_still_redraws_several_times_per_second() -> None:
    pace = DrawThrottle()
    for _turn in range(100):
        pace.add_sample(3.0)
    assert pace.interval_ticks(0.0) == DRAW_INTERVAL_TICKS[1]


class Canvas:
    paint_time_s = 0.0


def test_paint_time_is_counted_only_once() -> None:
    pace, canvas = DrawThrottle(), Canvas()
    canvas.paint_time_s = 100.0
    with pace.measure(canvas):
        began = time.thread_time()
        while time.thread_time() - began < 0.02:
            pass
    assert pace.draw_time_s == pytest.approx(10.0, abs=0.5)
    with pace.measure(canvas):
        pass
    assert pace.draw_time_s == pytest.approx(9.0, abs=0.5)
