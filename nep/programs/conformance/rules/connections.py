"""Rules for connecting and reconnecting subscribers."""

from __future__ import annotations

from msgspec.structs import replace

from nep.i18n import lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.peers import ScriptedPublisher
from nep.programs.conformance.rule import rule
from nep.programs.conformance.rules.messages import connect_subscriber, messages_of
from nep.programs.conformance.verdict import expect, time_limit
from nep.protocol.requests import AddPublisher

_SECTION = "connections"
_MAX_CLOSE_S = 3.0


def _expect_next(bench: Bench, publisher: ScriptedPublisher, sub: int) -> None:
    """Send a message and check that the adapter delivers it exactly once."""
    publisher.send(b'{"a":1}')
    expected_seq = str(publisher.seq)
    bench.require(lambda: any(each.get("seq") == expected_seq for each in bench.events(sub)), "message")
    bench.wait(0.1)
    expect("deliveries", sum(each.get("seq") == expected_seq for each in bench.events(sub)), 1)


@rule(
    "connect-once",
    lazy("A subscriber connects once to a publisher that the master lists twice."),
    "the-handshake",
)
def _connect_once(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    bench.master.repeat_pushes(bench.node_id, publisher.record, publisher.node)
    bench.wait(0.2)
    _expect_next(bench, publisher, sub)


@rule(
    "several-publishers",
    lazy(
        "A subscriber receives messages from every publisher of its topic, even after one of them has closed."
    ),
    _SECTION,
)
def _several_publishers(bench: Bench) -> None:
    first, sub = bench.create_subscribed_publisher(bench.new_topic())
    second = bench.create_publisher(first.topic)
    bench.require(lambda: bool(second.hellos), "hello")
    for publisher in (first, second):
        publisher.send(b'{"a":1}')
    bench.require(
        lambda: {each["publisher"] for each in bench.events(sub)} == {str(first.id), str(second.id)},
        "message",
    )
    bench.send_byes(first)
    _expect_next(bench, second, sub)


@rule(
    "reconnect",
    lazy("A subscriber reconnects after a lost connection and sends its hello again."),
    _SECTION,
)
def _reconnect(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send(b'{"a":1}')
    bench.require(lambda: bool(bench.events(sub)), "message")
    publisher.bind_again()
    bench.require(lambda: bool(publisher.hellos), "hello", 10.0)
    _expect_next(bench, publisher, sub)


@rule(
    "other-socket-at-publisher",
    lazy(
        "A subscriber connects to a publisher whose port was previously used by a ZeroMQ socket of "
        "another program."
    ),
    "a-failed-handshake",
)
def _other_socket_at_publisher(bench: Bench) -> None:
    topic = bench.new_topic()
    sub = bench.new_sub(topic)
    publisher = bench.create_publisher(topic, is_listed=False)
    publisher.socket.close(0)
    bench.register_publisher(publisher)
    bench.fail_handshake("PULL", publisher.record.endpoints[0])
    publisher.bind_again()
    bench.require(lambda: bool(publisher.hellos), "hello", 10.0)
    _expect_next(bench, publisher, sub)


@rule(
    "endpoint-change",
    lazy("A subscriber reconnects when a publisher's endpoint changes; the publisher's seqs continue."),
    "other-computers",
)
def _endpoint_change(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    publisher.send(b'{"a":1}')
    bench.require(lambda: bool(bench.events(sub)), "message")
    publisher.bind_other_port()
    bench.register_publisher(publisher)
    bench.require(lambda: bool(publisher.hellos), "hello", 10.0)
    _expect_next(bench, publisher, sub)
    if "losses" in bench.features.get("features", ()):
        expect("lost", bench.counts(sub)[1], 0)


@rule(
    "unusable-endpoint",
    lazy("An unusable endpoint doesn't affect the connections to other publishers."),
    "the-master",
)
def _unusable_endpoint(bench: Bench) -> None:
    publisher, sub = bench.create_subscribed_publisher(bench.new_topic())
    for endpoints in (("nanomsg://127.0.0.1:4000",), ("tcp://there is none:1",), ("",), ()):
        unusable = bench.create_publisher(publisher.topic, is_listed=False)
        unusable.record = replace(unusable.record, endpoints=endpoints)
        bench.master.submit(AddPublisher(unusable.node, unusable.record))
    bench.wait(0.2)
    _expect_next(bench, publisher, sub)


@rule(
    "subscriber-lost",
    lazy("A killed subscriber causes no losses for others and doesn't delay a closing publisher."),
    _SECTION,
)
def _subscriber_lost(bench: Bench) -> None:
    topic = bench.new_topic()
    pub = bench.new_pub(topic)
    killed_subscriber, other_subscriber = (
        connect_subscriber(bench, topic, 3),
        connect_subscriber(bench, topic, 3),
    )
    bench.call("publish", pub=pub, value={"a": 1}, count=10)
    killed_subscriber.socket.close(0)
    bench.call("publish", pub=pub, value={"a": 1}, count=10)
    bench.require(lambda: len(messages_of(other_subscriber)) == 20, "message")
    other_subscriber.socket.close(0)
    bench.wait(0.1)
    with time_limit(_MAX_CLOSE_S):
        bench.close_pub(pub)
