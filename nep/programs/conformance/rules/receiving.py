"""Rules for the messages that a client receives."""

from __future__ import annotations

import base64
from collections.abc import Mapping

import msgpack  # type: ignore[import-untyped]

from nep.i18n import _, lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.rule import rule
from nep.programs.conformance.verdict import broken_rule_error, expect, printable
from nep.protocol.wire import LATCHED, parse_acknowledgement

_SAMPLES: Mapping[str, tuple[bytes, object]] = {
    "json": ('{"text":"größe","n":[1,null,true]}'.encode(), {"text": "größe", "n": [1, None, True]}),
    "string": ("größe\n機器人".encode(), "größe\n機器人"),
    "bytes": (bytes(range(256)), None),
    "msgpack": (msgpack.packb({"a": [1, "b"]}), {"a": [1, "b"]}),
}


def _expect_seqs(bench: Bench, sub: int, count: int, first: int = 1) -> None:
    """Wait for `count` messages and check that their sequence numbers are consecutive from `first`."""
    bench.require(lambda: len(bench.events(sub)) >= count, "message")
    bench.wait(0.05)
    seqs = [each.get("seq") for each in bench.events(sub)]
    expect("seq", seqs, [str(number) for number in range(first, first + count)])


@rule("reads-parts", lazy("A subscriber accepts three-part messages of every codec."), "messages")
def _reads_parts(bench: Bench) -> None:
    for msg_type, (payload, value) in _SAMPLES.items():
        publisher, sub = bench.create_subscribed_publisher(bench.new_topic(), msg_type)
        publisher.send(payload)
        _expect_seqs(bench, sub, 1)
        event = bench.events(sub)[0]
        expect("payload", base64.b64decode(str(event.get("payload"))), payload)
        expect("codec", event.get("codec"), msg_type)
        expect("publisher", event.get("publisher"), str(publisher.id))
        if value is not None and "value" in event:
            expect("value", event["value"], value)


@rule("reads-one-part", lazy("A subscriber accepts single-part messages."), "one-part", "hello1")
def _reads_one_part(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    for form in ("one", "parts", "one", "one"):
        publisher.send(b'{"a":1}', form)
    _expect_seqs(bench, sub, 4)


@rule("reads-batches", lazy("A subscriber accepts batches of 1 to 256 messages."), "batches", "hello3")
def _reads_batches(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send_batch([b'{"a":1}', b'{"b":22}', b"[]"])
    publisher.send(b'{"a":1}', "one")
    publisher.send_batch([b"1"])
    publisher.send_batch([b'{"n":%d}' % number for number in range(256)])
    _expect_seqs(bench, sub, 261)
    payloads = [base64.b64decode(str(each.get("payload"))) for each in bench.events(sub)]
    expect("payload", payloads[:5], [b'{"a":1}', b'{"b":22}', b"[]", b'{"a":1}', b"1"])
    expect("payload", payloads[260], b'{"n":255}')


@rule("reads-alone", lazy("A subscriber accepts messages whose first part is its hello."), "notices")
def _reads_messages_under_hello(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    for form in ("alone", "parts", "alone"):
        publisher.send(b'{"a":1}', form)
    _expect_seqs(bench, sub, 3)


@rule(
    "latched-once",
    lazy("A latched message is delivered unless a message with its seq was received before."),
    "notices",
    "latched",
)
def _latched_once(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send(b'{"a":1}', "alone", flags=LATCHED)
    publisher.send(b'{"a":1}', "alone", seq=1, flags=LATCHED)
    publisher.send(b'{"a":2}', flags=LATCHED)
    publisher.send(b'{"a":2}', "alone", seq=2, flags=LATCHED)
    _expect_seqs(bench, sub, 2)


@rule(
    "other-topics",
    lazy("A subscriber compares the whole topic and ignores topics that only share its prefix."),
    "messages",
)
def _other_topics(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    name = publisher.topic
    publisher.topic = f"{name}2"
    publisher.send(b'{"a":1}', seq=1)
    publisher.topic = name
    publisher.send(b'{"a":1}', seq=1)
    _expect_seqs(bench, sub, 1)


@rule(
    "read",
    lazy("A subscriber answers every echo except the first by subscribing to a read filter and removing it."),
    "bytes-in-flight",
    "hello2",
)
def _read_acknowledgement(bench: Bench) -> None:
    topic = bench.new_topic()
    publisher, sub = bench.create_subscribed_publisher(topic)
    early_acknowledgements = [parse_acknowledgement(each.prefix) for each in publisher.filters]
    if any(each is not None for each in early_acknowledgements):
        raise broken_rule_error(_("the subscriber answered the first echo"))
    publisher.send(b'{"a":1}')
    publisher.send(b'{"a":1}')
    publisher.send_echo(next(iter(publisher.hellos)))
    bench.require(lambda: any(parse_acknowledgement(each.prefix) for each in publisher.filters), "read")
    _expect_seqs(bench, sub, 2)
    acknowledgements = [each for each in publisher.filters if parse_acknowledgement(each.prefix) is not None]
    acknowledgement = parse_acknowledgement(acknowledgements[0].prefix)
    expect(
        "read.subscriber",
        acknowledgement and acknowledgement.subscriber,
        bench.latest_record("subscriber", topic)["id"],
    )
    expect("read.publisher", acknowledgement and acknowledgement.publisher, publisher.id)
    expect("read.seq", acknowledgement and acknowledgement.seq, 2)
    bench.require(
        lambda: any(not each.is_added and parse_acknowledgement(each.prefix) for each in publisher.filters),
        "removal of the read filter",
    )


@rule(
    "receives-in-order",
    lazy("A subscriber delivers the messages of a publisher in order, each once."),
    "messages",
)
def _receives_in_order(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    for number in range(500):
        publisher.send(b'{"n":%d}' % number)
    bench.require(lambda: len(bench.events(sub)) >= 500, "message")
    seqs = [each.get("seq") for each in bench.events(sub)]
    if seqs != [str(number) for number in range(1, 501)]:
        raise broken_rule_error(_("the seqs are {seen}").format(seen=printable(seqs)))
