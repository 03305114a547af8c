"""Rules about how publishers, subscribers and nodes end."""

from __future__ import annotations

from nep.i18n import _, lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.peers import ScriptedPublisher
from nep.programs.conformance.rule import rule
from nep.programs.conformance.rules.messages import heard
from nep.programs.conformance.verdict import broken, expect
from nep.protocol.requests import RemovePublisher
from nep.protocol.wire import BYE

_SECTION = "how-a-publisher-ends"


def _is_connected(publisher: ScriptedPublisher) -> bool:
    return bool(publisher.hellos)


@rule(
    "bye",
    lazy("A publisher that closes says bye to each subscriber, with the seq of its last message."),
    _SECTION,
)
def bye(bench: Bench) -> None:
    """See the rule."""
    topic = bench.new_topic()
    pub = bench.new_pub(topic)
    subscriber = heard(bench, topic, 3)
    bench.ask("publish", pub=pub, value={"a": 1}, count=5)
    number = bench.adapter.begin("close_publisher", pub=pub)
    bench.forget()
    bench.need(lambda: bool(subscriber.byes), "bye")
    header = subscriber.byes[0].header
    expect("bye.seq", header.seq, 5)
    id = bench.record("publisher", topic)["id"]
    expect("bye.publisher", header.publisher, id)
    expect("received", len(subscriber.messages), 5)
    expect("publisher-.last_seq", bench.request("publisher-", "id", id).what.get("last_seq"), 5)
    subscriber.disconnect()
    bench.finish(number, "close_publisher")


@rule("bye-again", lazy("A publisher repeats its bye while a hello is there, and then closes."), _SECTION)
def bye_again(bench: Bench) -> None:
    """See the rule."""
    topic = bench.new_topic()
    pub = bench.new_pub(topic)
    subscriber = heard(bench, topic, 3)
    number = bench.adapter.begin("close_publisher", pub=pub)
    bench.forget()
    bench.need(lambda: len(subscriber.byes) >= 3, "bye again")
    bench.finish(number, "close_publisher")


@rule("bye-disconnects", lazy("A subscriber disconnects when it has read the bye."), _SECTION)
def bye_disconnects(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    publisher.send(b'{"a":1}')
    publisher.bye()
    bench.need(lambda: not _is_connected(publisher), "disconnect")
    bench.need(lambda: len(bench.events(sub)) == 1, "message")


@rule(
    "closed-is-heard",
    lazy("After 'publisher-' with 'is_closed' a subscriber reads on until the bye."),
    _SECTION,
)
def closed_is_heard(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    bench.master.submit(RemovePublisher(publisher.node.id, publisher.id, 3))
    bench.wait(0.3)
    if not _is_connected(publisher):
        raise broken(_("it disconnected before the bye"))
    for _number in range(3):
        publisher.send(b'{"a":1}')
    bench.need(lambda: len(bench.events(sub)) == 3, "message")
    publisher.bye()
    bench.need(lambda: not _is_connected(publisher), "disconnect")


@rule(
    "closed-is-left",
    lazy("A subscriber leaves a publisher that has closed and says no bye, after 3 s."),
    _SECTION,
)
def closed_is_left(bench: Bench) -> None:
    """See the rule."""
    publisher, _sub = bench.heard_publisher(bench.new_topic())
    bench.master.submit(RemovePublisher(publisher.node.id, publisher.id, 0))
    bench.wait(1.5)
    if not _is_connected(publisher):
        raise broken(_("it disconnected before the bye"))
    bench.need(lambda: not _is_connected(publisher), "disconnect", 10.0)


@rule(
    "lapsed-is-heard",
    lazy("After 'publisher-' without 'is_closed' the connection stays: the program may only be suspended."),
    _SECTION,
)
def lapsed_is_heard(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    bench.master.drop(publisher.node.id)
    bench.wait(0.5)
    publisher.send(b'{"a":1}')
    bench.need(lambda: bool(bench.events(sub)), "message")
    expect("connected", _is_connected(publisher), True)


@rule("subscriber-closes", lazy("A subscriber that closes tells the master and disconnects."), "the-master")
def subscriber_closes(bench: Bench) -> None:
    """See the rule."""
    topic = bench.new_topic()
    publisher, sub = bench.heard_publisher(topic)
    bench.close_sub(sub)
    bench.request("subscriber-", "id", bench.record("subscriber", topic)["id"])
    bench.need(lambda: not _is_connected(publisher), "disconnect")


@rule(
    "leave",
    lazy("A node that closes renews once more, sends 'leave', says bye, and ends with exit code 0."),
    _SECTION,
    is_last=True,
)
def leave(bench: Bench) -> None:
    """See the rule."""
    topic = bench.new_topic()
    pub = bench.new_pub(topic)
    subscriber = heard(bench, topic, 3)
    bench.ask("publish", pub=pub, value={"a": 1}, count=4)
    count = len(bench.master.heard)
    number = bench.adapter.begin("close")
    bench.need(lambda: bool(subscriber.byes), "bye")
    expect("bye.flags", subscriber.byes[0].header.flags, BYE)
    subscriber.disconnect()
    bench.need(lambda: bool(bench.requests("leave")), "leave")
    expect("leave.node_id", bench.requests("leave")[-1].what.get("node_id"), bench.node_id)
    said = [each for each in bench.master.heard[count:] if each.do in {"renew", "leave", "publisher-"}]
    first = said[0]
    if first.do == "leave":
        raise broken(_("'leave' came without a renewal before it"))
    if first.do == "renew":
        seqs = [each.get("last_seq") for each in first.what.get("publishers", ())]
        expect("renew.publishers.last_seq", 4 in seqs, True)
    bench.finish(number, "close")
    bench.need(lambda: bench.adapter.has_ended, "end of the adapter")
    expect("exit code", bench.adapter.lines.wait(10.0), 0)
