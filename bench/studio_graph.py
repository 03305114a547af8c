"""Benchmark of the Graph panel with 500 nodes and 2 000 connections, updated once per second.

    python bench/studio_graph.py [--nodes 500] [--lines 2000] [--seconds 8]

The graph is posted to the session as if a master had sent it. "plain" is the same window with 10
nodes; "plain again" is a second series, which shows the noise. "closed" has collapsed groups, the
default for this number of nodes; "all" shows all nodes; "100 %" shows a part of them with labels;
"still" is the same without updates. Paintings are those of the graph. At the end, the layout of all
nodes is timed, with the delay of the window's event loop meanwhile.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import cast

from PySide6.QtCore import QTimer
from studio_window import BARE, Meter, Row, Studio, child, network, run_for, studio, until, verdict

from app.core.network.source import GraphReceived
from app.ui.intents import OpenPanel
from app.ui.panels.watch.graph.panel import GraphPanel
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo

SHARE, LATE_MS = 0.05, 100.0
HOSTS, STAGES, FORWARD, ABROAD = 10, 5, 0.9, 0.15


def graph(nodes: int, lines: int, revision: int, update: int) -> GraphView:
    """Return a graph on several computers, in stages as in robots: drivers, filters, planning, actuators."""
    chance = random.Random(nodes)
    infos = {
        f"n{n}": NodeInfo(f"n{n}", f"node {n}", f"computer {n % HOSTS}", 100 + n, "Python", "native", n, 0.01)
        for n in range(nodes)
    }
    stage = {n: chance.randrange(STAGES) for n in range(nodes)}
    found: dict[str, TopicInfo] = {}
    while len(found) < lines:
        source = chance.randrange(nodes)
        host = (source + (chance.random() < ABROAD)) % HOSTS
        wanted = (stage[source] + (1 if chance.random() < FORWARD else -1)) % STAGES
        target = chance.randrange(nodes)
        if (
            target != source
            and target % HOSTS == host
            and (stage[target] == wanted or nodes < HOSTS * STAGES)
        ):
            name = f"/topic/{len(found)}"
            rate = 5.0 + (len(found) + update) % 40
            publisher = PublisherInfo(1, f"n{source}", (), False, update, 9, update, 1, rate, rate * 90)
            subscriber = SubscriberInfo(2, f"n{target}", update, 0)
            found[name] = TopicInfo(
                name, "json", "json", (publisher,), (subscriber,), rate, rate * 90, 1, 0, 0.0
            )
    return GraphView(1, revision, infos, found)


class Figures:
    """Timer that posts updated numbers of a graph to the session once per second."""

    def __init__(self, opened: Studio, graphs: Sequence[GraphView]) -> None:
        self._post = opened.session._mailbox.post_event  # noqa: SLF001
        self._graphs, self._turn = graphs, 0
        self._timer = QTimer()
        self._timer.timeout.connect(self.tell)

    def tell(self) -> None:
        """Post the next numbers."""
        self._turn += 1
        self._post(GraphReceived(self._graphs[self._turn % len(self._graphs)], 0.001))

    def go_on(self, on: bool) -> None:
        """Start or stop the updates."""
        (self._timer.start if on else self._timer.stop)(*((1000,) if on else ()))


def placed(panel: GraphPanel) -> bool:
    """Return True once the newest graph has its layout and is shown."""
    scene = panel.canvas.scene
    return scene is not None and scene.graph == panel._requested_graph and not panel._thread.is_busy  # noqa: SLF001


def show(name: str, row: Row, painted: int) -> None:
    """Print a row of the table."""
    print(
        f"{name:>14} {row.process:>8.1%} {row.gui:>7.1%} {row.ticks:>7.1%} {row.panels:>7.1%} "
        f"{painted / row.seconds:>10.1f} {row.late_p99:>9.1f} {row.late_max:>6.1f} {row.memory:>7.0f}",
        flush=True,
    )


class Runs:
    """Measurement of one state of the window after another; each is printed."""

    def __init__(self, opened: Studio, panel: GraphPanel) -> None:
        self.meter, self.panel = Meter(opened), panel
        self.rows: dict[str, Row] = {}
        print(
            f"{'':>14} {'process':>8} {'GUI':>7} {'tick':>7} {'panels':>7} {'paintings/s':>11} "
            f"{'late p99':>8} {'max':>6} {'RSS MB':>7}"
        )

    def measure(self, name: str, figures: Figures, seconds: float, *, on: bool = True) -> None:
        """Measure and print the window for `seconds`, with or without updates."""
        figures.go_on(on)
        run_for(2.0)
        before = self.panel.canvas.paint_count
        self.rows[name] = self.meter.measure(seconds)
        figures.go_on(False)
        show(name, self.rows[name], self.panel.canvas.paint_count - before)

    def place_all(self) -> float:
        """Expand every group and wait for the layout of all nodes.

        Return the longest delay of the window's event loop, in ms.
        """
        panel, began, late = self.panel, time.monotonic(), [0.0]
        panel._layout = None  # noqa: SLF001
        scene = panel.canvas.scene
        assert scene is not None
        every = frozenset(group.key for group in scene.graph.groups)
        panel._options = replace(panel._options, toggled_groups=every)  # noqa: SLF001
        while len(late) < 2 or not placed(panel):
            late.append(self.meter.measure(0.25).late_max)
        print(
            f"{'':>14} all have their places after {time.monotonic() - began:.1f} s, "
            f"the window late by {max(late):.0f} ms at most"
        )
        return max(late)


def opened_graph(opened: Studio) -> GraphPanel:
    """Return the window's Graph panel, disconnected from the master so that only posted graphs are shown."""
    until(lambda: opened.session.live.master.kind == "connected", "the master is there")
    opened.session.live.source.close()  # its empty graphs would mix with the posted graphs
    opened.commands.request(OpenPanel("graph"))
    bench = opened.window.bench
    assert bench is not None
    return cast("GraphPanel", bench.docks["graph"].panel)


def main() -> int:
    """Measure and print a table; return 0 if the goals were reached."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--nodes", type=int, default=500)
    parser.add_argument("--lines", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=8.0)
    arguments = parser.parse_args()
    seconds = arguments.seconds
    few = [graph(10, 15, 1, update) for update in range(1, 5)]
    many = [graph(arguments.nodes, arguments.lines, 2, update) for update in range(1, 5)]
    with ExitStack() as stack:
        address = stack.enter_context(network())
        bare = stack.enter_context(child(BARE, (), address))
        bare.answer()
        opened = stack.enter_context(studio(address))
        panel = opened_graph(opened)
        runs = Runs(opened, panel)
        figures = Figures(opened, few)
        figures.tell()
        until(lambda: placed(panel), "ten nodes have their places")
        for name in ("plain", "plain again"):
            runs.measure(name, figures, seconds / 2)
        figures = Figures(opened, many)
        bare.tell(str(seconds))
        figures.tell()
        run_for(0.5)
        until(lambda: placed(panel), "closed groups have their places")
        runs.measure("closed", figures, seconds)
        late_ms = runs.place_all()
        runs.measure("all", figures, seconds)
        panel.canvas.zoom_to(1.0)
        runs.measure("100 %", figures, seconds)
        runs.measure("still", figures, seconds, on=False)
        print(f"goals: panels below {SHARE:.0%} of a core; late by {LATE_MS:g} ms at most")
        cheap = all(runs.rows[name].panels < SHARE for name in ("closed", "all", "100 %", "still"))
        return verdict(cheap and late_ms <= LATE_MS, float(bare.answer()))


if __name__ == "__main__":
    sys.exit(main())
