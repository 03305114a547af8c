"""Benchmark of one-way large messages between two processes: nep, plain pyzmq and zenoh's Python.

    python3 dev.py bench nep_large                          raw 1080p images and bytes of four sizes
    python3 dev.py bench nep_large -- --sizes 1000 --blocks 60

The child process sends bursts that fit into every queue, so no message may be lost. This process
receives them and measures the time from the first message to the last. The variants are interleaved
in random order. A run counts only if two series of plain pyzmq differ by at most 5 %.

    plain           PUB.send(copy=False), SUB.recv(copy=False), over TCP
    nep             a publisher's `publish` and `Subscriber.listen`; large messages use shared memory
    nep, loan       the publisher writes into `Publisher.loan` (images only)
    nep, socket     like nep, without shared memory
    zenoh           Session.put of bytes over TCP, and a callback that copies the payload's bytes
"""

from __future__ import annotations

import argparse
import os
import queue
import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import zenoh
import zmq
from blocks import Child, Sample, interleaved, other_process, verdict

import nep

PICTURE = (1080, 1920, 3)
SENDER = """
import os, sys, time
import numpy as np, zenoh, zmq, nep
size, count, port, is_picture = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], sys.argv[4] == "picture"
frame = np.random.default_rng(1).integers(0, 255, (1080, 1920, 3), np.uint8)
data = os.urandom(size)
node = nep.node("sender")
pub = node.new_pub("large", "image" if is_picture else "bytes")
os.environ["NEP_SHARED_MEMORY"] = "0"
socket_pub = node.new_pub("socket", "image" if is_picture else "bytes")
del os.environ["NEP_SHARED_MEMORY"]
plain = zmq.Context().socket(zmq.PUB)
plain.setsockopt(zmq.SNDHWM, 0)
plain.bind("tcp://127.0.0.1:*")
settings = zenoh.Config()
settings.insert_json5("scouting/multicast/enabled", "false")
settings.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{port}"]')
session = zenoh.open(settings)
zenoh_pub = session.declare_publisher("large", congestion_control=zenoh.CongestionControl.BLOCK)
print(plain.getsockopt_string(zmq.LAST_ENDPOINT), flush=True)
for line in sys.stdin:
    what = line.strip()
    for n in range(1 if what.startswith("one ") else count):
        kind = what.removeprefix("one ")
        if kind == "plain":
            plain.send(frame if is_picture else data, copy=False)
        elif kind == "zenoh":
            zenoh_pub.put(data)
        elif kind == "loan":
            lent = pub.loan((1080, 1920, 3))
            lent[0, 0] = n
            pub.publish(nep.raw_image(lent))
        else:
            (pub if kind == "nep" else socket_pub).publish(nep.raw_image(frame) if is_picture else data)
    print("sent", flush=True)
"""


class Bursts:
    """Measurement of bursts of `count` messages that `child` sends on request."""

    def __init__(self, child: Child, count: int) -> None:
        self._child = child
        self._count = count

    def take(self, what: str, one: Callable[[], object]) -> Sample:
        """Receive a burst, one message per call of `one`; return the time per message after the first."""
        self._child.write(what)
        one()
        started = time.perf_counter()
        for _ in range(self._count - 1):
            one()
        seconds = (time.perf_counter() - started) / (self._count - 1)
        self._child.read()
        return Sample(seconds, 0.0)


def listen(subscriber: nep.Subscriber) -> object:
    """Return the next payload; exit if none arrives within 10 s."""
    is_there, payload = subscriber.listen(timeout_s=10.0)
    if not is_there:
        raise SystemExit("a message did not come")
    return payload


def heard(child: Child, what: str, is_there: Callable[[], bool]) -> None:
    """Request single messages until `is_there` is true, that is, until the subscription is established."""
    while not is_there():
        child.write(f"one {what}")
        child.read()


def free_port() -> int:
    """Return a free TCP port, because zenoh can't choose one itself."""
    with zmq.Context() as context, context.socket(zmq.PUB) as socket:
        return socket.bind_to_random_port("tcp://127.0.0.1")


def measure(size: int, count: int, blocks: int, *, is_picture: bool) -> tuple[dict[str, Sample], int]:
    """Return the samples of all variants and the number of lost messages."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    plain = context.socket(zmq.SUB)
    plain.setsockopt(zmq.RCVHWM, 0)
    plain.subscribe(b"")
    came: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    port = free_port()
    kind = "image" if is_picture else "bytes"
    with (
        nep.master("127.0.0.1:0", learn_s=0.0) as master,
        nep.node("bench", master=master.address) as node,
        node.new_sub("large", kind) as sub,
        node.new_sub("socket", kind) as socket_sub,
        other_process(
            SENDER, (str(size), str(count), str(port), "picture" if is_picture else "bytes"), master.address
        ) as child,
    ):
        plain.connect(child.read())
        settings = zenoh.Config()
        settings.insert_json5("scouting/multicast/enabled", "false")
        settings.insert_json5("connect/endpoints", f'["tcp/127.0.0.1:{port}"]')
        with zenoh.open(settings) as session:
            listener = session.declare_subscriber("large", lambda sample: came.put(sample.payload.to_bytes()))
            bursts = Bursts(child, count)
            receive_plain = partial(plain.recv, copy=False)
            variants: dict[str, Callable[[], Sample]] = {
                "plain": partial(bursts.take, "plain", receive_plain),
                "plain again": partial(bursts.take, "plain", receive_plain),
                "nep": partial(bursts.take, "nep", partial(listen, sub)),
                "nep, socket": partial(bursts.take, "socket", partial(listen, socket_sub)),
            }
            heard(child, "plain", lambda: bool(plain.poll(50)))
            while plain.poll(200):
                plain.recv()
            for _ in range(10):  # until the publisher uses shared memory
                heard(child, "nep", lambda: sub.listen(timeout_s=0.1)[0])
            if is_picture:
                variants["nep, loan"] = partial(bursts.take, "loan", partial(listen, sub))
            else:
                heard(child, "zenoh", lambda: not came.empty())
                while True:  # until all requested messages have arrived
                    try:
                        came.get(timeout=0.2)
                    except queue.Empty:
                        break
                variants["zenoh"] = partial(bursts.take, "zenoh", came.get)
            samples = interleaved(variants, blocks, limit=3)
            lost = (sub.lost or 0) + (socket_sub.lost or 0)
            listener.undeclare()
    context.destroy(0)
    return samples, lost


def show(samples: dict[str, Sample], lost: int) -> int:
    """Print the table; return 1 if the run does not count."""
    plain = samples["plain"]
    print(f"{'':>14} {'ms each':>9} {'plain ÷ it':>11} {'zenoh ÷ it':>11}")
    for name, sample in samples.items():
        ratio = plain.seconds / sample.seconds
        beside = f"{samples['zenoh'].seconds / sample.seconds:>11.2f}" if "zenoh" in samples else ""
        print(f"{name:>14} {sample.seconds * 1e3:>9.4f} {ratio:>11.2f} {beside}")
    print(f"lost: {lost}")
    return verdict(plain.seconds / samples["plain again"].seconds)


def main() -> int:
    """Measure and print one table per size; return 1 if a run does not count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sizes", type=int, nargs="*", default=[1_000, 64_000, 1_000_000, 6_000_000])
    parser.add_argument("--blocks", type=int, default=20)
    parser.add_argument("--count", type=int, default=20, help="messages in a burst; of small ones more")
    arguments = parser.parse_args()
    print(f"raw pictures of 1920 x 1080, bursts of {arguments.count}; {os.cpu_count()} processors")
    size = int(np.prod(PICTURE))
    codes = [show(*measure(size, arguments.count, arguments.blocks, is_picture=True))]
    for size in arguments.sizes:
        count = arguments.count * (100 if size < 10_000 else 10 if size < 100_000 else 1)
        print(f"\n{size} bytes, bursts of {count}")
        codes.append(show(*measure(size, count, arguments.blocks, is_picture=False)))
    return max(codes)


if __name__ == "__main__":
    sys.exit(main())
