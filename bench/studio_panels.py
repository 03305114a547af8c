"""Benchmark of each panel while it shows data: alone in the real window, one after the other.

    python bench/studio_panels.py [--seconds 8] [--panels plot image ...]

Another process publishes a robot's state at 100 Hz, a colour image of 640 x 480 at 25 Hz, twenty
small topics at 10 Hz and log records at 20 Hz; a virtual robot is connected. "plain" is the window
with the Alerts panel alone, which shows nothing; "plain again" is the A/A row. For each panel the
table has: the time of one call of `refresh`; the time of the window's thread beyond the plain window,
including all painting; the time of a graphics driver without a GPU beyond it (the editor was shown
before, so the driver composes the window); and how often the window is updated. Shares are of one
processor core.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

from studio_idle import ROBOT, Paints, driver_seconds
from studio_window import BARE, Child, Studio, child, network, run_for, studio, until, verdict

from app.ui.shell.docking.dock import Dock

TRUSTED, SETTLE_S = 0.02, 1.5
PLAIN = "alerts"
STATE, CAMERA = "/busy/state", "/busy/camera"
SENDER = """
import logging, math, threading, time
import numpy as np
import nep
node = nep.node("sender")
state, camera = node.new_pub("/busy/state", "json"), node.new_pub("/busy/camera", "image")
small = [node.new_pub(f"/busy/small/{n}", "json") for n in range(20)]
log = node.new_pub("/log", "json")
frame = np.zeros((480, 640, 3), np.uint8)
print("ready", flush=True)
pause, begin, n = threading.Event(), time.perf_counter(), 0
while True:
    t = n / 100
    state.publish({"joints": [round(math.sin(t + k), 4) for k in range(20)], "pose": {"x": t % 3, "y": 1.0},
                   "walking": n // 100 % 2 == 0, "mode": "autonomous"})
    if n % 4 == 0:
        frame[:] = n % 255
        camera.publish(frame)
    if n % 10 == 0:
        for k, each in enumerate(small):
            each.publish({"value": math.cos(t + k), "count": n})
    if n % 5 == 0:
        log.publish({"level": "info", "node": "sender", "text": f"line {n}", "stamp": time.time()})
    n += 1
    pause.wait(max(0.0, begin + n / 100 - time.perf_counter()))
"""
SHOWN = {
    "inspector": ("show_topic", STATE),
    "image": ("show_topic", CAMERA),
    "plot": ("plot_field", STATE, "joints[0]"),
    "publish": ("show_topic", STATE),
}
"""Method that selects what a panel shows, and its arguments, for panels without a default."""


@dataclass
class Cost:
    """Row of the table: shares of one core, and milliseconds per call of `refresh`."""

    refresh_ms: float = 0.0
    refreshes_hz: float = 0.0
    window: float = 0.0
    driver: float = 0.0
    updates_hz: float = 0.0


class Refreshes:
    """Timer of the `refresh` calls of a dock."""

    def __init__(self, dock: Dock) -> None:
        self.count, self.took_s = 0, 0.0
        self._refresh: Callable[[], object] = dock.refresh
        dock.refresh = self._timed  # type: ignore[method-assign]

    def _timed(self) -> None:
        began = time.thread_time()
        self._refresh()
        self.took_s += time.thread_time() - began
        self.count += 1


def alone(opened: Studio, name: str) -> Dock | None:
    """Open this panel and close all others; return None if the layout doesn't have it."""
    bench = opened.window.bench
    if bench is None:
        return None
    dock = bench.open(name)
    if dock is None:
        return None
    for other in bench.open_names():
        if other != name:
            bench.docks[other].close()
    what, *words = SHOWN.get(name, ("",))
    if what and hasattr(dock.panel, what):
        getattr(dock.panel, what)(*words)
    return dock


def measure(paints: Paints, dock: Dock, seconds: float) -> Cost:
    """Run the window with this panel alone for `seconds` and return its cost."""
    run_for(SETTLE_S)
    refreshes, paints.count = Refreshes(dock), 0
    began, window, driver = time.perf_counter(), time.thread_time(), driver_seconds()
    run_for(seconds)
    took = time.perf_counter() - began
    cost = Cost(
        1000 * refreshes.took_s / max(1, refreshes.count),
        refreshes.count / took,
        (time.thread_time() - window) / took,
        (driver_seconds() - driver) / took,
        paints.count / took,
    )
    del dock.refresh  # restores the method of the class
    return cost


def show(name: str, cost: Cost, plain: Cost) -> None:
    """Print a row of the table."""
    print(
        f"{name:>14} {cost.refresh_ms:>10.3f} {cost.refreshes_hz:>9.0f} {cost.window:>8.1%} "
        f"{cost.window - plain.window:>8.1%} {cost.driver - plain.driver:>8.1%} {cost.updates_hz:>10.1f}",
        flush=True,
    )


def rows(opened: Studio, bare: Child, names: list[str], seconds: float) -> tuple[bool, float]:
    """Print the table; return whether both plain rows agree, and the delay of an idle program in ms."""
    paints = Paints(opened)
    print(
        f"{'':>14} {'refresh ms':>10} {'times/s':>9} {'window':>8} {'beyond':>8} {'driver':>8} "
        f"{'updates/s':>10}"
    )
    dock = alone(opened, PLAIN)
    assert dock is not None
    plain = measure(paints, dock, seconds)
    show("plain", plain, plain)
    for name in names:
        shown = alone(opened, name)
        if shown is None:
            print(f"{name:>14} is in another layout")
        else:
            show(name, measure(paints, shown, seconds), plain)
    dock = alone(opened, PLAIN)
    assert dock is not None
    bare.tell(str(seconds))
    again = measure(paints, dock, seconds)
    show("plain again", again, plain)
    return abs(again.window - plain.window) <= TRUSTED, float(bare.answer())


def main() -> int:
    """Measure and print a table; return 0 if the run counts."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--panels", nargs="*", help="all of them when none is named")
    arguments = parser.parse_args()
    with ExitStack() as stack:
        address = stack.enter_context(network())
        bare = stack.enter_context(child(BARE, (), address))
        bare.answer()
        sender = stack.enter_context(child(SENDER, (), address))
        sender.answer()
        opened = stack.enter_context(studio(address, "behaviour"))  # the editor makes the driver composite
        opened.session.launcher.start_virtual_robot(ROBOT)
        until(lambda: opened.session.fleet.connected, "the virtual robot is there", 60.0)
        until(lambda: CAMERA in opened.session.live.topics, "the topics are listed")
        opened.commands.run("layout.developer")
        names = arguments.panels or sorted(set(opened.window.panels) - {PLAIN, "behaviour", "timeline"})
        same, late_ms = rows(opened, bare, names, arguments.seconds)
    if not same:
        print(
            f"the plain window differs from the one before by more than {TRUSTED:.0%} of a core: "
            "this run does NOT count"
        )
        return 1
    return verdict(same, late_ms)


if __name__ == "__main__":
    sys.exit(main())
