"""Contract tests of back ends: typed messages, also with programs that use no types."""

from __future__ import annotations

import asyncio
import math
import queue
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

import pytest

import nep
from nep.geometry import Pose, PoseStamped, Quaternion, Twist, Vector3
from nep.masters.master import Master
from nep.sensor import LaserScan
from tests.nep.meeting import Make
from tests.nep.programs import eventually, running


@dataclass
class Count:
    n: int
    unit: str = "pieces"


class Named(TypedDict):
    name: str


def test_typed_and_untyped_programs_exchange_messages(make: Make) -> None:
    a, b = make("a"), make("b")
    typed, untyped, text = b.new_sub("t", Twist), b.new_sub("t"), b.new_sub("t", "geometry_msgs/Twist")
    a.new_pub("t", Twist).publish(Twist(Vector3(0.5), Vector3(z=-1)))
    plain = {"linear": {"x": 0.5, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": -1.0}}
    assert typed.listen(timeout_s=30.0) == (True, Twist(Vector3(0.5), Vector3(z=-1.0)))
    assert untyped.listen(timeout_s=30.0) == (True, plain)
    assert text.listen(timeout_s=30.0) == (True, plain)
    for msg_type in ("json", "msgpack", "geometry_msgs/Twist"):
        a.new_pub("t", msg_type).publish({"linear": {"x": 2}, "new": None})
        assert typed.listen(timeout_s=30.0) == (True, Twist(Vector3(2.0)))
    assert typed.listen() == (False, None)


def test_graph_has_the_type_name(make: Make) -> None:
    a, b = make("a"), make("b")
    pub, sub = a.new_pub("t", Twist), b.new_sub("t", Count)
    assert (pub.msg_type, sub.msg_type) == ("geometry_msgs/Twist", "Count")
    eventually(lambda: "t" in a.graph().topics and a.graph().topics["t"].publishers != ())
    assert a.graph().topics["t"].msg_type == "geometry_msgs/Twist"
    pub.publish(Twist())
    message = sub.receive(30.0)
    assert message is not None
    assert (message.msg_type, message.codec, message.topic) == ("geometry_msgs/Twist", "json", "t")


def test_every_receive_method_returns_typed_payloads(make: Make) -> None:
    a, b = make("a"), make("b")
    sub, latest = b.new_sub("t", Count), b.new_sub("t", Count, keep="latest")
    sunk: queue.SimpleQueue[object] = queue.SimpleQueue()

    def sink(messages: Sequence[nep.Message]) -> None:
        for message in messages:
            sunk.put((message.payload, message.seq))

    b.new_sub("t", Count, sink=sink)
    pub = a.new_pub("t", Count)
    for n in range(1, 8):
        pub.publish(Count(n))
    received = sub.receive(30.0)
    assert received is not None
    assert (received.payload, received.seq, received.publisher) == (Count(1), 1, pub.id)
    assert received.stamp_ns is not None
    assert sub.listen(True) == (True, Count(2))
    assert next(iter(sub)).payload == Count(3)

    async def read() -> list[object]:
        came = await sub.receive_async(30.0)
        assert came is not None
        payloads = [came.payload, (await sub.listen_async(30.0))[1]]
        async for message in sub:
            payloads.append(message.payload)
            break
        return [*payloads, await sub.listen_async(30.0), await sub.listen_async(0.0)]

    assert asyncio.run(read()) == [Count(4), Count(5), Count(6), (True, Count(7)), (False, None)]
    assert [sunk.get(timeout=30.0) for _n in range(7)] == [(Count(n), n) for n in range(1, 8)]
    eventually(lambda: latest.listen(timeout_s=30.0) == (True, Count(7)))


def test_callbacks_receive_typed_payloads_and_typed_messages(make: Make) -> None:
    a, b = make("a"), make("b")
    got: list[object] = []

    def whole(message: nep.Message) -> None:
        got.append((message.seq, message.payload))
        if len(got) == 4:
            b.stop_spin()

    def payload(given: Count) -> None:
        got.append(given)
        if len(got) == 4:
            b.stop_spin()

    b.new_callback("t", Count, payload)
    b.new_callback("t", Count, whole, with_message=True)
    pub = a.new_pub("t", Count)
    pub.publish(Count(1))
    pub.publish(Count(2))
    b.spin(30.0)
    assert [each for each in got if isinstance(each, Count)] == [Count(1), Count(2)]
    assert [each for each in got if isinstance(each, tuple)] == [(1, Count(1)), (2, Count(2))]


def test_coroutines_and_multi_node_spins_receive_typed_payloads(make: Make) -> None:
    a, b = make("a"), make("b")
    got: list[object] = []

    async def callback(given: Count) -> None:
        got.append(given)
        b.stop_spin()

    waiting = b.new_callback("t", Count, callback)
    pub = a.new_pub("t", Count)
    pub.publish(Count(1))
    asyncio.run(b.spin_async(30.0))
    waiting.close()
    b.new_callback("t", Count, lambda given: (got.append(given), a.stop_spin(), b.stop_spin()))
    pub.publish(Count(2))
    nep.spin(a, b, timeout_s=30.0)
    assert got == [Count(1), Count(2)]


def test_message_of_a_mismatching_type_is_skipped_and_reported(
    make: Make, caplog: pytest.LogCaptureFixture
) -> None:
    a, b = make("a"), make("b")
    sub, pub = b.new_sub("t", PoseStamped), a.new_pub("t")
    pub.publish({"pose": {"position": {"x": "left"}}})
    pub.publish({})
    pub.publish({"pose": {"position": None}})
    assert sub.listen(timeout_s=30.0) == (True, PoseStamped())
    assert "pose.position.x is a 'str'; expected a 'float'" in caplog.text
    message = sub.receive(30.0)
    assert message is not None
    with pytest.raises(
        nep.DecodeError, match="pose\\.position is a 'NoneType'; expected a map of the fields"
    ):
        _ = message.payload
    pub.publish(3)
    assert sub.listen(timeout_s=0.5) == (False, None)
    told = "the value is a 'int'; expected a map of the fields of 'PoseStamped'"
    eventually(lambda: any(told in each.sentence for each in a.graph().alerts))
    pub.publish({})
    assert sub.listen(timeout_s=30.0) == (True, PoseStamped())
    eventually(lambda: not any(told in each.sentence for each in a.graph().alerts))


@pytest.mark.parametrize("is_heard", [True, False])
def test_payload_of_a_wrong_type_raises_with_and_without_a_subscriber(make: Make, is_heard: bool) -> None:
    a, b = make("a"), make("b")
    if is_heard:
        b.new_sub("t")
    pub = a.new_pub("t", Count)
    for bad in ({"n": 1}, 3, None, Pose(), Count):
        with pytest.raises(nep.EncodeError, match="as 'Count': publish a 'Count'"):
            pub.publish(bad)
    named = a.new_pub("t", Named)
    for bad in ([], "name", Count(1)):
        with pytest.raises(nep.EncodeError, match="publish a 'Named'"):
            named.publish(bad)
    assert (pub.refused, pub.count, named.refused) == (0, 0, 0)


def test_invalid_field_is_rejected_with_its_path(make: Make) -> None:
    a, b = make("a"), make("b")
    sub, pub = b.new_sub("t", Pose), a.new_pub("t", Pose)
    pub.publish(Pose(orientation=Quaternion(w="one")))
    assert (pub.refused, pub.problem) == (
        1, "can't encode a 'Pose' as 'geometry_msgs/Pose': orientation.w is a 'str'; expected a 'float'"
    )  # fmt: skip
    eventually(lambda: any("orientation.w is a 'str'" in each.sentence for each in a.graph().alerts))
    pub.publish(Pose())
    assert sub.listen(timeout_s=30.0) == (True, Pose())
    assert (pub.refused, pub.problem) == (1, "")
    pub.publish(nep.Encoded(b'{"position":{"x":1}}'))  # sent without validation
    assert sub.listen(timeout_s=30.0)[1].position.x == 1.0
    pub.publish_bytes(b'{"position":{"y":1}}')
    assert sub.listen(timeout_s=30.0)[1].position.y == 1.0


def test_dict_is_validated_and_arrives_typed(make: Make) -> None:
    a, b = make("a"), make("b")
    sub, pub = b.new_sub("t", Named), a.new_pub("t", Named)
    pub.publish({"name": "x", "more": 1})
    assert (
        pub.problem == "can't encode a 'dict' as 'Named': more isn't a field of 'Named'; known names: 'name'"
    )
    pub.publish({"name": "x"})
    assert sub.listen(timeout_s=30.0) == (True, {"name": "x"})


def test_late_and_wildcard_subscribers_receive_typed_payloads(make: Make) -> None:
    a, b = make("a"), make("b")
    a.new_pub("/x/t", Count, latched=True).publish(Count(5, "m"))
    for topic in ("/x/t", "/*/t"):
        sub = b.new_sub(topic, Count)
        message = sub.receive(30.0)
        assert message is not None
        assert (message.payload, message.topic, message.is_latched) == (Count(5, "m"), "/x/t", True)


def test_large_scan_arrives_with_infinity_as_nan(make: Make) -> None:
    a, b = make("a"), make("b")
    sub, pub = b.new_sub("t", LaserScan), a.new_pub("t", LaserScan)
    ranges = [n / 7 for n in range(100_000)]
    pub.publish(LaserScan(ranges=[*ranges, math.inf]))
    came = sub.listen(timeout_s=30.0)[1]
    assert isinstance(came, LaserScan)
    assert came.ranges[:-1] == ranges
    assert math.isnan(came.ranges[-1])
    assert (pub.nulled, pub.refused) == (1, 0)


def test_many_messages_keep_their_order(make: Make) -> None:
    a, b = make("a"), make("b")
    sub, pub = b.new_sub("t", Count), a.new_pub("t", Count)
    for n in range(2000):
        pub.publish(Count(n))
    assert [sub.listen(timeout_s=30.0)[1].n for _n in range(2000)] == list(range(2000))


def test_closed_subscriber_raises_closed_error(make: Make) -> None:
    a = make("a")
    sub = a.new_sub("t", Count)
    with pytest.raises(ValueError, match=r"timeout_s must be .*, not -1"):
        sub.listen(timeout_s=-1)
    with pytest.raises(ValueError, match=r"timeout_s must be .*, not 'x'"):
        sub.listen(timeout_s="x")
    sub.close()
    assert list(sub) == []
    with pytest.raises(nep.ClosedError):
        sub.listen()


def test_untyped_program_reads_typed_messages(master: Master) -> None:
    program = """
        import nep
        with nep.node("other") as node:
            sub, pub = node.new_sub("out"), node.new_pub("in")
            print("ready")
            payload = sub.listen(timeout_s=40)[1]
            print(payload["linear"]["x"], sorted(payload))
            pub.publish({"linear": {"y": payload["linear"]["x"] + 1}})
    """
    with nep.node("me", master=master.address) as node, running(program, NEP_MASTER=master.address) as other:
        assert other.line() == "ready"
        sub = node.new_sub("in", Twist)
        node.new_pub("out", Twist).publish(Twist(Vector3(1)))
        assert other.line() == "1.0 ['angular', 'linear']"
        assert sub.listen(timeout_s=40.0) == (True, Twist(Vector3(y=2.0)))
        assert other.end() == ("", "")
