"""Round trips and throughput of nep's native wire, as ratios to plain pyzmq measured in the same run.

    python bench/nep_roundtrip.py [--samples 200]

One side runs in this process, the other in its child, over loopback. All variants are interleaved in random
order within each block; "plain again" is plain pyzmq against itself and shows how far to trust the rest.
"""

from __future__ import annotations

import argparse
import os
import random
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import zmq

import nep

SIZES = (100, 16_384, 262_144, 1_048_576, 4_194_304)

ECHO = """
import sys, threading, zmq, nep
node = nep.node("echo")
sub, pub = node.new_sub("ping", "bytes"), node.new_pub("pong", "bytes")
def native():
    for message in sub:
        pub.publish_bytes(message.data)
context = zmq.Context()
def plain(kind, ports):
    back = context.socket(zmq.PUB); back.setsockopt(zmq.LINGER, 0)
    there = context.socket(zmq.SUB); there.subscribe(b"")
    ports.append(back.bind_to_random_port("tcp://127.0.0.1"))
    there.connect("tcp://127.0.0.1:" + sys.argv[kind])
    while True:
        back.send(there.recv(copy=False), copy=False)
ports = []
threading.Thread(target=native, daemon=True).start()
threading.Thread(target=plain, args=(1, ports), daemon=True).start()
while not ports:
    pass
print(ports[0], flush=True)
sys.stdin.read()
"""


class Plain:
    """One pair of plain PUB and SUB sockets to the echo."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]]) -> None:
        self.there = context.socket(zmq.PUB)
        self.back = context.socket(zmq.SUB)
        self.back.subscribe(b"")
        self.port = self.there.bind_to_random_port("tcp://127.0.0.1")

    def trip(self, data: bytes) -> None:
        """There and back."""
        self.there.send(data, copy=False)
        self.back.recv(copy=False)


def measure(trip: Callable[[bytes], None], data: bytes, samples: int) -> list[float]:
    """Seconds of each round trip."""
    taken = []
    for _ in range(samples):
        started = time.perf_counter()
        trip(data)
        taken.append(time.perf_counter() - started)
    return taken


def main() -> None:
    """Measure and print one table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--samples", type=int, default=200)
    samples = parser.parse_args().samples
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    plain = Plain(context)
    with nep.master("127.0.0.1:0", learn_s=0.0) as master:
        environment = {
            **os.environ,
            "NEP_MASTER": master.address,
            "PYTHONPATH": str(Path(__file__).parents[1]),
        }
        child = subprocess.Popen(
            [sys.executable, "-c", ECHO, str(plain.port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        assert child.stdout is not None
        plain.back.connect(f"tcp://127.0.0.1:{child.stdout.readline().strip()}")
        with nep.node("bench", master=master.address) as node:
            sub, pub = node.new_sub("pong", "bytes"), node.new_pub("ping", "bytes")

            def native(data: bytes) -> None:
                pub.publish(data)
                if sub.receive(5.0) is None:
                    raise SystemExit("a message did not come back")

            while True:  # until the plain pair is connected both ways
                plain.there.send(b"x")
                if plain.back.poll(50):
                    break
            while plain.back.poll(100):
                plain.back.recv()
            compare({"plain": plain.trip, "plain again": plain.trip, "native": native}, samples)
        child.kill()
        child.communicate()
    context.destroy(0)


def compare(variants: dict[str, Callable[[bytes], None]], samples: int) -> None:
    """Print the median round trip of "plain" and the others' ratio to it, for each size."""
    print(f"{'bytes':>9} {'plain ms':>9} {'plain again':>12} {'native':>7}")
    for size in SIZES:
        data = os.urandom(size)
        taken: dict[str, list[float]] = {name: [] for name in variants}
        for _ in range(10):
            for name in random.sample(list(variants), len(variants)):
                taken[name] += measure(variants[name], data, samples // 10)
        medians = {name: statistics.median(each) for name, each in taken.items()}
        ratios = {name: median / medians["plain"] for name, median in medians.items()}
        row = f"{medians['plain'] * 1e3:>9.3f} {ratios['plain again']:>12.2f} {ratios['native']:>7.2f}"
        print(f"{size:>9} {row}")


if __name__ == "__main__":
    main()
