"""Test that programs of the original NEP keep working while every port of the gateway is flooded."""

from __future__ import annotations

import json
import os
import random
import socket
import threading
from collections.abc import Callable, Iterator

import pytest
import zmq

from tests.interop.conftest import FIXED_PORTS

pytestmark = [pytest.mark.ports, pytest.mark.interop, pytest.mark.timeout(600)]

ROUNDS = 60
"""Minimum number of messages in each direction; more follow until every attack has run once."""
PAUSE_S = 0.02
"""Pause in seconds between two attacks of one kind; without it they starve tests that run in parallel."""
GARBAGE = (b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 4000, b"\xff\x00\x00")


class Flood:
    """Threads that repeat attacks until closed, with a count of the rounds of each attack."""

    def __init__(self) -> None:
        self.rounds: dict[str, int] = {}
        self._ends = threading.Event()
        self._threads: list[threading.Thread] = []

    def begin(self, name: str, attack: Callable[[], None]) -> None:
        self.rounds[name] = 0

        def work() -> None:
            while not self._ends.wait(PAUSE_S):
                attack()
                self.rounds[name] += 1

        self._threads.append(threading.Thread(target=work, name=f"flood {name}", daemon=True))
        self._threads[-1].start()

    def close(self) -> None:
        self._ends.set()
        for thread in self._threads:
            thread.join(30)


@pytest.fixture
def flood() -> Iterator[Flood]:
    made = Flood()
    yield made
    made.close()


def garbage_into(port: int) -> Callable[[], None]:
    """Return an attack that sends bytes other than ZeroMQ's protocol and closes within the greeting."""

    def attack() -> None:
        try:
            with socket.create_connection(("127.0.0.1", port), 5) as connection:
                connection.sendall(random.choice(GARBAGE))
        except OSError:
            pass  # expected: the port disconnects senders of invalid data

    return attack


def requests_to(port: int, context: zmq.Context[zmq.Socket[bytes]]) -> Callable[[], None]:
    """Return an attack that sends invalid requests, and requests in other nodes' names for unused topics."""

    def attack() -> None:
        asked = {
            "node": random.choice(["sender", "receiver", "x" * 3000, "\x1b[2J"]),
            "topic": random.choice(["t", f"spam{random.randrange(40)}", "<b>", ""]),
            "mode": random.choice(["many2many", "one2many", "?"]),
            "socket": random.choice(["publisher", "subscriber", "client"]),
            "pid": random.choice([1, os.getpid(), -1, "x"]),
            "msg_type": random.choice(["json", "image", "nonsense"]),
        }
        data = random.choice([json.dumps(asked).encode(), os.urandom(200), b"[" * 50_000])
        with context.socket(zmq.REQ) as asking:
            asking.setsockopt(zmq.LINGER, 0)
            asking.connect(f"tcp://127.0.0.1:{port}")
            asking.send(data)
            asking.poll(1000)

    return attack


def frames_into(port: int, context: zmq.Context[zmq.Socket[bytes]]) -> Callable[[], None]:
    """Return an attack that publishes malformed, large and foreign frames to the topic's port."""

    def attack() -> None:
        with context.socket(zmq.PUB) as publishing:
            publishing.setsockopt(zmq.LINGER, 100)
            publishing.connect(f"tcp://127.0.0.1:{port}")
            for frame in (b"t {", b"other {}", b"\xff" * 1000, b"t " + b"[" * 100_000, b"", b"t" * 1_000_000):
                publishing.send(frame)
            publishing.poll(20)

    return attack


def deaf_subscriber_of(port: int, context: zmq.Context[zmq.Socket[bytes]]) -> Callable[[], None]:
    """Return an attack that subscribes to everything, reads nothing and disconnects."""

    def attack() -> None:
        with context.socket(zmq.SUB) as subscribing:
            subscribing.setsockopt(zmq.LINGER, 0)
            subscribing.setsockopt(zmq.RCVHWM, 1)
            subscribing.connect(f"tcp://127.0.0.1:{port}")
            for number in range(50):
                subscribing.setsockopt(zmq.SUBSCRIBE, b"t" if number == 0 else os.urandom(20))
            subscribing.poll(50)

    return attack


@pytest.mark.parametrize("kind", ["0.5.3.5", "0.5.4.8", "nep-js"])
def test_originals_and_native_programs_exchange_messages_under_attack(
    master, peers, flood: Flood, kind: str
) -> None:
    publisher = peers.start(kind, "publisher", "t", name="sender").wait_ready()
    native = peers.start("native", "subscriber", "t", name="native").wait_ready()
    answering = peers.start("native", "publisher", "back", name="answering").wait_ready()
    receiver = peers.start(kind, "subscriber", "back", name="receiver").wait_ready()
    for _ in range(60):  # original programs have the slow-joiner problem
        publisher.tell({"n": -1})
        answering.tell({"n": -1})
        if native.hears({"n": -1}, 0.5) and receiver.hears({"n": -1}, 0.5):
            break
    context = zmq.Context()
    try:
        for port in FIXED_PORTS:
            flood.begin(f"garbage {port}", garbage_into(port))
            flood.begin(f"requests {port}", requests_to(port, context))
        for port in (9000, 9002):
            if kind != "0.5.4.8":  # non-JSON ends that version: docs/original-nep.md, Limits
                flood.begin(f"frames {port}", frames_into(port, context))
            flood.begin(f"deaf {port}", deaf_subscriber_of(port + 1, context))
            flood.begin(f"garbage {port}", garbage_into(port + 1))
        rounds = 0
        while rounds < ROUNDS or not all(flood.rounds.values()):  # until each attack ran at least once
            publisher.tell({"n": rounds})
            answering.tell({"n": rounds})
            assert native.hears({"n": rounds}), f"{rounds} of {kind} after {flood.rounds}"
            assert receiver.hears({"n": rounds}), f"{rounds} for {kind} after {flood.rounds}"
            rounds += 1
    finally:
        flood.close()
        context.destroy(linger=0)
    assert [message for message in native.got if message["n"] >= 0] == [{"n": n} for n in range(rounds)]
