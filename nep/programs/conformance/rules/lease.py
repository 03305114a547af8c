"""Rules for leases, statistics and a restarted master."""

from __future__ import annotations

from typing import Any

import msgpack  # type: ignore[import-untyped]

from nep.i18n import _, lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.rule import rule
from nep.programs.conformance.rules.messages import connect_publisher, messages_of
from nep.programs.conformance.scripted_master import RecordedRequest
from nep.programs.conformance.verdict import broken_rule_error, expect

_SECTION = "leases-and-master-restarts"


def _ids(request: RecordedRequest, kind: str) -> set[Any]:
    return {each.get("id") for each in request.fields.get(kind, ()) if isinstance(each, dict)}


@rule(
    "renew",
    lazy(
        "A node renews its lease every second. Each renewal contains the epoch and all of the "
        "node's publishers and subscribers, and no others."
    ),
    _SECTION,
)
def _renew(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.new_pub(topic)
    bench.new_sub(topic)
    first = bench.wait_for_renewal(len(bench.master.received))
    second = bench.wait_for_renewal(bench.master.received.index(first) + 1)
    if second.at - first.at > 2.5 * max(bench.scale, 0.4):
        raise broken_rule_error(
            _("the interval between two renewals was {seconds:.1f} s").format(seconds=second.at - first.at)
        )
    expect("renew.epoch", second.fields.get("epoch"), bench.master.graph.epoch)
    expect("renew.node_id", second.fields.get("node_id"), bench.node_id)
    for kind in ("publisher", "subscriber"):
        expect(f"renew.{kind}s", bench.latest_record(kind, topic)["id"] in _ids(second, f"{kind}s"), True)
    member = bench.master.graph.members[bench.node_id]
    expect("renew.publishers", _ids(second, "publishers"), set(member.publishers))
    expect("renew.subscribers", _ids(second, "subscribers"), set(member.subscribers))


@rule(
    "statistics",
    lazy(
        "Renewals contain the count, bytes and last seq of each publisher, and the received count "
        "of each subscriber."
    ),
    "publisher statistics",
    "statistics",
)
def _statistics(bench: Bench) -> None:
    topic, pub, subscriber = connect_publisher(bench)
    bench.call("publish", pub=pub, value={"a": 1}, count=6)
    bench.require(lambda: len(messages_of(subscriber)) == 6, "message")
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send(b'{"a":1}')
    bench.require(lambda: bool(bench.events(sub)), "message")
    bench.wait_for_renewal(len(bench.master.received))
    renewal = bench.wait_for_renewal(len(bench.master.received)).fields
    id, subscriber_id = (
        bench.latest_record("publisher", topic)["id"],
        bench.latest_record("subscriber", publisher.topic)["id"],
    )
    (sent,) = (each for each in renewal["publishers"] if each.get("id") == id)
    expect("count", sent.get("count"), 6)
    expect("last_seq", sent.get("last_seq"), 6)
    expect("bytes", sent.get("bytes"), sum(len(each.payload) for each in messages_of(subscriber)))
    (received,) = (each for each in renewal["subscribers"] if each.get("id") == subscriber_id)
    expect("received", received.get("received"), 1)


@rule("next-s", lazy("A node doesn't renew its lease before the time in 'next_s'."), _SECTION)
def _next_s(bench: Bench) -> None:
    bench.new_sub(bench.new_topic())
    next_s = 2.5 * bench.scale
    bench.master.reply_filter = lambda _request, reply: (
        {**reply, "what": {**reply["what"], "next_s": next_s}} if reply["is"] == "renewed" else reply
    )
    first = bench.wait_for_renewal(len(bench.master.received))
    second = bench.wait_for_renewal(bench.master.received.index(first) + 1, 10.0)
    if second.at - first.at < 0.8 * next_s:
        raise broken_rule_error(
            _("the node renewed its lease after {seconds:.1f} s; 'next_s' was {wanted:g}").format(
                wanted=next_s, seconds=second.at - first.at
            )
        )
    bench.master.reply_filter = lambda _request, reply: reply
    bench.wait_for_renewal(len(bench.master.received), 10.0)


@rule(
    "again",
    lazy("A node answers 'again' with a 'join' that has all its publishers and subscribers."),
    _SECTION,
)
def _rejoin_on_request(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.new_pub(topic)
    bench.new_sub(topic)
    ids = bench.latest_record("publisher", topic)["id"], bench.latest_record("subscriber", topic)["id"]
    count = len(bench.master.received)
    bench.master.expire_lease(bench.node_id)
    bench.require(lambda: any(each.do == "join" for each in bench.master.received[count:]), "join")
    join = next(each for each in bench.master.received[count:] if each.do == "join")
    expect("join.publishers", ids[0] in _ids(join, "publishers"), True)
    expect("join.subscribers", ids[1] in _ids(join, "subscribers"), True)
    renewal = bench.wait_for_renewal(bench.master.received.index(join) + 1)
    expect("renew.epoch", renewal.fields.get("epoch"), bench.master.graph.epoch)


@rule(
    "restart",
    lazy("A node joins a restarted master; no message is lost while the master is down."),
    _SECTION,
)
def _rejoin_restarted_master(bench: Bench) -> None:
    _topic, pub, subscriber = connect_publisher(bench)
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    bench.master.stop()
    bench.call("publish", pub=pub, value={"a": 1}, count=10)
    publisher.send(b'{"a":1}')
    bench.wait(0.3)
    count = len(bench.master.received)
    bench.master.start()
    bench.require(lambda: any(each.do == "join" for each in bench.master.received[count:]), "join", 10.0)
    bench.register_publisher(publisher)
    bench.call("publish", pub=pub, value={"a": 1}, count=10)
    publisher.send(b'{"a":1}')
    bench.require(lambda: len(messages_of(subscriber)) == 20, "message")
    bench.require(lambda: len(bench.events(sub)) == 2, "message")
    expect(
        "new connections",
        sum(each.is_added and each.prefix in publisher.hellos for each in publisher.filters),
        1,
    )
    renewal = bench.wait_for_renewal(len(bench.master.received))
    expect("renew.epoch", renewal.fields.get("epoch"), bench.master.graph.epoch)


@rule(
    "other-socket-at-master",
    lazy("A node joins a master at an address where a ZeroMQ socket of another program rejected it before."),
    "a-failed-handshake",
)
def _other_socket_at_master(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.new_sub(topic)
    id = bench.latest_record("subscriber", topic)["id"]
    bench.master.stop()
    bench.fail_handshake("PUB", f"tcp://{bench.master.address}")
    count = len(bench.master.received)
    bench.master.start()
    bench.require(lambda: any(each.do == "join" for each in bench.master.received[count:]), "join", 10.0)
    join = next(each for each in bench.master.received[count:] if each.do == "join")
    expect("join.subscribers", id in _ids(join, "subscribers"), True)


@rule(
    "renewed-topics",
    lazy("A subscriber also connects to publishers that are listed only in the reply to a renewal."),
    _SECTION,
)
def _renewed_topics(bench: Bench) -> None:
    topic = bench.new_topic()
    sub = bench.new_sub(topic)
    publisher = bench.create_publisher(topic, is_listed=False)
    entry = {
        "publisher": {
            "id": publisher.id,
            "topic": topic,
            "msg_type": "json",
            "codec": "json",
            "endpoints": list(publisher.record.endpoints),
        },
        "node_id": publisher.node.id,
        "node_name": publisher.node.name,
    }
    bench.master.reply_filter = lambda _request, reply: (
        {**reply, "what": {**reply["what"], "topics": [{"topic": topic, "publishers": [entry]}]}}
        if reply["is"] == "renewed"
        else reply
    )
    bench.require(lambda: bool(publisher.hellos), "hello")
    publisher.send(b'{"a":1}')
    bench.require(lambda: bool(bench.events(sub)), "message")


@rule(
    "unknown-answers",
    lazy("Probes, unknown pushes, unknown fields and malformed replies are ignored."),
    "the-master",
)
def _unknown_replies(bench: Bench) -> None:
    topic = bench.new_topic()
    sub = bench.new_sub(topic)
    epoch = bench.master.graph.epoch
    fields = {"epoch": epoch, "revision": 1, "from a later version": [1, {}]}
    for body in (
        msgpack.packb({"is": "probe", "re": 0, "what": fields}),
        msgpack.packb({"is": "later", "re": 0, "what": fields}),
        msgpack.packb({"is": "done", "re": 10**6, "what": fields}),
        msgpack.packb([1, 2]),
        b"\xc1",
        b"",
    ):
        bench.master.push(bench.node_id, body)
    bench.wait_for_renewal(len(bench.master.received))
    publisher = bench.create_publisher(topic)
    bench.require(lambda: bool(publisher.hellos), "hello")
    publisher.send(b'{"a":1}')
    bench.require(lambda: bool(bench.events(sub)), "message")
