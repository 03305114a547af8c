"""Benchmark of a master with many nodes: its idle cost and the response time of `nep topic list`.

    python bench/nep_master.py [--nodes 500] [--topics 2000] [--seconds 10] [--rounds 30]

The master runs in its own process. A second process simulates the nodes: each is a DEALER socket that
joins with its share of publishers and a subscriber for each topic of another node. Each renews its
lease with growing counters at the times a real node would (`RenewalTimer`): every second, or when the
master requests it.

    at rest       processor time of the master while all nodes renew, as a share of one core
    answer        time from a graph query on a bare socket to its complete reply, ten times a second
    answer alone  the same after five seconds without a query, in which every counter has changed
    graph         `Node.graph()`: the same plus decoding the reply, in a program that already runs
    topic list    the whole command `nep topic list`, including the start of Python

"again" is a second series of the same measurement, which shows the noise.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import zmq
from blocks import Child, is_trusted, other_process

import nep
from nep.protocol.encoding import encode_request
from nep.protocol.requests import QueryGraph

MASTER = """
import os, sys, nep
with nep.master("127.0.0.1:0", learn_s=0.0) as master:
    print(master.address, os.getpid(), flush=True)
    sys.stdin.read()
"""

NODES = """
import os, sys, time, zmq
from nep.backends.zeromq.master_session import RenewalTimer
from nep.protocol.encoding import decode_reply, encode_request
from nep.protocol.requests import (NodeRecord, PublisherCount, PublisherRecord,
    SubscriberCount, SubscriberRecord)
from nep.protocol.requests import FoundReply, Join, Renew, RenewedReply
count, topics = int(sys.argv[1]), int(sys.argv[2])
each = topics // count
context = zmq.Context()
context.set(zmq.MAX_SOCKETS, count + 10)
poller = zmq.Poller()
sockets = []
for n in range(count):
    socket = context.socket(zmq.DEALER)
    socket.setsockopt(zmq.ROUTING_ID, f"{n:016x}".encode())
    socket.setsockopt(zmq.RECONNECT_IVL, 50)
    socket.connect("tcp://" + os.environ["NEP_MASTER"])
    sockets.append(socket)
    poller.register(socket, zmq.POLLIN)
revisions, paces = [0] * count, [RenewalTimer() for _ in range(count)]
epoch = 0
def read(ms):
    # Read answers; whoever is not known, or not any more, joins.
    global epoch
    for socket, _ in poller.poll(ms):
        n = numbers[socket]
        while socket.getsockopt(zmq.EVENTS) & zmq.POLLIN:
            answer = decode_reply(socket.recv())[1]
            epoch = answer.epoch
            if isinstance(answer, FoundReply | RenewedReply):
                revisions[n] = answer.revision
            if isinstance(answer, RenewedReply):
                paces[n].set_interval(answer.next_s, time.monotonic())
                if answer.again:
                    join(n)
def ids(n):
    mine = range(n * each, n * each + each)
    others = [(topic + each) % (count * each) for topic in mine]
    return mine, others
def join(n):
    mine, others = ids(n)
    node = NodeRecord(f"{n:016x}", f"robot{n}", "computer", os.getpid(), since_ns=time.time_ns())
    publishers = tuple(
        PublisherRecord(
            1_000_000 + t, f"/robot{n}/sensor{t}", "json", "json", (f"tcp://127.0.0.1:{20000 + t}",)
        )
        for t in mine
    )
    subscribers = tuple(
        SubscriberRecord(2_000_000 + t, f"/robot{(t // each)}/sensor{t}", "json") for t in others
    )
    sockets[n].send(encode_request(Join(node, 0, publishers, subscribers), 1))
numbers = {socket: n for n, socket in enumerate(sockets)}
for n in range(count):
    join(n)
    read(0)
while not all(revisions):
    read(100)
print("joined", flush=True)
started = time.monotonic()
for n, pace in enumerate(paces):
    pace.due_at = started + n / count
while True:
    n = min(range(count), key=lambda n: paces[n].due_at)
    while (left := paces[n].due_at - time.monotonic()) > 0:
        read(int(left * 1000))
    read(0)
    mine, others = ids(n)
    seen = int((time.monotonic() - started) * 10)
    outs = tuple(PublisherCount(1_000_000 + t, seen, seen * 100, seen, time.time_ns()) for t in mine)
    ins = tuple(SubscriberCount(2_000_000 + t, seen, 0) for t in others)
    sockets[n].send(encode_request(Renew(f"{n:016x}", epoch, revisions[n], outs, ins), 2))
    paces[n].start(time.monotonic())
"""


def at_rest(process: psutil.Process, seconds: float) -> float:
    """Return the master's share of one core over `seconds`."""
    before = process.cpu_times()
    started = time.perf_counter()
    threading.Event().wait(seconds)
    used = process.cpu_times()
    return (used.user + used.system - before.user - before.system) / (time.perf_counter() - started)


def times(ask: Callable[[], object], rounds: int, pause_s: float = 0.1) -> list[float]:
    """Return the seconds of each of `rounds` calls, with a pause before each as in occasional queries."""
    taken = []
    never = threading.Event()
    for _ in range(rounds):
        never.wait(pause_s)
        started = time.perf_counter()
        ask()
        taken.append(time.perf_counter() - started)
    return taken


def looker(context: zmq.Context[zmq.Socket[bytes]], address: str) -> Callable[[], object]:
    """Return a function that queries the graph on a bare socket and returns the reply's length in bytes."""
    socket = context.socket(zmq.DEALER)
    socket.connect(f"tcp://{address}")
    body = encode_request(QueryGraph(), 1)

    def look() -> int:
        socket.send(body)
        return len(socket.recv())

    return look


def command(address: str) -> None:
    """Run `nep topic list`."""
    root = str(Path(__file__).parents[1])
    subprocess.run(
        [sys.executable, "-m", "nep", "topic", "list"],
        check=True,
        stdout=subprocess.DEVNULL,
        env={**os.environ, "NEP_MASTER": address, "PYTHONPATH": root},
    )


def show(name: str, seconds: list[float]) -> float:
    """Print a row; return its median in seconds."""
    ordered = sorted(seconds)
    tail = ordered[min(len(ordered) - 1, round(0.95 * len(ordered)))]
    median = statistics.median(ordered)
    print(f"{name:>14} {median * 1e3:>9.1f} {tail * 1e3:>9.1f} {ordered[-1] * 1e3:>9.1f}", flush=True)
    return median


def measure(master: Child, arguments: argparse.Namespace) -> int:
    """Measure and print; return 1 if a goal is missed or the run does not count."""
    address, pid = master.read().split()
    process = psutil.Process(int(pid))
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    amounts = (str(arguments.nodes), str(arguments.topics))
    with other_process(NODES, amounts, address) as nodes, nep.node("bench", master=address) as node:
        nodes.read()
        at_rest(process, 3.0)
        rest, again = at_rest(process, arguments.seconds), at_rest(process, arguments.seconds)
        look = looker(context, address)
        print(f"{arguments.nodes} nodes, {arguments.topics} topics; a view has {look()} bytes")
        print(f"at rest: {rest:.1%} of a core, again {again:.1%}")
        print(f"{'ms':>14} {'median':>9} {'p95':>9} {'most':>9}")
        found = show("answer", times(look, arguments.rounds))
        second = show("answer again", times(look, arguments.rounds))
        show("answer alone", times(look, max(3, arguments.rounds // 6), 5.0))
        graph = show("graph", times(node.graph, arguments.rounds))
        show("topic list", times(lambda: command(address), max(3, arguments.rounds // 6)))
        view = node.graph()
        if len(view.topics) < arguments.topics or len(view.nodes) < arguments.nodes:
            raise SystemExit("the master lost nodes or topics")
    context.destroy(0)
    counts = is_trusted(second / found)
    print(f"answer against itself: {second / found:.3f}{'' if counts else '; this run does NOT count'}")
    return 0 if counts and max(rest, again) <= 0.03 and found <= 0.020 and graph <= 0.020 else 1


def main() -> int:
    """Measure and print one table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--nodes", type=int, default=500)
    parser.add_argument("--topics", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=30)
    with other_process(MASTER, (), "") as master:
        return measure(master, parser.parse_args())


if __name__ == "__main__":
    sys.exit(main())
