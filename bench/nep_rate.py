"""Benchmark of 1 kB messages per second between two processes: nep's native wire ÷ plain pyzmq.

    python bench/nep_rate.py [--messages 9000] [--blocks 30] [--limit 5]

The child process sends bursts that fit into every queue, so no message may be lost. This process
receives them and measures the time from the first message to the last. The variants are interleaved
in random order. "plain again" is a second series of plain pyzmq: a run counts only if both differ by
at most 5 %. `blocks.py` describes how blocks are repeated until then.

    plain           one part of 1000 bytes: PUB.send, SUB.recv as bytes; no counting, checks or decoding
    plain, local    the same over a Unix socket, which nep uses on one computer where it can
    plain, 3 parts  the same bytes after a topic and 32 bytes: send_multipart, recv_multipart
    listen          Subscriber.listen in the main thread
    spin            a callback that `Node.spin` calls in the main thread
    sink            batches passed to a sink in the node's thread, as in Studio
    json            a robot's state, encoded and decoded, 1000 bytes of JSON, with listen
    json, a text    the same with 1000 bytes that are almost entirely one string
    plain json      the robot's state with `json.dumps`, `json.loads` and one part, as in many programs
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial

import zmq
from blocks import Child, Sample, cpu_s, interleaved, other_process, verdict

import nep
from nep.messages.message import Message

SIZE = 1000
STATE_GOAL = 2.5
"""Minimum ratio of the message rate of `json` to that of plain pyzmq with the `json` module."""
NATIVE = ("listen", "spin", "sink", "json", "text")

SENDER = """
import json, os, sys, time, zmq, nep
from nep.backends.zeromq.bindings import has_unix_sockets
count, state = int(sys.argv[1]), json.loads(sys.argv[2])
data = os.urandom(1000)
node = nep.node("sender")
payloads = {"json": state, "text": {"text": "x" * 989}}
topics = {name: node.new_pub(name, "json" if name in payloads else "bytes") for name in sys.argv[3:]}
context = zmq.Context()
plains = [context.socket(zmq.PUB) for _ in range(3)]
local = f"ipc://@nep-bench-{os.getpid()}" if has_unix_sockets() else "tcp://127.0.0.1:*"
for plain, end in zip(plains, ("tcp://127.0.0.1:*", "tcp://127.0.0.1:*", local)):
    plain.setsockopt(zmq.SNDHWM, 0)
    plain.bind(end)
print(*(plain.getsockopt_string(zmq.LAST_ENDPOINT) for plain in plains), flush=True)
for line in sys.stdin:
    what = line.strip()
    if what in topics:
        publish, payload = topics[what].publish, payloads.get(what, data)
        for _ in range(count):
            publish(payload)
    elif what == "parts":
        head = bytes(32)
        for _ in range(count):
            plains[1].send_multipart((b"parts", head, data))
    elif what == "plain json":
        for _ in range(count):
            plains[0].send(json.dumps(state).encode())
    elif what == "one":
        for plain in plains:
            plain.send(data)
    else:
        send = plains[2 if what == "local" else 0].send
        for _ in range(count):
            send(data)
    print(time.process_time(), flush=True)
"""


def robot_state() -> dict[str, object]:
    """Return a typical robot state of 1000 bytes as JSON."""
    joints = {f"joint_{n}": {"angle": 0.123 * n, "load": 0.5 - n / 100} for n in range(12)}
    state: dict[str, object] = {"name": "robot", "battery": 0.83, "position": [1.25, -0.5, 0.0], "text": ""}
    state |= {"joints": joints}
    state["text"] = "x" * (SIZE - len(json.dumps(state, separators=(",", ":"))))
    return state


class Count:
    """Receiver that counts `wanted` messages and measures the time they take."""

    def __init__(self, wanted: int) -> None:
        self._wanted = wanted
        self._lock = threading.Lock()
        self.is_full = threading.Event()
        self.begin()

    def begin(self) -> None:
        """Reset the count and start the clock."""
        with self._lock:
            self._first = self._count = 0
            self._started, self._ended = time.perf_counter(), 0.0
            self.is_full.clear()

    def batch(self, messages: Sequence[Message]) -> None:
        """Count a batch of messages; used as a sink.

        The time starts at the request, because a whole burst may arrive in one batch.
        """
        with self._lock:
            self._count += len(messages)
            self._ended = time.perf_counter()
            if self._count >= self._wanted:
                self.is_full.set()

    def one(self, _payload: object) -> None:
        """Count one message; used as a callback. The time starts at the first message."""
        self._count += 1
        if self._count == 1:
            self._first = 1
            self._started = time.perf_counter()
        elif self._count == self._wanted:
            self._ended = time.perf_counter()
            self.is_full.set()

    @property
    def seconds_each(self) -> float:
        """Seconds per message."""
        return (self._ended - self._started) / (self._count - self._first)


class Bursts:
    """Measurement of bursts of `count` messages that `child` sends on request."""

    def __init__(self, child: Child, count: int) -> None:
        self._child = child
        self._count = count
        self._child_s = 0.0

    def take(self, what: str, one: Callable[[], object]) -> Sample:
        """Receive a burst of `what`, one message per call of `one`.

        The processor time of the sample is that of both processes.
        """
        used = cpu_s()
        self._child.write(what)
        one()
        started = time.perf_counter()
        for _ in range(self._count - 1):
            one()
        return self._sample((time.perf_counter() - started) / (self._count - 1), used)

    def count(self, what: str, counted: Count, wait: Callable[[], object]) -> Sample:
        """Receive a burst of `what` with `counted` while `wait` blocks."""
        counted.begin()
        used = cpu_s()
        self._child.write(what)
        wait()
        if not counted.is_full.is_set():
            raise SystemExit(f"{what}: a message did not come")
        return self._sample(counted.seconds_each, used)

    def _sample(self, seconds: float, used: float) -> Sample:
        used = cpu_s() - used
        before, self._child_s = self._child_s, float(self._child.read())
        return Sample(seconds, (used + self._child_s - before) / self._count)


def connect(sockets: Sequence[zmq.Socket[bytes]], ends: Sequence[str], child: Child) -> None:
    """Connect to the child's plain sockets and wait until each receives messages."""
    for socket, end in zip(sockets, ends, strict=True):
        socket.setsockopt(zmq.RCVHWM, 0)
        socket.subscribe(b"")
        socket.connect(end)
        while not socket.poll(50):
            child.write("one")
            child.read()
    for socket in sockets:
        while socket.poll(200):
            socket.recv_multipart()


def show(samples: dict[str, Sample]) -> int:
    """Print the table; return 1 if the run does not count or the goal for a robot's state is missed."""
    plain = samples["plain"]
    print(f"{'':>16} {'messages/s':>11} {'÷ plain':>8} {'CPU µs':>7} {'÷ plain':>8}")
    for name, sample in samples.items():
        ratio, cpu = plain.seconds / sample.seconds, sample.cpu_s / plain.cpu_s
        print(
            f"{name:>16} {1.0 / sample.seconds:>11,.0f} {ratio:>8.2f} {sample.cpu_s * 1e6:>7.2f} {cpu:>8.2f}"
        )
    state = samples["plain json"].seconds / samples["json"].seconds
    print(f"a robot's state, json ÷ plain json: {state:.2f} times the messages a second (goal: {STATE_GOAL})")
    return max(verdict(plain.seconds / samples["plain again"].seconds), int(state < STATE_GOAL))


def listen(subscriber: nep.Subscriber) -> object:
    """Return the next payload; exit if none arrives within 5 s."""
    has_local_names, payload = subscriber.listen(timeout_s=5.0)
    if not has_local_names:
        raise SystemExit("a message did not come")
    return payload


def spin(node: nep.Node, spun: Count) -> None:
    """Spin until all messages are counted, 10 s at most."""
    ending = threading.Thread(target=lambda: (spun.is_full.wait(10.0), node.stop_spin()))
    ending.start()
    node.spin(10.0)
    ending.join()


def measure(count: int, blocks: int, limit: int) -> tuple[dict[str, Sample], int]:
    """Return the samples of all variants and the number of lost messages."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    plain, parts, local = (context.socket(zmq.SUB) for _ in range(3))
    sunk, spun = Count(count), Count(count)
    state = robot_state()
    with (
        nep.master("127.0.0.1:0", learn_s=0.0) as master,
        nep.node("bench", master=master.address) as node,
        node.new_sub("listen", "bytes") as listener,
        node.new_sub("json", "json") as reader,
        node.new_sub("text", "json") as texter,
        node.new_sub("sink", "bytes", sink=sunk.batch) as sinker,
        node.new_callback("spin", "bytes", spun.one) as spinner,
        other_process(SENDER, (str(count), json.dumps(state), *NATIVE), master.address) as child,
    ):
        connect((plain, parts, local), child.read().split(), child)
        bursts = Bursts(child, count)

        if listen_once(bursts, reader) != state:
            raise SystemExit("the state came back as another one")
        variants = {
            "plain": partial(bursts.take, "plain", plain.recv),
            "plain again": partial(bursts.take, "plain", plain.recv),
            "plain, local": partial(bursts.take, "local", local.recv),
            "plain, 3 parts": partial(bursts.take, "parts", parts.recv_multipart),
            "listen": partial(bursts.take, "listen", partial(listen, listener)),
            "spin": partial(bursts.count, "spin", spun, partial(spin, node, spun)),
            "sink": partial(bursts.count, "sink", sunk, partial(sunk.is_full.wait, 10.0)),
            "json": partial(bursts.take, "json", partial(listen, reader)),
            "json, a text": partial(bursts.take, "text", partial(listen, texter)),
            "plain json": partial(bursts.take, "plain json", lambda: json.loads(plain.recv())),
        }
        samples = interleaved(variants, blocks, limit=limit)
        lost = sum(each.lost or 0 for each in (listener, reader, texter, sinker, spinner))
    context.destroy(0)
    return samples, lost


def listen_once(bursts: Bursts, reader: nep.Subscriber) -> object:
    """Receive a burst of states; return the last one."""
    last: list[object] = []
    bursts.take("json", lambda: last.append(reader.listen(timeout_s=5.0)[1]))
    return last[-1]


def main() -> int:
    """Measure and print one table; return 1 if the run does not count or a goal is missed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--messages", type=int, default=9_000)
    parser.add_argument("--blocks", type=int, default=30)
    parser.add_argument(
        "--limit", type=int, default=5, help="so many times the blocks at most, see blocks.py"
    )
    arguments = parser.parse_args()
    samples, lost = measure(arguments.messages, arguments.blocks, arguments.limit)
    print(f"{SIZE} bytes, bursts of {arguments.messages} messages; lost on the native wire: {lost}")
    return show(samples)


if __name__ == "__main__":
    sys.exit(main())
