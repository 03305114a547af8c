"""Rules for the handshake of hello and echo, which prevents losses at the start."""

from __future__ import annotations

from nep.i18n import _, lazy
from nep.programs.conformance.bench import Bench
from nep.programs.conformance.peers import ScriptedPublisher
from nep.programs.conformance.rule import rule
from nep.programs.conformance.rules.messages import connect_subscriber
from nep.programs.conformance.verdict import broken_rule_error, expect, printable, time_limit
from nep.protocol.wire import LATCHED, hello_part, topic_part

_SECTION = "the-handshake"
_MAX_WAIT_S = 3.0  # the wire allows 0.5 s; the margin is for busy computers


def hello_level(bench: Bench) -> int:
    """Return the highest hello level (1 to 3) that the adapter announces; 0 if it announces none."""
    announced = bench.features.get("features", ())
    return max((level for level in (1, 2, 3) if f"hello{level}" in announced), default=0)


def _filters(publisher: ScriptedPublisher) -> list[bytes]:
    return [each.prefix for each in publisher.filters if each.is_added]


@rule(
    "hello-after-topic",
    lazy("A subscriber subscribes to its topic, with the trailing zero byte, and then to its hello."),
    "connections",
)
def _hello_after_topic(bench: Bench) -> None:
    topic = bench.new_topic()
    publisher, _sub = bench.create_subscribed_publisher(topic)
    filters = _filters(publisher)
    if topic_part(topic) not in filters:
        raise broken_rule_error(
            _("the subscriptions are {seen}, without {wanted}").format(
                seen=printable(filters), wanted=printable(topic_part(topic))
            )
        )
    hello = next(iter(publisher.hellos))
    if filters.index(hello) < filters.index(topic_part(topic)):
        raise broken_rule_error(_("the subscriber subscribed to the hello before the topic"))


@rule(
    "hello-form",
    lazy(
        "A hello contains the subscriber's id as 16 lowercase hexadecimal digits, and the level "
        "that it supports."
    ),
    "connections",
)
def _hello_form(bench: Bench) -> None:
    topic = bench.new_topic()
    publisher, _sub = bench.create_subscribed_publisher(topic)
    level = hello_level(bench)
    expected = hello_part(
        int(bench.latest_record("subscriber", topic)["id"]),
        topic,
        reads_one_part=level == 1,
        acknowledges_echoes=level == 2,
        reads_batches=level == 3,
    )
    expect("hello", next(iter(publisher.hellos)), expected)


@rule(
    "echo",
    lazy("A publisher answers each hello with an echo that has the seq of its last message."),
    "notices",
)
def _echo(bench: Bench) -> None:
    topic = bench.new_topic()
    pub = bench.new_pub(topic)
    bench.call("publish", pub=pub, value={"a": 1}, count=3)
    record = bench.latest_record("publisher", topic)
    subscriber = connect_subscriber(bench, topic, 3)
    header = subscriber.echoes[0].header
    expect("echo.seq", header.seq, 3)
    expect("echo.publisher", header.publisher, record["id"])
    expect("echo.size", header.size, 0)


@rule(
    "foreign-hello",
    lazy("A publisher ignores hellos for another topic: they were meant for the port's previous owner."),
    "connections",
)
def _hello_for_other_topic(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.new_pub(topic)
    subscriber = connect_subscriber(bench, topic, 3)
    other = hello_part(subscriber.record.id, f"{topic}/other", reads_batches=True)
    subscriber.socket.subscribe(other)
    subscriber.socket.subscribe(hello_part(7, topic))
    bench.require(lambda: any(parts[0] == hello_part(7, topic) for parts in subscriber.received), "echo")
    if any(parts[0] == other for parts in subscriber.received):
        raise broken_rule_error(_("the publisher answered the hello {hello}").format(hello=printable(other)))


@rule(
    "first-message",
    lazy("The first message after 'new_pub' reaches subscribers that were registered before."),
    _SECTION,
)
def _first_message(bench: Bench) -> None:
    topic = bench.new_topic()
    subscriber = bench.create_subscriber(topic)
    bench.connect_delay_s = 0.15
    pub = bench.new_pub(topic)
    bench.call("publish", pub=pub, value={"n": 1})
    bench.require(lambda: bool(subscriber.echoes), "echo")
    bench.call("publish", pub=pub, value={"n": 2})
    bench.require(lambda: bool(subscriber.messages), "message")
    expect("message.seq", subscriber.messages[0].header.seq, 1)


@rule(
    "new-pub-bounded",
    lazy("'new_pub' waits at most 0.5 s for a subscriber that doesn't connect."),
    _SECTION,
)
def _new_pub_bounded(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.create_subscriber(topic)
    bench.connect_delay_s = None
    with time_limit(_MAX_WAIT_S):
        bench.new_pub(topic)


@rule(
    "missing",
    lazy("Subscribers that don't send a hello in time are reported to the program and to the master."),
    _SECTION,
)
def _missing_hello_is_reported(bench: Bench) -> None:
    topic = bench.new_topic()
    subscriber = bench.create_subscriber(topic)
    bench.connect_delay_s = None
    reply = bench.call("publisher", topic=topic, type="json")
    expect("publisher.missing", reply.get("missing"), [subscriber.node.name])
    fields = bench.wait_for_request(
        "missing", "publisher_id", bench.latest_record("publisher", topic)["id"]
    ).fields
    expect("missing.subscriber_ids", list(fields.get("subscriber_ids", ())), [subscriber.record.id])
    bench.call("close_publisher", pub=reply.get("pub"))


@rule(
    "new-sub-waits",
    lazy("'new_sub' returns once every publisher that the master listed has sent its echo."),
    _SECTION,
)
def _new_sub_waits(bench: Bench) -> None:
    topic = bench.new_topic()
    publisher = bench.create_publisher(topic, should_echo=False)
    number = bench.adapter.send_request("subscriber", topic=topic, type="json")
    bench.require(lambda: bool(publisher.hellos), "hello")
    bench.wait(0.15)
    has_returned = bench.adapter.reply(number) is not None
    for hello in list(publisher.hellos):
        publisher.send_echo(hello)
    bench.close_sub(int(bench.wait_for_reply(number, "subscriber")["sub"]))
    if has_returned:
        raise broken_rule_error(_("'new_sub' returned before the echo"))


@rule(
    "new-sub-bounded",
    lazy("'new_sub' waits at most 0.5 s for a publisher that sends no echo."),
    _SECTION,
)
def _new_sub_bounded(bench: Bench) -> None:
    topic = bench.new_topic()
    bench.create_publisher(topic, should_echo=False)
    with time_limit(_MAX_WAIT_S):
        bench.new_sub(topic)


@rule(
    "push-connects",
    lazy("A subscriber connects to publishers that the master pushes."),
    _SECTION,
)
def _push_connects(bench: Bench) -> None:
    topic = bench.new_topic()
    sub = bench.new_sub(topic)
    publisher = bench.create_publisher(topic)
    bench.require(lambda: bool(publisher.hellos), "hello")
    publisher.send(b'{"n":1}')
    bench.require(lambda: bool(bench.events(sub)), "message")


@rule(
    "latched",
    lazy(
        "A latched publisher sends its last message before the echo, with its own seq and the flag LATCHED."
    ),
    "notices",
    "latched",
)
def _latched(bench: Bench) -> None:
    topic = bench.new_topic()
    pub = bench.new_pub(topic, latched=True)
    expect("publisher.latched", bench.latest_record("publisher", topic).get("latched"), True)
    bench.call("publish", pub=pub, value={"n": 1})
    bench.call("publish", pub=pub, value={"n": 2})
    subscriber = connect_subscriber(bench, topic, 3)
    notices = [each for each in subscriber.notices if each.at <= subscriber.echoes[0].at]
    first_notice = notices[0]
    if first_notice.payload is None:
        raise broken_rule_error(_("the publisher sent no message before the echo"))
    expect("latched.seq", first_notice.header.seq, 2)
    expect("latched.flags", first_notice.header.flags, LATCHED)


@rule(
    "history",
    lazy("A publisher with a history sends its last messages, the oldest first, and then the echo."),
    "notices",
    "history",
)
def _history(bench: Bench) -> None:
    topic = bench.new_topic()
    pub = bench.new_pub(topic, history=3, latched=True)
    expect("publisher.history", bench.latest_record("publisher", topic).get("history"), 3)
    bench.call("publish", pub=pub, value={"a": 1}, count=5)
    subscriber = connect_subscriber(bench, topic, 3)
    count = next(index for index, each in enumerate(subscriber.notices) if each.payload is None)
    seqs = [each.header.seq for each in subscriber.notices[:count] if each.payload is not None]
    expect("history", seqs, [3, 4, 5])
