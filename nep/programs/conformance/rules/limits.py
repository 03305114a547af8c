"""Rules about what a client must survive."""

from __future__ import annotations

from collections.abc import Iterator

import msgpack  # type: ignore[import-untyped]

from nep.i18n import _, lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.malformed import malformed_parts
from nep.programs.conformance.peers import ScriptedPublisher
from nep.programs.conformance.rule import rule
from nep.programs.conformance.rules.messages import heard, messages_of
from nep.programs.conformance.verdict import broken, expect, shown
from nep.protocol.wire import Header, topic_part

_DEEP = 100_000


def _goes_on(bench: Bench, publisher: ScriptedPublisher, sub: int) -> None:
    """A good message arrives; nothing else has."""
    publisher.send(b'{"good":1}', seq=1)
    bench.need(lambda: any(_seq(each) == 1 for each in bench.events(sub)), "message")
    others = [each for each in bench.events(sub) if each.get("publisher") != str(publisher.id)]
    if others:
        raise broken(_("it delivered {seen}").format(seen=shown(others[0])))


def _seq(event: object) -> int:
    return int(event["seq"]) if isinstance(event, dict) else 0


def _send_malformed(publisher: ScriptedPublisher) -> Iterator[str]:
    for code, parts in malformed_parts(publisher.topic):
        publisher.socket.send_multipart(parts)
        yield code


@rule(
    "malformed",
    lazy("Malformed messages are not delivered and do not keep a subscriber from reading on."),
    "order-of-checks",
)
def malformed(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    for _code in _send_malformed(publisher):
        bench.pump()
    _goes_on(bench, publisher, sub)
    lost = bench.counts(sub)[1] if "losses" in bench.features.get("features", ()) else 0
    expect("lost", lost, 0)


@rule(
    "malformed-named",
    lazy("A renewal names what a subscriber could not read, as 'problem'."),
    "bounds",
    "statistics",
)
def malformed_named(bench: Bench) -> None:
    """See the rule."""
    topic = bench.new_topic()
    publisher, sub = bench.heard_publisher(topic)
    head = Header(1, 0, 1, 1, 1).pack()
    publisher.socket.send_multipart([topic_part(topic), head[:31], b"{}"])
    _goes_on(bench, publisher, sub)
    id = bench.record("subscriber", topic)["id"]
    bench.renewal(len(bench.master.heard))
    found = bench.renewal(len(bench.master.heard)).what
    (told,) = (each for each in found.get("subscribers", ()) if each.get("id") == id)
    problem = told.get("problem", "")
    if not isinstance(problem, str) or not problem:
        expect("subscribers.problem", problem, "a sentence")


@rule("deep", lazy("Deeply nested JSON and msgpack do not stop a subscriber."), "messages")
def deep(bench: Bench) -> None:
    """See the rule."""
    for msg_type, payload, good in (
        ("json", b"[" * _DEEP + b"]" * _DEEP, b"[1]"),
        ("msgpack", b"\x91" * _DEEP + b"\xc0", msgpack.packb([1])),
    ):
        publisher, sub = bench.heard_publisher(bench.new_topic(), msg_type)
        publisher.send(payload)
        publisher.send(payload[:1000])
        publisher.send(good)
        bench.need(lambda: any(_seq(each) == 3 for each in bench.events(sub)), "message")  # noqa: B023


@rule("undecodable", lazy("Payloads that can't be decoded do not stop a subscriber."), "messages")
def undecodable(bench: Bench) -> None:
    """See the rule."""
    for msg_type, payload in (("json", b'{"a":'), ("string", b"\xff\xfe"), ("msgpack", b"\xc1")):
        publisher, sub = bench.heard_publisher(bench.new_topic(), msg_type)
        publisher.send(payload)
        publisher.send(b"1" if msg_type != "msgpack" else b"\x01")
        bench.need(lambda: any(_seq(each) == 2 for each in bench.events(sub)), "message")  # noqa: B023


@rule("large", lazy("Messages of 8 MB arrive whole."), "bounds")
def large(bench: Bench) -> None:
    """See the rule."""
    topic = bench.new_topic()
    publisher, sub = bench.heard_publisher(topic, "bytes")
    publisher.send(bytes(8 * 2**20))
    bench.need(lambda: bool(bench.events(sub)), "message", 10.0)
    expect("payload", len(str(bench.events(sub)[0].get("payload"))), 4 * ((8 * 2**20 + 2) // 3))


@rule(
    "unknown-filters",
    lazy("Malformed subscriptions, and those of more than 4096 bytes, do not stop a publisher."),
    "bounds",
)
def unknown_filters(bench: Bench) -> None:
    """See the rule."""
    topic = bench.new_topic()
    pub = bench.new_pub(topic)
    good = heard(bench, topic, 3)
    bad = bench.subscriber(topic, level=None, endpoint=bench.record("publisher", topic)["endpoints"][0])
    for what in (
        b"\xff",
        b"\xffhello/",
        b"\xffhello9/" + b"0" * 16 + b"/x",
        b"\xffread/1/2",
        b"\xffshares/",
        b"x",
    ):
        bad.socket.subscribe(what)
    bad.socket.subscribe(b"\xff" * 5000)
    bench.wait(0.2)
    bench.ask("publish", pub=pub, value={"a": 1}, count=3)
    bench.need(lambda: len(messages_of(good)) == 3, "message")
    other = heard(bench, topic, 3)
    bench.ask("publish", pub=pub, value={"a": 1})
    bench.need(lambda: len(messages_of(other)) == 1, "message")
