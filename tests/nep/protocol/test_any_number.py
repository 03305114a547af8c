"""Tests of arbitrary numbers, texts and shapes in requests: they break no renewal, reply or graph view."""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import Mapping
from types import UnionType
from typing import Any, Union, get_args, get_origin

import msgspec
import pytest
import zmq
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import nep
from nep.errors import WireError
from nep.masters.graph import Graph, with_hosts
from nep.masters.master import Master
from nep.messages.packing import pack_saturated
from nep.protocol import encoding, requests, wire
from nep.protocol.requests import (
    MAX_COUNT,
    AddPublisher,
    AddSubscriber,
    GraphReply,
    Join,
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    QueryGraph,
    Renew,
    Request,
    SubscriberCount,
    SubscriberRecord,
)
from tests.examples import examples
from tests.nep.programs import eventually

MANY = settings(deadline=None, max_examples=examples(60), suppress_health_check=list(HealthCheck))
EDGES = [0, 1, -1, 2**31, 2**32, 2**53, 2**63 - 1, 2**63, 2**64 - 1, 2**64, -(2**63), -(2**63) - 1, 2**200]
INTS = st.sampled_from(EDGES) | st.integers(-(2**70), 2**70)
ON_THE_WIRE = st.sampled_from([each for each in EDGES if -(2**63) <= each < 2**64]) | st.integers(
    0, 2**64 - 1
)
FLOATS = st.floats() | st.sampled_from([math.nan, math.inf, -math.inf, -1.0, 1e308])
TEXTS = st.text(st.characters(categories=["L", "Cc", "Cs", "Cf"]), max_size=6) | st.sampled_from(
    ["", "\ud800", "t", "/a", "x" * 300, "tcp://127.0.0.1:5000", "ipc:///tmp/x", "inproc://a", "tcp://1;2:3"]
)
PLAIN = st.recursive(
    st.none() | st.booleans() | ON_THE_WIRE | FLOATS | st.text(max_size=5) | st.binary(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5) | ON_THE_WIRE, inner, max_size=4)
    ),
    max_leaves=12,
)
ANSWERS = [*get_args(requests.Reply), *get_args(requests.Push)]
ASKED = [each for each in get_args(Request) if each is not requests.ReportAlerts]


def of(hint: Any, ints: st.SearchStrategy[int] = INTS) -> st.SearchStrategy[Any]:
    """Return a strategy for values of a type, including values that no correct program sends."""
    simple: dict[Any, st.SearchStrategy[Any]] = {int: ints, float: FLOATS, str: TEXTS, bool: st.booleans()}
    if hint in simple:
        return simple[hint]
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return st.builds(hint, **{each.name: of(each.type, ints) for each in msgspec.structs.fields(hint)})
    origin, args = get_origin(hint), get_args(hint)
    if origin in {UnionType, Union}:
        return st.one_of(*(st.none() if each is type(None) else of(each, ints) for each in args))
    if origin is tuple:
        return st.lists(of(args[0], ints), max_size=3).map(tuple)
    assert origin is Mapping or issubclass(origin, Mapping), hint
    return st.dictionaries(of(args[0], ints), of(args[1], ints), max_size=3)


@pytest.mark.parametrize("kind", ASKED, ids=lambda kind: kind.__name__)
def test_every_request_with_arbitrary_values_is_decoded_as_its_own_type(kind: type[Request]) -> None:
    @MANY
    @given(of(kind))
    def check(request: Request) -> None:
        asked = encoding.decode_request(encoding.encode_request(request, 7))
        assert asked.call == 7
        assert isinstance(asked.request, kind)

    check()


@pytest.mark.parametrize("kind", ANSWERS, ids=lambda kind: kind.__name__)
def test_every_reply_with_arbitrary_values_is_decoded_as_its_own_type(kind: type[Any]) -> None:
    @MANY
    @given(of(kind))
    def check(answer: Any) -> None:
        call, read = encoding.decode_reply(encoding.encode_reply(answer, 7))
        assert (call, type(read)) == (7, kind)
        with_hosts(answer, ("127.0.0.1",))

    check()


@MANY
@given(st.sampled_from(sorted(encoding._REQUESTS)), PLAIN, PLAIN)
def test_arbitrary_requests_and_replies_raise_only_wire_errors(name: str, what: object, call: object) -> None:
    encoding.decode_request(pack_saturated({"do": name, "call": call, "what": what}))
    for answer in encoding._REPLIES:
        with contextlib.suppress(WireError):
            encoding.decode_reply(pack_saturated({"is": answer, "re": call, "what": what}))


@settings(MANY, max_examples=examples(150))
@given(st.lists(st.one_of(*(of(kind, ON_THE_WIRE) for kind in ASKED)), max_size=12), st.booleans())
def test_arbitrary_requests_do_not_raise_in_the_graph_or_break_its_view(
    asked: list[Request], is_foreign: bool
) -> None:
    graph = Graph(epoch=7, now=0.0, learn_s=0.0)
    honest = NodeRecord("0" * 16, "honest", "host", 1)
    graph.apply(Join(honest, 0, (PublisherRecord(1, "/a", "json", "json"),)), 1, 0.0, honest.id)
    for now, request in enumerate(asked):
        route = "" if is_foreign else "x"
        if is_foreign and isinstance(request, Join | AddPublisher | AddSubscriber):
            route = request.node.id
        for each in graph.apply(request, 1, float(now) / 100, route or "x", is_foreign=is_foreign):
            encoding.encode_reply(each.body, 1)
        graph.tick(float(now) / 100)
    (answer,) = graph.apply(QueryGraph(), 1, 1.0, "looker")
    assert isinstance(answer.body, GraphReply)
    call, seen = encoding.decode_reply(encoding.encode_reply(answer.body, 5))
    assert (call, type(seen)) == (5, GraphReply)
    for topic in answer.body.view.topics.values():
        assert topic.lost is None or 0 <= topic.lost <= MAX_COUNT
        for told in topic.publishers:
            assert 0 <= told.count <= MAX_COUNT
            assert 0 <= told.bytes <= MAX_COUNT
            assert told.rate_hz is None or math.isfinite(told.rate_hz)


@pytest.mark.parametrize("seq", [2**64 - 1, 2**63, 2**40])
def test_message_with_implausible_sequence_number_raises_an_alert_and_counts_no_loss(
    master: Master, seq: int
) -> None:
    """The message is written to the socket of a real publisher's connection, as any program can do."""
    with (
        nep.node("hearer", master=master.address) as hearer,
        nep.node("sayer", master=master.address) as sayer,
    ):
        sub = hearer.new_sub("/t", "bytes")
        pub = sayer.new_pub("/t", "bytes")
        pub.publish(b"1")
        assert sub.listen(timeout_s=30.0) == (True, b"1")
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        xpub = context.socket(zmq.XPUB)
        xpub.setsockopt(zmq.LINGER, 0)
        port = xpub.bind_to_random_port("tcp://127.0.0.1")
        record = PublisherRecord(99, "/t", "bytes", "bytes", (f"tcp://127.0.0.1:{port}",))
        with context.socket(zmq.DEALER) as dealer:
            dealer.setsockopt(zmq.LINGER, 0)
            dealer.setsockopt(zmq.ROUTING_ID, b"0" * 16)
            dealer.connect(f"tcp://{master.address}")
            dealer.send(encoding.encode_request(AddPublisher(NodeRecord("0" * 16, "x", "h", 1), record), 1))
            assert xpub.poll(60_000)
            for _ in range(2):  # the subscriber's topic filter and hello
                xpub.recv()
            for number in (1, seq):
                xpub.send_multipart(wire.join("/t", wire.Header(3, 0, number, 1, 99), b"x"))
            assert sub.listen(timeout_s=30.0) == (True, b"x")
            eventually(lambda: sub.refused == 1)
            pub.publish(b"2")
            assert sub.listen(timeout_s=30.0) == (True, b"2")
            assert sub.lost == 0
            (alert,) = eventually_alerts(hearer)
            assert f"its sequence number jumps from 1 to {seq}" in alert
            assert hearer.graph().topics["/t"].lost == 0
        xpub.close()
        context.term()


def eventually_alerts(node: nep.Node) -> list[str]:
    """Wait for alerts about messages and return their texts."""
    found: list[str] = []

    def look() -> bool:
        found[:] = [each.sentence for each in node.graph().alerts if each.id.startswith("message:")]
        return bool(found)

    eventually(look)
    return found


def test_reply_that_cannot_be_encoded_fails_without_affecting_other_replies(
    master: Master, caplog: pytest.LogCaptureFixture
) -> None:
    """Stands for a bug in an attachment of the master that registers an unencodable value."""
    caplog.set_level(logging.CRITICAL, "nep.master")
    with (
        nep.node("honest", master=master.address) as honest,
        nep.node("other", master=master.address) as other,
    ):
        sub, still = honest.new_sub("/odd"), honest.new_sub("/still")
        odd: Any = object()
        node = NodeRecord("original:odd:1", "odd", "host", 1)
        master.submit(AddPublisher(node, PublisherRecord(5, "/odd", odd, "json", ("tcp://127.0.0.1:9",))))
        pub = other.new_pub("/still")
        pub.publish("here")
        assert still.listen(timeout_s=30.0) == (True, "here")
        with pytest.raises(nep.RequestRefusedError, match=r"the master .*its log"):
            honest.graph()
        assert sub.lost == 0
        master.submit(requests.Leave(node.id))
        assert "/still" in honest.graph().topics


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, 1e300])
def test_non_finite_negative_or_huge_cpu_share_is_ignored(value: float) -> None:
    graph = Graph(epoch=7, now=0.0, learn_s=0.0)
    graph.apply(Join(NodeRecord("n", "N", "h", 1)), 1, 0.0, "n")
    for request in (Renew("n", 7, 99, (), (), value),):
        graph.apply(request, 1, 0.1, "n")
        assert graph.view().nodes["n"].cpu_ratio is None


def test_summed_counts_saturate_at_64_bits() -> None:
    graph = Graph(epoch=7, now=0.0, learn_s=0.0)
    subscribers = tuple(SubscriberRecord(n, "/t", "json") for n in (1, 2, 3))
    graph.apply(
        Join(NodeRecord("n", "N", "h", 1), 0, (PublisherRecord(9, "/t", "j", "json"),), subscribers),
        1,
        0.0,
        "n",
    )
    counts = tuple(SubscriberCount(n, 2**64 - 1, 2**64 - 1, "no\x1b[2J" * 999) for n in (1, 2, 3))
    for now, most in ((1.0, 2**64 - 1), (2.0, -5), (3.0, 2**64 - 1)):
        request = Renew("n", 7, 99, (PublisherCount(9, most, most, most, most),), counts)
        graph.apply(request, 1, now, "n")
        topic = graph.view().topics["/t"]
        assert topic.lost == MAX_COUNT
        assert topic.loss_ratio is not None
        assert 0.0 <= topic.loss_ratio <= 1.0
        assert topic.publishers[0].count == (0 if most < 0 else MAX_COUNT)
    (alert,) = graph.view().alerts
    assert alert.sentence.isprintable()
    assert len(alert.sentence) < 4000
