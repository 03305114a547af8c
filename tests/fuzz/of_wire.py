"""Fuzz targets for the native wire, batches, services and the messages between nodes and master."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator

from nep.backends.zeromq.legacy import from_frame, to_frame
from nep.backends.zeromq.services.tcp_stream import TcpStream
from nep.backends.zeromq.shared.payloads import SharedSources
from nep.errors import BadTopicError, NepError, WireError
from nep.masters.graph import Graph
from nep.masters.registry import check_request
from nep.protocol import batch, encoding, service_wire, topic_pattern, wire
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    AddPublisher,
    AddSubscriber,
    DoneReply,
    FoundReply,
    GraphReply,
    Join,
    Listen,
    NodeRecord,
    Ping,
    PublisherCount,
    PublisherRecord,
    QueryGraph,
    RejectedReply,
    RemotePublisher,
    Renew,
    RenewedReply,
    SubscriberCount,
    SubscriberRecord,
    derive_id,
    derive_node_id,
)
from tests.fuzz.target import SEPARATOR, Targets, check_sentence, joined, parts_of, text_of

TARGETS = Targets()
HEADER = wire.Header(3, wire.LATCHED, 5, 6, 7, 4)
NODE = NodeRecord(derive_node_id("key"), "näme", "host", 42, key="key")
PUBLISHER = PublisherRecord(
    derive_id("key", 1), "/topic", "json", "json", ("tcp://127.0.0.1:5000",), number=1
)
SUBSCRIBER = SubscriberRecord(derive_id("key", 2), "/topic", "json")


def messages() -> Iterator[bytes]:
    yield joined(wire.join("topic", HEADER, b"four"))
    yield joined(wire.join("tö/pic", HEADER, b"four", {"shape": [1, 2, 3], "encoding": "jpeg"}))
    yield b"".join(wire.join("topic", HEADER, b"four"))
    yield joined([wire.hello_part(7, "topic"), HEADER._replace(flags=wire.BYE).pack()])


@TARGETS.add(WireError, seeds=messages, words=(SEPARATOR, b"\0", b"\x01\x03\x02\0"))
def split(data: bytes) -> None:
    read = wire.split(parts_of(data))
    again = wire.split(wire.join(read.topic, read.header, read.payload, read.extension))
    assert (again.topic, again.payload) == (read.topic, read.payload)


def notices() -> Iterator[bytes]:
    for kind in ({}, {"reads_one_part": True}, {"acknowledges_echoes": True}, {"reads_batches": True}):
        yield wire.hello_part(0x1234, "tö/pic", **kind)
    yield wire.acknowledgement_part(wire.Acknowledgement(1, 2, 3, 2**64 - 1))
    yield wire.acceptance_part(wire.OfferAcceptance(1, 2, 3))


@TARGETS.add(
    seeds=notices, words=(b"\xffhello/", b"\xffhello3/", b"\xffread/", b"\xffshares/", b"0000000000000000/")
)
def filters(data: bytes) -> None:
    hello = wire.parse_hello(data)
    if hello is not None:
        assert 0 <= hello.subscriber < 2**64
        made = wire.hello_part(
            hello.subscriber,
            hello.topic,
            reads_one_part=hello.reads_one_part,
            acknowledges_echoes=hello.acknowledges_echoes,
            reads_batches=hello.reads_batches,
        )
        assert made.lower() == data.lower()
    read = wire.parse_acknowledgement(data)
    if read is not None:
        assert wire.acknowledgement_part(read) == data.lower()
        assert all(0 <= each < 2**64 for each in read)
    shares = wire.parse_acceptance(data)
    if shares is not None:
        assert wire.acceptance_part(shares) == data.lower()


def batches() -> Iterator[bytes]:
    for payloads in ([b"one"], [b"", b"two", b"three"], [b"x"] * 256):
        part = batch.encode_batch(b"t\0", wire.encode_form(3, 0), 1, 7, [*range(len(payloads))], payloads)
        yield part[2 + wire.HEADER_BYTES :]


@TARGETS.add(WireError, seeds=batches)
def batch_entries(data: bytes) -> None:
    found = batch.parse_entries(data)
    assert 1 <= len(found) <= batch.MAX_BATCH_MESSAGES
    assert sum(each.end - each.begin for each in found) <= len(data)
    assert found[-1].end == len(data)


def calls() -> Iterator[bytes]:
    native = service_wire.NATIVE
    yield joined(native.encode_call(7, 1, 2.5, b'{"a":1}'))
    yield joined(native.encode_call(2**64 - 1, 4, None, b""))
    for kind in (service_wire.CallKind.ERROR, service_wire.CallKind.REJECTED):
        failed = service_wire.error_reply(kind, "ValueError", "no \ud800")
        yield joined(native.encode_reply(9, failed))
        yield joined(service_wire.ORIGINAL.encode_reply(9, failed))
    yield joined(service_wire.ORIGINAL.encode_call(7, 1, 2.5, b'{"a":1}'))


@TARGETS.add(WireError, seeds=calls, words=(SEPARATOR, b'{"nep_error":', b"\x01\x01\x01\0"))
def native_calls(data: bytes) -> None:
    call = service_wire.NATIVE.read_call(parts_of(data))
    assert call.timeout_s is None or 0 < call.timeout_s < 2**32
    made = service_wire.NATIVE.encode_call(call.number, call.codec, call.timeout_s, call.data)
    assert joined(made) == data


@TARGETS.add(WireError, seeds=calls, words=(SEPARATOR, b'{"nep_error":', b'"reason":'))
def answers_of_services(data: bytes) -> None:
    parts = parts_of(data)
    for framing in (service_wire.NATIVE, service_wire.ORIGINAL):
        try:
            answer = framing.read_reply(parts)
        except WireError:
            continue
        name, reason = service_wire.read_error_reply(answer.reply.data)
        assert len(name) < 1000
        assert len(reason) < 20_000
        (name + reason).encode()
    service_wire.ORIGINAL.read_call(parts)


def streams() -> Iterator[bytes]:
    pairs = [joined_pair(service_wire.NATIVE.encode_call(7, 1, 2.5, b"x" * size)) for size in (0, 3, 1000)]
    yield pairs[0] + pairs[1]
    yield b"".join(pairs)
    yield pairs[2][:-1]


def joined_pair(parts: list[bytes | memoryview]) -> bytes:
    body = b"".join(parts)
    return struct.pack("<I", len(body)) + body


@TARGETS.add(WireError, seeds=streams, words=(b"\x10\0\0\0", b"\xff\xff\xff\xff"), slower=4)
def tcp_stream(data: bytes) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.setblocking(False)
        theirs.sendall(data[:60_000])
        theirs.close()
        stream = TcpStream(ours)
        pairs = []
        while stream.read() or not stream.has_ended:
            while (pair := stream.next()) is not None:
                pairs.append(pair)
        while (pair := stream.next()) is not None:
            pairs.append(pair)
        assert b"".join(map(joined_pair, pairs)) == data[:60_000]


@TARGETS.add(WireError, seeds=lambda: [struct.pack("<Q", 7), b""])
def shared_references(data: bytes) -> None:
    sources = SharedSources(1, lambda _shares: None)
    assert sources.read(7, data) is None


# ---- nodes and master


def requests() -> Iterator[bytes]:
    asked = [
        Join(NODE, 1, (PUBLISHER,), (SUBSCRIBER,)),
        AddPublisher(NODE, PUBLISHER),
        AddSubscriber(NODE, SUBSCRIBER),
        Renew(
            NODE.id,
            1,
            2,
            (PublisherCount(PUBLISHER.id, 3, 4, 5),),
            (SubscriberCount(SUBSCRIBER.id, 4, 0),),
            0.5,
        ),
        Listen(("*",)),
        QueryGraph(),
        Ping(),
    ]
    for number, each in enumerate(asked):
        yield encoding.encode_request(each, number)


WORDS = tuple(
    bytes([0xA0 + len(word)]) + word.encode()
    for word in ("do", "call", "what", "is", "re", "join", "renew", "node_id", "publishers", "epoch")
)


@TARGETS.add(NepError, seeds=requests, words=WORDS)
def requests_of_nodes(data: bytes) -> None:
    received = encoding.decode_request(data)
    assert received.call >= 0
    if isinstance(received.request, WireError):
        assert len(received.request.reason) < 2000
        return
    again = encoding.decode_request(encoding.encode_request(received.request, received.call))
    # `repr`, because NaN isn't equal to itself; integers beyond msgpack's range can't occur.
    assert repr(again) == repr(received)
    check_request(received.request)


def conversations() -> Iterator[bytes]:
    all_of_them = [*requests()]
    yield joined(all_of_them)
    yield joined([all_of_them[1], all_of_them[2], all_of_them[5]])


@TARGETS.add(WireError, seeds=conversations, words=(*WORDS, SEPARATOR), slower=4)
def a_master(data: bytes) -> None:
    graph = Graph(1, 0.0, learn_s=0.0)
    for number, body in enumerate(parts_of(data)[:20]):
        received = encoding.decode_request(body)
        if not isinstance(received.request, WireError | Listen):
            for each in graph.apply(received.request, received.call, float(number), "a", is_foreign=True):
                encoding.decode_reply(encoding.encode_reply(each.body, each.call or 0))
        graph.tick(float(number))
        encoding.decode_reply(encoding.encode_reply(GraphReply(1, 2, graph.view()), 1))


def answers() -> Iterator[bytes]:
    yield encoding.encode_reply(DoneReply(1, 2), 1)
    yield encoding.encode_reply(RejectedReply(1, 2, "no"), 2)
    yield encoding.encode_reply(FoundReply(1, 2, (RemotePublisher(PUBLISHER, NODE.id, "näme"),)), 3)
    yield encoding.encode_reply(GraphReply(1, 2, GraphView(1, 2, {}, {}, ())), 4)
    yield encoding.encode_reply(RenewedReply(2, 3, last_seqs={4: 5}, hosts=("127.0.0.1",), next_s=2.0), 1)


@TARGETS.add(WireError, seeds=answers, words=WORDS)
def answers_of_the_master(data: bytes) -> None:
    call, answer = encoding.decode_reply(data)
    _call, again = encoding.decode_reply(encoding.encode_reply(answer, call))
    assert repr(again) == repr(answer)


# ---- names


@TARGETS.add(BadTopicError, NepError, seeds=lambda: ["/tö/pic".encode(), b"survey:x", b"nep.service:x"])
def names(data: bytes) -> None:
    text = text_of(data)
    for check in (wire.check_node_name, wire.check_topic, service_wire.check_service):
        try:
            assert check(text) is text
        except NepError as error:
            check_sentence(error)
    service_wire.check_survey(text)
    assert service_wire.service_of(service_wire.topic_of(text)) == text


@TARGETS.add(
    seeds=lambda: [joined([b"/a/*/c/**", b"/a/b/c/d"]), joined([b"**", b""])],
    words=(b"/**", b"/*", SEPARATOR),
)
def topic_patterns(data: bytes) -> None:
    pattern, _, topic = text_of(data[:400]).partition("\udcff|\udcff")
    if topic_pattern.matches(pattern, topic):
        assert pattern == topic or topic_pattern.is_pattern(pattern)
    assert topic_pattern.matches(topic, topic)
    assert topic_pattern.matches("**", topic)


# ---- frames of the original NEP


def frames() -> Iterator[bytes]:
    for generation in "AB":
        yield to_frame("topic", generation, "json", "json", b'{"a":1}')
        yield to_frame("topic", generation, "image", "image", b"\xff\xd8\xff")
        yield to_frame("topic", generation, "string", "string", b"hello")


@TARGETS.add(WireError, seeds=frames, words=(b"topic ",))
def frames_of_the_original(data: bytes) -> None:
    for msg_type, codec in (
        ("json", "json"),
        ("dictionary", "json"),
        ("string", "string"),
        ("bytes", "bytes"),
        ("msgpack", "msgpack"),
    ):
        found = from_frame("topic", msg_type, codec, data)
        assert found is None or len(found) <= len(data)
    for msg_type in ("image", "images"):
        from_frame("topic", msg_type, "image", data)
