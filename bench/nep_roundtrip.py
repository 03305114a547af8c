"""Benchmark of round trips on nep's native wire, as a ratio to plain pyzmq measured in the same run.

    python bench/nep_roundtrip.py [--trips 30] [--blocks 16] [--limit 4]

One side runs in this process, the other in a child process, over loopback, each in its main thread or
in a dedicated thread. All variants are interleaved in random order within each block. "plain again"
is a second series of plain pyzmq: a row counts only if both differ by at most 5 %, and the mean of
all rows only if the mean of "plain again" does. "local" uses a Unix socket where the platform has
them: plain pyzmq, and nep with string topics (here bytes that are sent unchanged), which nep sends
over Unix sockets.

Each message lies at a different offset in memory: where its bytes begin within a page can double the
time that the kernel needs to copy it, see `bench/README.md`.
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
from nep.backends.zeromq.bindings import has_unix_sockets

SIZES = (100, 1_024, 16_384, 65_536, 262_144, 1_048_576, 4_194_304, 8_388_608)
JUDGED = 16_384
PAGE = 4096

ECHO = """
import sys, threading, time, zmq, nep
node = nep.node("echo")
def native(kind):
    sub, pub = node.new_sub("ping_" + kind, kind), node.new_pub("pong_" + kind, kind)
    threading.Thread(target=lambda: echo(sub, pub), daemon=True).start()
def echo(sub, pub):
    while True:
        pub.publish_bytes(sub.receive().data)
native("bytes")
native("string")
def plain(there, back):
    while True:
        back.send(there.recv(copy=False), copy=False)
context = zmq.Context()
ends = []
for end in sys.argv[1:]:
    back, there = context.socket(zmq.PUB), context.socket(zmq.SUB)
    there.subscribe(b"")
    back.bind(end.rpartition(":")[0] + ":*" if end.startswith("tcp") else end + "-back")
    ends.append(back.getsockopt_string(zmq.LAST_ENDPOINT))
    there.connect(end)
    threading.Thread(target=plain, args=(there, back), daemon=True).start()
print(*ends, flush=True)
for line in sys.stdin:
    print(time.process_time(), flush=True)
"""

Trip = Callable[[memoryview], None]


class Plain:
    """Pair of plain PUB and SUB sockets to the echo; the PUB socket is bound to `end`."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], end: str) -> None:
        self.there = context.socket(zmq.PUB)
        self.back = context.socket(zmq.SUB)
        self.back.subscribe(b"")
        self.there.bind(end)
        self.end = self.there.getsockopt_string(zmq.LAST_ENDPOINT)

    def connect(self, end: str) -> None:
        """Connect to the echo and wait until both directions work."""
        self.back.connect(end)
        while not self.back.poll(50):
            self.there.send(b"x")
        while self.back.poll(200):
            self.back.recv()

    def trip(self, data: memoryview) -> None:
        """Send the data to the echo and wait for its return."""
        self.there.send(data, copy=False)
        self.back.recv(copy=False)


class Native:
    """Publisher and subscriber of `node` to the echo, with the message type `kind`."""

    def __init__(self, node: nep.Node, kind: str) -> None:
        self._sub = node.new_sub(f"pong_{kind}", kind)
        self._pub = node.new_pub(f"ping_{kind}", kind)

    def trip(self, data: memoryview) -> None:
        """Send the data to the echo and wait for its return."""
        self._pub.publish_bytes(data)
        if self._sub.receive(5.0) is None:
            raise SystemExit("a message did not come back")

    def close(self) -> None:
        """Close both; exit if messages were lost."""
        if self._sub.lost:
            raise SystemExit(f"{self._sub.lost} messages were lost")
        self._pub.close()
        self._sub.close()


def measure(trip: Trip, ask: Child, size: int, trips: int) -> Sample:
    """Return the median of some round trips and the processor time of both processes per trip."""
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
    """Return the processor time that the child has used, in seconds."""
    ask.write("time")
    return float(ask.read())


def compare(variants: dict[str, Trip], ask: Child, blocks: int, trips: int, limit: int) -> int:
    """Print the median round trip of "plain" and the ratio of the other variants to it, for each size."""
    others = [name for name in variants if name != "plain"]
    print(f"{'bytes':>9} {'plain ms':>9}", *(f"{name:>14}" for name in others), " CPU ms  native CPU")
    ratios: dict[str, list[float]] = {name: [] for name in others}
    for size in SIZES:
        ready = {name: partial(measure, trip, ask, size, trips) for name, trip in variants.items()}
        found = interleaved(ready, blocks, limit=limit)
        plain = found["plain"]
        here = {name: found[name].seconds / plain.seconds for name in others}
        if size >= JUDGED:
            for name, ratio in here.items():
                ratios[name].append(ratio)
        cpu = found["native"].cpu_s / plain.cpu_s
        columns = " ".join(f"{ratio:>14.2f}" for ratio in here.values())
        doubt = "" if is_trusted(here["plain again"]) else "  does not count"
        print(
            f"{size:>9} {plain.seconds * 1e3:>9.3f} {columns} {plain.cpu_s * 1e3:>7.3f} {cpu:>11.2f}{doubt}",
            flush=True,
        )
    print(f"÷ plain, geometric mean from {JUDGED} bytes up:")
    for name, each in ratios.items():
        print(f"{name:>20} {mean(each):.3f}")
    return verdict(mean(ratios["plain again"]))


def mean(ratios: list[float]) -> float:
    """Return the geometric mean."""
    return math.exp(statistics.fmean(math.log(each) for each in ratios))


def main() -> int:
    """Measure and print one table; return 1 if the run does not count."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trips", type=int, default=30)
    parser.add_argument("--blocks", type=int, default=16)
    parser.add_argument(
        "--limit", type=int, default=4, help="so many times the blocks at most, see blocks.py"
    )
    arguments = parser.parse_args()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    plain = Plain(context, "tcp://127.0.0.1:*")
    # Platforms without Unix sockets use a second TCP socket.
    local = Plain(context, f"ipc://@nep-bench-{os.getpid()}" if has_unix_sockets() else "tcp://127.0.0.1:*")
    with (
        nep.master("127.0.0.1:0", learn_s=0.0) as master,
        nep.node("bench", master=master.address) as node,
        other_process(ECHO, (plain.end, local.end), master.address) as ask,
    ):
        for pair, end in zip((plain, local), ask.read().split(), strict=True):
            pair.connect(end)
        pairs = [Native(node, "bytes"), Native(node, "string")]
        variants: dict[str, Trip] = {
            "plain": plain.trip,
            "plain again": plain.trip,
            "plain, local": local.trip,
            "native": pairs[0].trip,
            "native, local": pairs[1].trip,
        }
        code = compare(variants, ask, arguments.blocks, arguments.trips, arguments.limit)
        for made in pairs:
            made.close()
    context.destroy(0)
    return code


if __name__ == "__main__":
    sys.exit(main())
