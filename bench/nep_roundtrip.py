"""Round trips of nep's native wire: their time, as a ratio to plain pyzmq measured in the same run.

    python bench/nep_roundtrip.py [--trips 30] [--blocks 16] [--limit 4]

One side runs in this process, the other in its child, over loopback, each in its main thread or a thread that
does nothing else. All variants are interleaved in random order within each block; "plain again" is plain
pyzmq against itself: a row counts only when that is within 5 %, and the mean of all only when the mean of
that is.

Every message lies at another place in memory: where exactly its bytes begin within a page can double the time
that the kernel takes to copy it, see `bench/README.md`.
"""

from __future__ import annotations

import argparse
import math
import os
import random
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial

import zmq
from blocks import Child, Sample, cpu_s, interleaved, is_trusted, other_process, verdict

import nep

SIZES = (100, 1_024, 16_384, 65_536, 262_144, 1_048_576, 4_194_304, 8_388_608)
JUDGED = 16_384
PAGE = 4096

ECHO = """
import sys, threading, time, zmq, nep
node = nep.node("echo")
sub, pub = node.new_sub("ping", "bytes"), node.new_pub("pong", "bytes")
def native():
    while True:
        pub.publish_bytes(sub.receive().data)
def plain(port, ports):
    context = zmq.Context()
    back = context.socket(zmq.PUB)
    there = context.socket(zmq.SUB)
    there.subscribe(b"")
    ports.append(back.bind_to_random_port("tcp://127.0.0.1"))
    there.connect("tcp://127.0.0.1:" + port)
    while True:
        back.send(there.recv(copy=False), copy=False)
ports = []
threading.Thread(target=native, daemon=True).start()
threading.Thread(target=plain, args=(sys.argv[1], ports), daemon=True).start()
while not ports:
    time.sleep(0.01)
print(ports[0], flush=True)
for line in sys.stdin:
    print(time.process_time(), flush=True)
"""

Trip = Callable[[memoryview], None]


class Plain:
    """One pair of plain PUB and SUB sockets to the echo."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]]) -> None:
        self.there = context.socket(zmq.PUB)
        self.back = context.socket(zmq.SUB)
        self.back.subscribe(b"")
        self.port = self.there.bind_to_random_port("tcp://127.0.0.1")

    def connect(self, port: str) -> None:
        """Connect to the echo, and wait until both ways are there."""
        self.back.connect(f"tcp://127.0.0.1:{port}")
        while not self.back.poll(50):
            self.there.send(b"x")
        while self.back.poll(200):
            self.back.recv()

    def trip(self, data: memoryview) -> None:
        """There and back."""
        self.there.send(data, copy=False)
        self.back.recv(copy=False)


def measure(trip: Trip, ask: Child, size: int, trips: int) -> Sample:
    """The median of some round trips; processor time of both processes for each."""
    room = os.urandom(size + PAGE)
    places = [memoryview(room)[place : place + size] for place in range(0, PAGE, 16)]
    taken = []
    used = cpu_s() + child_s(ask)
    for data in random.choices(places, k=trips):
        started = time.perf_counter()
        trip(data)
        taken.append(time.perf_counter() - started)
    used = cpu_s() + child_s(ask) - used
    return Sample(statistics.median(taken), used / trips)


def child_s(ask: Child) -> float:
    """Processor time of the child so far."""
    ask.write("time")
    return float(ask.read())


def compare(variants: dict[str, Trip], ask: Child, blocks: int, trips: int, limit: int) -> int:
    """Print the median round trip of "plain" and the others' ratio to it, for each size."""
    print(f"{'bytes':>9} {'plain ms':>9} {'plain again':>12} {'native':>7} {'CPU ms':>8} {'native CPU':>11}")
    again, native = [], []
    for size in SIZES:
        ready = {name: partial(measure, trip, ask, size, trips) for name, trip in variants.items()}
        found = interleaved(ready, blocks, limit=limit)
        plain = found["plain"]
        a_a, ratio = (found[name].seconds / plain.seconds for name in ("plain again", "native"))
        if size >= JUDGED:
            again.append(a_a)
            native.append(ratio)
        cpu = found["native"].cpu_s / plain.cpu_s
        times = f"{size:>9} {plain.seconds * 1e3:>9.3f} {a_a:>12.2f} {ratio:>7.2f}"
        doubt = "" if is_trusted(a_a) else "  does not count"
        print(f"{times} {plain.cpu_s * 1e3:>8.3f} {cpu:>11.2f}{doubt}", flush=True)
    print(f"native ÷ plain, geometric mean from {JUDGED} bytes up: {mean(native):.3f}")
    return verdict(mean(again))


def mean(ratios: list[float]) -> float:
    """The geometric mean."""
    return math.exp(statistics.fmean(math.log(each) for each in ratios))


def main() -> int:
    """Measure and print one table; 1 when the run does not count."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trips", type=int, default=30)
    parser.add_argument("--blocks", type=int, default=16)
    parser.add_argument(
        "--limit", type=int, default=4, help="so many times the blocks at most, see blocks.py"
    )
    arguments = parser.parse_args()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    plain = Plain(context)
    with (
        nep.master("127.0.0.1:0", learn_s=0.0) as master,
        nep.node("bench", master=master.address) as node,
        node.new_sub("pong", "bytes") as sub,
        node.new_pub("ping", "bytes") as pub,
        other_process(ECHO, (str(plain.port),), master.address) as ask,
    ):
        plain.connect(ask.read())

        def native(data: memoryview) -> None:
            pub.publish_bytes(data)
            if sub.receive(5.0) is None:
                raise SystemExit("a message did not come back")

        variants: dict[str, Trip] = {"plain": plain.trip, "plain again": plain.trip, "native": native}
        code = compare(variants, ask, arguments.blocks, arguments.trips, arguments.limit)
        if sub.lost:
            raise SystemExit(f"{sub.lost} messages were lost")
    context.destroy(0)
    return code


if __name__ == "__main__":
    sys.exit(main())
