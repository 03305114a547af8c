"""1 kB messages a second from process to process: nep's native wire ÷ plain pyzmq, measured in one run.

    python bench/nep_rate.py [--messages 30000] [--blocks 16]

The child sends bursts that fit into every queue, so nothing may be lost; this process receives them in its
main thread and takes the time from the first message to the last. The variants are interleaved in random
order; "plain again" is plain pyzmq against itself: a run counts only when that is within 5 %.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial

import zmq
from blocks import Child, Sample, cpu_s, interleaved, other_process, verdict

import nep

SIZE = 1000

SENDER = """
import os, sys, time, zmq, nep
size, count = int(sys.argv[1]), int(sys.argv[2])
data = os.urandom(size)
node = nep.node("sender")
pub = node.new_pub("rate", "bytes")
plain = zmq.Context().socket(zmq.PUB)
plain.setsockopt(zmq.SNDHWM, 0)
print(plain.bind_to_random_port("tcp://127.0.0.1"), flush=True)
for line in sys.stdin:
    if line.startswith("native"):
        for _ in range(count):
            pub.publish(data)
    else:
        for _ in range(count if line.startswith("plain") else 1):
            plain.send(data)
    print(time.process_time(), flush=True)
"""


class Bursts:
    """Asks `child` for bursts of `count` messages and takes the time to receive them."""

    def __init__(self, child: Child, count: int) -> None:
        self._child = child
        self._count = count
        self._child_s = 0.0

    def take(self, what: str, one: Callable[[], object]) -> Sample:
        """One burst of `what`; `one` receives a message. Processor time is that of both processes."""
        used = cpu_s()
        self._child.write(what)
        one()
        started = time.perf_counter()
        for _ in range(self._count - 1):
            one()
        taken = time.perf_counter() - started
        used = cpu_s() - used
        before, self._child_s = self._child_s, float(self._child.read())
        return Sample(taken / self._count, (used + self._child_s - before) / self._count)


def connect(socket: zmq.Socket[bytes], port: str, child: Child) -> None:
    """Connect to the child's plain socket, and wait until its messages come."""
    socket.setsockopt(zmq.RCVHWM, 0)
    socket.subscribe(b"")
    socket.connect(f"tcp://127.0.0.1:{port}")
    while not socket.poll(50):
        child.write("one")
        child.read()
    while socket.poll(200):
        socket.recv()


def show(samples: dict[str, Sample]) -> int:
    """Print the table; 1 when the run does not count."""
    plain = samples["plain"]
    print(f"{'':>16} {'messages/s':>11} {'÷ plain':>8} {'CPU µs':>7} {'÷ plain':>8}")
    for name, sample in samples.items():
        ratio, cpu = plain.seconds / sample.seconds, sample.cpu_s / plain.cpu_s
        print(
            f"{name:>16} {1.0 / sample.seconds:>11,.0f} {ratio:>8.2f} {sample.cpu_s * 1e6:>7.2f} {cpu:>8.2f}"
        )
    return verdict(plain.seconds / samples["plain again"].seconds)


def main() -> int:
    """Measure and print one table; 1 when the run does not count."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--messages", type=int, default=30_000)
    parser.add_argument("--blocks", type=int, default=16)
    arguments = parser.parse_args()
    count: int = arguments.messages
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    plain = context.socket(zmq.SUB)
    with (
        nep.master("127.0.0.1:0", learn_s=0.0) as master,
        nep.node("bench", master=master.address) as node,
        node.new_sub("rate", "bytes", max_messages=2 * count) as sub,
        other_process(SENDER, (str(SIZE), str(count)), master.address) as child,
    ):
        connect(plain, child.read(), child)
        bursts = Bursts(child, count)

        def listen() -> None:
            if not sub.listen(timeout_s=5.0)[0]:
                raise SystemExit("a message did not come")

        def receive() -> None:
            if sub.receive(5.0) is None:
                raise SystemExit("a message did not come")

        variants = {
            "plain": partial(bursts.take, "plain", plain.recv),
            "plain again": partial(bursts.take, "plain", plain.recv),
            "native, listen": partial(bursts.take, "native", listen),
            "native, receive": partial(bursts.take, "native", receive),
        }
        samples = interleaved(variants, arguments.blocks)
        lost = sub.lost
    context.destroy(0)
    print(f"{SIZE} bytes, bursts of {count} messages; lost on the native wire: {lost}")
    return show(samples)


if __name__ == "__main__":
    sys.exit(main())
