"""Tests of batches: small messages published in quick succession are sent together."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import pytest
import zmq
from hypothesis import given
from hypothesis import strategies as st

import nep
from nep.backends.base import PublisherSpec
from nep.backends.connection import Hybrid
from nep.backends.zeromq.pending_batch import (
    BATCH_WINDOW_NS,
    MAX_DELAY_NS,
    MAX_PENDING_MESSAGES,
    PendingBatch,
)
from nep.errors import ClosedError, WireError
from nep.masters.master import Master
from nep.messages.codecs import codec_for
from nep.messages.encoded import Encoded
from nep.protocol import wire
from nep.protocol.batch import BATCH, MAX_BATCH_MESSAGES, encode_batch, parse_entries
from tests.nep.programs import eventually

LONG_S = 30.0
IDS = itertools.count(1)


@pytest.fixture
def node(master: Master, patient: None) -> Iterator[nep.Node]:
    with nep.node("batches", master=master.address) as made:
        yield made


@pytest.fixture
def stranger(node: nep.Node) -> Iterator[Callable[..., zmq.Socket[bytes]]]:
    """Function that opens a plain ZeroMQ subscriber with a given hello, to inspect the received parts."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    context.linger = 0
    sockets = []

    def made(topic: str, hello: bytes) -> zmq.Socket[bytes]:
        socket = context.socket(zmq.SUB)
        sockets.append(socket)
        socket.rcvtimeo = int(LONG_S * 1000)
        socket.subscribe(wire.topic_part(topic))
        socket.subscribe(hello)
        socket.connect(node.graph().topics[topic].publishers[0].endpoints[0])
        assert socket.recv_multipart()[0] == hello  # the publisher's echo
        return socket

    yield made
    for each in sockets:
        each.close(0)
    context.term()


def able(topic: str) -> bytes:
    return wire.hello_part(next(IDS), topic, reads_batches=True)


def heard(socket: zmq.Socket[bytes], count: int) -> list[tuple[int, int]]:
    """Receive `count` messages. Return the number of messages in each part and the `seq` of its first."""
    said = []
    while sum(each for each, _seq in said) < count:
        parts = socket.recv_multipart()
        if parts[0].startswith(b"\xff"):
            continue
        if len(parts) > 1:
            said.append((1, wire.read_header(parts[1]).seq))
            continue
        _topic, head, body = wire.split_single_part(parts[0])
        header = wire.read_header(head)
        said.append((len(parse_entries(body)) if header.flags & BATCH else 1, header.seq))
    return said


def burst(publisher: nep.Publisher, count: int) -> None:
    publish = publisher.publish
    for number in range(count):
        publish(number)


def all_of(subscriber: nep.Subscriber, count: int) -> list[nep.Message]:
    got = []
    for _ in range(count):
        message = subscriber.receive(LONG_S)
        assert message is not None
        got.append(message)
    return got


# ---- delivery


def test_burst_arrives_in_order_with_every_message_intact(node: nep.Node) -> None:
    sub, pub = node.new_sub("t"), node.new_pub("t")
    burst(pub, 2000)
    got = all_of(sub, 2000)
    assert [each.payload for each in got] == list(range(2000))
    assert [each.seq for each in got] == list(range(1, 2001))
    stamps = [each.stamp_ns or 0 for each in got]
    assert stamps == sorted(stamps)
    assert len(set(stamps)) > 1000  # each message keeps its own stamp
    assert (sub.received, sub.lost, sub.refused, pub.count) == (2000, 0, 0, 2000)


def test_batched_bytes_are_counted_by_payload_size(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    for _ in range(100):
        pub.publish(b"12345")
    all_of(sub, 100)
    assert pub._transport.counts().bytes == 500


def test_subscribers_that_support_batches_receive_batches(
    node: nep.Node, stranger: Callable[..., zmq.Socket[bytes]]
) -> None:
    pub = node.new_pub("t")
    socket = stranger("t", able("t"))

    def comes_together() -> bool:
        before = pub.count
        burst(pub, 500)
        said = heard(socket, 500)
        assert said[0] == (1, before + 1)  # the first message is never delayed
        assert [seq for _many, seq in said] == [
            before + 1 + sum(each for each, _seq in said[:place]) for place in range(len(said))
        ]
        assert max(many for many, _seq in said) <= MAX_PENDING_MESSAGES
        return len(said) < 250

    eventually(comes_together)  # on a busy computer, each gap may exceed the window of 20 µs


@pytest.mark.parametrize("other", ["an older nep", "a debugger"])
def test_subscribers_without_batch_support_receive_single_messages(
    node: nep.Node, stranger: Callable[..., zmq.Socket[bytes]], other: str
) -> None:
    pub, sub = node.new_pub("t"), node.new_sub("t")
    old = (
        wire.hello_part(next(IDS), "t", acknowledges_echoes=True)
        if other == "an older nep"
        else wire.hello_part(7, "t")
    )
    socket = stranger("t", old)
    burst(pub, 300)
    assert {many for many, _seq in heard(socket, 300)} == {1}
    assert [each.payload for each in all_of(sub, 300)] == list(range(300))


@pytest.mark.parametrize("how", ["latched", "not wanted"])
def test_latched_and_unbatched_publishers_send_without_delay(
    node: nep.Node, stranger: Callable[..., zmq.Socket[bytes]], how: str
) -> None:
    pub = node.new_pub("t", latched=how == "latched", batch=how != "not wanted")
    socket = stranger("t", able("t"))
    burst(pub, 300)
    assert {many for many, _seq in heard(socket, 300)} == {1}


def test_remaining_batch_is_flushed_without_further_publishing(node: nep.Node) -> None:
    sub, pub = node.new_sub("t"), node.new_pub("t")
    for _ in range(20):
        burst(pub, 7)
        assert [each.payload for each in all_of(sub, 7)] == list(range(7))


def test_immediate_close_flushes_pending_messages(node: nep.Node, master: Master) -> None:
    sub = node.new_sub("t")
    with nep.node("short", master=master.address) as short:
        burst(short.new_pub("t"), 100)
    assert [each.payload for each in all_of(sub, 100)] == list(range(100))
    pub = node.new_pub("t")
    publish = pub.publish
    burst(pub, 5)
    pub.close()
    with pytest.raises(ClosedError):
        publish(1)
    assert [each.payload for each in all_of(sub, 5)] == list(range(5))
    assert sub.lost == 0


def test_large_and_annotated_messages_keep_their_order_among_batches(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    sizes = [1, 0, 16_383, 16_384, 5, 70_000, 2, 3, 0, 100_000, 9]
    for turn in range(20):
        for size in sizes:
            pub.publish(bytes([turn]) * size)
        pub.publish_bytes(b"beside", {"frame_id": "x"})
    for turn in range(20):
        got = [bytes(each.data) for each in all_of(sub, len(sizes) + 1)]
        assert got == [*(bytes([turn]) * size for size in sizes), b"beside"]
    assert sub.lost == 0


def test_subscriber_that_joins_during_a_burst_counts_no_loss(node: nep.Node) -> None:
    pub, sub = node.new_pub("t"), node.new_sub("t")
    burst(pub, 50)
    late = node.new_sub("t")
    burst(pub, 50)
    heard: list[object] = []

    def is_all_heard() -> bool:
        """Return whether the last 50 messages arrived; earlier ones may still have been queued."""
        while (message := late.receive(0.01)) is not None:
            heard.append(message.payload)
        return heard[-50:] == list(range(50))

    eventually(is_all_heard)
    all_of(sub, 100)
    assert (sub.lost, late.lost) == (0, 0)
    sub.close()
    late.close()
    eventually(lambda: not pub.subscribers)
    burst(pub, 50)
    assert pub.count == 150


def test_batched_messages_beyond_the_inbox_limit_are_dropped_and_counted(node: nep.Node) -> None:
    pub = node.new_pub("t")
    latest = node.new_sub("t", keep="latest")
    few = node.new_sub("t", max_messages=3)
    burst(pub, 400)

    def newest(sub: nep.Subscriber) -> bool:
        message = sub.receive(0.05)
        return message is not None and message.payload == 399

    for sub in (latest, few):
        eventually(lambda sub=sub: newest(sub))
        assert sub.received + (sub.lost or 0) == 400
    assert len(few._transport.ready) <= 3


def test_subscriber_keeps_only_max_messages_of_a_batch(
    node: nep.Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    sub = node.new_sub("t", "bytes", max_messages=2)
    batch = [nep.Message("t", bytes([number]), "bytes", "bytes") for number in range(5)]

    def read_batch(buffer: list[nep.Message], *_limits: int, may_wait: bool = False) -> int:
        buffer += batch
        count = len(batch)
        batch.clear()
        return count

    monkeypatch.setattr(sub._transport, "_read_into", read_batch)
    assert [sub.listen() for _ in range(3)] == [(True, b"\3"), (True, b"\4"), (False, b"")]
    assert sub.lost == 3


# ---- batching window


def waiting(batch: PendingBatch, *stamps_ns: int) -> None:
    for stamp_ns in stamps_ns:
        batch.pending.append((b"x", stamp_ns))


def test_batching_requires_a_permitting_publisher_and_supporting_subscribers() -> None:
    batch = PendingBatch(is_enabled=True)
    batch.open_window(1000)
    assert batch.until_ns == 0  # no subscriber accepts batches yet
    batch.set_allowed(is_supported=True)
    batch.open_window(1000)
    assert batch.until_ns == 1000 + BATCH_WINDOW_NS
    never = PendingBatch(is_enabled=False)
    never.set_allowed(is_supported=True)
    never.open_window(1000)
    assert (never.is_allowed, never.until_ns) == (False, 0)


def test_next_flush_check_is_scheduled_by_the_maximum_delay() -> None:
    batch = PendingBatch(is_enabled=True)
    batch.is_flush_scheduled = True
    waiting(batch, 10_000, 12_000)
    assert batch.next_check_s(20_000) == pytest.approx((MAX_DELAY_NS - 10_000) / 1e9)
    assert batch.next_check_s(10_000 + MAX_DELAY_NS) == 0.0
    assert batch.pop_batch() == [(b"x", 10_000), (b"x", 12_000)]
    assert (batch.burst_check_s, batch.is_flush_scheduled) == (0.0, False)
    batch.is_flush_scheduled = batch.has_sent_full_batch = True  # the publisher sends full batches itself
    waiting(batch, 200_000)
    assert batch.next_check_s(200_001) > MAX_DELAY_NS / 1e9
    assert batch.next_check_s(10**9) == 0.0
    batch.pop_batch()
    assert batch.burst_check_s == 0.0  # nothing was sent since


def test_clock_set_back_does_not_delay_a_flush() -> None:
    batch = PendingBatch(is_enabled=True)
    waiting(batch, 10**18)
    assert batch.next_check_s(5 * 10**17) == 0.0


# ---- encoding


@given(
    st.lists(
        st.tuples(st.integers(0, 2**64 - 1), st.binary(max_size=50)), min_size=1, max_size=MAX_BATCH_MESSAGES
    ),
    st.integers(1, 2**63),
)
def test_batch_round_trips(messages: list[tuple[int, bytes]], seq: int) -> None:
    stamps, payloads = [each[0] for each in messages], [each[1] for each in messages]
    part = encode_batch(b"t\0", wire.encode_form(3, 0), seq, 9, stamps, payloads)
    topic, head, body = wire.split_single_part(part)
    assert (topic, wire.read_header(head)) == (b"t\0", wire.Header(3, BATCH, seq, stamps[0], 9, len(body)))
    read = parse_entries(body)
    assert [each.stamp_ns for each in read] == stamps
    assert [body[each.begin : each.end] for each in read] == payloads


@given(st.binary(max_size=200))
def test_any_batch_bytes_are_parsed_or_rejected_with_a_reason(body: bytes) -> None:
    try:
        read = parse_entries(body)
    except WireError as error:
        assert error.reason  # noqa: PT017 - either is right
    else:
        assert read[-1].end == len(body)


class _RecordingTransport:
    has_subscribers = True
    is_closed = False
    problem = ""

    def __init__(self) -> None:
        self.sent: list[Encoded | bytes] = []

    def send(self, encoded: Encoded) -> None:
        self.sent.append(encoded)

    def send_bytes(self, data: bytes) -> None:
        self.sent.append(data)

    def report(self, problem: str) -> None:
        """Do nothing."""


def test_encoded_payload_is_sent_unchanged_and_others_as_bytes() -> None:
    transport = _RecordingTransport()
    spec = PublisherSpec(1, "t", "json", codec_for("json"), False, Hybrid("127.0.0.1:0"), None)
    publisher = nep.Publisher(transport, spec)  # type: ignore[arg-type]
    publisher.publish(Encoded(b"1"))
    publisher.publish(1)
    publisher.publish(2, strict=True)
    assert transport.sent == [Encoded(b"1"), b"1", Encoded(b"2")]
