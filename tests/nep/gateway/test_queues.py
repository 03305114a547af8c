"""Tests of the gateway's buffers for original subscribers that do not read, which are bounded in bytes."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from typing import TypeAlias

import pytest
import zmq

from nep.programs.gateway.portmap import TopicLine
from nep.programs.gateway.proxy_pair import MAX_BUFFERED_BYTES, ProxyPair

LONG_MS = 30_000
Socket: TypeAlias = zmq.Socket[bytes]


@pytest.fixture
def context() -> Iterator[zmq.Context[zmq.Socket[bytes]]]:
    made = zmq.Context()
    yield made
    made.destroy(linger=0)


def free_base() -> int:
    """Return a free port whose successor is free, too."""
    while True:
        with socket.socket() as first, socket.socket() as second:
            first.bind(("127.0.0.1", 0))
            base = first.getsockname()[1]
            try:
                second.bind(("127.0.0.1", base + 1))
            except (OSError, OverflowError):
                continue
            return base


@pytest.fixture
def pair(context: zmq.Context[zmq.Socket[bytes]]) -> Iterator[ProxyPair]:
    made = ProxyPair(context, TopicLine("t", "prefixed", "json", "many2many"), free_base())
    yield made
    made.close()


@pytest.fixture
def subscriber(context: zmq.Context[zmq.Socket[bytes]], pair: ProxyPair) -> Iterator[Callable[..., Socket]]:
    """Function that opens a subscriber that queues `keep` messages; each needs a filter of its own."""
    made: list[Socket] = []

    def subscribe(keep: int, filter_: bytes = b"t") -> Socket:
        made.append(context.socket(zmq.SUB))
        made[-1].setsockopt(zmq.RCVHWM, keep)
        made[-1].setsockopt(zmq.RCVBUF, 100_000)
        made[-1].setsockopt(zmq.SUBSCRIBE, filter_)
        made[-1].connect(f"tcp://127.0.0.1:{pair.base + 1}")
        while not pair.read_filters():
            assert pair.outgoing.poll(LONG_MS)
        return made[-1]

    yield subscribe
    for each in made:
        each.close(linger=0)


def numbered(number: int, size: int) -> bytes:
    return b'{"n":%d,"x":"%s"}' % (number, b"x" * size)


def rest(of: Socket) -> list[bytes]:
    """Receive messages until none arrives for 500 ms."""
    found = []
    while of.poll(500):
        found.append(of.recv())
    return found


@pytest.mark.parametrize("size", [200_000, 4_000_000, 60_000_000])
def test_buffer_of_a_stalled_subscriber_is_bounded_in_bytes(pair, subscriber, size: int) -> None:
    stuck = subscriber(keep=1)
    for number in range(3 * MAX_BUFFERED_BYTES // size):
        pair.deliver(numbered(number, size))
    kept = rest(stuck)
    assert kept[0].startswith(b't {"n":0')
    assert sum(map(len, kept)) < MAX_BUFFERED_BYTES + 3 * size + 20_000_000  # plus messages in flight


def test_active_reader_receives_everything_next_to_a_stalled_reader(pair, subscriber) -> None:
    subscriber(keep=1)
    reader = subscriber(keep=1000, filter_=b"t {")
    for number in range(200):
        pair.deliver(numbered(number, 1_000_000))
        assert reader.poll(LONG_MS)
        assert reader.recv().startswith(b't {"n":%d,' % number)


def test_900_small_messages_are_buffered_after_a_large_one(pair, subscriber) -> None:
    slow = subscriber(keep=1)
    pair.deliver(numbered(0, 30_000_000))
    assert slow.recv().startswith(b't {"n":0,')
    for number in range(900):
        pair.deliver(numbered(number, 10))
    for number in range(900):
        assert slow.poll(LONG_MS)
        assert slow.recv().startswith(b't {"n":%d,' % number)
