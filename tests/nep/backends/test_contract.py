"""Contract tests that run with every back end."""

from __future__ import annotations

import gc
import os
import re
import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest

import nep
from nep.masters.master import Master
from nep.protocol.graph_view import GraphView
from tests.nep.meeting import BACKENDS, Make, meeting, place_for
from tests.nep.programs import eventually

_has_ros2 = bool(os.environ.get("NEP_TEST_ROS2"))
"""Set by tests/nep/backends/test_ros2.py, which runs this file in a separate network namespace."""
_back_ends = ["ros2"] if _has_ros2 else list(BACKENDS)
_DOMAIN = "5"
_topics = ["test", "/a/b"] if _has_ros2 else ["test", "/a/b", "ü"]
"""Topics of the tests; ROS 2 allows no non-ASCII letters in names."""


@pytest.fixture(scope="module", autouse=True)
def _somebody_who_knows_the_domain() -> Iterator[None]:
    """Node that stays open: the first node of a program takes a third of a second for discovery."""
    if not _has_ros2:
        yield
        return
    with nep.node("knows", "ros2", master=_DOMAIN) as node:
        node.graph()
        yield


@pytest.fixture(params=_back_ends)
def make(request: pytest.FixtureRequest, master: Master) -> Iterator[Callable[[str], nep.Node]]:
    """Factory of nodes on one network; they are closed after the test."""
    where = _DOMAIN if _has_ros2 else place_for(request.param, master.address)
    with meeting(request.param, where) as new:
        yield new


def names(view: GraphView) -> set[str]:
    """Return the names of all nodes that the test has created."""
    return {each.name for each in view.nodes.values()} - {"knows"}


def seq(number: int) -> int | None:
    """Return the expected sequence number of a message, or None for DDS, which doesn't expose its own."""
    return None if _has_ros2 else number


def test_message_arrives_with_all_its_metadata(make: Make) -> None:
    sub = make("b").new_sub("topic", "json")
    pub = make("a").new_pub("topic", "json")
    pub.publish({"message": "hello"})
    message = sub.receive(30.0)
    assert message is not None
    assert (message.topic, message.codec, message.msg_type) == ("topic", "json", "json")
    assert (message.payload, message.seq, message.publisher) == ({"message": "hello"}, seq(1), pub.id)
    assert message.stamp_ns is not None
    assert message.data.readonly
    assert message.size_bytes == len(b'{"message":"hello"}')


def test_listen_without_a_timeout_polls_as_in_the_listing_of_the_paper(make: Make) -> None:
    sub = make("b").new_sub("example", "json")
    pub = make("a").new_pub("example", "json")
    assert sub.listen() == (False, {})
    pub.publish({"n": 1})
    assert sub.listen(timeout_s=30.0) == (True, {"n": 1})
    assert sub.listen() == (False, {})


@pytest.mark.parametrize(
    ("msg_type", "payload"),
    [("json", [1, {"a": None}]), ("string", "grüß"), ("bytes", b"\0\xff"), ("msgpack", {"b": b"x", "1": 2})],
)
def test_every_type_round_trips(make: Make, msg_type: str, payload: object) -> None:
    sub = make("b").new_sub("topic", msg_type)
    make("a").new_pub("topic", msg_type).publish(payload)
    assert sub.listen(timeout_s=30.0) == (True, payload)


@pytest.mark.parametrize("topic", _topics)
def test_topics_with_a_common_prefix_are_distinct(make: Make, topic: str) -> None:
    sub, node = make("b").new_sub(topic), make("a")
    node.new_pub(topic + "2").publish(1)
    node.new_pub(topic).publish(2)
    assert sub.listen(timeout_s=30.0) == (True, 2)
    assert sub.listen() == (False, {})


def test_messages_arrive_in_order_without_loss(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")
    for n in range(5000):
        pub.publish(n)
    assert [sub.listen(timeout_s=30.0)[1] for _ in range(5000)] == list(range(5000))
    assert (sub.received, sub.lost) == (5000, 0)


def test_every_subscriber_receives_from_every_publisher(make: Make) -> None:
    subs = [make(f"s{n}").new_sub("topic") for n in range(3)]
    pubs = [make(f"p{n}").new_pub("topic") for n in range(3)]
    for n, pub in enumerate(pubs):
        assert pub.subscribers == 3
        pub.publish(n)
    for sub in subs:
        assert sorted(sub.listen(timeout_s=30.0)[1] for _ in range(3)) == [0, 1, 2]  # type: ignore[type-var]


def test_next_message_reaches_a_new_subscriber(make: Make) -> None:
    pubs = [make(f"p{n}").new_pub("topic") for n in range(3)]
    sub = make("s").new_sub("topic")
    for n, pub in enumerate(pubs):
        pub.publish(n)
    assert sorted(sub.listen(timeout_s=30.0)[1] for _ in pubs) == [0, 1, 2]  # type: ignore[type-var]


def test_late_subscriber_receives_the_latched_message_once(make: Make) -> None:
    pub = make("a").new_pub("/robot/description", "robot/description", latched=True)
    early = make("early").new_sub("/robot/description", "robot/description")
    pub.publish({"v": 1})
    pub.publish({"v": 2})
    late = make("late").new_sub("/robot/description", "robot/description")
    message = late.receive(30.0)
    assert message is not None
    assert (message.payload, message.is_latched, message.seq) == ({"v": 2}, True, seq(2))
    assert late.listen() == (False, {})
    assert [early.listen(timeout_s=30.0)[1] for _ in range(2)] == [{"v": 1}, {"v": 2}]
    assert early.listen(timeout_s=0.05) == (False, {})
    assert (early.lost, late.lost) == (0, 0)


def test_payload_that_cannot_be_encoded_is_rejected_with_and_without_a_subscriber(
    make: Make, caplog: pytest.LogCaptureFixture
) -> None:
    node = make("a")
    pub = node.new_pub("topic")
    bad = {"pose": {"x": 1}, "joints": [0, {"angle": {1, 2}}]}
    pub.publish(bad)
    assert (pub.subscribers, pub.count, pub.refused) == (0, 0, 1)
    assert "a message on 'topic' can't be sent (1 so far): can't encode a 'dict' as 'json'" in caplog.text
    assert "the value is at 'joints[1].angle'" in caplog.text
    sub = make("b").new_sub("topic")
    assert pub.subscribers == 1
    pub.publish(bad)
    assert (pub.count, pub.refused) == (0, 2)
    eventually(lambda: [each.id for each in node.graph().alerts] == ["encode:topic"])
    (alert,) = node.graph().alerts
    assert alert.sentence.startswith("“a” can't publish on “topic”: can't encode a 'dict' as 'json'")
    pub.publish(1)
    assert sub.listen(timeout_s=30.0) == (True, 1)
    assert (sub.lost, pub.count, pub.refused) == (0, 1, 2)
    eventually(lambda: not node.graph().alerts)


def test_new_subscriber_does_not_make_an_invalid_payload_raise(make: Make) -> None:
    pub = make("a").new_pub("topic")
    bad = {"joints": {1, 2}}
    pub.publish(bad)
    sub = make("b").new_sub("topic")
    pub.publish(bad)
    pub.publish(1)
    assert sub.listen(timeout_s=30.0) == (True, 1)


def test_rejected_payload_does_not_replace_the_latched_message(make: Make) -> None:
    pub = make("a").new_pub("topic", latched=True)
    pub.publish("good")
    pub.publish(object())
    assert (pub.count, pub.refused) == (1, 1)
    assert make("b").new_sub("topic").listen(timeout_s=30.0) == (True, "good")


@pytest.mark.parametrize("is_heard", [False, True])
@pytest.mark.parametrize("latched", [False, True])
@pytest.mark.parametrize(
    ("msg_type", "payload", "sentence"),
    [
        ("string", 5, "can't encode a 'int' as 'string': publish a 'str', or use the type 'json'"),
        ("bytes", "text", "can't encode a 'str' as 'bytes': publish 'bytes'"),
        ("image", "text", "can't encode a 'str' as 'image': publish a 'uint8' array"),
        ("image", np.zeros((4, 4, 3), np.complex64), "'complex64'"),
        ("image", np.zeros((4, 0, 3), np.uint8), "(4, 0, 3)"),
        ("json", nep.Encoded("text"), "can't encode a 'str' as 'json': the data must be 'bytes'"),  # type: ignore[arg-type]
        ("json", nep.Encoded(b"1", [1]), "can't encode a 'list' as 'json': an extension must be a map"),  # type: ignore[arg-type]
    ],
)
def test_payload_of_a_wrong_type_raises_with_and_without_a_subscriber(
    make: Make, msg_type: str, payload: object, sentence: str, is_heard: bool, latched: bool
) -> None:
    pub = make("a").new_pub("topic", msg_type, latched=latched)
    if is_heard:
        make("b").new_sub("topic", msg_type)
    for _ in range(3):  # every publish raises, not only some of them
        with pytest.raises(nep.EncodeError, match=re.escape(sentence)):
            pub.publish(payload)
    assert (pub.count, pub.refused) == (0, 0)


class Treacherous:
    """Payload whose methods raise, as those of a user's class may."""

    def tolist(self) -> object:
        raise RuntimeError(self)

    def __str__(self) -> str:
        raise RuntimeError


@pytest.mark.parametrize("is_heard", [False, True])
@pytest.mark.parametrize(
    ("msg_type", "payload"),
    [
        ("string", "\ud800"),
        ("json", {"a": "\ud800"}),
        ("json", {object(): 1}),
        ("json", 2**70),
        ("json", Treacherous()),
        ("msgpack", Treacherous()),
        ("json", {Treacherous(): Treacherous()}),
        ("msgpack", [2**70]),
        ("image", b"no picture"),
        ("bytes", nep.Encoded(b"1", {"a": object()})),
    ],
)
def test_payload_with_invalid_content_is_counted_and_does_not_raise(
    make: Make, msg_type: str, payload: object, is_heard: bool
) -> None:
    pub = make("a").new_pub("topic", msg_type)
    if is_heard:
        make("b").new_sub("topic", msg_type)
    pub.publish(payload)
    assert (pub.count, pub.refused) == (0, 1)


@pytest.mark.parametrize("is_heard", [False, True])
def test_strict_publisher_raises_with_and_without_a_subscriber(make: Make, is_heard: bool) -> None:
    pub = make("a").new_pub("topic")
    sub = make("b").new_sub("topic") if is_heard else None
    for payload, sentence in (
        ({"joints": [0, {"angle": {1, 2}}]}, "the value is at 'joints[1].angle'"),
        ({"a": "\ud800"}, "can't encode a 'dict' as 'json'"),
        (2**70, "can't encode a 'int' as 'json'"),
        ({Treacherous(): Treacherous()}, "can't encode a 'dict' as 'json'"),
        (nep.Encoded(b"1", {"a": object()}), "can't encode a 'Encoded' as 'json'"),
    ):
        for _ in range(2):  # every publish raises, not only some of them
            with pytest.raises(nep.EncodeError, match=re.escape(sentence)):
                pub.publish(payload, strict=True)
    assert (pub.count, pub.refused, pub.problem) == (0, 0, "")
    pub.publish({1})
    assert pub.refused == 1
    pub.publish(1, strict=True)
    assert (pub.count, pub.problem) == (1, "")
    if sub is not None:
        assert sub.listen(timeout_s=30.0) == (True, 1)
    pub.close()
    with pytest.raises(nep.ClosedError):
        pub.publish(1, strict=True)


def test_keep_latest_delivers_only_the_newest_message(make: Make) -> None:
    sub = make("b").new_sub("topic", keep="latest")
    other = make("c").new_sub("topic")
    pub = make("a").new_pub("topic")
    for n in range(100):
        pub.publish(n)
    while other.listen(timeout_s=30.0)[1] != 99:
        pass
    last: object = None
    while last != 99:  # the two connections are not synchronized
        ok, last = sub.listen(timeout_s=30.0)
        assert ok
    assert sub.listen() == (False, {})
    assert sub.lost == 0


def test_keep_latest_delivers_only_the_newest_message_of_a_batch(make: Make) -> None:
    sub, pub = make("b").new_sub("topic", keep="latest"), make("a").new_pub("topic")
    for n in range(5):
        sub.listen()  # from now on, the reading thread reads the socket for a while
        for each in range(100):
            pub.publish([n, each])
        last: object = None
        while last != [n, 99]:
            last = sub.listen(timeout_s=30.0)[1]
        assert sub.listen() == (False, {})
    assert sub.received == 500
    assert sub.lost == 0


def test_full_inbox_drops_the_oldest_and_counts(make: Make) -> None:
    sub = make("b").new_sub("topic", max_messages=10)
    pub = make("a").new_pub("topic")
    other = make("c").new_sub("topic")
    for n in range(100):
        pub.publish(n)
    while other.listen(timeout_s=30.0)[1] != 99:
        pass
    # Without a reader, the node's thread moves messages into the inbox.
    deadline = threading.Event()
    while sub.received + (sub.lost or 0) < 100 and not deadline.wait(0.01):
        pass
    assert [sub.listen()[1] for _ in range(10)] == list(range(90, 100))
    assert (sub.received, sub.lost) == (10, 90)


def test_callbacks_run_in_the_spinning_thread(make: Make) -> None:
    node, pub = make("b"), make("a").new_pub("example")
    got: list[tuple[object, str]] = []

    def callback(message: dict[str, int]) -> None:
        got.append((message, threading.current_thread().name))
        if len(got) == 1:
            node.new_pub("made/in/callback").publish(1)
        if len(got) == 3:
            node.stop_spin()

    node.new_callback("example", "json", callback)
    for n in range(3):
        pub.publish({"n": n})
    node.spin(30.0)
    assert got == [({"n": n}, threading.current_thread().name) for n in range(3)]


def test_slow_callback_with_keep_latest_skips_to_the_newest_message(make: Make) -> None:
    node, pub = make("b"), make("a").new_pub("example")
    got: list[object] = []

    def callback(payload: object) -> None:
        got.append(payload)
        if payload == 99:
            node.stop_spin()
            return
        if len(got) == 1:  # 100 messages arrive while the callback runs
            for n in range(100):
                pub.publish(n)
            eventually(lambda: sub.received == 101)

    sub = node.new_callback("example", "json", callback, keep="latest")
    pub.publish("first")
    node.spin(30.0)
    assert (got[0], got[-1]) == ("first", 99)
    assert len(got) < 50, "what was published meanwhile did not queue up"
    assert sub.lost == 0


def test_full_callback_inbox_drops_the_oldest_and_counts(make: Make) -> None:
    node, pub = make("b"), make("a").new_pub("topic")
    got: list[object] = []

    def callback(payload: object) -> None:
        got.append(payload)
        if len(got) == 10:
            node.stop_spin()

    sub = node.new_callback("topic", "json", callback, max_messages=10)
    for n in range(100):
        pub.publish(n)
    eventually(lambda: sub.received + (sub.lost or 0) == 100)
    node.spin(30.0)
    assert got == list(range(90, 100))
    assert (sub.received, sub.lost) == (10, 90)


def test_callback_with_message_receives_the_whole_message(
    make: Make, caplog: pytest.LogCaptureFixture
) -> None:
    node, pub = make("b"), make("a").new_pub("example")
    got: list[nep.Message] = []

    def callback(message: nep.Message) -> None:
        got.append(message)
        node.stop_spin()

    node.new_callback("example", "json", callback, with_message=True)
    pub.publish_bytes(b"{no json")
    pub.publish({"n": 1})
    node.spin(30.0)
    (message,) = got
    assert (message.topic, message.seq, message.publisher) == ("example", seq(2), pub.id)
    assert (message.payload, message.msg_type) == ({"n": 1}, "json")
    assert message.stamp_ns is not None
    assert "a message on 'example' can't be read (1 so far): can't decode 8 bytes" in caplog.text


def test_timers_run_in_the_spinning_thread_between_callbacks(make: Make) -> None:
    node, pub = make("b"), make("a").new_pub("example")
    threads: set[int] = set()
    fired: list[int] = []

    def tick() -> None:
        threads.add(threading.get_ident())
        fired.append(len(fired))
        pub.publish(len(fired))

    def callback(payload: object) -> None:
        threads.add(threading.get_ident())
        if payload == 3:
            timer.cancel()
            node.stop_spin()

    node.new_callback("example", "json", callback)
    timer = node.new_timer(0.001, tick)
    node.spin(30.0)
    assert len(fired) >= 3
    assert threads == {threading.get_ident()}
    count = len(fired)
    node.spin(0.02)
    assert (len(fired), timer.is_cancelled) == (count, True)


def test_timer_created_during_a_spin_runs(make: Make) -> None:
    node = make("b")
    spinning = threading.Event()
    node.new_timer(0.001, spinning.set)
    thread = threading.Thread(target=node.spin)
    thread.start()
    assert spinning.wait(30.0)
    node.new_timer(0.001, node.stop_spin)
    thread.join(30.0)
    assert not thread.is_alive()


def test_timer_can_close_its_node(make: Make) -> None:
    node = make("b")
    timer = node.new_timer(0.001, node.close)
    node.spin()
    assert timer.is_cancelled
    with pytest.raises(nep.ClosedError, match="node 'b' is closed"):
        node.new_timer(1.0, print)


def test_exception_in_a_callback_propagates_from_spin(make: Make) -> None:
    node, pub = make("b"), make("a").new_pub("example")

    def callback(_message: object) -> None:
        raise ZeroDivisionError

    node.new_callback("example", "json", callback)
    pub.publish(1)
    with pytest.raises(ZeroDivisionError):
        node.spin(30.0)


def test_spin_ends_at_its_timeout_and_on_stop_spin(make: Make) -> None:
    node = make("b")
    node.new_callback("example", "json", lambda _: None)
    node.spin(0.05)
    thread = threading.Thread(target=node.spin)
    thread.start()
    node.stop_spin()
    thread.join(30.0)
    assert not thread.is_alive()


def test_sink_receives_batches_in_a_thread_of_the_node(make: Make) -> None:
    batches: list[list[object]] = []
    done = threading.Event()
    names: set[str] = set()

    def sink(messages: object) -> None:
        batches.append([message.payload for message in messages])  # type: ignore[attr-defined]
        names.add(threading.current_thread().name)
        if sum(map(len, batches)) == 2000:
            done.set()

    make("b").new_sub("topic", sink=sink)
    pub = make("a").new_pub("topic")
    for n in range(2000):
        pub.publish(n)
    assert done.wait(30.0)
    assert [n for batch in batches for n in batch] == list(range(2000))
    assert all(name.startswith("nep-") for name in names)
    assert len(batches) < 1000


@pytest.mark.parametrize("error", [ZeroDivisionError, SystemExit])
def test_sink_that_raises_receives_the_next_batch(
    make: Make, caplog: pytest.LogCaptureFixture, error: type[BaseException]
) -> None:
    got = threading.Semaphore(0)

    def sink(_messages: object) -> None:
        got.release()
        raise error

    make("b").new_sub("topic", sink=sink)
    pub = make("a").new_pub("topic")
    for n in range(2):
        pub.publish(n)
        assert got.acquire(timeout=30.0)
    eventually(lambda: caplog.text.count("the sink of 'topic' failed") == 2)


def test_undecodable_message_raises_on_payload_access_and_is_skipped_by_listen(make: Make) -> None:
    sub, node = make("b").new_sub("topic"), make("a")
    pub = node.new_pub("topic")
    pub.publish_bytes(b"{no json")
    pub.publish({"fine": 1})
    message = sub.receive(30.0)
    assert message is not None
    with pytest.raises(nep.DecodeError, match="can't decode 8 bytes as 'json'"):
        _ = message.payload
    pub.publish_bytes(b"{no json")
    assert sub.listen(timeout_s=30.0) == (True, {"fine": 1})
    assert sub.listen(timeout_s=0.1) == (False, {})


def test_close_is_idempotent_and_later_use_raises_closed_error(make: Make) -> None:
    node = make("b")
    sub, pub = node.new_sub("topic"), make("a").new_pub("topic")
    sub.close()
    sub.close()
    with pytest.raises(nep.ClosedError, match="subscriber 'topic' is closed"):
        sub.listen()
    pub.close()
    pub.close()
    with pytest.raises(nep.ClosedError, match="publisher 'topic' is closed"):
        pub.publish(1)
    eventually(lambda: "topic" not in node.graph().topics)
    node.close()
    with pytest.raises(nep.ClosedError, match="node 'b' is closed"):
        node.new_sub("topic")


def test_close_discards_unread_messages(make: Make) -> None:
    sub, pub = make("b").new_sub("unread", "json"), make("a").new_pub("unread", "json")
    for n in range(3):
        pub.publish(n)
    eventually(lambda: sub.received == 3)
    assert sub.listen() == (True, 0)
    sub.close()
    pub.publish(3)
    with pytest.raises(nep.ClosedError):
        sub.listen()
    assert [
        each for each in gc.get_objects() if isinstance(each, nep.Message) and each.topic == "unread"
    ] == []


def test_close_wakes_a_waiting_subscriber_in_another_thread(make: Make) -> None:
    node = make("b")
    sub = node.new_sub("topic")
    ended: list[str] = []

    def read() -> None:
        with pytest.raises(nep.ClosedError):
            sub.listen(True)
        ended.append("raised")
        for _ in sub:
            pass
        ended.append("stopped")

    thread = threading.Thread(target=read)
    thread.start()
    node.close()
    thread.join(30.0)
    assert ended == ["raised", "stopped"]


@pytest.mark.usefixtures("frequent_switching")
def test_opening_while_another_thread_closes_the_node_raises_closed_error(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("zeromq.transport", "zenoh.transport", "zenoh.node_services"):  # a peer may have closed
        monkeypatch.setattr(f"nep.backends.{module}.HANDSHAKE_TIMEOUT_S", 0.5)
    raised: list[BaseException] = []

    def open_all(node: nep.Node, has_begun: threading.Event) -> None:
        try:
            while True:
                has_begun.set()
                for n in "abc":
                    node.new_sub(f"closing/{n}")
                    node.new_server(f"closing/{n}", str)
                    node.new_client(f"closing/{n}")
                    node.new_callback(f"closing/{n}", "json", print)
                    node.new_pub(f"closing/{n}")
        except BaseException as error:  # noqa: BLE001 - whatever it is, it is judged below
            raised.append(error)

    for _ in range(8):
        node, has_begun = make("closing"), threading.Event()
        threads = [threading.Thread(target=open_all, args=(node, has_begun)) for _ in range(2)]
        for thread in threads:
            thread.start()
        has_begun.wait(30.0)
        node.close()
        for thread in threads:
            thread.join(30.0)
    assert [each for each in raised if not isinstance(each, nep.ClosedError)] == []
    assert len(raised) == 16
    other = make("other")
    eventually(lambda: "closing" not in names(other.graph()))


def test_graph_lists_nodes_topics_publishers_and_subscribers(make: Make) -> None:
    node, other = make("a"), make("b")
    pub = node.new_pub("topic", "robot/description", latched=True)
    sub = other.new_sub("topic", "robot/description")
    view = node.graph()
    assert names(view) == {"a", "b"}
    topic = view.topics["topic"]
    assert (topic.msg_type, topic.codec) == ("robot/description", "json")
    assert [(each.id, each.node_id, each.latched) for each in topic.publishers] == [(pub.id, node.id, True)]
    assert [(each.id, each.node_id) for each in topic.subscribers] == [(sub.id, other.id)]
    sub.close()
    eventually(lambda: node.graph().topics["topic"].subscribers == ())
    other.close()
    eventually(lambda: names(node.graph()) == {"a"})


def test_conflicting_types_and_duplicate_node_names_are_alerts(make: Make) -> None:
    first, second = make("twin"), make("twin")
    first.new_pub("topic", "json")
    second.new_pub("topic", "string")
    ids = {alert.id: alert.sentence for alert in first.graph().alerts}
    assert set(ids) == {"name:twin", "type:topic"}
    assert "2 types" in ids["type:topic"]
    second.close()
    eventually(lambda: first.graph().alerts == ())


def test_concurrent_publishing_from_many_threads_loses_nothing(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")

    def work(start: int) -> None:
        for n in range(start, start + 250):
            pub.publish(n)

    threads = [threading.Thread(target=work, args=(1000 * n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    got = [sub.listen(timeout_s=30.0)[1] for _ in range(1000)]
    for thread in threads:
        thread.join()
    assert sorted(got) == sorted(1000 * n + m for n in range(4) for m in range(250))  # type: ignore[type-var]
    assert sub.lost == 0


def test_mutable_payloads_are_copied_on_publish(make: Make) -> None:
    sub, pub = make("b").new_sub("topic", "bytes"), make("a").new_pub("topic", "bytes")
    data = bytearray(100_000)
    pub.publish(data)
    pub.publish_bytes(memoryview(data))
    data[:] = b"\1" * 100_000
    assert sub.listen(timeout_s=30.0) == (True, bytes(100_000))
    assert sub.listen(timeout_s=30.0) == (True, bytes(100_000))
