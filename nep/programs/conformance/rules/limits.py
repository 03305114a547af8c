"""Rules for malformed and oversized input."""

from __future__ import annotations

from collections.abc import Iterator

import msgpack  # type: ignore[import-untyped]

from nep.i18n import _, lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.malformed import malformed_parts
from nep.programs.conformance.peers import ScriptedPublisher
from nep.programs.conformance.rule import rule
from nep.programs.conformance.rules.messages import connect_publisher, connect_subscriber, messages_of
from nep.programs.conformance.verdict import broken_rule_error, expect, printable
from nep.protocol.wire import Header, topic_part

_NESTING_DEPTH = 100_000


def _expect_delivery(bench: Bench, publisher: ScriptedPublisher, sub: int) -> None:
    """Send a valid message and check that the adapter delivers it and no other."""
    publisher.send(b'{"good":1}', seq=1)
    bench.require(lambda: any(_seq(each) == 1 for each in bench.events(sub)), "message")
    others = [each for each in bench.events(sub) if each.get("publisher") != str(publisher.id)]
    if others:
        raise broken_rule_error(_("the subscriber delivered {seen}").format(seen=printable(others[0])))


def _seq(event: object) -> int:
    return int(event["seq"]) if isinstance(event, dict) else 0


def _send_malformed(publisher: ScriptedPublisher) -> Iterator[str]:
    for code, parts in malformed_parts(publisher.topic):
        publisher.socket.send_multipart(parts)
        yield code


@rule(
    "malformed",
    lazy("Malformed messages aren't delivered, and the subscriber keeps reading."),
    "order-of-checks",
)
def _malformed_messages(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    for _code in _send_malformed(publisher):
        bench.pump()
    _expect_delivery(bench, publisher, sub)
    lost = bench.counts(sub)[1] if "losses" in bench.features.get("features", ()) else 0
    expect("lost", lost, 0)


@rule(
    "malformed-named",
    lazy("If a subscriber can't parse a message, its next renewal describes it in 'problem'."),
    "bounds",
    "statistics",
)
def _malformed_messages_are_reported(bench: Bench) -> None:
    topic = bench.new_topic()
    publisher, sub = bench.create_subscribed_publisher(topic)
    header = Header(1, 0, 1, 1, 1).pack()
    publisher.socket.send_multipart([topic_part(topic), header[:31], b"{}"])
    _expect_delivery(bench, publisher, sub)
    id = bench.latest_record("subscriber", topic)["id"]
    bench.wait_for_renewal(len(bench.master.received))
    renewal = bench.wait_for_renewal(len(bench.master.received)).fields
    (entry,) = (each for each in renewal.get("subscribers", ()) if each.get("id") == id)
    problem = entry.get("problem", "")
    if not isinstance(problem, str) or not problem:
        expect("subscribers.problem", problem, "a sentence")


@rule("deep", lazy("Deeply nested JSON and msgpack don't stop a subscriber."), "messages")
def _deep_nesting(bench: Bench) -> None:
    for msg_type, payload, valid_payload in (
        ("json", b"[" * _NESTING_DEPTH + b"]" * _NESTING_DEPTH, b"[1]"),
        ("msgpack", b"\x91" * _NESTING_DEPTH + b"\xc0", msgpack.packb([1])),
    ):
        publisher, sub = bench.create_subscribed_publisher(bench.new_topic(), msg_type)
        publisher.send(payload)
        publisher.send(payload[:1000])
        publisher.send(valid_payload)
        bench.require(lambda: any(_seq(each) == 3 for each in bench.events(sub)), "message")  # noqa: B023


@rule("undecodable", lazy("Payloads that can't be decoded don't stop a subscriber."), "messages")
def _undecodable_payloads(bench: Bench) -> None:
    for msg_type, payload in (("json", b'{"a":'), ("string", b"\xff\xfe"), ("msgpack", b"\xc1")):
        publisher, sub = bench.create_subscribed_publisher(bench.new_topic(), msg_type)
        publisher.send(payload)
        publisher.send(b"1" if msg_type != "msgpack" else b"\x01")
        bench.require(lambda: any(_seq(each) == 2 for each in bench.events(sub)), "message")  # noqa: B023


@rule("large", lazy("Messages of 8 MB are received intact."), "bounds")
def _large_messages(bench: Bench) -> None:
    topic = bench.new_topic()
    publisher, sub = bench.create_subscribed_publisher(topic, "bytes")
    publisher.send(bytes(8 * 2**20))
    bench.require(lambda: bool(bench.events(sub)), "message", 10.0)
    expect("payload", len(str(bench.events(sub)[0].get("payload"))), 4 * ((8 * 2**20 + 2) // 3))


@rule(
    "unknown-filters",
    lazy("Malformed subscriptions, and those of more than 4096 bytes, don't stop a publisher."),
    "bounds",
)
def _unknown_filters(bench: Bench) -> None:
    topic, pub, subscriber = connect_publisher(bench)
    faulty_subscriber = connect_subscriber(bench, topic, None)
    for prefix in (
        b"\xff",
        b"\xffhello/",
        b"\xffhello9/" + b"0" * 16 + b"/x",
        b"\xffread/1/2",
        b"\xffshares/",
        b"x",
    ):
        faulty_subscriber.socket.subscribe(prefix)
    faulty_subscriber.socket.subscribe(b"\xff" * 5000)
    bench.wait(0.2)
    bench.call("publish", pub=pub, value={"a": 1}, count=3)
    bench.require(lambda: len(messages_of(subscriber)) == 3, "message")
    other = connect_subscriber(bench, topic, 3)
    bench.call("publish", pub=pub, value={"a": 1})
    bench.require(lambda: len(messages_of(other)) == 1, "message")
