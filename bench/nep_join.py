"""Benchmark of the time to join: a new node and its first publisher, with live and killed subscribers.

    python bench/nep_join.py [--subscribers 10] [--rounds 40]

Each subscriber is a process. `Node` and `new_pub` are timed together; after `new_pub`, the first
message must reach every subscriber without further waiting, which is checked.

    live       all subscribers are alive
    killed     one more subscriber has just been killed (SIGKILL), unnoticed by the master
    plain      a bound XPUB socket of plain pyzmq waits for the same number of plain subscribers in
               other processes: the cost of processes and sockets without a master; "plain again"
               repeats it
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from contextlib import ExitStack

import zmq
from blocks import Child, is_trusted, other_process

import nep

SUBSCRIBER = """
import os, sys, threading, zmq, nep
node = nep.node("subscriber")
sub = node.new_sub("join", "bytes")
print(os.getpid(), flush=True)
plain = zmq.Context().socket(zmq.SUB)
plain.subscribe(b"")
for line in sys.stdin:
    what, _, port = line.strip().partition(" ")
    if what == "heard":
        message = sub.receive(2.0)
        print("no" if message is None else bytes(message.data).decode(), flush=True)
    elif what == "connect":
        plain.connect("tcp://127.0.0.1:" + port)
    elif what == "disconnect":
        plain.disconnect("tcp://127.0.0.1:" + port)
        print("done", flush=True)
"""


def join(master: str, name: str) -> tuple[float, nep.Node, nep.Publisher]:
    """Create a node and its first publisher; return the duration in seconds and both."""
    started = time.perf_counter()
    node = nep.node(name, master=master)
    publisher = node.new_pub("join", "bytes")
    return time.perf_counter() - started, node, publisher


def live(master: str, children: list[Child], number: int) -> float:
    """Join with live subscribers, each of which must receive the first message; return the duration."""
    taken, node, publisher = join(master, f"joiner{number}")
    publisher.publish(f"hello {number}".encode())
    with node:
        for child in children:
            child.write("heard")
        heard = [child.read() for child in children]
        if heard != [f"hello {number}"] * len(children):
            raise SystemExit(f"not everybody heard the first message: {heard}")
    return taken


def killed(master: str, children: list[Child], number: int) -> float:
    """Join right after one more subscriber was killed; return the duration."""
    with other_process(SUBSCRIBER, (), master) as victim:
        victim.read()
        victim.kill()
        return live(master, children, number)


def plain(context: zmq.Context[zmq.Socket[bytes]], children: list[Child]) -> float:
    """Return the duration of binding and receiving the subscriptions of all child processes."""
    started = time.perf_counter()
    socket = context.socket(zmq.XPUB)
    socket.setsockopt(zmq.XPUB_VERBOSE, 1)
    port = socket.bind_to_random_port("tcp://127.0.0.1")
    for child in children:
        child.write(f"connect {port}")
    for _ in children:
        socket.recv()
    taken = time.perf_counter() - started
    for child in children:
        child.write(f"disconnect {port}")
    for child in children:
        child.read()
    socket.close(0)
    return taken


def show(name: str, seconds: list[float]) -> float:
    """Print a row and return its median."""
    ordered = sorted(seconds)
    tail = ordered[min(len(ordered) - 1, round(0.95 * len(ordered)))]
    median = statistics.median(ordered)
    print(f"{name:>12} {median * 1e3:>9.2f} {tail * 1e3:>9.2f} {ordered[-1] * 1e3:>9.2f}", flush=True)
    return median


def main() -> int:
    """Measure and print a table; return 1 if a median misses its goal or the run is not valid."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--subscribers", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=40)
    arguments = parser.parse_args()
    times: dict[str, list[float]] = {"plain": [], "plain again": [], "live": [], "killed": []}
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with ExitStack() as stack:
        master = stack.enter_context(nep.master("127.0.0.1:0", learn_s=0.0))
        children = [
            stack.enter_context(other_process(SUBSCRIBER, (), master.address))
            for _ in range(arguments.subscribers)
        ]
        for child in children:
            child.read()
        live(master.address, children, 0)
        for number in range(1, arguments.rounds + 1):
            for name in ("plain", "plain again"):
                times[name].append(plain(context, children))
            times["live"].append(live(master.address, children, number))
            times["killed"].append(killed(master.address, children, -number))
    context.destroy(0)
    print(f"{arguments.subscribers} subscriber processes; milliseconds for a node and its first publisher")
    print(f"{'':>12} {'median':>9} {'p95':>9} {'most':>9}")
    medians = {name: show(name, seconds) for name, seconds in times.items()}
    again = medians["plain again"] / medians["plain"]
    print(f"plain against itself: {again:.3f}{'' if is_trusted(again) else '; this run does NOT count'}")
    return 0 if is_trusted(again) and medians["live"] <= 0.010 and medians["killed"] <= 0.025 else 1


if __name__ == "__main__":
    sys.exit(main())
