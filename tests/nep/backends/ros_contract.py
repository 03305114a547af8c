"""The contract of back ends over ROS, in a process of its own: see `test_ros.py`, which runs this file.

rospy lives as long as its process, with threads and sockets, and there is one ROS node for all tests. What
ROS has no room for is left out: the publisher's id and number of a message without a header, how many were
lost of those, letters such as "ü" in topics, and bytes that are wrong for their type.
"""

from __future__ import annotations

import importlib.util
import math
import os
import queue
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import nep
from nep.geometry import Header, Point, Pose, PoseStamped, Time, Twist, Vector3
from tests.nep.backends import test_contract as contract
from tests.nep.backends import test_contract_async as contract_async
from tests.nep.backends.ros_programs import ros_master
from tests.nep.meeting import Make

pytestmark = [  # rospy's own ways
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]

for _name in (
    "test_the_paper_s_listing_polls",
    "test_every_type_arrives_as_it_was",
    "test_many_to_many",
    "test_the_next_message_reaches_a_new_subscriber",
    "test_what_is_latched_and_cannot_be_sent_leaves_what_was_latched_before",
    "test_whoever_begins_to_listen_ends_no_publisher",
    "test_a_payload_of_a_wrong_type_is_an_error_heard_or_unheard",
    "test_whatever_is_inside_ends_no_program",
    "test_callbacks_run_in_the_thread_that_spins",
    "test_timers_run_in_the_thread_that_spins_and_beside_callbacks",
    "test_a_timer_that_is_made_while_a_node_spins_runs",
    "test_a_timer_may_close_its_node",
    "test_what_a_callback_raises_comes_out_of_spin",
    "test_spin_ends_after_its_time_and_when_told",
    "test_a_sink_gets_batches_in_a_thread_of_the_node",
    "test_a_sink_that_fails_gets_the_next_batch",
    "test_bad_bytes_are_skipped_by_listen_and_become_an_alert",
    "test_a_full_inbox_drops_the_oldest_and_counts",
    "test_a_callback_s_full_inbox_drops_the_oldest_and_counts",
    "test_what_can_still_be_changed_is_copied",
    "test_closing_discards_unread_messages",
):
    globals()[_name] = getattr(contract, _name)


for _name in (
    "test_a_time_limit_and_none",
    "test_whoever_is_cancelled_has_taken_no_message",
    "test_two_coroutines_share_a_subscriber",
    "test_closing_ends_who_waits",
    "test_closing_in_the_loop_while_another_coroutine_waits",
    "test_spin_runs_functions_and_coroutine_functions_one_at_a_time",
    "test_timers_and_other_coroutines_run_beside_a_spin",
    "test_what_others_order_reaches_a_spin_that_waits",
    "test_what_a_callback_raises_comes_out_of_the_spin",
    "test_a_spin_that_is_cancelled_leaves_nothing",
    "test_two_loops_in_two_threads",
):
    globals()[_name] = getattr(contract_async, _name)


@pytest.fixture(autouse=True)
def _nothing_is_left() -> None:
    """rospy's threads and sockets stay until the process ends."""


@pytest.fixture(scope="module")
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with ros_master(tmp_path_factory.mktemp("ros")) as address:
        yield address


@pytest.fixture
def make(ros: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    made: list[nep.Node] = []

    def new(name: str) -> nep.Node:
        node = nep.node(name, "ROS", master=ros)
        made.append(node)
        return node

    yield new
    for node in made:
        node.close()


COMPRESSED = "sensor_msgs/CompressedImage"
FRAME = np.full((4, 6, 3), 200, np.uint8)
DEPTH = np.arange(24, dtype=np.uint16).reshape(4, 6) * 2000
TWIST = {"linear": {"x": 0.5, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": math.inf}}
PAYLOADS: dict[str, tuple[str, object]] = {
    "json": ("json", {"n": 2**64 - 1, "text": "grüß"}),
    "a name of the user's": ("robot/state", {"state": [1, None]}),
    "string": ("string", "grüß\0"),
    "bytes": ("bytes", bytes(range(256))),
    "bytes of 8 MB": ("bytes", bytes(8_000_000)),
    "msgpack": ("msgpack", {"data": b"\0\xff", "n": -(2**63)}),
    "image, JPEG": ("image", FRAME),
    "image, PNG": ("image", DEPTH),
    COMPRESSED: (COMPRESSED, FRAME),
    "sensor_msgs/Image": ("sensor_msgs/Image", DEPTH),
    "sensor_msgs/Image of 8 MB": ("sensor_msgs/Image", np.zeros((1400, 2000, 3), np.uint8)),
    "geometry_msgs/Twist": ("geometry_msgs/Twist", TWIST),
    "std_msgs/Empty": ("std_msgs/Empty", {}),
}
if importlib.util.find_spec("cv2") is None:  # which makes and reads the files
    PAYLOADS = {key: each for key, each in PAYLOADS.items() if each[0] not in {"image", COMPRESSED}}


def is_same(one: object, other: object) -> bool:
    if isinstance(other, np.ndarray):
        return isinstance(one, np.ndarray) and one.dtype == other.dtype and bool((one == other).all())
    return one == other


# The publishers come first: ROS's master takes a tenth of a second to tell of one that comes later.


def listened(make: Make, kind: str, payload: object) -> object:
    pub = make("a").new_pub("/typed", kind)
    sub = make("b").new_sub("/typed", kind)
    pub.publish(payload)
    return sub.listen(timeout_s=30.0)[1]


def latched(make: Make, kind: str, payload: object) -> object:
    make("a").new_pub("/typed", kind, latched=True).publish(payload)
    return make("late").new_sub("/typed", kind).listen(timeout_s=30.0)[1]


def called_back(make: Make, kind: str, payload: object) -> object:
    pub = make("a").new_pub("/typed", kind)
    node, came = make("b"), []

    def callback(message: object) -> None:
        came.append(message)
        node.stop_spin()

    node.new_callback("/typed", kind, callback)
    pub.publish(payload)
    node.spin(30.0)
    return came[0]


def newest(make: Make, kind: str, payload: object) -> object:
    pub = make("a").new_pub("/typed", kind)
    sub = make("b").new_sub("/typed", kind, keep="latest")
    pub.publish(payload)
    return sub.listen(timeout_s=30.0)[1]


def poured(make: Make, kind: str, payload: object) -> object:
    came: queue.SimpleQueue[object] = queue.SimpleQueue()
    pub = make("a").new_pub("/typed", kind)
    make("b").new_sub("/typed", kind, sink=lambda messages: [came.put(each.payload) for each in messages])
    pub.publish(payload)
    return came.get(timeout=30.0)


def from_two_to_two(make: Make, kind: str, payload: object) -> object:
    pubs = [make(name).new_pub("/typed", kind) for name in ("a", "b")]
    subs = [make(name).new_sub("/typed", kind) for name in ("c", "d")]
    for pub in pubs:
        pub.publish(payload)
    came = [sub.listen(timeout_s=30.0)[1] for sub in subs for _both in range(2)]
    assert all(is_same(each, payload) for each in came)
    return came[0]


@pytest.mark.parametrize("kind", PAYLOADS)
@pytest.mark.parametrize("pattern", [listened, latched, called_back, newest, poured, from_two_to_two])
def test_every_type_with_every_pattern(
    make: Make, pattern: Callable[[Make, str, object], object], kind: str
) -> None:
    msg_type, payload = PAYLOADS[kind]
    assert is_same(pattern(make, msg_type, payload), payload)


def test_order_is_kept_and_nothing_is_lost(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")
    for n in range(5000):
        pub.publish(n)
    assert [sub.listen(timeout_s=30.0)[1] for _ in range(5000)] == list(range(5000))
    assert (sub.received, sub.lost) == (5000, None)


def test_a_late_subscriber_gets_what_is_latched_once(make: Make) -> None:
    pub = make("a").new_pub("/robot/description", "robot/description", latched=True)
    early = make("early").new_sub("/robot/description", "robot/description")
    pub.publish({"v": 1})
    pub.publish({"v": 2})
    assert [early.listen(timeout_s=30.0)[1] for _ in range(2)] == [{"v": 1}, {"v": 2}]
    late = make("late").new_sub("/robot/description", "robot/description")
    message = late.receive(30.0)
    assert message is not None
    assert (message.payload, message.is_latched) == ({"v": 2}, True)
    assert late.listen(timeout_s=0.05) == (False, {})
    assert early.listen(timeout_s=0.05) == (False, {})


def test_keep_latest(make: Make) -> None:
    sub = make("b").new_sub("topic", keep="latest")
    other = make("c").new_sub("topic")
    pub = make("a").new_pub("topic")
    for n in range(100):
        pub.publish(n)
    while other.listen(timeout_s=30.0)[1] != 99:
        pass
    last: object = None
    while last != 99:
        ok, last = sub.listen(timeout_s=30.0)
        assert ok
    assert sub.listen() == (False, {})


def test_a_header_numbers_messages_and_has_the_time(make: Make) -> None:
    sub = make("b").new_sub("stamped", "geometry_msgs/TwistStamped")
    pub = make("a").new_pub("stamped", "geometry_msgs/TwistStamped")
    before = time.time_ns()
    for n in range(3):
        pub.publish({"twist": {"linear": {"x": n}}})
    messages = [sub.receive(30.0) for _ in range(3)]
    assert all(message is not None for message in messages)
    seqs = [message.seq for message in messages if message is not None]
    assert seqs == [1, 2, 3]
    assert (sub.lost, messages[0].stamp_ns >= before) == (0, True)  # type: ignore[union-attr,operator]
    pub._transport.process._seqs["/stamped"] += 4  # as if four had not come
    pub.publish({})
    assert sub.receive(30.0) is not None
    assert sub.lost == 4


def test_the_graph_has_this_program_s_nodes_with_counts(make: Make) -> None:
    node, other = make("a"), make("b")
    pub = node.new_pub("topic", "geometry_msgs/Twist", latched=True)
    sub = other.new_sub("topic", "geometry_msgs/Twist")
    pub.publish({})
    assert sub.receive(30.0) is not None
    view = node.graph()
    assert {each.name for each in view.nodes.values()} >= {"a", "b"}
    topic = view.topics["/topic"]
    assert (topic.msg_type, topic.codec, topic.rate_hz) == ("geometry_msgs/Twist", "ros", None)
    assert [(each.id, each.node_id, each.count) for each in topic.publishers] == [(pub.id, node.id, 1)]
    assert [(each.id, each.node_id, each.received) for each in topic.subscribers] == [(sub.id, other.id, 1)]
    other.close()
    assert "b" not in {each.name for each in node.graph().nodes.values()}
    assert node.graph().topics["/topic"].subscribers == ()


def test_two_types_of_one_program_on_a_topic_are_refused_until_the_first_is_gone(make: Make) -> None:
    first = make("a").new_pub("topic", "json")
    with pytest.raises(nep.NepError, match=r"this program publishes 'std_msgs/String' on '/topic'"):
        make("b").new_pub("topic", "bytes")
    first.close()
    make("c").new_pub("topic", "bytes").close()
    with pytest.raises(nep.NepError, match=r"this program publishes 'rosgraph_msgs/Log' on '/rosout'"):
        make("d").new_pub("/rosout", "json")


def test_a_subscriber_of_another_type_says_so(make: Make, caplog: pytest.LogCaptureFixture) -> None:
    sub, node = make("b").new_sub("topic", "bytes"), make("a")
    pub = node.new_pub("topic", "json")
    pub.publish(1)
    assert sub.listen(timeout_s=0.05) == (False, b"")
    while not sub.refused:
        assert sub.listen(timeout_s=0.05) == (False, b"")
    assert "it publishes 'std_msgs/String', which a subscriber of 'bytes' can't read" in caplog.text
    assert any("std_msgs/String" in alert.sentence for alert in node.graph().alerts)


def test_what_rospy_has_queued_is_sent_before_a_publisher_closes(make: Make) -> None:
    sub, pub = make("b").new_sub("big", "bytes"), make("a").new_pub("big", "bytes")
    for n in range(20):
        pub.publish(bytes([n]) * 8_000_000)
    pub.close(30.0)
    for n in range(20):
        ok, data = sub.listen(timeout_s=30.0)
        assert ok, n
        assert data == bytes([n]) * 8_000_000


def test_closing_ends_waits_and_is_said(make: Make) -> None:
    node = make("a")
    sub, pub = node.new_sub("topic"), node.new_pub("topic")
    ended: list[str] = []

    def wait() -> None:
        try:
            sub.receive()
        except nep.ClosedError:
            ended.append("raised")

    thread = threading.Thread(target=wait)
    thread.start()
    node.close()
    thread.join(30.0)
    assert ended == ["raised"]
    with pytest.raises(nep.ClosedError):
        pub.publish(1)
    with pytest.raises(nep.ClosedError):
        node.new_sub("topic")


def test_another_master_is_refused_in_a_sentence(make: Make, ros: str, tmp_path: Path) -> None:
    make("a").new_pub("topic")
    with (
        ros_master(tmp_path) as other,
        nep.node("n", "ros", master=other) as node,
        pytest.raises(nep.NepError, match=rf"ROS master at '{ros}'.*'{other}'"),
    ):
        node.new_pub("topic")


@pytest.mark.parametrize("topic", ["ü", "/a//b", "a/", "1a", "a-b", "a\u0301", "~", "~/", "/", "a~"])
def test_topics_that_ros_does_not_have(make: Make, topic: str) -> None:
    with pytest.raises(nep.BadTopicError, match=f"'{topic}' .*ROS topic"):
        make("a").new_sub(topic)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
def test_a_forked_child_says_that_it_cannot_and_leaves_the_parent_alone(make: Make) -> None:
    sub, pub = make("b").new_sub("topic"), make("a").new_pub("topic")
    ros = pub._transport.process.master.address
    read, write = os.pipe()
    child = os.fork()
    if not child:
        try:
            nep.node("c", "ros", master=ros).new_pub("topic")
        except nep.NepError as error:
            os.write(write, str(error).encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as said:
        assert "'ros' does not work in a forked process" in said.read()
    os.waitpid(child, 0)
    pub.publish(1)
    assert sub.listen(timeout_s=30.0) == (True, 1)


def test_dataclasses_with_ros_s_names_travel_as_ros_s_own_types(make: Make) -> None:
    a, b = make("a"), make("b")
    twists, maps, poses = b.new_sub("/t", Twist), b.new_sub("/t"), b.new_sub("/p", PoseStamped)
    pub, stamped = a.new_pub("/t", Twist), a.new_pub("/p", PoseStamped)
    pub.publish(Twist(Vector3(0.5), Vector3(z=math.inf)))
    assert twists.listen(timeout_s=30.0) == (True, Twist(Vector3(0.5), Vector3(z=math.inf)))
    assert maps.listen(timeout_s=30.0) == (True, TWIST)
    pose = PoseStamped(Header(Time(5, 6), "map"), Pose(Point(1.0)))
    stamped.publish(pose)
    assert poses.listen(timeout_s=30.0) == (True, pose)
    pub.publish(Twist("fast"))
    assert pub.problem.endswith("linear is a 'str'; give a 'Vector3'")
