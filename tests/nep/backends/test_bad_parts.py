"""Tests of truncated, random and huge parts on every native port.

Bad parts are counted, and valid messages arrive.

Each example sends bad messages and then a good one on the same connection. When the good one has
arrived, the bad ones have been processed, so no test waits for a fixed time.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import socket
import struct
import threading
from collections.abc import Iterator

import pytest
import zmq
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import nep
from nep.errors import WireError
from nep.masters.master import Master
from nep.messages.message import Message
from nep.messages.packing import pack
from nep.protocol import encoding, wire
from nep.protocol.requests import (
    AddSubscriber,
    DoneReply,
    FoundReply,
    NodeRecord,
    Ping,
    RejectedReply,
    SubscriberRecord,
)
from tests.nep.programs import eventually

FEW = settings(
    deadline=None,
    max_examples=25,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
TOPIC = b"bad\0"
HUGE = st.sampled_from([70_000, 1_000_000, 4_000_000]).map(lambda size: b"\x93" * size)
HEADERS = st.builds(
    wire.Header,
    st.sampled_from([1, 3, 5, 99]),
    st.sampled_from([0, 1, 2, 4, 0xFFFF]),
    st.integers(1, 9),
    st.just(0),
    st.sampled_from([7, 2**62]),
    st.sampled_from([0, 3, 4, 1000, 2**32 - 1]),
).map(wire.Header.pack)
PARTS = st.binary(max_size=40) | HEADERS | HEADERS.map(lambda head: head[:-1]) | HUGE | st.just(TOPIC)
BAD = st.lists(PARTS, min_size=0, max_size=4).map(lambda parts: [TOPIC, *parts]) | st.lists(
    PARTS, min_size=0, max_size=3
).map(lambda parts: [b"".join([TOPIC, *parts])])


@pytest.fixture(scope="module")
def master() -> Iterator[Master]:
    with Master("127.0.0.1:0", learn_s=0.0) as made:
        yield made


@pytest.fixture
def context() -> Iterator[zmq.Context[zmq.Socket[bytes]]]:
    made: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    made.linger = 0
    yield made
    made.destroy(0)


# ---- a subscriber's port


class Rogue:
    """Publisher of arbitrary parts and of valid messages."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]]) -> None:
        self.socket = context.socket(zmq.XPUB)
        self.port = self.socket.bind_to_random_port("tcp://127.0.0.1")
        self.seqs = itertools.count(1)

    def good(self, told: bool = True, one: bool = False) -> bytes:
        """Send a valid message, optionally as a single part. Return its payload."""
        payload = b"good %d" % next(self.seqs)
        head = wire.Header(3, 0, int(payload[5:]), 0, 42, len(payload) if told else 0)
        parts = [TOPIC, head.pack(), payload]
        self.socket.send_multipart([b"".join(parts)] if one else parts)
        return payload


def is_message(parts: list[bytes]) -> bool:
    try:
        read = wire.split(parts)
    except WireError:
        return False
    return read.header.codec in {1, 3, 5} and read.topic == "bad"


def test_subscriber_receives_valid_messages_between_invalid_ones(
    context: zmq.Context[zmq.Socket[bytes]],
) -> None:
    rogue = Rogue(context)
    with nep.node("victim") as node:
        sub = node.new_sub("bad", "bytes", node.direct(port=rogue.port, mode="one2many", wire="native"))

        @FEW
        @given(st.lists(BAD, min_size=1, max_size=4), st.booleans(), st.booleans())
        def attack(messages: list[list[bytes]], told: bool, one: bool) -> None:
            refused = sub.refused
            expected = [rogue.good()]
            bad = 0
            for parts in messages:
                rogue.socket.send_multipart(parts)
                bad += not is_message(parts)
                expected.append(rogue.good(told, one))
            heard = []
            while len(heard) < len(expected):
                message = sub.receive(30.0)
                assert message is not None, "a good message was lost"
                if message.publisher == 42:
                    heard.append(bytes(message.data))
            assert heard == expected
            assert sub.refused - refused >= bad  # one malformed message may be counted twice

        rogue.socket.recv()  # wait for the subscription
        rogue.socket.recv()
        attack()
        rogue.socket.send_multipart([TOPIC, b"short"])
        expected = rogue.good()
        message = sub.receive(30.0)
        assert message is not None
        assert bytes(message.data) == expected
        assert "a header must have 32 bytes, but this one has 5" in sub._transport.counts().problem  # type: ignore[attr-defined]


@pytest.mark.parametrize("in_batches", [False, True])
def test_single_part_with_a_wrong_length_is_rejected(
    context: zmq.Context[zmq.Socket[bytes]], in_batches: bool
) -> None:
    rogue = Rogue(context)
    heard: list[Message] = []
    with nep.node("victim") as node:
        direct = node.direct(port=rogue.port, mode="one2many", wire="native")
        sub = node.new_sub("bad", "bytes", direct, sink=heard.extend if in_batches else None)
        rogue.socket.recv()  # wait for the subscription
        rogue.socket.recv()
        good: list[bytes] = []
        for _ in range(20):
            good.append(rogue.good(one=True))
            head = wire.Header(3, 0, next(rogue.seqs), 0, 42, 4).pack()
            rogue.socket.send(b"".join([TOPIC, head, b"three"]))
            good.append(rogue.good(one=True))
        while not in_batches and len(heard) < len(good):
            message = sub.receive(30.0)
            assert message is not None
            heard.append(message)
        eventually(lambda: len(heard) >= len(good))
        assert [bytes(message.data) for message in heard] == good
        assert sub.refused == 20
    rogue.socket.close(0)


# ---- a publisher's port

SUBSCRIPTIONS = (
    st.binary(max_size=40)
    | st.binary(max_size=30).map(lambda junk: b"\x01\xffhello/" + junk)
    | st.binary(max_size=30).map(lambda junk: b"\x00\xffhello/" + junk)
    | st.sampled_from([b"\x01" + wire.hello_part(5, "other"), b"\x00" + wire.hello_part(5, "victim")])
    | st.sampled_from([b"\x01", b"\x01" + b"x" * 4000, b"x" * 4000])
)


def shake_hands(port: int) -> socket.socket:
    """Return a raw connection to a publisher after the ZMTP handshake, to send more than libzmq would."""
    made = socket.create_connection(("127.0.0.1", port), timeout=60.0)
    made.sendall(b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32))
    left = 64
    while left:
        left -= len(made.recv(left))
    ready = b"\x05READY\x0bSocket-Type" + struct.pack(">I", 3) + b"SUB"
    made.sendall(bytes([4, len(ready)]) + ready)
    return made


@pytest.mark.usefixtures("patient")
def test_publisher_disconnects_a_subscriber_that_sends_an_oversized_subscription(master: Master) -> None:
    with nep.node("victim", master=master.address) as node:
        pub = node.new_pub("book", "bytes")
        sub = node.new_sub("book", "bytes")
        (info,) = node.graph().topics["book"].publishers
        for size in (wire.MAX_SUBSCRIPTION_BYTES + 1, 4_000_000, 2**62):
            with shake_hands(int(info.endpoints[0].rpartition(":")[2])) as rogue:
                with contextlib.suppress(OSError):  # the publisher closes before reading everything
                    rogue.sendall(b"\x02" + struct.pack(">Q", size) + b"\x01")
                    rogue.sendall(b"a" * min(size - 1, 4_000_000))
                with contextlib.suppress(ConnectionResetError):
                    while rogue.recv(1000):
                        pass  # until the publisher disconnects
        pub.publish(b"still here")
        message = sub.receive(30.0)
        assert message is not None
        assert (pub.subscribers, sub.lost) == (1, 0)


@pytest.mark.usefixtures("patient")
def test_publisher_survives_invalid_subscriptions(
    context: zmq.Context[zmq.Socket[bytes]], master: Master
) -> None:
    with nep.node("victim", master=master.address) as node:
        pub = node.new_pub("victim", "bytes")
        (info,) = node.graph().topics["victim"].publishers
        sub = node.new_sub("victim", "bytes")
        rogue = context.socket(zmq.XSUB)
        rogue.connect(info.endpoints[0])
        ids = itertools.count(1000)

        @FEW
        @given(st.lists(st.lists(SUBSCRIPTIONS, min_size=1, max_size=2), min_size=1, max_size=5))
        def attack(messages: list[list[bytes]]) -> None:
            for parts in messages:
                rogue.send_multipart(parts)
            own = wire.hello_part(next(ids), "victim")
            rogue.send(b"\x01" + own)
            while True:  # wait for the echo to the valid hello, after all others
                assert rogue.poll(60_000), "a proper subscriber is not greeted any more"
                first, *_rest = rogue.recv_multipart()
                if first == own:
                    break
            rogue.send(b"\x00" + own)
            pub.publish(b"still here")
            message = sub.receive(30.0)
            assert message is not None
            assert bytes(message.data) == b"still here"

        refused = pub._transport.rejections  # type: ignore[attr-defined]
        rogue.send(b"\x01nobody knows that")
        attack()
        assert refused.count >= 1
        assert "invalid subscription" in refused.recent_message()
        assert sub.lost == 0
        rogue.close()
        eventually(lambda: pub.subscribers == 1)


# ---- the master's port

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text() | st.binary(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
NAMES = st.sampled_from([*encoding._REQUESTS, "fly", ""])
FIELDS = st.dictionaries(
    st.sampled_from(
        [
            "node",
            "node_id",
            "epoch",
            "revision",
            "publisher",
            "publishers",
            "subscribers",
            "id",
            "managed",
            "hosts",
        ]
    ),
    VALUES | st.just("attacker"),
    max_size=5,
)
REQUESTS = (
    st.binary(max_size=60)
    | VALUES.map(pack)
    | st.builds(lambda do, call, what: pack({"do": do, "call": call, "what": what}), NAMES, VALUES, FIELDS)
    | st.integers(1, 100_000).map(lambda depth: b"\x91" * depth)
    | st.integers(1, 3000).map(lambda depth: pack({"do": "look", "call": 1})[:-1] + b"\x91" * depth + b"\xc0")
    | HUGE
)


def test_master_replies_to_every_request_and_keeps_serving(
    context: zmq.Context[zmq.Socket[bytes]], master: Master, caplog: pytest.LogCaptureFixture
) -> None:
    with nep.node("bystander", master=master.address) as node:
        node.new_pub("bystander", "bytes")
        attacker = context.socket(zmq.DEALER)
        attacker.setsockopt(zmq.ROUTING_ID, b"attacker")
        attacker.connect(f"tcp://{master.address}")
        calls = itertools.count(10**6)

        @FEW
        @given(st.lists(st.lists(REQUESTS, min_size=1, max_size=3), min_size=1, max_size=4))
        def attack(messages: list[list[bytes]]) -> None:
            for parts in messages:
                attacker.send_multipart(parts)
            call = next(calls)
            attacker.send(encoding.encode_request(Ping(), call))
            answers = 0
            while True:
                assert attacker.poll(60_000), "the master does not answer any more"
                number, answer = encoding.decode_reply(attacker.recv())
                if number == call:
                    assert isinstance(answer, DoneReply)
                    break
                answers += 1
                if isinstance(answer, RejectedReply):
                    assert answer.reason
            assert answers == len(messages)  # each request is answered

        attack()
        view = node.graph()
        assert "bystander" in view.topics
    assert "the master failed" not in caplog.text


@pytest.mark.parametrize("size", [0, 1, 200, 255])
def test_master_serves_nodes_with_routing_ids_of_any_length(
    context: zmq.Context[zmq.Socket[bytes]], master: Master, size: int
) -> None:
    with context.socket(zmq.DEALER) as dealer:
        ask_with_id(dealer, master, size)


def ask_with_id(dealer: zmq.Socket[bytes], master: Master, size: int) -> None:
    if size:
        dealer.setsockopt(zmq.ROUTING_ID, b"\xfe" * size)
    dealer.connect(f"tcp://{master.address}")
    record = SubscriberRecord(5, "t", "json")
    said = NodeRecord("\udcfe" * size if size else "x", "odd", "host", None)
    body = pack({"do": "subscriber+", "call": 3, "what": {}})
    if not size:
        body = encoding.encode_request(AddSubscriber(said, record), 3)
    dealer.send(body)
    assert dealer.poll(60_000)
    assert isinstance(encoding.decode_reply(dealer.recv())[1], RejectedReply)
    dealer.send(encoding.encode_request(Ping(), 4))
    assert dealer.poll(60_000)


# ---- a node's port to its master

ANSWERS = (
    st.binary(max_size=60)
    | VALUES.map(pack)
    | st.builds(
        lambda name, call, what: pack({"is": name, "re": call, "what": what}),
        st.sampled_from([*encoding._REPLIES, "fly"]),
        st.integers(0, 20) | VALUES,
        st.dictionaries(
            st.sampled_from(
                ["epoch", "revision", "publisher", "publishers", "topics", "last_seqs", "view", "id", "topic"]
            ),
            VALUES | st.just(1),
            max_size=6,
        ),
    )
    | st.integers(1, 100_000).map(lambda depth: b"\x91" * depth)
    | HUGE
)


def test_node_survives_invalid_replies_of_a_master(
    context: zmq.Context[zmq.Socket[bytes]], caplog: pytest.LogCaptureFixture
) -> None:
    router = context.socket(zmq.ROUTER)
    port = router.bind_to_random_port("tcp://127.0.0.1")
    caplog.set_level(logging.WARNING)
    with nep.node("victim", master=f"127.0.0.1:{port}", wait_s=60.0) as node:
        answered: list[object] = []

        def serve(until: str) -> bytes:
            """Reply to requests properly until one of this name arrives. Return the sender's routing ID."""
            while True:
                assert router.poll(60_000), "the node says nothing any more"
                sender, body = router.recv_multipart()
                asked = encoding.decode_request(body)
                name = encoding._REQUEST_NAMES[type(asked.request)]  # type: ignore[index]
                answered.append(asked.request)
                reply = FoundReply(9, 1) if name in {"subscriber+", "join"} else DoneReply(9, 1)
                router.send_multipart([sender, encoding.encode_reply(reply, asked.call)])
                if name == until:
                    return sender

        made: list[nep.Subscriber] = []
        thread = threading.Thread(target=lambda: made.append(node.new_sub("t", "bytes")))
        thread.start()
        sender = serve("subscriber+")
        thread.join()

        @FEW
        @given(st.lists(st.lists(ANSWERS, min_size=1, max_size=2), min_size=1, max_size=4))
        def attack(messages: list[list[bytes]]) -> None:
            for parts in messages:
                router.send_multipart([sender, *parts])
            ended: list[object] = []

            def look() -> None:
                try:
                    ended.append(node.graph(5.0))
                except nep.NepError as error:
                    ended.append(error)

            thread = threading.Thread(target=look)
            thread.start()
            serve("look")
            thread.join()
            assert ended

        attack()
        thread = threading.Thread(target=lambda: made.append(node.new_sub("u", "bytes")))
        thread.start()
        serve("subscriber+")
        thread.join()
        assert len(made) == 2
        thread = threading.Thread(target=node.close)
        thread.start()
        serve("leave")
        thread.join()
    assert "malformed" in caplog.text
    assert "error while serving a socket" not in caplog.text
