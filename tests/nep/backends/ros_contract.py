"""Contract tests of back ends over ROS, in a separate process that `test_ros.py` starts.

rospy keeps threads and sockets until its process ends, and all tests share one ROS node. Features that
ROS lacks are left out: publisher ID and sequence number of a message without a header, the number of
lost ones of those, letters such as "ü" in topics, and bytes that are invalid for their type.
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

pytestmark = [  # raised inside rospy
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]

for _name in (
    "test_listen_without_a_timeout_polls_as_in_the_listing_of_the_paper",
    "test_every_type_round_trips",
    "test_every_subscriber_receives_from_every_publisher",
    "test_next_message_reaches_a_new_subscriber",
    "test_rejected_payload_does_not_replace_the_latched_message",
    "test_new_subscriber_does_not_make_an_invalid_payload_raise",
    "test_payload_of_a_wrong_type_raises_with_and_without_a_subscriber",
    "test_payload_with_invalid_content_is_counted_and_does_not_raise",
    "test_callbacks_run_in_the_spinning_thread",
    "test_timers_run_in_the_spinning_thread_between_callbacks",
    "test_timer_created_during_a_spin_runs",
    "test_timer_can_close_its_node",
    "test_exception_in_a_callback_propagates_from_spin",
    "test_spin_ends_at_its_timeout_and_on_stop_spin",
    "test_sink_receives_batches_in_a_thread_of_the_node",
    "test_sink_that_raises_receives_the_next_batch",
    "test_undecodable_message_raises_on_payload_access_and_is_skipped_by_listen",
    "test_full_inbox_drops_the_oldest_and_counts",
    "test_full_callback_inbox_drops_the_oldest_and_counts",
    "test_mutable_payloads_are_copied_on_publish",
    "test_close_discards_unread_messages",
):
    globals()[_name] = getattr(contract, _name)


for _name in (
    "test_async_receive_ends_at_its_timeout_and_rejects_a_negative_one",
    "test_cancelled_receive_consumes_no_message",
    "test_five_coroutines_share_a_subscriber",
    "test_close_wakes_waiting_coroutines",
    "test_close_in_the_loop_wakes_a_waiting_coroutine",
    "test_spin_runs_functions_and_coroutine_functions_one_at_a_time",
    "test_timers_and_other_coroutines_run_during_an_async_spin",
    "test_callbacks_added_and_stop_requested_from_other_threads_wake_an_async_spin",
    "test_exception_in_a_callback_propagates_from_async_spin",
    "test_cancelled_async_spin_releases_its_watchers_and_loses_no_message",
    "test_two_loops_in_two_threads_share_a_subscriber",
):
    globals()[_name] = getattr(contract_async, _name)


@pytest.fixture(autouse=True)
def _fail_on_leaks() -> None:
    """Disable the check for leaks: rospy's threads and sockets stay until the process ends."""


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
if importlib.util.find_spec("cv2") is None:  # needed to encode and decode the image files
    PAYLOADS = {key: each for key, each in PAYLOADS.items() if each[0] not in {"image", COMPRESSED}}


def is_same(one: object, other: object) -> bool:
    if isinstance(other, np.ndarray):
        return isinstance(one, np.ndarray) and one.dtype == other.dtype and bool((one == other).all())
    return one == other


# Publishers are created first: the ROS master takes 0.1 s to announce one that is created later.


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
def test_every_type_is_exchanged_with_every_publisher_subscriber_pattern(
    make: Make, pattern: Callable[[Make, str, object], object], kind: str
) -> None:
    msg_type, payload = PAYLOADS[kind]
    assert is_same(pattern(make, msg_type, payload), payload)


def test_messages_arrive_in_order_without_loss(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")
    for n in range(5000):
        pub.publish(n)
    assert [sub.listen(timeout_s=30.0)[1] for _ in range(5000)] == list(range(5000))
    assert (sub.received, sub.lost) == (5000, None)


def test_late_subscriber_receives_the_latched_message_once(make: Make) -> None:
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


def test_keep_latest_delivers_only_the_newest_message(make: Make) -> None:
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


def test_header_has_sequence_numbers_and_time_stamps(make: Make) -> None:
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
    pub._transport.process._seqs["/stamped"] += 4  # simulates four lost messages
    pub.publish({})
    assert sub.receive(30.0) is not None
    assert sub.lost == 4


def test_graph_has_nodes_of_this_program_with_counts(make: Make) -> None:
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


def test_second_type_of_one_program_on_a_topic_is_rejected_until_the_first_closes(make: Make) -> None:
    first = make("a").new_pub("topic", "json")
    with pytest.raises(nep.NepError, match=r"this program publishes 'std_msgs/String' on '/topic'"):
        make("b").new_pub("topic", "bytes")
    first.close()
    make("c").new_pub("topic", "bytes").close()
    with pytest.raises(nep.NepError, match=r"this program publishes 'rosgraph_msgs/Log' on '/rosout'"):
        make("d").new_pub("/rosout", "json")


def test_type_mismatch_is_reported_by_the_subscriber(make: Make, caplog: pytest.LogCaptureFixture) -> None:
    sub, node = make("b").new_sub("topic", "bytes"), make("a")
    pub = node.new_pub("topic", "json")
    pub.publish(1)
    assert sub.listen(timeout_s=0.05) == (False, b"")
    while not sub.refused:
        assert sub.listen(timeout_s=0.05) == (False, b"")
    assert "the publisher sends 'std_msgs/String', which a subscriber of 'bytes' can't read" in caplog.text
    assert any("std_msgs/String" in alert.sentence for alert in node.graph().alerts)


def test_messages_queued_by_rospy_are_sent_before_a_publisher_closes(make: Make) -> None:
    sub, pub = make("b").new_sub("big", "bytes"), make("a").new_pub("big", "bytes")
    for n in range(20):
        pub.publish(bytes([n]) * 8_000_000)
    pub.close(30.0)
    for n in range(20):
        ok, data = sub.listen(timeout_s=30.0)
        assert ok, n
        assert data == bytes([n]) * 8_000_000


def test_close_wakes_a_waiting_subscriber_with_closed_error(make: Make) -> None:
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


def test_second_ros_master_in_one_program_is_rejected(make: Make, ros: str, tmp_path: Path) -> None:
    make("a").new_pub("topic")
    with (
        ros_master(tmp_path) as other,
        nep.node("n", "ros", master=other) as node,
        pytest.raises(nep.NepError, match=rf"ROS master at '{ros}'.*'{other}'"),
    ):
        node.new_pub("topic")


@pytest.mark.parametrize("topic", ["ü", "/a//b", "a/", "1a", "a-b", "a\u0301", "~", "~/", "/", "a~"])
def test_topic_names_invalid_in_ros_are_rejected(make: Make, topic: str) -> None:
    with pytest.raises(nep.BadTopicError, match=f"'{topic}' .*ROS topic"):
        make("a").new_sub(topic)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
def test_forked_child_raises_an_error_and_the_parent_keeps_working(make: Make) -> None:
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
        assert "'ros' doesn't work in a process forked" in said.read()
    os.waitpid(child, 0)
    pub.publish(1)
    assert sub.listen(timeout_s=30.0) == (True, 1)


def test_dataclasses_named_like_ros_types_are_sent_as_those_types(make: Make) -> None:
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
    assert pub.problem.endswith("linear is a 'str'; expected a 'Vector3'")
