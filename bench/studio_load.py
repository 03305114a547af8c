"""Benchmark of 1 kB JSON messages from other processes in the open window: 50 000 and 300 000 per second.

    python bench/studio_load.py [--seconds 8] [--rates 50000 300000] [--publishers 2]

The window is the real one: the Developer layout, the Topics panel and an Inspector on a busy topic.
The cost of the panels' own painting is measured first, with 30 messages per second on the same topics
("plain", and "plain again", which shows the noise); what a row needs beyond it is the cost of the
messages. "bare" is the delay (p99) of a program that only waits at the same time: results from a busy
computer are not meaningful. Drops are exact if every sent message is kept for the panels, or counted
as dropped or lost.
"""

from __future__ import annotations

import argparse
import sys
import time
from contextlib import ExitStack

from studio_window import BARE, Child, Meter, Row, Studio, child, network, run_for, studio, until, verdict

from app.intents import Inspect

GUI_BEYOND, LATE_MS, MEMORY_MB, CLOSE_S = 0.10, 10.0, 40.0, 2.0
PLAIN_HZ = 30
SETTLE_S = 3.0

PUBLISHER = """
import json, sys, threading, time, nep
name = sys.argv[1]
message = {"joints": [round(0.01 * n, 3) for n in range(100)], "name": name, "state": "walking", "ok": True}
message["rest"] = "x" * (1000 - len(json.dumps(message)) - 12)
data = json.dumps(message).encode()
node = nep.node("load " + name[1:])
pub = node.new_pub(name, "json")
pause = threading.Event()
print("ready", flush=True)
for line in sys.stdin:
    rate, seconds = (float(word) for word in line.split())
    before, began = pub.count, time.perf_counter()
    while True:
        now = time.perf_counter() - began
        if now > seconds:
            break
        due = int(rate * now) - (pub.count - before)
        if due <= 0:
            pause.wait(0.001)
        for _ in range(min(due, 500)):
            pub.publish_bytes(data)
    print(pub.count, pub.count - before, round(time.perf_counter() - began, 3), flush=True)
"""


class Load:
    """Window that receives the messages of several publisher processes."""

    def __init__(self, opened: Studio, publishers: list[Child], topics: list[str], bare: Child) -> None:
        self.opened, self.publishers, self.topics = opened, publishers, topics
        self.meter, self._bare, self.bare_ms = Meter(opened), bare, 0.0

    def row(self, name: str, rate: float, seconds: float, plain: Row | None = None) -> Row:
        """Let the publishers send `rate` messages per second in total; print and return a row."""
        self._bare.tell(f"{seconds}")
        for publisher in self.publishers:
            publisher.tell(f"{rate / len(self.publishers)} {seconds + 0.5}")
        run_for(0.3)
        row = self.meter.measure(seconds)
        bare_ms = float(self._bare.answer())
        answers = [publisher.answer().split() for publisher in self.publishers]
        offered = sum(float(count) / float(took) for _total, count, took in answers)
        beyond = row.gui - (plain or row).gui
        print(
            f"{name:>12} {offered:>9,.0f} {row.gui:>7.1%} {beyond:>7.1%} {row.ticks:>7.1%} "
            f"{row.panels:>7.1%} {row.process:>7.0%} {row.late_p50:>6.1f} {row.late_p99:>6.1f} "
            f"{row.late_max:>6.1f} {bare_ms:>6.1f} {row.memory:>7.0f}",
            flush=True,
        )
        if plain is None or name.startswith("plain"):
            self.bare_ms = max(self.bare_ms, bare_ms)  # a load keeps the computer busy anyway
        return row

    def counted(self) -> tuple[int, int, int]:
        """Return the numbers of kept, dropped and lost messages of all topics."""
        known = [self.opened.session.live.topics[topic] for topic in self.topics]
        kept = sum(topic.received - topic.dropped for topic in known)
        return kept, sum(topic.dropped for topic in known), sum(topic.missed for topic in known)

    def is_exact(self) -> bool:
        """Wait for the last messages; return True if every sent message is kept or counted."""
        for publisher in self.publishers:
            publisher.tell("30 1.0")  # losses of a burst are detected by the messages after it
        sent = sum(int(publisher.answer().split()[0]) for publisher in self.publishers)
        before = (-1, -1, -1)
        while self.counted() != before:
            before = self.counted()
            run_for(SETTLE_S)
        kept, dropped, missed = before
        exact = sent == kept + dropped + missed
        print(
            f"sent {sent:,} = kept {kept:,} + dropped {dropped:,} + lost on the way {missed:,}: "
            + ("exact" if exact else f"NOT exact, {sent - kept - dropped - missed:,} are unaccounted for")
        )
        return exact

    def measure(self, rates: list[float], seconds: float) -> bool:
        """Print the table; return True if all goals were reached."""
        print(
            f"{'':>12} {'sent/s':>9} {'GUI':>7} {'beyond':>7} {'tick':>7} {'panels':>7} {'process':>7} "
            f"{'late50':>6} {'p99 ms':>6} {'max':>6} {'bare':>6} {'RSS MB':>7}"
        )
        plain = self.row("plain", PLAIN_HZ * len(self.publishers), seconds)
        self.row("plain again", PLAIN_HZ * len(self.publishers), seconds, plain)
        reached = True
        for rate in rates:
            rows = [self.row(name, rate, seconds, plain) for name in (f"{rate:,.0f}", "and again")]
            reached &= (
                all(row.gui - plain.gui <= GUI_BEYOND and row.late_p99 <= LATE_MS for row in rows)
                and rows[1].memory - rows[0].memory <= MEMORY_MB
            )
        print(
            f"goals: beyond at most {GUI_BEYOND:.0%}, p99 late at most {LATE_MS:g} ms, "
            f"memory flat within {MEMORY_MB:g} MB"
        )
        return self.is_exact() and reached


def main() -> int:
    """Measure and print a table; return 0 if every goal was reached."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--rates", type=float, nargs="*", default=[50_000.0, 300_000.0])
    parser.add_argument("--publishers", type=int, default=2)
    arguments = parser.parse_args()
    topics = [f"/busy/{number}" for number in range(arguments.publishers)]
    with ExitStack() as stack:
        address = stack.enter_context(network())
        bare = stack.enter_context(child(BARE, (), address))
        publishers = [stack.enter_context(child(PUBLISHER, (topic,), address)) for topic in topics]
        for each in (bare, *publishers):
            each.answer()
        opened = stack.enter_context(studio(address))
        until(lambda: all(topic in opened.session.live.topics for topic in topics), "the topics are listed")
        opened.commands.request(Inspect(topics[0]))
        for topic in topics:
            opened.session.live.watch(topic)
        run_for(3.0)
        load = Load(opened, publishers, topics, bare)
        reached = load.measure(arguments.rates, arguments.seconds)
        for publisher in publishers:
            publisher.tell(f"{max(arguments.rates) / len(publishers)} 4.0")
        run_for(1.5)
        began = time.monotonic()
        opened.window.close()
        took = time.monotonic() - began
        print(f"closed in {took:.2f} s while they were sending (goal: {CLOSE_S:g} s)")
        return verdict(reached and took <= CLOSE_S, load.bare_ms)


if __name__ == "__main__":
    sys.exit(main())
