"""Rules about connections: where a subscriber connects, and what it does when one ends."""

from __future__ import annotations

import time
from dataclasses import replace

from nep.i18n import _, lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.peers import ScriptedPublisher
from nep.programs.conformance.rule import rule
from nep.programs.conformance.rules.messages import heard, messages_of
from nep.programs.conformance.verdict import broken, expect
from nep.protocol.requests import AddPublisher

_SECTION = "who-connects"
_MOST_WAIT_S = 3.0


def _hears(bench: Bench, publisher: ScriptedPublisher, sub: int) -> None:
    """The next message arrives, once."""
    publisher.send(b'{"a":1}')
    wanted = str(publisher.seq)
    bench.need(lambda: any(each.get("seq") == wanted for each in bench.events(sub)), "message")
    bench.wait(0.1)
    expect("deliveries", sum(each.get("seq") == wanted for each in bench.events(sub)), 1)


@rule("connect-once", lazy("A publisher that the master names twice is connected to once."), "the-handshake")
def connect_once(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    bench.master.repeat_pushes(bench.node_id, publisher.record, publisher.node)
    bench.wait(0.2)
    _hears(bench, publisher, sub)


@rule(
    "several-publishers",
    lazy("A subscriber hears every publisher of its topic, and goes on when one of them ends."),
    _SECTION,
)
def several_publishers(bench: Bench) -> None:
    """See the rule."""
    first, sub = bench.heard_publisher(bench.new_topic())
    second = bench.publisher(first.topic)
    bench.need(lambda: bool(second.hellos), "hello")
    for publisher in (first, second):
        publisher.send(b'{"a":1}')
    bench.need(
        lambda: {each["publisher"] for each in bench.events(sub)} == {str(first.id), str(second.id)},
        "message",
    )
    first.bye()
    bench.need(lambda: not first.hellos, "disconnect")
    _hears(bench, second, sub)


@rule(
    "reconnect",
    lazy("When a connection ends a subscriber connects again by itself, and says hello again."),
    _SECTION,
)
def reconnect(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    publisher.send(b'{"a":1}')
    bench.need(lambda: bool(bench.events(sub)), "message")
    publisher.bind_again()
    bench.need(lambda: bool(publisher.hellos), "hello", 10.0)
    _hears(bench, publisher, sub)


@rule(
    "endpoint-change",
    lazy("When a publisher's endpoint changes a subscriber connects to the new one; its seqs go on."),
    "other-computers",
)
def endpoint_change(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    publisher.send(b'{"a":1}')
    bench.need(lambda: bool(bench.events(sub)), "message")
    publisher.bind_elsewhere()
    bench.list_publisher(publisher)
    bench.need(lambda: bool(publisher.hellos), "hello", 10.0)
    _hears(bench, publisher, sub)
    if "losses" in bench.features.get("features", ()):
        expect("lost", bench.counts(sub)[1], 0)


@rule(
    "unusable-endpoint",
    lazy("An endpoint that can't be connected to keeps a subscriber from no other publisher."),
    "the-master",
)
def unusable_endpoint(bench: Bench) -> None:
    """See the rule."""
    publisher, sub = bench.heard_publisher(bench.new_topic())
    for endpoints in (("nanomsg://127.0.0.1:4000/4001",), ("tcp://there is none:1",), ("",), ()):
        made = bench.publisher(publisher.topic, is_listed=False)
        made.record = replace(made.record, endpoints=endpoints)
        bench.master.submit(AddPublisher(made.node, made.record))
    bench.wait(0.2)
    _hears(bench, publisher, sub)


@rule(
    "subscriber-lost",
    lazy("A subscriber that ends without a word costs others nothing, and a closing publisher no time."),
    _SECTION,
)
def subscriber_lost(bench: Bench) -> None:
    """See the rule."""
    topic = bench.new_topic()
    pub = bench.new_pub(topic)
    gone, other = heard(bench, topic, 3), heard(bench, topic, 3)
    bench.ask("publish", pub=pub, value={"a": 1}, count=10)
    gone.socket.close(0)
    bench.ask("publish", pub=pub, value={"a": 1}, count=10)
    bench.need(lambda: len(messages_of(other)) == 20, "message")
    other.socket.close(0)
    bench.wait(0.1)
    began = time.monotonic()
    bench.close_pub(pub)
    took_s = time.monotonic() - began
    if took_s > _MOST_WAIT_S:
        raise broken(_("it took {seconds:.1f} s").format(seconds=took_s))
