"""Tests of the limits in bytes with real processes: unread data grows nowhere, and every loss is counted."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator

import psutil
import pytest
import zmq

import nep
from nep.backends.zeromq.byte_window import WINDOW_BYTES
from nep.masters.master import Master
from tests.nep.programs import Program, eventually, running

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot stop a process")

HUGE = 6_220_800
"""Size of a 1920 x 1080 image in bytes."""
MB = 2**20
MAX_COUNT = WINDOW_BYTES + 64 * MB
"""Maximum growth of a process in bytes; the second summand is for a batch of a sink and Python's overhead."""

SUBSCRIBER = """
import sys, threading, nep
is_over = threading.Event()
def busy(messages):
    is_over.wait()
with nep.node("subscriber", master=sys.argv[1]) as node:
    sinks = {"busy": busy, "quick": lambda messages: None}
    sub = node.new_sub("t", "bytes", sink=sinks.get(sys.argv[2]))
    print("ready")
    for line in sys.stdin:
        if line == "on\\n":
            is_over.set()
        elif line == "take\\n":
            print(sum(sub.receive(30.0) is not None for _ in range(31)))
        print(sub.received, sub.lost)
"""


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("publisher", master=master.address) as made:
        yield made


@pytest.fixture
def publisher(node: nep.Node) -> nep.Publisher:
    return node.new_pub("t", "bytes")


def rss(pid: int) -> int:
    return int(psutil.Process(pid).memory_info().rss)


def subscribed(program: Program) -> Program:
    assert program.line() == "ready"
    return program


def publish_huge(publisher: nep.Publisher, count: int) -> int:
    """Publish `count` images in separate memory. Return the maximum growth of this process in bytes."""
    before = most = rss(os.getpid())
    for number in range(count):
        publisher.publish(bytes([number % 256]) * HUGE)
        most = max(most, rss(os.getpid()))
    return most - before


def told(program: Program) -> tuple[int, int]:
    """Return the numbers of received and lost messages that a program reports."""
    program.say("tell")
    received, lost = program.line().split()
    return int(received), int(lost)


def is_all_counted(program: Program, count: int) -> bool:
    return sum(told(program)) == count


def test_publisher_memory_stays_bounded_and_a_stopped_subscriber_counts_its_losses(
    publisher: nep.Publisher, master: Master
) -> None:
    with running(SUBSCRIBER, master.address, "idle") as stopped:
        subscribed(stopped)
        for _ in range(1000):
            publisher.publish(b"small")
        stopped.stop()
        assert publish_huge(publisher, 80) < MAX_COUNT
        stopped.signal(signal.SIGCONT)
        eventually(lambda: is_all_counted(stopped, 1080))


def test_memory_of_a_program_with_a_busy_sink_grows_only_to_a_limit(
    publisher: nep.Publisher, master: Master
) -> None:
    with running(SUBSCRIBER, master.address, "busy") as busy:
        subscribed(busy)
        before = rss(busy.process.pid)
        for _ in range(100):  # below the socket's message limit, so huge messages are queued there too
            publisher.publish(b"small")
        grown = []

        def has_settled() -> bool:  # no growth for a second
            grown.append(rss(busy.process.pid) - before)
            is_still = len(grown) > 100 and max(grown[-100:]) - min(grown[-100:]) < MB
            return is_still and max(grown) > 100 * MB

        publish_huge(publisher, 80)
        eventually(has_settled)
        assert max(grown) < MAX_COUNT
        busy.say("on")
        busy.line()
        eventually(lambda: is_all_counted(busy, 180))
        assert rss(busy.process.pid) - before < MAX_COUNT


def test_stopped_subscriber_does_not_affect_other_subscribers(
    publisher: nep.Publisher, master: Master
) -> None:
    with (
        running(SUBSCRIBER, master.address, "idle") as stopped,
        running(SUBSCRIBER, master.address, "quick") as quick,
    ):
        subscribed(stopped)
        subscribed(quick)
        stopped.stop()
        for number in range(80):
            publisher.publish(bytes([number]) * HUGE)
            if number % 10 == 9:
                eventually(lambda: is_all_counted(quick, publisher.count))
        assert told(quick) == (80, 0)
        stopped.signal(signal.SIGCONT)
        eventually(lambda: is_all_counted(stopped, 80))
        assert told(stopped)[1] >= 80 - WINDOW_BYTES // HUGE - 1  # the stopped one's queue was bounded
        publisher.publish(b"for both again")
        for each in (quick, stopped):
            eventually(lambda each=each: is_all_counted(each, 81))  # type: ignore[misc]


def test_thirty_huge_messages_are_not_lost_while_their_subscriber_is_stopped(
    publisher: nep.Publisher, master: Master
) -> None:
    with running(SUBSCRIBER, master.address, "idle") as late:
        subscribed(late)
        publisher.publish(b"x" * 8_000_000)  # the size of the first message has no effect
        eventually(lambda: is_all_counted(late, 1))
        late.stop()
        publish_huge(publisher, 30)
        late.signal(signal.SIGCONT)
        late.say("take")
        assert late.line() == "31"
        assert late.line() == "31 0"


def test_subscriber_without_hello_that_reads_nothing_does_not_affect_other_subscribers(
    node: nep.Node, publisher: nep.Publisher, master: Master
) -> None:
    """This subscriber can't acknowledge; the publisher counts what libzmq holds for it."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.SUB) as other, running(SUBSCRIBER, master.address, "quick") as quick:
        subscribed(quick)
        other.linger, other.rcvhwm = 0, 1
        other.setsockopt(zmq.SUBSCRIBE, b"t\0")
        other.connect(node.graph().topics["t"].publishers[0].endpoints[0])
        eventually(lambda: publisher.publish(b"small") is None and bool(other.poll(10)))
        grown, before = 0, rss(os.getpid())
        for _ in range(8):
            publish_huge(publisher, 10)
            grown = max(grown, rss(os.getpid()) - before)
            eventually(lambda: is_all_counted(quick, publisher.count))
        assert grown < MAX_COUNT
        assert told(quick)[1] == 0
    context.term()
