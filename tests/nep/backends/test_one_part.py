"""Tests of the number of parts of small messages.

They have one part while all subscribers support that, and three as soon as another subscriber joins.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import pytest
import zmq

import nep
from nep.masters.master import Master
from nep.protocol import wire
from tests.nep.programs import eventually

Stranger = Callable[..., zmq.Socket[bytes]]
IDS = itertools.count(1)


@pytest.fixture
def node(master: Master, patient: None) -> Iterator[nep.Node]:
    with nep.node("parts", master=master.address) as made:
        yield made


@pytest.fixture
def stranger(node: nep.Node) -> Iterator[Stranger]:
    """Function that connects a plain ZeroMQ subscriber with these filters to the topic's publisher."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    context.linger = 0
    sockets = []

    def made(topic: str, *filters: bytes) -> zmq.Socket[bytes]:
        socket = context.socket(zmq.SUB)
        sockets.append(socket)
        for each in filters:
            socket.subscribe(each)
        socket.connect(node.graph().topics[topic].publishers[0].endpoints[0])
        return socket

    yield made
    for each in sockets:
        each.close(0)
    context.term()


def heard(pub: nep.Publisher, socket: zmq.Socket[bytes], payload: bytes, parts: int) -> None:
    """Publish until the socket receives the payload in this number of parts."""

    def comes() -> bool:
        pub.publish(payload)
        while socket.poll(50):
            got = socket.recv_multipart()
            if got[0].startswith(b"\xff"):
                continue  # the publisher's echo
            if wire.split(got).payload == payload and len(got) == parts:
                return True
        return False

    eventually(comes)


def test_capable_subscriber_receives_single_part_messages_while_no_other_subscribes(
    node: nep.Node, stranger: Stranger
) -> None:
    pub = node.new_pub("t", "bytes")
    hello = wire.hello_part(next(IDS), "t", reads_one_part=True)
    able = stranger("t", b"t\0", hello)
    assert able.recv_multipart()[0] == hello  # the publisher's echo
    heard(pub, able, b"small", 1)
    heard(pub, able, b"x" * 100_000, 3)  # large payloads are not copied into a single part

    own = wire.hello_part(next(IDS), "t")
    other = stranger("t", b"t\0", own)
    assert other.recv_multipart()[0] == own
    heard(pub, other, b"for both", 3)
    heard(pub, able, b"for both again", 3)
    for _ in range(3):  # after the echo, a subscriber never gets a form it didn't request
        pub.publish(b"in parts")
    assert [len(other.recv_multipart()) for _ in range(3)] == [3, 3, 3]


@pytest.mark.parametrize("filter_", [b"", b"t", b"t\0"], ids=["everything", "a prefix", "the topic"])
def test_subscriber_without_hello_receives_three_parts(
    node: nep.Node, stranger: Stranger, filter_: bytes
) -> None:
    pub = node.new_pub("t", "bytes")
    sub = node.new_sub("t", "bytes")
    debugger = stranger("t", filter_)
    heard(pub, debugger, b"for all to read", 3)
    message = sub.receive(30.0)
    assert message is not None
    assert bytes(message.data) == b"for all to read"
    debugger.close()
    sub.close()
    eventually(lambda: pub.subscribers == 0)
    hello = wire.hello_part(next(IDS), "t", reads_one_part=True)
    heard(pub, stranger("t", b"t\0", hello), b"one again", 1)


def test_other_subscribers_and_topics_do_not_change_single_part_delivery_afterwards(
    node: nep.Node, stranger: Stranger
) -> None:
    pub = node.new_pub("t", "bytes")
    stays = wire.hello_part(next(IDS), "t", reads_one_part=True)
    able = stranger("t", b"t\0", stays)
    heard(pub, able, b"at first", 1)
    for _ in range(5):
        with node.new_sub("t", "bytes"):
            assert pub.subscribers == 2
        eventually(lambda: pub.subscribers == 1)
    lost = stranger("t", b"other\0", wire.hello_part(next(IDS), "other"))  # another publisher's endpoint
    heard(pub, able, b"in the end", 1)
    assert not lost.poll(50)


@pytest.mark.parametrize("size", [0, 1, 8_191, 8_192, 16_383, 16_384, 70_000])
def test_every_payload_size_round_trips(node: nep.Node, size: int) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    payload = bytes(range(256)) * (size // 256 + 1)
    for data in (payload[:size], memoryview(payload)[:size], payload[:size]):
        pub.publish_bytes(data)
        message = sub.receive(30.0)
        assert message is not None
        assert message.data == payload[:size]
        assert message.data.readonly
    assert sub.lost == 0
