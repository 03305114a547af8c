"""Rules for the messages that a client sends."""

from __future__ import annotations

import base64
import json
import time
from collections.abc import Mapping

import msgpack  # type: ignore[import-untyped]

from nep.errors import WireError
from nep.i18n import _, lazy
from nep.messages.codecs import codec_for
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.peers import ScriptedSubscriber
from nep.programs.conformance.rule import rule
from nep.programs.conformance.verdict import broken_rule_error, expect, printable
from nep.protocol.batch import parse_parts
from nep.protocol.wire import BATCH, ParsedMessage, topic_part, unpack_header_at

_BURST_LENGTH = 200
_MAX_STAMP_ERROR_NS = 60_000_000_000
_SAMPLES: Mapping[str, tuple[dict[str, object], bytes]] = {
    "json": ({"value": {"text": "größe", "n": 2**53 - 1}}, b""),
    "string": ({"text": "größe\n機器人"}, "größe\n機器人".encode()),
    "bytes": ({"bytes": base64.b64encode(bytes(range(256))).decode()}, bytes(range(256))),
    "msgpack": ({"value": [1, "a", None, True, 0.5]}, msgpack.packb([1, "a", None, True, 0.5])),
}


def connect_subscriber(
    bench: Bench, topic: str, level: int | None, msg_type: str = "json"
) -> ScriptedSubscriber:
    """Create a subscriber of the tester that is connected to the adapter's publisher of a topic.

    Args:
        bench: Test bench.
        topic: Name of the topic.
        level: Hello level; None to send no hello. Otherwise the function waits for the echo.
        msg_type: Message type.
    """
    endpoint = bench.latest_record("publisher", topic)["endpoints"][0]
    subscriber = bench.create_subscriber(topic, msg_type, level=level, endpoint=endpoint)
    if level is not None:
        bench.require(lambda: bool(subscriber.echoes), "echo")
    return subscriber


def connect_publisher(
    bench: Bench, level: int | None = 3, msg_type: str = "json"
) -> tuple[str, int, ScriptedSubscriber]:
    """Create a publisher of the adapter, and a subscriber of the tester that is connected to it.

    Returns:
        The topic, the adapter's id of the publisher, and the subscriber.
    """
    topic = bench.new_topic()
    pub = bench.new_pub(topic, msg_type)
    return topic, pub, connect_subscriber(bench, topic, level, msg_type)


def messages_of(subscriber: ScriptedSubscriber) -> list[ParsedMessage]:
    """Return all messages received by a subscriber. Raises `BrokenRuleError` for a malformed message."""
    try:
        return subscriber.messages
    except WireError as error:
        raise broken_rule_error(
            _("a message can't be parsed ({code}): {reason}").format(code=error.code, reason=error.reason)
        ) from error


def _connect_plain_subscriber(bench: Bench, topic: str, pub: int) -> ScriptedSubscriber:
    """Return a subscriber that sends no hello, after it has received a message of the adapter's publisher."""
    subscriber = connect_subscriber(bench, topic, None)
    for _turn in range(200):
        bench.call("publish", pub=pub, value={"warm": True})
        if bench.wait_until(lambda: bool(subscriber.received), 0.05):
            return subscriber
    raise broken_rule_error(_("no '{what}' within {seconds:g} s").format(what="message", seconds=10.0))


@rule(
    "three-parts",
    lazy("A subscriber that sends no hello receives three-part messages: topic, 32-byte header and payload."),
    "messages",
)
def _three_parts(bench: Bench) -> None:
    topic, pub, other = connect_publisher(bench)
    subscriber = _connect_plain_subscriber(bench, topic, pub)
    count, raw_count = len(subscriber.received), len(subscriber.raw_messages)
    bench.call("publish", pub=pub, value={"a": 1}, count=_BURST_LENGTH)
    bench.require(lambda: len(subscriber.received) >= count + _BURST_LENGTH, "message")
    # libzmq delivers earlier messages before the publisher can read the subscription
    for parts in subscriber.raw_messages[raw_count:]:
        expect("parts", len(parts), 3)
        expect("topic", parts[0], topic_part(topic))
    messages_of(subscriber)
    bench.require(lambda: len(messages_of(other)) >= count + _BURST_LENGTH, "message")


@rule(
    "batches-to-readers",
    lazy("Batches are sent only to subscribers whose hello has level 3."),
    "batches",
)
def _batches_to_readers(bench: Bench) -> None:
    topic, pub, subscriber = connect_publisher(bench, 1)
    connect_subscriber(bench, topic, 3)
    bench.call("publish", pub=pub, value={"a": 1}, count=_BURST_LENGTH)
    bench.require(lambda: bool(subscriber.raw_messages) and _last_seq(subscriber) >= _BURST_LENGTH, "message")
    for parts in subscriber.raw_messages:
        if len(parts) == 1 and unpack_header_at(parts[0], len(topic_part(topic)))[0] >> 16 & BATCH:
            raise broken_rule_error(_("the publisher sent a batch to a subscriber whose hello has level 1"))


def _last_seq(subscriber: ScriptedSubscriber) -> int:
    return messages_of(subscriber)[-1].header.seq


@rule(
    "forms",
    lazy("Messages arrive complete and in order in every form that the subscriber supports."),
    "one-part",
)
def _message_forms(bench: Bench) -> None:
    for level in (0, 1, 2, 3):
        _topic, pub, subscriber = connect_publisher(bench, level)
        bench.call("publish", pub=pub, value={"a": 1}, count=_BURST_LENGTH)
        bench.require(lambda: len(messages_of(subscriber)) >= _BURST_LENGTH, "message")  # noqa: B023 - called immediately
        seqs = [each.header.seq for each in messages_of(subscriber)]
        if seqs != list(range(1, _BURST_LENGTH + 1)):
            raise broken_rule_error(_("the seqs are {seen}").format(seen=printable(seqs)))
        numbers = [json.loads(bytes(each.payload)).get("n") for each in messages_of(subscriber)]
        if numbers != list(range(1, _BURST_LENGTH + 1)):
            raise broken_rule_error(_("the messages aren't in order: {seen}").format(seen=printable(numbers)))


@rule(
    "header",
    lazy("A header has version 1, the codec's number, no unknown flags, the size and the publisher's id."),
    "messages",
)
def _header(bench: Bench) -> None:
    for msg_type, (members, _payload) in _SAMPLES.items():
        topic, pub, subscriber = connect_publisher(bench, 0, msg_type)
        bench.call("publish", pub=pub, **members)
        bench.require(lambda: bool(subscriber.raw_messages), "message")  # noqa: B023 - called immediately
        header = messages_of(subscriber)[0].header
        expect("header.codec", header.codec, codec_for(msg_type).number)
        expect("header.flags", header.flags, 0)
        expect("header.seq", header.seq, 1)
        expect("header.publisher", header.publisher, bench.latest_record("publisher", topic)["id"])


@rule(
    "payload",
    lazy("The codec encodes payloads: JSON and text as UTF-8, msgpack as msgpack, bytes unchanged."),
    "messages",
)
def _payload(bench: Bench) -> None:
    for msg_type, (members, expected) in _SAMPLES.items():
        _topic, pub, subscriber = connect_publisher(bench, 0, msg_type)
        bench.call("publish", pub=pub, **members)
        bench.require(lambda: bool(subscriber.raw_messages), "message")  # noqa: B023 - called immediately
        data = bytes(parse_parts(subscriber.raw_messages[0])[0].payload)
        try:
            if msg_type == "json":
                expect("payload", json.loads(data.decode()), members["value"])
            elif msg_type == "msgpack":
                expect("payload", msgpack.unpackb(data), members["value"])
            else:
                expect("payload", data, expected)
        except ValueError as error:
            raise broken_rule_error(
                _("the payload {seen} isn't valid {msg_type}").format(seen=printable(data), msg_type=msg_type)
            ) from error


@rule(
    "seq-unheard",
    lazy("Seqs also count messages that were published without subscribers."),
    "messages",
)
def _seq_without_subscribers(bench: Bench) -> None:
    topic = bench.new_topic()
    pub = bench.new_pub(topic)
    bench.call("publish", pub=pub, value={"a": 1}, count=7)
    subscriber = connect_subscriber(bench, topic, 0)
    bench.call("publish", pub=pub, value={"a": 1})
    bench.require(lambda: bool(subscriber.raw_messages), "message")
    expect("header.seq", messages_of(subscriber)[0].header.seq, 8)


@rule(
    "stamp",
    lazy("Time stamps are in nanoseconds since 1970 and never decrease."),
    "messages",
)
def _stamp(bench: Bench) -> None:
    _topic, pub, subscriber = connect_publisher(bench)
    bench.call("publish", pub=pub, value={"a": 1}, count=20)
    bench.require(lambda: len(messages_of(subscriber)) >= 20, "message")
    stamps = [each.header.stamp_ns for each in messages_of(subscriber)]
    now = time.time_ns()
    if any(abs(now - each) > _MAX_STAMP_ERROR_NS for each in stamps):
        raise broken_rule_error(
            _("the time stamp is {seen}; the time is {now}").format(seen=stamps[0], now=now)
        )
    if stamps != sorted(stamps):
        raise broken_rule_error(_("the time stamps are {seen}").format(seen=printable(stamps)))
