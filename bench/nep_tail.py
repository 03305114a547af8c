"""Benchmark of the tail latency of nep with and without batching, in one run.

    python bench/nep_tail.py [--seconds 20] [--blocks 6]

The child process publishes a small message at a steady rate (1, 1 000 and 60 000 per second), or
bursts of 40 with a single message 150 microseconds after each. This process receives each of them.
The age of a message is its arrival time minus its time stamp, on one computer's clock. "batch" is a
publisher with default settings, "never" one created with `batch=False`. The blocks of both are
interleaved. Messages of a burst and single messages are reported separately.

Most of the latency in the tail is caused by the computer; the ratio shows what batching adds.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time

from blocks import Child, other_process

import nep

SENDER = """
import json, sys, time, nep
node = nep.node("sender")
topics = {"batch": node.new_pub("batch", "bytes"), "never": node.new_pub("never", "bytes", batch=False)}
print("up", flush=True)
def until(moment):
    left = moment - time.perf_counter()
    if left > 0.002:
        time.sleep(left - 0.001)
    while time.perf_counter() < moment:
        pass
for line in sys.stdin:
    name, rate, count = json.loads(line)
    publish, begun = topics[name].publish, time.perf_counter()
    for number in range(count):
        if rate:
            until(begun + number / rate)
            publish(b"steady")
        else:
            until(begun + number * 0.005)
            for _ in range(40):
                publish(b"burst")
            until(time.perf_counter() + 150e-6)
            publish(b"alone")
    print("done", flush=True)
"""

PACES = {"1 a second": 1, "1 000 a second": 1_000, "60 000 a second": 60_000, "bursts": 0}


def ages(child: Child, subscriber: nep.Subscriber, order: list[object]) -> dict[bytes, list[int]]:
    """Return the age of each message in nanoseconds, grouped by its data."""
    came: dict[bytes, list[int]] = {}
    _name, rate, count = order
    assert isinstance(count, int)
    wanted = count if rate else 41 * count
    child.write(json.dumps(order))
    for _ in range(wanted):
        message = subscriber.receive(10.0)
        now = time.time_ns()
        if message is None:
            raise SystemExit("a message did not come")
        came.setdefault(bytes(message.data), []).append(now - (message.stamp_ns or 0))
    child.read()
    return came


def at(sorted_ns: list[int], share: float) -> float:
    """Return the quantile `share` (0 to 1) of ascending ages, in microseconds."""
    return sorted_ns[min(len(sorted_ns) - 1, int(share * len(sorted_ns)))] / 1000


def main() -> int:
    """Measure and print one table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=20.0, help="of each pace, for each of the two")
    parser.add_argument("--blocks", type=int, default=6)
    arguments = parser.parse_args()
    block_s = arguments.seconds / arguments.blocks
    taken: dict[tuple[str, str, bytes], list[int]] = {}
    with (
        nep.master("127.0.0.1:0", learn_s=0.0) as master,
        nep.node("bench", master=master.address) as node,
        node.new_sub("batch", "bytes") as batch,
        node.new_sub("never", "bytes") as never,
        other_process(SENDER, (), master.address) as child,
    ):
        child.read()
        todo = [(pace, name) for pace in PACES for name in ("batch", "never")] * arguments.blocks
        random.shuffle(todo)
        for pace, name in todo:
            rate = PACES[pace]
            order: list[object] = [name, rate, max(1, int(block_s * (rate or 200)))]
            for what, each in ages(child, batch if name == "batch" else never, order).items():
                taken.setdefault((pace, name, what), []).extend(each)
        lost = (batch.lost or 0) + (never.lost or 0)
    print(f"age in microseconds; lost: {lost}")
    print(f"{'':>24} {'':>6} {'median':>8} {'p99':>8} {'p99.9':>8} {'worst':>9} {'of':>8}")
    for pace, rate in PACES.items():
        for what in (b"steady",) if rate else (b"burst", b"alone"):
            for name in ("batch", "never"):
                all_ns = sorted(taken[pace, name, what])
                row = " ".join(f"{at(all_ns, share):8.0f}" for share in (0.5, 0.99, 0.999))
                said = pace if rate else f"{pace}: {what.decode()}"
                print(f"{said:>24} {name:>6} {row} {all_ns[-1] / 1000:9.0f} {len(all_ns):8}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
