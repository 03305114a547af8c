"""Tests of the fast paths of the native wire: they skip no handshake or message and delay no reader."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from time import monotonic

import pytest
import zmq

import nep
from nep.backends.base import SubscriberSpec
from nep.backends.connection import Hybrid
from nep.backends.zeromq.sub_socket import SubSocket
from nep.masters.master import Master
from nep.protocol import wire
from nep.protocol.requests import PublisherRecord, RemotePublisher
from tests.nep.programs import GREETINGS_S, eventually, running


@pytest.fixture
def node(master: Master, patient: None) -> Iterator[nep.Node]:
    with nep.node("reading", master=master.address) as made:
        yield made


def test_received_payload_can_be_forwarded_and_stays_readable(node: nep.Node, master: Master) -> None:
    data = os.urandom(300_000)
    with nep.node("relay", master=master.address) as relay:
        there, back = relay.new_sub("there", "bytes"), relay.new_pub("back", "bytes")
        sub, pub = node.new_sub("back", "bytes"), node.new_pub("there", "bytes")
        pub.publish(data)
        message = there.receive(30.0)
        assert message is not None
        back.publish_bytes(message.data)
        back.publish_bytes(message.data[1000:])  # a slice isn't forwarded as the whole message
        whole, part = sub.receive(30.0), sub.receive(30.0)
        assert whole is not None
        assert part is not None
        assert whole.data == data
        assert part.data == data[1000:]
        assert message.data == data


def test_memoryview_with_multi_byte_items_is_sent_as_bytes(node: nep.Node) -> None:
    sub, pub = node.new_sub("wide", "bytes"), node.new_pub("wide", "bytes")
    for size in (8, 80_000):
        data = os.urandom(size)
        pub.publish_bytes(memoryview(data).cast("q"))
        message = sub.receive(30.0)
        assert message is not None
        assert message.data == data


def test_subscriber_that_joins_a_stream_completes_its_handshake(node: nep.Node, master: Master) -> None:
    pub = node.new_pub("stream", "bytes")
    is_over = threading.Event()

    def stream() -> None:
        while not is_over.wait(0.0001):  # faster than a publisher polls for subscriptions
            for _ in range(3):
                pub.publish(b"x" * 100)

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        with nep.node("late", master=master.address) as late:
            for number in range(1, 6):
                started = monotonic()
                sub = late.new_sub("stream", "bytes")
                assert monotonic() - started < GREETINGS_S  # the handshake did not time out
                assert sub.receive(30.0) is not None
                assert pub.subscribers == number
    finally:
        is_over.set()
        thread.join()


def test_subscriber_that_joins_after_a_burst_completes_its_handshake(node: nep.Node, master: Master) -> None:
    pub = node.new_pub("burst", "bytes")
    with nep.node("late", master=master.address) as late:
        for number in range(1, 11):
            for _ in range(20):
                pub.publish(b"x")
            started = monotonic()
            late.new_sub("burst", "bytes")
            assert monotonic() - started < GREETINGS_S
            assert pub.subscribers == number


def test_blocking_reader_does_not_delay_a_new_publisher(node: nep.Node, master: Master) -> None:
    sub, first = node.new_sub("many", "bytes"), node.new_pub("many", "bytes")
    heard: list[bytes] = []
    is_over = threading.Event()

    def read() -> None:
        while not is_over.is_set():
            message = sub.receive(0.05)
            if message is not None:
                heard.append(bytes(message.data))

    def stream() -> None:
        while not is_over.wait(0.001):
            first.publish(b"first")

    threads = [threading.Thread(target=read), threading.Thread(target=stream)]
    for thread in threads:
        thread.start()
    try:
        eventually(lambda: len(heard) > 20)
        with nep.node("other", master=master.address) as other:
            for number in range(5):
                started = monotonic()
                pub = other.new_pub("many", "bytes")
                assert monotonic() - started < GREETINGS_S
                pub.publish(b"%d" % number)
                assert not pub.missing
            eventually(lambda: [each for each in heard if each != b"first"] == [b"0", b"1", b"2", b"3", b"4"])
    finally:
        is_over.set()
        for thread in threads:
            thread.join()
    assert sub.lost == 0


def test_unread_messages_are_moved_to_the_inbox_by_the_node(node: nep.Node) -> None:
    sub, pub = node.new_sub("left", "bytes"), node.new_pub("left", "bytes")
    for _ in range(3):  # a reader that takes one message at a time
        pub.publish(b"x")
        assert sub.receive(30.0) is not None
    for _ in range(3000):
        pub.publish(b"x")
    assert sub.receive(30.0) is not None
    eventually(lambda: sub.received == 3003)
    assert sub.lost == 0
    assert sum(sub.receive(30.0) is not None for _ in range(2999)) == 2999


def test_close_ends_an_iteration_over_a_subscriber(node: nep.Node) -> None:
    sub, pub = node.new_sub("ends", "bytes"), node.new_pub("ends", "bytes")
    ended = threading.Event()

    def read() -> None:
        for _message in sub:
            pass
        ended.set()

    thread = threading.Thread(target=read)
    thread.start()
    pub.publish(b"x")
    eventually(lambda: sub.received == 1)
    sub.close()
    assert ended.wait(30.0)
    thread.join()


COMING_AND_GOING = """
import os, sys, threading, nep
size, is_over = int(sys.argv[2]), threading.Event()
with nep.node("a", master=sys.argv[1]) as a, nep.node("b", master=sys.argv[1]) as b:
    pub = a.new_pub("busy", "bytes")
    data = os.urandom(size)
    def stream():
        while not is_over.is_set():
            pub.publish(data)
    thread = threading.Thread(target=stream)
    thread.start()
    for _ in range(30):
        b.new_sub("busy", "bytes").close()
    is_over.set()
    thread.join()
print("stands")
"""


@pytest.mark.parametrize("size", [1000, 20_000])
def test_frequent_subscribing_and_unsubscribing_does_not_crash_the_program(master: Master, size: int) -> None:
    """Regression test: libzmq crashes if the high-water mark is changed while a connection is closing."""
    for _ in range(2):
        with running(COMING_AND_GOING, master.address, str(size)) as program:
            assert program.line() == "stands"


def test_stream_of_large_messages_does_not_stall(node: nep.Node, master: Master) -> None:
    """Sends more than the window for bytes in flight, during several renewals."""
    with nep.node("other", master=master.address) as other:
        pub, sub = node.new_pub("on", "bytes"), other.new_sub("on", "bytes")
        data = os.urandom(20_000)
        started = monotonic()
        while pub.count < 8000 or monotonic() - started < 2.5:
            pub.publish(data)
            assert sub.receive(30.0) is not None, f"message {pub.count} did not come"
        assert sub.lost == 0


def test_sink_can_open_publishers_and_subscribers(node: nep.Node) -> None:
    heard: list[object] = []

    def sink(_messages: object) -> None:
        sub = node.new_sub("answers", sink=heard.extend)
        node.new_pub("answers").publish(len(node.graph().topics["answers"].subscribers))
        heard.append(sub)

    pub = node.new_pub("questions")
    node.new_sub("questions", sink=sink)
    pub.publish(1)
    eventually(lambda: len(heard) == 2)
    assert [each.payload for each in heard if isinstance(each, nep.Message)] == [1]


@pytest.fixture
def context() -> Iterator[zmq.Context[zmq.Socket[bytes]]]:
    made: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    made.linger = 0
    yield made
    made.destroy(0)


def test_subscription_without_hello_receives_three_part_messages(
    node: nep.Node, context: zmq.Context[zmq.Socket[bytes]]
) -> None:
    pub = node.new_pub("open", "bytes")
    with context.socket(zmq.SUB) as other:
        other.setsockopt(zmq.SUBSCRIBE, b"")
        other.connect(node.graph().topics["open"].publishers[0].endpoints[0])
        eventually(lambda: pub.publish(b"x") is None and bool(other.poll(10)))
        topic, header, payload = other.recv_multipart()
    assert (topic, payload) == (b"open\0", b"x")
    assert wire.read_header(header).publisher == pub.id
    assert pub.subscribers == 0  # no subscriber sent a hello


def test_publisher_with_a_changed_port_is_reconnected(context: zmq.Context[zmq.Socket[bytes]]) -> None:
    """Happens when a master is restarted without and then with `--listen`: same address, other port."""
    spec = SubscriberSpec(5, "t", "bytes", Hybrid("x", "many2many"), None)
    sub = SubSocket(context.socket(zmq.SUB), spec)
    first, second = context.socket(zmq.XPUB), context.socket(zmq.XPUB)
    for there in (first, second):
        port = there.bind_to_random_port("tcp://127.0.0.1")
        record = PublisherRecord(7, "t", "bytes", "bytes", (f"tcp://127.0.0.1:{port}",))
        for _ in range(2):
            sub.connect(RemotePublisher(record, "n", "N"))  # connecting twice has no effect
        said = []
        while len(said) < 2:
            assert there.poll(60_000), "it does not come to the new port"
            said.append(there.recv())
        assert said[0] == b"\x01t\0"
        there.send_multipart([said[1][1:], wire.Header(3, 0, 0, 0, 7).pack()])
        eventually(lambda: sub.read_into([], 1, 1) == 0 and sub.sources.get(7).has_echoed)
    for each in (first, second, sub):
        each.close()


def test_message_after_a_rejected_batch_is_read_immediately(context: zmq.Context[zmq.Socket[bytes]]) -> None:
    """The descriptor is edge-triggered: it does not signal messages that are already in the queue."""
    spec = SubscriberSpec(5, "t", "bytes", Hybrid("x", "many2many"), None)
    socket, there = context.socket(zmq.SUB), context.socket(zmq.XPUB)
    sub = SubSocket(socket, spec)
    there.bind("inproc://there")
    socket.connect("inproc://there")
    assert there.recv() == b"\1t\0"
    batch = wire.Header(3, wire.BATCH, 1, 1, 7, 4).pack() + bytes(4)  # an empty batch
    for _number in range(3):
        there.send(b"t\0" + batch)
    there.send_multipart(wire.join("t", wire.Header(3, 0, 1, 1, 7), b"good"))
    assert sub.has_input
    messages: list[nep.Message] = []
    assert sub.read_into(messages, 1, 1_000) == 1
    assert bytes(messages[0].data) == b"good"
    assert sub.rejections.count == 3
    sub.close()
    there.close(0)
