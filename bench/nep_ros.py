"""Benchmark of round trips of strings between two programs: nep ÷ rospy, measured in one run.

    python bench/nep_ros.py [--trips 30] [--blocks 16] [--limit 4]

Each message is a `str` of ASCII letters that is encoded, sent, decoded and read on both sides, over
loopback. All variants are interleaved in random order within each block. "plain again" is a second
series of rospy: a row counts only if both differ by at most 5 %.

    plain      rospy ↔ rospy, std_msgs/String; the callback itself publishes the reply
    native     nep's native wire, `string`: `publish` and `listen` in main threads
    back end   nep's back end `ros`, `string`: the same messages as rospy's

Needs Debian's python3-rospy, python3-rosmaster and python3-std-msgs; exits with a message if they are
missing.
"""

from __future__ import annotations

import argparse
import math
import os
import random
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from blocks import Child, Sample, cpu_s, interleaved, is_trusted, other_process, verdict

import nep
from nep.backends.ros.library import get_rospy

SIZES = (1_024, 16_384, 65_536, 262_144, 1_048_576, 4_194_304, 8_388_608)
WAIT_S = 30.0
"""Seconds after which a message that was not returned counts as lost."""

ECHO = """
import sys, threading, time, nep
from nep.backends.ros.library import get_rospy
native, carried = nep.node("echo"), nep.node("echo", "ros", master=sys.argv[1])
def echo(node):
    sub, pub = node.new_sub("ping_nep", "string"), node.new_pub("pong_nep", "string")
    while True:
        ok, text = sub.listen(True)
        pub.publish(text)
for node in (native, carried):
    threading.Thread(target=echo, args=(node,), daemon=True).start()
carried.new_sub("any")  # now rospy is there
rospy = get_rospy()
from std_msgs.msg import String
back = rospy.Publisher("pong", String, queue_size=10, tcp_nodelay=True)
there = rospy.Subscriber("ping", String, lambda message: back.publish(String(message.data)), tcp_nodelay=True)
print("ready", flush=True)
for line in sys.stdin:
    print(time.process_time(), flush=True)
"""

Trips = Callable[[Sequence[str]], list[float]]


class RospyTrips:
    """Round trips with rospy; each returned message sends the next one, in rospy's thread."""

    def __init__(self, rospy: Any) -> None:  # noqa: ANN401 - it has no types
        from std_msgs.msg import String  # type: ignore[import-not-found] # noqa: PLC0415 - found with rospy

        self._message = String
        self._done = threading.Event()
        self._texts: list[str] = []
        self._taken: list[float] = []
        self._started = 0.0
        self._pub = rospy.Publisher("ping", String, queue_size=10, tcp_nodelay=True)
        self._sub = rospy.Subscriber("pong", String, self._came, tcp_nodelay=True)

    @property
    def is_connected(self) -> bool:
        """True when both directions are connected."""
        return bool(self._pub.get_num_connections() and self._sub.get_num_connections())

    def __call__(self, texts: Sequence[str]) -> list[float]:
        """Send each text to the echo and back; return the seconds of each round trip."""
        self._texts, self._taken = list(texts), []
        self._done.clear()
        self._send()
        if not self._done.wait(WAIT_S):
            raise SystemExit("a message of rospy did not come back")
        return self._taken

    def _send(self) -> None:
        self._started = time.perf_counter()
        self._pub.publish(self._message(self._texts[-1]))

    def _came(self, message: Any) -> None:  # noqa: ANN401 - it has no types
        self._taken.append(time.perf_counter() - self._started)
        if message.data != self._texts.pop():
            raise SystemExit("another message came back")
        if self._texts:
            self._send()
        else:
            self._done.set()


class NepTrips:
    """Round trips with a nep node."""

    def __init__(self, node: nep.Node) -> None:
        self._sub = node.new_sub("pong_nep", "string")
        self._pub = node.new_pub("ping_nep", "string")

    @property
    def is_connected(self) -> bool:
        """True when the echo has subscribed."""
        return self._pub.subscribers > 0

    def __call__(self, texts: Sequence[str]) -> list[float]:
        """Send each text to the echo and back; return the seconds of each round trip."""
        taken = []
        for text in reversed(texts):
            started = time.perf_counter()
            self._pub.publish(text)
            ok, came = self._sub.listen(timeout_s=WAIT_S)
            taken.append(time.perf_counter() - started)
            if not ok or came != text:
                raise SystemExit("a message of nep did not come back")
        return taken


def measure(trips: Trips, all_taken: list[float], ask: Child, size: int, count: int) -> Sample:
    """Return the median of `count` round trips and the processor time of both processes per trip."""
    texts = ["".join(random.choices("abcdefghijklmnop", k=16)) + "x" * (size - 16) for _ in range(count)]
    used = cpu_s() + child_s(ask)
    taken = trips(texts)
    used = cpu_s() + child_s(ask) - used
    all_taken += taken
    return Sample(statistics.median(taken), used / count)


def child_s(ask: Child) -> float:
    """Return the processor time that the child has used, in seconds."""
    ask.write("time")
    return float(ask.read())


def p95(taken: list[float]) -> float:
    """Return the 95th percentile."""
    return statistics.quantiles(taken, n=20)[-1]


def compare(variants: dict[str, Trips], ask: Child, blocks: int, count: int, limit: int) -> int:
    """Print a row for each size; return 1 if the run does not count."""
    others = [name for name in variants if name != "plain"]
    columns = " ".join(f"{name:>14} {'p95 ms':>7}" for name in others)
    print(f"{'bytes':>9} {'rospy ms':>9} {'p95 ms':>7} {columns}  CPU ms, rospy and native")
    ratios: dict[str, list[float]] = {name: [] for name in others}
    for size in SIZES:
        taken: dict[str, list[float]] = {name: [] for name in variants}
        ready = {
            name: partial(measure, trips, taken[name], ask, size, count) for name, trips in variants.items()
        }
        found = interleaved(ready, blocks, limit=limit)
        plain = found["plain"]
        here = {name: found[name].seconds / plain.seconds for name in others}
        counts = is_trusted(here["plain again"])
        for name, ratio in here.items():
            ratios[name].append(ratio)
        columns = " ".join(f"{here[name]:>14.2f} {p95(taken[name]) * 1e3:>7.2f}" for name in others)
        print(
            f"{size:>9} {plain.seconds * 1e3:>9.3f} {p95(taken['plain']) * 1e3:>7.2f} {columns}"
            f" {plain.cpu_s * 1e3:>7.2f} {found['native'].cpu_s * 1e3:>7.2f}",
            "" if counts else " does not count",
            flush=True,
        )
    print("÷ rospy, geometric mean:")
    for name, each in ratios.items():
        print(f"{name:>14} {mean(each):.3f}")
    return verdict(mean(ratios["plain again"]))


def mean(ratios: list[float]) -> float:
    """Return the geometric mean."""
    return math.exp(statistics.fmean(math.log(each) for each in ratios))


@contextmanager
def ros_master() -> Iterator[str]:
    """Start a ROS master on loopback and yield its address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"127.0.0.1:{port}"
    os.environ.update(
        ROS_MASTER_URI=f"http://{address}", ROS_IP="127.0.0.1", ROS_LOG_DIR=tempfile.gettempdir()
    )
    silent = subprocess.DEVNULL
    with subprocess.Popen(["rosmaster", "--core", "-p", str(port)], stdout=silent, stderr=silent) as process:
        try:
            yield address
        finally:
            process.kill()


def main() -> int:
    """Measure and print one table; return 1 if the run does not count."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trips", type=int, default=30)
    parser.add_argument("--blocks", type=int, default=16)
    parser.add_argument(
        "--limit", type=int, default=4, help="so many times the blocks at most, see blocks.py"
    )
    arguments = parser.parse_args()
    try:
        rospy = get_rospy()
    except nep.NepError as error:
        print(f"not run: {error}")
        return 0
    if shutil.which("rosmaster") is None:
        print("not run: there is no 'rosmaster'; install it with 'sudo apt install python3-rosmaster'")
        return 0
    with (
        ros_master() as address,
        nep.master("127.0.0.1:0", learn_s=0.0) as master,
        nep.node("bench", master=master.address) as node,
        nep.node("bench", "ros", master=address, wait_s=WAIT_S) as carried,
        other_process(ECHO, (address,), master.address) as ask,
    ):
        native, back_end = NepTrips(node), NepTrips(carried)
        plain = RospyTrips(rospy)
        ask.read()
        pause = threading.Event()
        while not (native.is_connected and back_end.is_connected and plain.is_connected):
            pause.wait(0.01)
        variants: dict[str, Trips] = {
            "plain": plain, "plain again": plain, "native": native, "back end": back_end
        }  # fmt: skip
        return compare(variants, ask, arguments.blocks, arguments.trips, arguments.limit)


if __name__ == "__main__":
    sys.exit(main())
