"""Rules for closing publishers, subscribers and nodes."""

from __future__ import annotations

from nep.i18n import _, lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.peers import ScriptedPublisher
from nep.programs.conformance.rule import rule
from nep.programs.conformance.rules.messages import connect_publisher
from nep.programs.conformance.verdict import broken_rule_error, expect
from nep.protocol.requests import RemovePublisher
from nep.protocol.wire import BYE

_SECTION = "closing-a-publisher"


def _is_connected(publisher: ScriptedPublisher) -> bool:
    return bool(publisher.hellos)


def _close_without_bye(bench: Bench, publisher: ScriptedPublisher, last_seq: int, wait_s: float) -> None:
    """Report a publisher as closed, and check that the adapter stays connected for `wait_s` seconds."""
    bench.master.submit(RemovePublisher(publisher.node.id, publisher.id, last_seq))
    bench.wait(wait_s)
    if not _is_connected(publisher):
        raise broken_rule_error(_("the subscriber disconnected before the bye"))


@rule(
    "bye",
    lazy("A closing publisher sends each subscriber a bye with the seq of its last message."),
    _SECTION,
)
def _bye(bench: Bench) -> None:
    topic, pub, subscriber = connect_publisher(bench)
    bench.call("publish", pub=pub, value={"a": 1}, count=5)
    number = bench.adapter.send_request("close_publisher", pub=pub)
    bench.discard_close_requests()
    bench.require(lambda: bool(subscriber.byes), "bye")
    header = subscriber.byes[0].header
    expect("bye.seq", header.seq, 5)
    id = bench.latest_record("publisher", topic)["id"]
    expect("bye.publisher", header.publisher, id)
    expect("received", len(subscriber.messages), 5)
    expect("publisher-.last_seq", bench.wait_for_request("publisher-", "id", id).fields.get("last_seq"), 5)
    subscriber.disconnect()
    bench.wait_for_reply(number, "close_publisher")


@rule("bye-again", lazy("A publisher repeats its bye until no hello remains, and then closes."), _SECTION)
def _bye_repeats(bench: Bench) -> None:
    _topic, pub, subscriber = connect_publisher(bench)
    number = bench.adapter.send_request("close_publisher", pub=pub)
    bench.discard_close_requests()
    bench.require(lambda: len(subscriber.byes) >= 3, "repeated bye")
    bench.wait_for_reply(number, "close_publisher")


@rule("bye-disconnects", lazy("A subscriber disconnects after reading the bye."), _SECTION)
def _bye_disconnects(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send(b'{"a":1}')
    bench.send_byes(publisher)
    bench.require(lambda: len(bench.events(sub)) == 1, "message")


@rule(
    "closed-is-heard",
    lazy("After 'publisher-' with 'is_closed', a subscriber keeps reading until the bye."),
    _SECTION,
)
def _closed_publisher_is_read(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    _close_without_bye(bench, publisher, 3, 0.3)
    for _number in range(3):
        publisher.send(b'{"a":1}')
    bench.require(lambda: len(bench.events(sub)) == 3, "message")
    publisher.send_byes()
    bench.require(lambda: not _is_connected(publisher), "disconnect")


@rule(
    "closed-is-left",
    lazy("A subscriber disconnects after 3 s from a closed publisher that sends no bye."),
    _SECTION,
)
def _closed_publisher_is_disconnected(bench: Bench) -> None:
    publisher, _sub = bench.create_subscribed_publisher(bench.new_topic())
    _close_without_bye(bench, publisher, 0, 1.5)
    bench.require(lambda: not _is_connected(publisher), "disconnect", 10.0)


@rule(
    "lapsed-is-heard",
    lazy("After 'publisher-' without 'is_closed', the connection stays open: the program may be suspended."),
    _SECTION,
)
def _lapsed_publisher_stays_connected(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    bench.master.expire_lease(publisher.node.id)
    bench.wait(0.5)
    publisher.send(b'{"a":1}')
    bench.require(lambda: bool(bench.events(sub)), "message")
    expect("connected", _is_connected(publisher), True)


@rule(
    "subscriber-closes",
    lazy("A closing subscriber sends 'subscriber-' to the master and disconnects."),
    "the-master",
)
def _subscriber_closes(bench: Bench) -> None:
    topic = bench.new_topic()
    publisher, sub = bench.create_subscribed_publisher(topic)
    bench.close_sub(sub)
    bench.wait_for_request("subscriber-", "id", bench.latest_record("subscriber", topic)["id"])
    bench.require(lambda: not _is_connected(publisher), "disconnect")


@rule(
    "leave",
    lazy("A closing node renews its lease once more, sends 'leave' and its byes, and exits with code 0."),
    _SECTION,
    is_last=True,
)
def _node_leaves(bench: Bench) -> None:
    _topic, pub, subscriber = connect_publisher(bench)
    bench.call("publish", pub=pub, value={"a": 1}, count=4)
    count = len(bench.master.received)
    number = bench.adapter.send_request("close")
    bench.require(lambda: bool(subscriber.byes), "bye")
    expect("bye.flags", subscriber.byes[0].header.flags, BYE)
    subscriber.disconnect()
    bench.require(lambda: bool(bench.requests("leave")), "leave")
    expect("leave.node_id", bench.requests("leave")[-1].fields.get("node_id"), bench.node_id)
    requests = bench.master.received[count:]
    first = next(each for each in requests if each.do in {"renew", "leave", "publisher-"})
    if first.do == "leave":
        raise broken_rule_error(_("'leave' was sent without a preceding renewal"))
    if first.do == "renew":
        seqs = [each.get("last_seq") for each in first.fields.get("publishers", ())]
        expect("renew.publishers.last_seq", 4 in seqs, True)
    bench.wait_for_reply(number, "close")
    bench.require(lambda: bench.adapter.has_ended, "end of the adapter")
    expect("exit code", bench.adapter.streams.wait(10.0), 0)
