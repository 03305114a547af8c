"""Benchmark of the cost per delivered message from one publisher to many subscribers, and the reverse.

    python3 dev.py bench nep_fan                                 five minutes at most
    python3 dev.py bench nep_fan -- --blocks 3 --ends 1 10 50

Each of the many ends is a process; this process is the single end. The result is the CPU time of all
processes and threads for each delivered message, which depends little on the load of the computer.
Variants are interleaved in random order in each block; a run is valid if plain pyzmq differs from
itself by at most 5 %.

    out      this process publishes, each other process receives every message
    in       each other process publishes, this process receives all messages
    paced    50 messages/s from each publisher: nearly every message wakes its receiver
    burst    1000 messages without pause: a receiver finds several messages at each wake-up, fewer with
             more processes per processor; the result depends on the scheduler too

The total cost of a message is fitted by a line over the number of ends: a + b * ends. Scaling is linear
if a delivery to 50 ends costs at most 1.2 times a delivery to 10; paced messages decide.
"""

from __future__ import annotations

import argparse
import itertools
import json
import random
import statistics
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import NamedTuple

import zmq
from blocks import Child, cpu_s, is_trusted, other_process, verdict

import nep

ENDS = (1, 5, 10, 50)
SIZE = 1000
LINEAR = 1.2
WAIT_S = 30.0
ROOM = 1_000_000
"""Inbox size of a subscriber in messages: a complete burst fits, as in plain sockets without a limit."""
WAYS, PACES = ("out", "in"), ("paced", "burst")
COUNTS = {"burst": 1000, "paced": 50}
PACED_HZ = 50.0

END = """
import json, sys, threading, time, zmq, nep
sizes, hub, wait_s, hertz = json.loads(sys.argv[1]), json.loads(sys.argv[2]), 30.0, float(sys.argv[3])
node, context, data = nep.node("end"), zmq.Context(), bytes(1000)
subs = {n: node.new_sub(f"out_{n}", "bytes") for n in sizes}
pubs = {n: node.new_pub(f"in_{n}", "bytes") for n in sizes}
plain_subs, plain_pubs = {}, {}
for n in sizes:
    plain_subs[n], plain_pubs[n] = context.socket(zmq.SUB), context.socket(zmq.XPUB)
    plain_subs[n].setsockopt(zmq.RCVHWM, 0)
    plain_pubs[n].setsockopt(zmq.SNDHWM, 0)
    plain_subs[n].setsockopt(zmq.RCVTIMEO, int(wait_s * 1000))
    plain_subs[n].subscribe(b"")
    plain_subs[n].connect(hub[str(n)])
    plain_pubs[n].bind("tcp://127.0.0.1:*")
def listen(n):
    if not subs[n].listen(timeout_s=wait_s)[0]:
        raise SystemExit(f"a message for one of {n} did not come; lost: {subs[n].lost}")
does = {
    ("nep", "out"): listen, ("nep", "in"): lambda n: pubs[n].publish(data),
    ("plain", "out"): lambda n: plain_subs[n].recv(), ("plain", "in"): lambda n: plain_pubs[n].send(data),
}
print(json.dumps({n: plain_pubs[n].getsockopt_string(zmq.LAST_ENDPOINT) for n in sizes}), flush=True)
pause = threading.Event()
for line in sys.stdin:
    asked = json.loads(line)
    if asked == "cpu":
        print(time.process_time(), flush=True)
        continue
    if asked == "met":
        for each in plain_pubs.values():
            each.recv()  # the subscription of the one
        print("met", flush=True)
        continue
    if asked == "lost":
        print(sum(each.lost or 0 for each in subs.values()), flush=True)
        continue
    what, way, pace, n, count = asked
    do, begun = does[what, way], time.perf_counter()
    for number in range(count):
        if pace == "paced" and way == "in":
            pause.wait(max(0.0, begun + number / hertz - time.perf_counter()))
        do(n)
    print("done", flush=True)
"""


class Cell(NamedTuple):
    """Variant: library ("nep" or "plain"), direction, pace and number of ends."""

    what: str
    way: str
    pace: str
    ends: int


class Hub:
    """Single end in this process: publisher, subscriber and plain sockets for each number of ends."""

    def __init__(self, node: nep.Node, context: zmq.Context[zmq.Socket[bytes]], ends: Sequence[int]) -> None:
        self._data = bytes(SIZE)
        self._subs = {n: node.new_sub(f"in_{n}", "bytes", max_messages=ROOM) for n in ends}
        self._pubs = {n: node.new_pub(f"out_{n}", "bytes") for n in ends}
        self._plain_pubs = {n: context.socket(zmq.XPUB) for n in ends}  # XPUB reports subscriptions
        self._plain_subs = {n: context.socket(zmq.SUB) for n in ends}
        for n in ends:
            self._plain_pubs[n].setsockopt(zmq.SNDHWM, 0)
            self._plain_pubs[n].setsockopt(zmq.XPUB_VERBOSE, 1)
            self._plain_pubs[n].bind("tcp://127.0.0.1:*")
            self._plain_subs[n].setsockopt(zmq.RCVHWM, 0)
            self._plain_subs[n].setsockopt(zmq.RCVTIMEO, int(WAIT_S * 1000))
            self._plain_subs[n].subscribe(b"")

    @property
    def plain_ends(self) -> dict[int, str]:
        """Return the endpoints for the plain subscribers, by the number of ends."""
        return {n: each.getsockopt_string(zmq.LAST_ENDPOINT) for n, each in self._plain_pubs.items()}

    def meet(self, plain_ends: Sequence[Mapping[str, str]]) -> None:
        """Connect to the plain publishers of all ends and wait until all subscribers are connected."""
        for each in plain_ends:
            for number, end in each.items():
                self._plain_subs[int(number)].connect(end)
        for n, plain in self._plain_pubs.items():
            for _ in range(n):
                if not plain.poll(int(WAIT_S * 1000)):
                    raise SystemExit("not all plain subscribers came")
                plain.recv()
        pause, deadline = threading.Event(), time.monotonic() + WAIT_S
        while any(self._pubs[n].subscribers < n for n in self._pubs):
            if time.monotonic() > deadline:
                raise SystemExit("not all subscribers came")
            pause.wait(0.01)

    def do(self, cell: Cell) -> Callable[[], object]:
        """Return the function that publishes or receives one message of a variant."""
        n = cell.ends
        if cell.what == "nep":
            return (
                partial(self._pubs[n].publish, self._data) if cell.way == "out" else partial(self._listen, n)
            )
        return (
            partial(self._plain_pubs[n].send, self._data) if cell.way == "out" else self._plain_subs[n].recv
        )

    def _listen(self, n: int) -> None:
        if not self._subs[n].listen(timeout_s=WAIT_S)[0]:
            raise SystemExit(f"a message of {n} publishers did not come; lost: {self._subs[n].lost}")

    @property
    def lost(self) -> int:
        """Return the number of lost messages."""
        return sum(each.lost or 0 for each in self._subs.values())


def used_s(children: Sequence[Child]) -> float:
    """Return the CPU time of this process and the child processes, in seconds."""
    return cpu_s() + sum(map(float, tell(children, "cpu")))


def tell(children: Sequence[Child], what: str) -> list[str]:
    """Send a request to all child processes and return their replies."""
    for each in children:
        each.write(json.dumps(what))
    return [each.read() for each in children]


def cost(hub: Hub, children: Sequence[Child], cell: Cell) -> float:
    """Return the CPU time of all processes for each delivered message, in seconds."""
    count = COUNTS[cell.pace]
    active = children[: cell.ends]
    do = hub.do(cell)
    before = used_s(active)
    for each in active:
        each.write(json.dumps([*cell, count]))
    if cell.way == "out":
        pause, begun = threading.Event(), time.perf_counter()
        for number in range(count):
            if cell.pace == "paced":
                pause.wait(max(0.0, begun + number / PACED_HZ - time.perf_counter()))
            do()
    else:
        for _ in range(count * cell.ends):
            do()
    for each in active:
        if each.read() != "done":
            raise SystemExit("one of the ends gave another answer")
    return (used_s(active) - before) / (count * cell.ends)


def measure(
    hub: Hub, children: Sequence[Child], ends: Sequence[int], blocks: int, ends_at: float
) -> dict[tuple[str, Cell], list[float]]:
    """Measure each variant once per block until ``blocks`` or ``ends_at``; "again" repeats the plain ones."""
    cells = [Cell(*each) for each in itertools.product(("nep", "plain"), WAYS, PACES, ends)]
    variants = [(each.what, each) for each in cells] + [
        ("again", each) for each in cells if each.what == "plain"
    ]
    taken: dict[tuple[str, Cell], list[float]] = {each: [] for each in variants}
    longest_s = 0.0
    for block in range(blocks + 1):
        started = time.monotonic()
        for name, cell in random.sample(variants, len(variants)):
            if block:
                taken[name, cell].append(cost(hub, children, cell))
            elif cell.pace == "burst":  # warm-up: the first run allocates memory
                cost(hub, children, cell)
        longest_s = max(longest_s, time.monotonic() - started)
        if block and time.monotonic() + longest_s > ends_at:
            break
    return taken


def line(ends: Sequence[int], each: Sequence[float]) -> tuple[float, float]:
    """Fit a line to the total cost of a message; return the constant cost and the cost for each end."""
    if len(ends) < 2:
        return 0.0, each[0]
    slope, beginning = statistics.linear_regression(
        ends, [n * one for n, one in zip(ends, each, strict=True)]
    )
    return beginning, slope


def show(taken: Mapping[tuple[str, Cell], Sequence[float]], ends: Sequence[int]) -> int:
    """Print the tables; return 1 if the run is not valid or scaling is not linear."""
    medians = {key: statistics.median(found) for key, found in taken.items()}
    again = []
    is_linear = True
    print("processor time of all processes for each delivered message, µs; of a message with n ends: a + b n")
    heads = "".join(f"{n:>8}" for n in ends)
    print(f"{'':>22}{heads} {'a':>8} {'b':>8} {'50 ÷ 10':>8}")
    for way, pace in itertools.product(WAYS, PACES):
        for name in ("nep", "plain", "again"):
            what = "nep" if name == "nep" else "plain"
            each = [medians[name, Cell(what, way, pace, n)] for n in ends]
            beginning, slope = line(ends, each)
            by_ends = dict(zip(ends, each, strict=True))
            ratio = by_ends[50] / by_ends[10] if {10, 50} <= by_ends.keys() else None
            columns = "".join(f"{one * 1e6:>8.2f}" for one in each)
            shown = "" if ratio is None else f"{ratio:>8.2f}"
            beyond = name == "nep" and ratio is not None and ratio > LINEAR
            is_linear &= not (beyond and pace == "paced")
            mark = f"  above {LINEAR}" if beyond else ""
            title = f"{way}, {pace}, {name}"
            print(f"{title:>22}{columns} {beginning * 1e6:>8.2f} {slope * 1e6:>8.2f} {shown}{mark}")
        again += [
            medians["again", Cell("plain", way, pace, n)] / medians["plain", Cell("plain", way, pace, n)]
            for n in ends
        ]
    off = sum(not is_trusted(one) for one in again)
    print(f"plain against itself is beyond 5 % in {off} of {len(again)} columns; their mean:")
    return max(verdict(statistics.geometric_mean(again)), int(not is_linear))


def words(number: int, ends: Sequence[int], plain_ends: Mapping[int, str]) -> tuple[str, ...]:
    """Return the arguments of an end: its numbers of ends, the plain endpoints and the pace."""
    return json.dumps([n for n in ends if number < n]), json.dumps(plain_ends), str(PACED_HZ)


def main() -> int:
    """Measure and print the tables; return 1 if the run is not valid or scaling is not linear."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--ends", type=int, nargs="+", default=list(ENDS), help="how many there are of the many"
    )
    parser.add_argument("--blocks", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=300.0, help="no more blocks when this is over")
    arguments = parser.parse_args()
    ends = sorted(set(arguments.ends))
    if ends[0] < 1 or arguments.blocks < 1:
        parser.error("there is at least one end, and one block")
    ends_at = time.monotonic() + arguments.seconds
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with ExitStack() as stack:
        stack.callback(context.destroy, 0)
        master = stack.enter_context(nep.master("127.0.0.1:0", learn_s=0.0))
        hub = Hub(stack.enter_context(nep.node("hub", master=master.address)), context, ends)
        children = [
            stack.enter_context(other_process(END, words(number, ends, hub.plain_ends), master.address))
            for number in range(ends[-1])
        ]
        plain_ends = [json.loads(each.read()) for each in children]
        hub.meet(plain_ends)
        tell(children, "met")
        taken = measure(hub, children, ends, arguments.blocks, ends_at)
        lost = hub.lost + sum(map(int, tell(children, "lost")))
    print(f"{SIZE} bytes; {min(map(len, taken.values()))} blocks; lost by nep: {lost}")
    return max(show(taken, ends), int(lost > 0))


if __name__ == "__main__":
    sys.exit(main())
