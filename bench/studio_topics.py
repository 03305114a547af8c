"""Benchmark of the Topics panel with 10 000 topics, updated 20 times per second.

    python bench/studio_topics.py [--topics 10000] [--seconds 8]

A graph with new numbers for every topic is posted to the session 20 times per second, as if a master
had sent it, and the Topics panel shows it. Each topic's last message appears to be at most a tenth of
a second old, so that ages change as well. Measured is the processor time of the whole process.
"plain" is the same window with 10 topics.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from time import time_ns

from PySide6.QtCore import QTimer
from studio_window import BARE, Meter, Row, Studio, child, network, run_for, studio, until, verdict

from app.core.network.source import GraphReceived
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo

SHARE, HZ, SETTLE_S = 0.25, 20, 4.0
NODES = 50


def graph(topics: int, update: int) -> GraphView:
    """Return a graph as a master sends it; its numbers change with every update."""
    nodes = {
        f"n{n}": NodeInfo(f"n{n}", f"driver {n}", "here", 100 + n, "python", "native", 0)
        for n in range(NODES)
    }
    found = {}
    for number in range(topics):
        name, rate = f"/many/{number:05d}", 10.0 + (number + update) % 50
        node = f"n{number % NODES}"
        one = PublisherInfo(number, node, (), False, update, update * 90, update, update, rate, 90 * rate)
        found[name] = TopicInfo(
            name,
            "json",
            "json",
            (one,),
            rate_hz=rate,
            bandwidth_Bps=90 * rate,
            last_stamp_ns=1,
        )
    return GraphView(1, 1 + topics, nodes, found)  # nodes and topics stay the same; only figures change


def fed(opened: Studio, meter: Meter, topics: int, seconds: float) -> Row:
    """Measure the window while the session gets new numbers 20 times per second.

    The graphs are created beforehand.
    """
    graphs = [graph(topics, update) for update in range(1, 5)]
    post, turn = opened.session._mailbox.post_event, [0]  # noqa: SLF001

    def tell() -> None:
        turn[0] += 1
        post(GraphReceived(graphs[turn[0] % len(graphs)], 0.001))

    timer = QTimer()
    timer.timeout.connect(tell)
    timer.start(1000 // HZ)
    run_for(SETTLE_S)
    row = meter.measure(seconds)
    timer.stop()
    return row


def show(name: str, row: Row) -> None:
    """Print a row of the table."""
    print(
        f"{name:>14} {row.process:>8.1%} {row.gui:>7.1%} {row.ticks:>7.1%} {row.panels:>7.1%} "
        f"{row.late_p99:>9.1f} {row.late_max:>6.1f} {row.memory:>7.0f}",
        flush=True,
    )


def main() -> int:
    """Measure and print a table; return 0 if the goal was reached."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--topics", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=8.0)
    arguments = parser.parse_args()
    with ExitStack() as stack:
        address = stack.enter_context(network())
        bare = stack.enter_context(child(BARE, (), address))
        bare.answer()
        opened = stack.enter_context(studio(address))
        until(lambda: opened.session.live.master.kind == "connected", "the master is there")
        opened.session.live.source.close()  # its empty graphs would mix with the posted graphs
        opened.session.live.now_ns = lambda: time_ns() % 100_000_000
        meter = Meter(opened)
        print(
            f"{'':>14} {'process':>8} {'GUI':>7} {'tick':>7} {'panels':>7} {'late p99':>9} {'max':>6} "
            f"{'RSS MB':>7}"
        )
        show("plain", fed(opened, meter, 10, arguments.seconds / 2))
        show("plain again", fed(opened, meter, 10, arguments.seconds / 2))
        bare.tell(str(arguments.seconds))
        row = fed(opened, meter, arguments.topics, arguments.seconds)
        show(f"{arguments.topics} topics", row)
        print(f"goal: the process takes less than {SHARE:.0%} of a core")
        return verdict(row.process < SHARE, float(bare.answer()))


if __name__ == "__main__":
    sys.exit(main())
