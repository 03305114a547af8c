"""Contract tests of back ends: subscribers with a pattern receive all matching topics."""

from __future__ import annotations

import asyncio
import sys
import threading

import pytest
from msgspec.structs import replace

import nep
from nep.backends.zenoh.keys import data_key, hello_key, pattern_data_key, pattern_hellos_key, topic_of
from nep.errors import WireError
from nep.masters.graph import Graph
from nep.masters.master import Master
from nep.masters.pattern_index import MAX_PATTERNS, MAX_PATTERNS_PER_NODE, PatternIndex
from nep.nodes.backend_checks import is_pattern_for
from nep.protocol.requests import (
    AddPublisher,
    AddSubscriber,
    NodeRecord,
    PublisherRecord,
    RejectedReply,
    SubscriberRecord,
    derive_id,
    derive_node_id,
)
from nep.protocol.topic_pattern import is_pattern, matches
from tests.nep.meeting import Make, place_for
from tests.nep.programs import eventually, running


def read(sub: nep.Subscriber, most: int) -> list[tuple[str, object]]:
    """Receive `most` messages. Return their topics and payloads."""
    got = []
    while len(got) < most:
        message = sub.receive(30.0)
        assert message is not None, got
        got.append((message.topic, message.payload))
    return got


def test_pattern_receives_matching_topics_including_later_ones(make: Make) -> None:
    node, other = make("a"), make("b")
    before = [node.new_pub(f"/robot/{name}/camera") for name in ("ann", "bob")]
    others = [node.new_pub(topic) for topic in ("/robot/camera", "/robot/ann/camera/raw", "/room/ann/camera")]
    sub = other.new_sub("/robot/*/camera")
    after = node.new_pub("/robot/cid/camera")
    third = make("c").new_pub("/robot/ann/camera")
    assert [pub.subscribers for pub in (*before, after, third, *others)] == [1, 1, 1, 1, 0, 0, 0]
    for pub in others:
        pub.publish("not for it")
    for n, pub in enumerate((*before, after, third)):
        pub.publish(n)
    assert sorted(read(sub, 4)) == [
        ("/robot/ann/camera", 0),
        ("/robot/ann/camera", 3),
        ("/robot/bob/camera", 1),
        ("/robot/cid/camera", 2),
    ]
    assert sub.listen(timeout_s=0.05) == (False, {})
    assert (sub.topic, sub.received, sub.lost, sub.refused) == ("/robot/*/camera", 4, 0, 0)


def test_first_message_of_a_later_publisher_is_not_lost(make: Make) -> None:
    sub, node = make("b").new_sub("/robot/**"), make("a")
    for n in range(20):
        with node.new_pub(f"/robot/{n}/x") as pub:
            assert pub.subscribers == 1
            pub.publish(n)
    assert read(sub, 20) == [(f"/robot/{n}/x", n) for n in range(20)]
    assert sub.lost == 0


def test_order_is_kept_per_topic_and_counters_are_summed(make: Make) -> None:
    sub, node = make("b").new_sub("t/*"), make("a")
    pubs = [node.new_pub(f"t/{n}") for n in range(3)]
    for number in range(300):
        for pub in pubs:
            pub.publish(number)
    got = read(sub, 900)
    for pub in pubs:
        assert [payload for topic, payload in got if topic == pub.topic] == list(range(300))
    assert (sub.received, sub.lost) == (900, 0)


def test_callback_receives_the_message_with_its_own_topic(make: Make) -> None:
    node, other = make("b"), make("a")
    got: list[tuple[str, str, object]] = []

    def callback(message: nep.Message) -> None:
        got.append((message.topic, message.msg_type, message.payload))
        if len(got) == 2:
            node.stop_spin()

    node.new_callback("**/words", "string", callback, with_message=True)
    pubs = [other.new_pub("words", "string"), other.new_pub("/a/b/words", "my/words")]
    pubs[0].publish("short")
    pubs[1].publish(["long"])
    node.spin(30.0)
    assert sorted(got) == [("/a/b/words", "my/words", ["long"]), ("words", "string", "short")]


def test_patterns_receive_through_a_multi_node_spin_async_iteration_and_sinks(make: Make) -> None:
    node, other, out = make("b"), make("c"), make("a")
    got: list[object] = []
    sunk: list[tuple[str, object]] = []
    came = threading.Event()

    def sink(messages: object) -> None:
        sunk.extend((each.topic, each.payload) for each in messages)  # type: ignore[attr-defined]
        if len(sunk) == 2:
            came.set()

    def callback(payload: object) -> None:
        got.append(payload)
        node.stop_spin()
        other.stop_spin()

    node.new_callback("x/*", "json", callback)
    other.new_sub("x/*", sink=sink)
    waiting = other.new_sub("x/*")

    async def read_async() -> list[str]:
        topics = []
        async for message in waiting:
            topics.append(message.topic)
            if len(topics) == 2:
                break
        return topics

    out.new_pub("x/1").publish(1)
    nep.spin(node, other, timeout_s=30.0)
    out.new_pub("x/2").publish(2)
    assert asyncio.run(read_async()) == ["x/1", "x/2"]
    assert came.wait(30.0)
    assert (got, sunk) == ([1], [("x/1", 1), ("x/2", 2)])


def test_latched_messages_arrive_and_a_full_inbox_drops_the_oldest(make: Make) -> None:
    node = make("a")
    for name in ("a", "b"):
        pub = node.new_pub(f"state/{name}", latched=True)
        pub.publish("old")
        pub.publish(name)
    live = node.new_pub("live/a")
    other = make("b")
    assert sorted(read(other.new_sub("state/*"), 2)) == [("state/a", "a"), ("state/b", "b")]
    few = other.new_sub("live/*", max_messages=10)
    latest = other.new_sub("live/**", keep="latest")
    for n in range(100):
        live.publish(n)
    eventually(lambda: few.received + (few.lost or 0) == 100)
    assert [payload for _topic, payload in read(few, 10)] == list(range(90, 100))
    assert (few.received, few.lost) == (10, 90)
    eventually(lambda: latest.received >= 100 or latest.listen()[1] == 99)
    assert latest.lost == 0


def test_pattern_and_plain_subscribers_receive_the_same_topic_independently(make: Make) -> None:
    other, node = make("b"), make("a")
    subs = [other.new_sub(topic) for topic in ("a/*/c", "**", "a/b/c", "a/b/*", "*")]
    pub = node.new_pub("a/b/c")
    assert pub.subscribers == 4
    pub.publish(1)
    assert [read(sub, 1) for sub in subs[:4]] == [[("a/b/c", 1)]] * 4
    subs[0].close()
    eventually(lambda: pub.subscribers == 3)
    pub.publish(2)
    assert [read(sub, 1) for sub in subs[1:4]] == [[("a/b/c", 2)]] * 3
    assert subs[4].listen() == (False, {})
    with pytest.raises(nep.ClosedError, match=r"subscriber 'a/\*/c' is closed"):
        subs[0].listen()


def test_star_inside_a_level_or_with_wildcards_disabled_is_literal(make: Make) -> None:
    other, node = make("b"), make("a")
    inside, plain = other.new_sub("a*b"), other.new_sub("x/*", wildcards=False)
    star, letter, named = node.new_pub("a*b"), node.new_pub("aXb"), node.new_pub("x/*")
    assert (star.subscribers, letter.subscribers, named.subscribers) == (1, 0, 1)
    star.publish(1)
    named.publish(2)
    node.new_pub("x/y").publish(3)
    assert read(inside, 1) == [("a*b", 1)]
    assert read(plain, 1) == [("x/*", 2)]
    assert plain.listen() == (False, {})


def test_close_wakes_a_waiting_subscriber_and_unregisters_the_pattern(make: Make) -> None:
    node, other = make("b"), make("a")
    pub = other.new_pub("a/b")
    sub = node.new_sub("a/*")
    ended: list[str] = []

    def wait() -> None:
        with pytest.raises(nep.ClosedError):
            sub.listen(True)
        ended.append("ended")

    thread = threading.Thread(target=wait)
    thread.start()
    node.close()
    thread.join(30.0)
    assert ended == ["ended"]
    eventually(lambda: pub.subscribers == 0)
    eventually(lambda: "a/*" not in other.graph().patterns)


def test_undecodable_messages_are_skipped_and_the_graph_lists_the_pattern(make: Make) -> None:
    node, other = make("b"), make("a")
    sub = node.new_sub("a/*")
    pub = other.new_pub("a/b")
    pub.publish_bytes(b"{no json")
    pub.publish(1)
    assert sub.listen(timeout_s=30.0) == (True, 1)
    view = other.graph()
    assert [each.id for each in view.patterns["a/*"].subscribers] == [sub.id]
    assert "a/*" not in view.topics
    exact = other.new_sub("a/*", wildcards=False)
    view = other.graph()
    assert [each.id for each in view.topics["a/*"].subscribers] == [exact.id]
    assert [each.id for each in view.patterns["a/*"].subscribers] == [sub.id]
    sub.close()
    eventually(lambda: not other.graph().patterns)
    assert [each.id for each in other.graph().topics["a/*"].subscribers] == [exact.id]


def test_back_end_without_wildcards_rejects_patterns(make: Make) -> None:
    node = make("a")
    object.__setattr__(node._backend, "has_patterns", False)
    try:
        with pytest.raises(ValueError, match=f"'{node._backend.name}' .*wildcards"):
            node.new_sub("a/*")
        node.new_sub("a*", wildcards=True)
    finally:
        object.__setattr__(node._backend, "has_patterns", True)


def test_direct_connection_takes_the_topic_name_literally() -> None:
    with nep.node("a") as node:
        assert not is_pattern_for(node._backend, "a/*", node.direct(port=9999))
        assert is_pattern_for(node._backend, "a/*", node.hybrid())


@pytest.mark.parametrize("backend", ["zeromq", "zenoh"])
def test_restarted_publishers_are_received_after_a_kill(master: Master, backend: str) -> None:
    place = place_for(backend, master.address)
    code = """
    import sys, nep
    pub = nep.node("a", sys.argv[1], master=sys.argv[2]).new_pub("r/" + sys.argv[3])
    pub.publish(sys.argv[3])
    print("there")
    input()
    """
    with nep.node("b", backend, master=place) as node:
        sub = node.new_sub("r/*")
        for name in ("1", "2", "1"):
            with running(code, backend, place, name) as program:
                assert program.line() == "there"
                assert read(sub, 1) == [(f"r/{name}", name)]
                program.process.kill()


@pytest.mark.usefixtures("patient")
def test_pattern_is_registered_again_at_a_restarted_master(master: Master) -> None:
    port = master.address
    with nep.node("b", master=port) as node, nep.node("a", master=port) as other:
        sub = node.new_sub("r/*")
        old = other.new_pub("r/old")
        master.close()
        old.publish(1)
        assert read(sub, 1) == [("r/old", 1)]
        with Master(port, learn_s=1.0):
            eventually(lambda: "r/*" in node.graph(30.0).patterns)
            new = other.new_pub("r/new")
            assert new.subscribers == 1
            new.publish(2)
            old.publish(3)
            assert sorted(read(sub, 2)) == [("r/new", 2), ("r/old", 3)]


@pytest.mark.parametrize("backend", ["zeromq", "nanomsg"])
def test_older_master_without_wildcards_is_reported(
    master: Master, monkeypatch: pytest.MonkeyPatch, backend: str
) -> None:
    real = Graph.apply

    def apply(self: Graph, request: object, *args: object, **named: object) -> object:
        if isinstance(request, AddSubscriber):  # an older master ignores this field
            request = replace(request, subscriber=replace(request.subscriber, pattern=False))
        return real(self, request, *args, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(Graph, "apply", apply)
    with nep.node("b", backend) as node:
        with pytest.raises(nep.NepError, match=f"'{master.address}' .*wildcards"):
            node.new_sub("r/*")
        assert "r/*" not in node.graph().topics
        node.new_sub("r/x")


@pytest.mark.usefixtures("patient")
def test_topics_of_closed_publishers_are_unsubscribed(master: Master) -> None:
    with nep.node("b") as node, nep.node("a") as other:
        sub = node.new_sub("r/*")
        topics = sub._transport._topics  # type: ignore[attr-defined]
        for n in range(5):
            with other.new_pub(f"r/{n}") as pub:
                pub.publish(n)
        assert len(read(sub, 5)) == 5
        eventually(lambda: not topics.sockets)
        assert (sub.received, sub.lost) == (5, 0)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
@pytest.mark.parametrize("backend", ["memory", "zeromq"])
def test_subscriber_is_closed_in_a_forked_child(master: Master, backend: str) -> None:
    code = """
    import os, sys, nep
    node = nep.node("a", sys.argv[1])
    sub, pub = node.new_sub("t/*"), node.new_pub("t/1")
    pid = os.fork()
    if not pid:
        try:
            sub.listen(True)
        except nep.ClosedError as error:
            os._exit(3 if error.is_forked else 4)
    print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
    pub.publish(1)
    print(sub.listen(timeout_s=30.0))
    """
    with running(code, backend) as program:
        assert [program.line(), program.line()] == ["3", "(True, 1)"]
        assert program.end()[1] == ""


# ---- pattern matching and limits


@pytest.mark.parametrize(
    ("pattern", "topic", "is_match"),
    [
        ("/robot/*/camera", "/robot/ann/camera", True),
        ("/robot/*/camera", "/robot//camera", False),
        ("/robot/*/camera", "/robot/a/b/camera", False),
        ("/robot/**/camera", "/robot/camera", True),
        ("/robot/**/camera", "/robot/a/b/camera", True),
        ("/robot/**", "/robot", True),
        ("/robot/**", "/robots", False),
        ("**", "/any/thing", True),
        ("*", "one", True),
        ("*", "/one", False),
        ("/*", "/one", True),
        ("**/camera", "camera", True),
        ("**/camera", "/a/camera", True),
        ("**/camera", "/a/cameras", False),
        ("a/**/b/**/c", "a/x/b/y/z/c", True),
        ("a/**/b/**/c", "a/x/y/c", False),
        ("a/*", "a/*", True),
        ("ü/*", "ü/ß", True),
        ("/".join(["**", "a"] * 40), "/".join(["a"] * 100), True),
        ("/".join(["**", "a"] * 40), "/".join(["a"] * 99 + ["b"]), False),
    ],
)
def test_pattern_matches_topics(pattern: str, topic: str, is_match: bool) -> None:
    assert matches(pattern, topic) is is_match
    assert is_pattern(pattern)


@pytest.mark.parametrize("topic", ["a*b", "/robot/*x", "***", "/a/b", "", "a/**b"])
def test_plain_topics_are_not_patterns(topic: str) -> None:
    assert not is_pattern(topic)


@pytest.mark.parametrize(
    "pattern", ["/robot/*/camera", "/robot/**", "**", "*", "**/camera", "a/**/b/*/c", "/*"]
)
@pytest.mark.parametrize("topic", ["/robot/a/camera", "/robot", "/a", "camera", "a/b/x/c", "a/x y/b/ü/c"])
def test_zenoh_key_expressions_cover_every_matching_topic(pattern: str, topic: str) -> None:
    zenoh = pytest.importorskip("zenoh")
    heard = zenoh.KeyExpr(pattern_data_key(pattern)).intersects(zenoh.KeyExpr(data_key(topic)))
    assert heard or not matches(pattern, topic)
    answered = zenoh.KeyExpr(pattern_hellos_key(pattern)).intersects(zenoh.KeyExpr(hello_key(topic, 7)))
    assert answered is heard
    assert topic_of(data_key(topic)) == topic_of(hello_key(topic, 7)) == topic


def test_pattern_index_removes_unused_entries() -> None:
    index: PatternIndex[str] = PatternIndex()
    index.add_topic("a/1")
    index.add("a/*", 1, "n", ["a/1", "b/1"])
    index.add("a/*", 2, "m", [])
    index.add_topic("a/2")
    assert index.topics_of("a/*") == {"a/1", "a/2"}
    assert index.subscribers_of("a/2") == [("n", 1), ("m", 2)]
    index.remove_topic("a/1")
    assert index.topics_of("a/*") == {"a/2"}
    assert index.subscribers_of("a/1") == [("n", 1), ("m", 2)], "they are told that it went"
    index.remove("a/*", 1)
    index.remove("a/*", 1)
    index.remove("b/*", 1)
    assert (len(index), index.subscribers_of("a/2")) == (1, [("m", 2)])
    index.remove("a/*", 2)
    assert (len(index), index._topics, index._patterns, index.subscribers_of("a/2")) == (0, {}, {}, [])


def _node(number: int) -> NodeRecord:
    key = f"key {number}"
    return NodeRecord(derive_node_id(key), f"n{number}", "host", 1, key=key)


def _pattern(number: int, each: int) -> AddSubscriber:
    node = _node(number)
    return AddSubscriber(node, SubscriberRecord(derive_id(node.key, each), f"t{each}/*", "json", each, True))


def test_pattern_registrations_beyond_the_limit_are_rejected() -> None:
    graph = Graph(1, 0.0, learn_s=0.0)

    def ask(request: AddSubscriber | AddPublisher, number: int) -> object:
        return graph.apply(request, 1, 0.0, f"route {number}", is_foreign=True)[-1].body

    for each in range(1, MAX_PATTERNS_PER_NODE + 1):
        assert not isinstance(ask(_pattern(0, each), 0), RejectedReply)
    refused = ask(_pattern(0, MAX_PATTERNS_PER_NODE + 1), 0)
    assert isinstance(refused, RejectedReply)
    assert "at most 100 subscribers with wildcards" in refused.reason
    for number in range(1, MAX_PATTERNS // MAX_PATTERNS_PER_NODE):
        for each in range(1, MAX_PATTERNS_PER_NODE + 1):
            assert not isinstance(ask(_pattern(number, each), number), RejectedReply)
    assert isinstance(ask(_pattern(99, 1), 99), RejectedReply)
    node = _node(98)
    record = PublisherRecord(
        derive_id(node.key, 1), "t5/x", "json", "json", ("tcp://127.0.0.1:5000",), number=1
    )
    answer = ask(AddPublisher(node, record), 98)
    assert len(answer.expected) == MAX_PATTERNS // MAX_PATTERNS_PER_NODE  # type: ignore[attr-defined]
    assert not isinstance(answer, WireError)
