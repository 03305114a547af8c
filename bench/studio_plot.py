"""Benchmark of plots in the real window: ten curves at 1 kHz over a minute, and a million points.

    python bench/studio_plot.py [--seconds 6]

Another process publishes ten topics at 1 kHz each (10 000 messages per second), or one topic with ten
numbers at 1 kHz. The Plot panel draws ten curves of them, whose last minute is filled in before.
Measured is the processor time of the whole process beyond that of the window with an empty plot
("plain"; "plain again" is the A/A row), and the time of one drawing. In the last row one curve has a
million points and gets a thousand more each second.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack

import numpy as np
from studio_window import BARE, Meter, Row, Studio, child, network, run_for, studio, until, verdict

from app.ui.panels.watch.plot.panel import PlotPanel

SHARE, SETTLE_S = 0.25, 1.5
CURVES, HZ, BEFORE_S = 10, 1000, 60
SENDER = """
import math, sys, threading, time
import nep
node = nep.node("sender")
many = [node.new_pub(f"/many/{number}", "json") for number in range(10)]
one = node.new_pub("/one", "json")
print("ready", flush=True)
pause = threading.Event()
for line in sys.stdin:
    what, seconds = line.split()
    begin, sent = time.perf_counter(), 0
    print("begun", flush=True)
    while (now := time.perf_counter() - begin) < float(seconds):
        while sent < now * 1000:
            t = sent / 1000
            if what == "many":
                for number, publisher in enumerate(many):
                    publisher.publish({"v": math.sin(t * 3 + number) + 0.1 * math.sin(t * 97)})
            else:
                one.publish({f"v{number}": math.sin(t * 3 + number) for number in range(10)})
            sent += 1
        pause.wait(0.002)
"""


class Drawings:
    """Durations of the drawings of a plot, in ms."""

    def __init__(self, plot: PlotPanel) -> None:
        self.took_ms: list[float] = []
        self._draw = plot._draw  # noqa: SLF001
        plot._draw = self._timed  # type: ignore[method-assign]  # noqa: SLF001

    def _timed(self) -> None:
        began = time.thread_time()
        self._draw()
        self.took_ms.append((time.thread_time() - began) * 1000)


def opened_plot(opened: Studio) -> PlotPanel:
    """Open the Plot panel and return it."""
    dock = opened.window.open_panel("plot")
    assert dock is not None
    dock.panel.resize(dock.panel.size())
    assert isinstance(dock.panel, PlotPanel)
    return dock.panel


def fill(plot: PlotPanel, points: int) -> None:
    """Append `points` past samples to each curve, 1 ms apart, up to the current time."""
    now_s = plot.session.live.series.now_s()
    times = now_s - np.arange(points, 0, -1) / HZ
    for number, shown in enumerate(plot.shown):
        noise = np.random.default_rng(number).normal(size=points) * 0.1
        shown.curve.samples.extend(times, np.sin(times * 3 + number) + noise, np.zeros(points, dtype=bool))


def replot(plot: PlotPanel, fields: Sequence[str]) -> None:
    """Plot these fields and remove all others."""
    for shown in list(plot.shown):
        plot.remove(shown.name)
    for field in fields:
        topic, path = field.split(".")
        plot.plot_field(topic, path)


def show(name: str, row: Row, plain: float, drawings: Drawings) -> float:
    """Print a row of the table; return the process's share beyond the plain window."""
    took = drawings.took_ms
    each = f"{statistics.median(took):>8.1f}" if took else f"{'':>8}"
    print(
        f"{name:>28} {row.process:>8.1%} {row.process - plain:>8.1%} {row.gui:>7.1%} {row.ticks:>7.1%} "
        f"{row.panels:>7.1%} {each} {row.late_p99:>9.1f} {row.memory:>7.0f}",
        flush=True,
    )
    took.clear()
    return row.process - plain


def main() -> int:
    """Measure and print a table; return 0 if the goal was reached."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=6.0)
    seconds = parser.parse_args().seconds
    with ExitStack() as stack:
        address = stack.enter_context(network())
        bare = stack.enter_context(child(BARE, (), address))
        bare.answer()
        sender = stack.enter_context(child(SENDER, (), address))
        sender.answer()
        opened = stack.enter_context(studio(address))
        until(lambda: "/many/9" in opened.session.live.topics, "the topics are there")
        plot = opened_plot(opened)
        meter, drawings = Meter(opened), Drawings(plot)
        run_for(SETTLE_S)
        print(
            f"{'':>28} {'process':>8} {'beyond':>8} {'GUI':>7} {'tick':>7} {'panels':>7} {'draw ms':>8} "
            f"{'late p99':>9} {'RSS MB':>7}"
        )
        plain = meter.measure(seconds)
        show("plain", plain, plain.process, drawings)
        show("plain again", meter.measure(seconds), plain.process, drawings)
        bare.tell(str(3 * seconds))
        beyond = []
        cases = (
            ("many", "ten topics at 1 kHz", [f"/many/{number}.v" for number in range(CURVES)], BEFORE_S * HZ),
            ("one", "one topic, ten fields", [f"/one.v{number}" for number in range(CURVES)], BEFORE_S * HZ),
            ("one", "a million points", ["/one.v0"], 1_000_000),
        )
        for what, name, fields, points in cases:
            replot(plot, fields)
            fill(plot, points)
            if points > BEFORE_S * HZ:
                plot._set_span("all")  # noqa: SLF001
            sender.tell(f"{what} {seconds + SETTLE_S + 1}")
            sender.answer()
            run_for(SETTLE_S)
            came = [len(shown.curve.samples) + shown.curve.samples.evicted_count for shown in plot.shown]
            lost = plot.curves.lost
            drawings.took_ms.clear()
            row = meter.measure(seconds)
            more = [len(each.curve.samples) + each.curve.samples.evicted_count for each in plot.shown]
            beyond.append(show(name, row, plain.process, drawings))
            rates = [(b - a) / row.seconds for a, b in zip(came, more, strict=True)]
            print(
                f"{'':>28} {min(rates):.0f} to {max(rates):.0f} numbers a second of each curve, "
                f"{plot.points.text()}, {plot.curves.lost - lost} lost"
            )
            run_for(1.5)
        print(f"goal: ten curves at 1 kHz take less than {SHARE:.0%} of a core beyond the plain window")
        return verdict(max(beyond[:2]) < SHARE, float(bare.answer()))


if __name__ == "__main__":
    sys.exit(main())
