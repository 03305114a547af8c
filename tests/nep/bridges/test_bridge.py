"""Tests of bridges between every pair of back ends: names, types, directions, latched topics, counts."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from nep.backends import memory
from nep.backends.base import find_backend
from nep.errors import EncodeError, NepError
from nep.masters.master import Master
from nep.messages.codecs import Codec, codec_for
from nep.messages.encoded import Encoded
from nep.messages.message import MessageKind
from nep.programs.bridges import Bridge, BridgeConfiguration, SideConfiguration, side_configuration
from nep.programs.bridges.configuration import check_different_networks
from nep.protocol.graph_view import BRIDGES_TOPIC
from tests.nep.bridges.joined import (
    Net,
    bridged,
    configured,
    nets,
    route,
    settled,
    silent,
    taken,
    topic,
)
from tests.nep.programs import eventually

PAIRS = [
    ("zeromq", "memory"), ("memory", "zeromq"), ("zeromq", "nanomsg"), ("nanomsg", "zenoh"),
    ("zenoh", "zeromq"), ("zeromq", "zeromq"), ("memory", "memory"),
]  # fmt: skip


@pytest.fixture(params=PAIRS, ids="-".join)
def pair(request):
    with nets(*request.param) as found:
        yield found


def test_every_published_message_is_forwarded_in_order(pair):
    a, b = pair
    with bridged(a, b, topic("/count", "other/name", "a->b")) as bridge:
        sub = b.node("hears").new_sub("other/name")
        pub = a.node("says").new_pub("/count")
        for number in range(2000):
            pub.publish(number)
        counts = settled(route(bridge, "a", "/count"), 2000)
        assert pub.count == counts.received + counts.lost == 2000
        assert (counts.sent, counts.thinned, counts.failed, counts.returned) == (2000, 0, 0, 0)
        assert taken(sub, 2000) == list(range(2000))
        assert sub.lost == 0
        assert counts.bytes == sum(len(str(number)) for number in range(2000))


def test_bidirectional_topic_does_not_echo_to_its_sender(pair):
    a, b = pair
    with bridged(a, b, topic("/chat")) as bridge:
        on_a, on_b = a.node("a"), b.node("b")
        hears_a, hears_b = on_a.new_sub("/chat"), on_b.new_sub("/chat")
        says_a, says_b = on_a.new_pub("/chat"), on_b.new_pub("/chat")
        for number in range(50):
            says_a.publish({"from": "a", "n": number})
            says_b.publish({"from": "b", "n": number})
        for hears in (hears_a, hears_b):
            came = taken(hears, 100)
            for who in ("a", "b"):
                assert [each["n"] for each in came if each["from"] == who] == list(range(50))
            assert silent(hears)
        for side in ("a", "b"):
            counts = settled(route(bridge, side, "/chat"), 50)
            assert (counts.received, counts.sent, counts.lost) == (50, 50, 0)


@pytest.mark.parametrize(
    ("msg_type", "payload"),
    [("json", {"a": [1, None]}), ("string", "grüß"), ("bytes", b"\0\xff"), ("msgpack", {"b": b"x"})],
)
def test_standard_types_keep_payload_codec_and_type(pair, msg_type, payload):
    a, b = pair
    with bridged(a, b, topic("/t", direction="b->a")):
        sub = a.node("a").new_sub("/t", msg_type)
        b.node("b").new_pub("/t", msg_type).publish(payload)
        message = sub.receive(30.0)
        assert (message.payload, message.codec, message.msg_type) == (payload, msg_type, msg_type)


def test_image_keeps_its_bytes_and_shape():
    with nets("memory", "zeromq") as (a, b), bridged(a, b, topic("/camera")):
        sub, direct = b.node("b").new_sub("/camera", "image"), a.node("c").new_sub("/camera", "image")
        picture = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
        a.node("a").new_pub("/camera", "image").publish(picture)
        came, original = sub.receive(30.0), direct.receive(30.0)
        assert bytes(came.data) == bytes(original.data)
        assert came.extension["shape"] == original.extension["shape"] == [4, 6, 3]
        assert came.payload.shape == (4, 6, 3)


def test_large_message_is_forwarded():
    with nets("memory", "zeromq") as (a, b), bridged(a, b, topic("/big")):
        sub = b.node("b").new_sub("/big", "bytes")
        a.node("a").new_pub("/big", "bytes").publish(bytes(8_000_000))
        assert sub.receive(30.0).size_bytes == 8_000_000


def test_named_type_is_preserved():
    with nets("zeromq", "memory") as (a, b), bridged(a, b, topic("/robot/description")):
        sub = b.node("b").new_sub("/robot/description")
        a.node("a").new_pub("/robot/description", "robot/description").publish({"v": 1})
        assert sub.receive(30.0).msg_type == "robot/description"


@pytest.mark.parametrize("soon_s", [0.05, 0.5])
def test_bridge_adopts_the_type_of_other_publishers_of_the_topic(monkeypatch, soon_s):
    """The bridge polls the topics again after the message to determine the type, at any polling interval."""
    monkeypatch.setattr("nep.programs.bridges.side._EARLY_POLL_S", soon_s)
    with nets("memory", "zeromq") as (a, b), bridged(a, b, topic("/t")) as bridge:
        on_b = b.node("b")
        own, sub = on_b.new_pub("/t", "robot/state"), on_b.new_sub("/t", "robot/state")
        a.node("a").new_pub("/t", "json").publish({"v": 1})
        message = sub.receive(30.0)
        assert (message.payload, message.msg_type) == ({"v": 1}, "robot/state")
        own.publish({"v": 2})
        assert sub.receive(30.0).msg_type == "robot/state"
        assert not [each for each in on_b.graph().alerts if each.id == "type:/t"]
        a.node("c").new_pub("/t", "string").publish("text")
        assert settled(route(bridge, "a", "/t"), 2).failed == 0
        assert sub.receive(30.0).payload == "text"


def test_type_known_only_to_the_other_back_end_is_taken_from_its_subscribers(twist_side):
    import nep

    with nets("zeromq") as (a,), nep.node("robot", "ros-like", master="lab") as robot:
        waits = robot.new_sub("/cmd_vel", "test_msgs/Twist")
        told = BridgeConfiguration(
            "t", side_configuration(a.backend, a.master), twist_side, (topic("/cmd_vel"),)
        )
        with Bridge(told) as bridge:
            assert bridge.wait_until_ready(30.0)
            on_a = a.node("a")
            pub, hears = on_a.new_pub("/cmd_vel"), on_a.new_sub("/back")
            pub.publish({"x": 1.5})
            pub.publish({"y": 1.5})
            message = waits.receive(30.0)
            assert (message.codec, message.msg_type, bytes(message.data)) == (
                "twist",
                "test_msgs/Twist",
                b"x=1.5",
            )
            counts = settled(route(bridge, "a", "/cmd_vel"), 2)
            assert (counts.sent, counts.failed) == (1, 1)
            assert counts.problem == "can't encode a 'dict' as 'twist': it has no 'x'"
            assert hears.received == 0


def test_typed_back_end_is_subscribed_with_the_published_type(twist_side):
    import nep

    with nets("zeromq") as (a,), nep.node("robot", "ros-like", master="lab") as robot:
        told = BridgeConfiguration(
            "t", side_configuration(a.backend, a.master), twist_side, (topic("/speed"),)
        )
        with Bridge(told) as bridge:
            assert bridge.wait_until_ready(30.0)
            found = route(bridge, "b", "/speed")
            assert not found.is_subscribed, "as json its bytes would be something else"
            pub, hears = robot.new_pub("/speed", "test_msgs/Twist"), a.node("a").new_sub("/speed")
            eventually(lambda: found.is_subscribed)
            pub.publish({"x": 2.0})
            message = hears.receive(30.0)
            assert (message.payload, message.codec, message.msg_type) == (
                {"x": 2.0},
                "json",
                "test_msgs/Twist",
            )


def test_image_of_a_back_end_specific_type_is_forwarded_as_an_image(twist_side):
    import nep

    with nets("zeromq") as (a,), nep.node("robot", "ros-like", master="lab") as robot:
        told = BridgeConfiguration(
            "t", side_configuration(a.backend, a.master), twist_side, (topic("/camera"),)
        )
        with Bridge(told) as bridge:
            pub, hears = (
                robot.new_pub("/camera", "test_msgs/Picture"),
                a.node("a").new_sub("/camera", "image"),
            )
            eventually(lambda: route(bridge, "b", "/camera").is_subscribed)
            pub.publish(np.zeros((4, 6, 3), np.uint8))
            message = hears.receive(30.0)
            assert (message.codec, message.msg_type, message.payload.shape) == ("image", "image", (4, 6, 3))


def test_string_is_not_converted_to_a_map_type(twist_side):
    import nep

    with nets("zeromq") as (a,), nep.node("robot", "ros-like", master="lab") as robot:
        waits = robot.new_sub("/said", "test_msgs/Twist")
        told = BridgeConfiguration(
            "t", side_configuration(a.backend, a.master), twist_side, (topic("/said"),)
        )
        with Bridge(told) as bridge:
            assert bridge.wait_until_ready(30.0)
            a.node("a").new_pub("/said", "string").publish("hello")
            message = waits.receive(30.0)
            assert (message.payload, message.msg_type) == ("hello", "string")


def test_unknown_target_type_is_reported_once_and_its_messages_wait(twist_side, caplog):
    with nets("zeromq") as (a,):
        wanted = topic("/t", direction="a->b")
        told = BridgeConfiguration(
            "t", side_configuration(a.backend, a.master), twist_side, (wanted, topic("/good"))
        )
        with Bridge(told) as bridge:
            assert bridge.wait_until_ready(30.0)
            pub = a.node("a").new_pub("/t", "no_msgs/Type")
            found = route(bridge, "a", "/t")
            for number in range(5):
                pub.publish(number)
                eventually(lambda number=number: found.counts().waiting == number + 1)
                eventually(lambda: found.connection_problem == "there is no type 'no_msgs/Type'; install it")
            polls = bridge.sides["b"].poll_count
            eventually(lambda: bridge.sides["b"].poll_count >= polls + 2)
            assert caplog.text.count("install it") == 1
            assert bridge.status()["routes"][0]["trouble"] == found.connection_problem


class Typed(memory.MemoryTransport):
    """Memory transport whose messages are decoded by the publisher's codec, even if others don't know it."""

    def create_publisher(self, spec):
        made = super().create_publisher(spec)
        made._kind = MessageKind(
            spec.topic, spec.codec.name, spec.msg_type, spec.is_latched, spec.codec.decode
        )
        return made


@pytest.fixture
def twist_side(monkeypatch):
    """Bridge side whose back end has its own type and codec, as the ROS back ends have."""

    def encode(payload):
        if not isinstance(payload, dict) or "x" not in payload:
            raise EncodeError("twist", type(payload).__name__, "it has no 'x'")
        return Encoded(f"x={payload['x']}".encode())

    def decode(data, _extension):
        return {"x": float(bytes(data)[2:])}

    def chosen(name):
        if name.startswith("no_msgs"):
            raise NepError(f"there is no type '{name}'; install it")
        return twist if name == "test_msgs/Twist" else codec_for(name.replace("test_msgs/Picture", "image"))

    twist = Codec("twist", 0, encode, decode, dict, lambda payload: payload)
    backend = replace(
        memory.BACKEND,
        name="ros-like",
        open=Typed,
        codec_for=chosen,
    )
    named = {"ros-like": backend, "zeromq": find_backend("zeromq")}
    monkeypatch.setattr("nep.nodes.node.find_backend", lambda name: named[name])
    return SideConfiguration(backend, "lab", "ros-like:lab")


def test_differing_types_are_converted_through_the_payload():
    with (
        nets("memory", "zeromq") as (a, b),
        bridged(a, b, topic("/t", a_type="msgpack", b_type="json")) as bridge,
    ):
        on_a, on_b = a.node("a"), b.node("b")
        hears_a, hears_b = on_a.new_sub("/t", "msgpack"), on_b.new_sub("/t")
        says_a, says_b = on_a.new_pub("/t", "msgpack"), on_b.new_pub("/t")
        says_a.publish({"x": 1})
        assert [hears.receive(30.0).codec for hears in (hears_a, hears_b)] == ["msgpack", "json"]
        says_b.publish({"y": 2})
        message = hears_a.receive(30.0)
        assert (message.codec, message.payload) == ("msgpack", {"y": 2})
        assert settled(route(bridge, "a", "/t"), 1).failed == 0


def test_conversion_failure_is_counted_with_its_reason_and_an_alert(caplog):
    with (
        nets("memory", "zeromq") as (a, b),
        bridged(a, b, topic("/t", direction="a->b", b_type="string"), topic("/other")) as bridge,
    ):
        on_b = b.node("b")
        sub, other = on_b.new_sub("/t", "string"), on_b.new_sub("/other")
        pub = a.node("a").new_pub("/t", "json")
        for payload in ("good", {"no": "text"}, 7, "good again"):
            pub.publish(payload)
        counts = settled(route(bridge, "a", "/t"), 4)
        assert (counts.received, counts.sent, counts.failed) == (4, 2, 2)
        assert counts.problem == "can't encode a 'int' as 'string': publish a 'str', or use the type 'json'"
        assert taken(sub, 2) == ["good", "good again"]
        pub.publish({})
        settled(route(bridge, "a", "/t"), 5)

        def alerts():
            return {each.id: each.sentence for each in on_b.graph().alerts}

        eventually(lambda: "encode:/t" in alerts())
        assert re.match("“bridge-test-to-memory” .*“/t”: .*'dict' as 'string'", alerts()["encode:/t"])
        pub.publish("cured")
        eventually(lambda: "encode:/t" not in alerts())
        a.node("a2").new_pub("/other").publish(1)
        assert other.listen(timeout_s=30.0) == (True, 1)


def test_undecodable_message_is_counted_as_failed():
    with (
        nets("memory", "memory") as (a, b),
        bridged(a, b, topic("/t", direction="a->b", b_type="msgpack")) as bridge,
    ):
        pub = a.node("a").new_pub("/t")
        pub.publish(1)
        pub.publish_bytes(b"{oops")
        pub.publish(2)
        counts = settled(route(bridge, "a", "/t"), 3)
        assert (counts.sent, counts.failed) == (2, 1)
        assert counts.problem.startswith("can't decode 5 bytes as 'json'")


def test_invalid_json_is_forwarded_if_no_conversion_is_needed():
    with nets("memory", "zeromq") as (a, b), bridged(a, b, topic("/t")):
        sub = b.node("b").new_sub("/t")
        a.node("a").new_pub("/t").publish_bytes(b"{oops")
        assert bytes(sub.receive(30.0).data) == b"{oops"


# ---- latched


def test_latched_message_stays_latched_for_late_subscribers(pair):
    a, b = pair
    pub = a.node("robot").new_pub("/description", latched=True)
    pub.publish({"v": 1})
    with bridged(a, b, topic("/description")) as bridge:
        settled(route(bridge, "a", "/description"), 1)
        late = b.node("late").new_sub("/description").receive(30.0)
        assert (late.payload, late.is_latched) == ({"v": 1}, True)
        pub.publish({"v": 2})
        settled(route(bridge, "a", "/description"), 2)
        assert b.node("later").new_sub("/description").receive(30.0).payload == {"v": 2}


def test_latched_message_of_each_publisher_is_kept_until_the_publisher_ends(monkeypatch):
    monkeypatch.setattr("nep.programs.bridges.route._PUBLISHER_EXPIRY_S", 0.0)
    with nets("memory", "memory") as (a, b), bridged(a, b, topic("/robots")) as bridge:
        pubs = [a.node(f"robot{n}").new_pub("/robots", latched=True) for n in range(3)]
        for number, pub in enumerate(pubs):
            pub.publish(number)
        settled(route(bridge, "a", "/robots"), 3)
        late = b.node("late").new_sub("/robots")
        assert sorted(taken(late, 3)) == [0, 1, 2]
        pubs[1].close()
        watcher = b.node("watcher")
        eventually(lambda: len(watcher.graph().topics["/robots"].publishers) == 2)
        assert sorted(taken(b.node("later").new_sub("/robots"), 2)) == [0, 2]


def test_latched_and_unlatched_messages_of_one_topic_are_both_forwarded():
    with nets("memory", "zeromq") as (a, b), bridged(a, b, topic("/t")):
        sub, node = b.node("b").new_sub("/t"), a.node("a")
        node.new_pub("/t", latched=True).publish("kept")
        node.new_pub("/t").publish("passing")
        came = {message.payload: message.is_latched for message in (sub.receive(30.0) for _ in range(2))}
        assert came == {"kept": True, "passing": False}


# ---- patterns


def test_pattern_renames_every_matching_topic(pair):
    a, b = pair
    with bridged(a, b, topic("/robot/*", "ros/*/now", "a->b")) as bridge:
        on_a, on_b = a.node("a"), b.node("b")
        pubs = {
            name: on_a.new_pub(name) for name in ("/robot/arm", "/robot/leg", "/robot/a/b", "/robots/arm")
        }
        eventually(lambda: len(bridge.routes) == 2 and all(each.is_subscribed for each in bridge.routes))
        subs = {name: on_b.new_sub(f"ros/{name}/now") for name in ("arm", "leg")}
        for name, pub in pubs.items():
            pub.publish(name)
        assert subs["arm"].listen(timeout_s=30.0) == (True, "/robot/arm")
        assert subs["leg"].listen(timeout_s=30.0) == (True, "/robot/leg")
        assert {each.end.topic for each in bridge.routes} == {"ros/arm/now", "ros/leg/now"}


def test_bidirectional_pattern_matches_topics_of_both_sides_but_not_its_own_topics():
    with nets("memory", "zeromq") as (a, b), bridged(a, b, topic("/a/**", "/b/**")) as bridge:
        on_a, on_b = a.node("a"), b.node("b")
        says_a, says_b = on_a.new_pub("/a/x/y"), on_b.new_pub("/b/z")
        eventually(lambda: len(bridge.routes) == 2 and all(each.is_subscribed for each in bridge.routes))
        hears_a, hears_b = on_a.new_sub("/a/z"), on_b.new_sub("/b/x/y")
        says_a.publish(1)
        says_b.publish(2)
        assert (taken(hears_b, 1), taken(hears_a, 1)) == ([1], [2])
        looked = on_b.graph().topics[BRIDGES_TOPIC].publishers[0].count
        eventually(lambda: on_b.graph().topics[BRIDGES_TOPIC].publishers[0].count > looked)
        ways = {(each.origin.side, each.origin.topic) for each in bridge.routes}
        assert ways == {("a", "/a/x/y"), ("b", "/b/z")}


def test_topic_name_that_contains_a_star_is_matched_literally():
    with nets("memory", "zeromq") as (a, b), bridged(a, b, topic("/r/**", "/s/**", "a->b")) as bridge:
        on_a, on_b = a.node("a"), b.node("b")
        pubs = [on_a.new_pub(name) for name in ("/r/*", "/r/x")]
        eventually(lambda: len(bridge.routes) == 2 and all(each.is_subscribed for each in bridge.routes))
        hears = on_b.new_sub("/s/x")
        for pub in pubs:
            pub.publish(pub.topic)
        assert taken(hears, 1) == ["/r/x"]
        assert settled(route(bridge, "a", "/r/*"), 1).received == 1
        assert settled(route(bridge, "a", "/r/x"), 1).received == 1
        assert silent(hears)


def test_explicitly_named_topic_is_not_matched_by_a_pattern():
    with (
        nets("memory", "memory") as (a, b),
        bridged(a, b, topic("/**", "/all/**"), topic("/named", "/own")) as bridge,
    ):
        on_a = a.node("a")
        on_a.new_pub("/named")
        on_a.new_pub("/found")
        eventually(lambda: len(bridge.routes) == 3)
        assert {each.end.topic for each in bridge.routes if each.origin.side == "a"} == {"/own", "/all/found"}


def test_pattern_route_closes_when_idle_and_reopens(monkeypatch):
    monkeypatch.setattr("nep.programs.bridges.bridge.IDLE_TIMEOUT_S", 0.0)
    with nets("memory", "zeromq") as (a, b), bridged(a, b, topic("/r/*", "/s/*"), topic("/named")) as bridge:
        on_a, on_b = a.node("a"), b.node("b")
        hears = on_b.new_sub("/s/x")
        for number in range(3):
            pub = on_a.new_pub("/r/x")
            eventually(lambda: any(each.is_from_pattern and each.is_subscribed for each in bridge.routes))
            pub.publish(number)
            assert hears.listen(timeout_s=30.0) == (True, number)
            pub.close()
            eventually(lambda: not any(each.is_from_pattern for each in bridge.routes))
            assert len(bridge.routes) == 2, "what is named stays"
            eventually(lambda: not on_b.graph().topics["/s/x"].publishers)
            assert "/r/x" not in on_a.graph().topics
        assert hears.lost == 0


def test_pattern_routes_are_bounded(monkeypatch, caplog):
    monkeypatch.setattr("nep.programs.bridges.bridge.MAX_ROUTES", 2)
    with nets("memory", "memory") as (a, b), bridged(a, b, topic("/**", "/all/**")) as bridge:
        node = a.node("a")
        for number in range(4):
            node.new_pub(f"/{number}")
        eventually(lambda: "make them narrower" in caplog.text)
        assert len(bridge.routes) == 2


# ---- unavailable networks


def test_unavailable_network_is_reported_and_awaited_while_other_networks_work(caplog):
    with Master("127.0.0.1:0", learn_s=0.0) as first:
        address = first.address
    with nets("memory") as (a,):
        away = Net("memory")
        away.backend, away.master = "zeromq", address
        with Bridge(configured(a, away, topic("/t"))) as bridge:
            pub = a.node("a").new_pub("/t")
            eventually(lambda: route(bridge, "a", "/t").is_subscribed)
            for number in range(5):
                pub.publish(number)
            eventually(lambda: route(bridge, "a", "/t").counts().waiting == 5)
            eventually(lambda: re.match(f"no master .*'{address}'", bridge.sides["b"].problem))
            # The problem is set before it is logged.
            eventually(lambda: "waiting for side" in caplog.text)
            assert caplog.text.count("waiting for side") == 1
            assert not bridge.is_ready
            with Master(address, learn_s=0.0), away:
                assert bridge.wait_until_ready(30.0)
                counts = settled(route(bridge, "a", "/t"), 5)
                assert (counts.sent, counts.dropped, counts.waiting) == (5, 0, 0)
                assert bridge.sides["b"].problem == ""
                assert f"side b of the bridge, zeromq:{address}" in caplog.text
                sub = away.node("b").new_sub("/t")
                pub.publish("now")
                assert sub.listen(timeout_s=30.0) == (True, "now")


def test_messages_beyond_the_backlog_limit_are_dropped_and_counted(monkeypatch):
    monkeypatch.setattr("nep.programs.bridges.route.MAX_BACKLOG_MESSAGES", 10)
    with Master("127.0.0.1:0", learn_s=0.0) as first:
        address = first.address
    with nets("memory") as (a,):
        away = Net("memory")
        away.backend, away.master = "zeromq", address
        with Bridge(configured(a, away, topic("/t", direction="a->b"))) as bridge:
            pub = a.node("a").new_pub("/t")
            eventually(lambda: bridge.routes[0].is_subscribed)
            for number in range(25):
                pub.publish(number)
            eventually(lambda: bridge.routes[0].counts().received == 25)
            counts = bridge.routes[0].counts()
            assert (counts.waiting, counts.dropped, counts.sent) == (10, 15, 0)


def test_failed_route_does_not_stop_other_routes(caplog):
    class Bad:
        """Node that raises for one topic."""

        def __init__(self, node):
            self._node = node

        def __getattr__(self, name):
            return getattr(self._node, name)

        def new_sub(self, name, *args, **more):
            if name == "/bad":
                raise RuntimeError("no such type")
            return self._node.new_sub(name, *args, **more)

    with nets("memory", "memory") as (a, b):
        bridge = Bridge(configured(a, b, topic("/good")))
        try:
            bridge.sides["a"].node = Bad(bridge.sides["a"].node)
            bridge._add_route(topic("/bad"), "a", "/bad", "/bad")
            bridge._add_route(topic("/late"), "a", "/late", "/late")
            eventually(lambda: route(bridge, "a", "/late").is_subscribed)
            eventually(lambda: route(bridge, "a", "/bad").connection_problem == "RuntimeError: no such type")
            assert "'/bad' on side a is not forwarded to '/bad' yet: RuntimeError" in caplog.text
            sub = b.node("b").new_sub("/good")
            a.node("a").new_pub("/good").publish(1)
            assert sub.listen(timeout_s=30.0) == (True, 1)
        finally:
            bridge.close()


def test_publisher_of_another_type_is_subscribed_with_its_type():
    with nets("memory", "memory") as (a, b), bridged(a, b, topic("/t", direction="a->b")) as bridge:
        watcher = a.node("watcher")
        assert watcher.graph().topics["/t"].msg_type == "json"
        pub = a.node("a").new_pub("/t", "string")
        found = route(bridge, "a", "/t")
        eventually(lambda: found._subscriber.msg_type == "string")
        pub.publish("x")
        assert settled(found, 1).sent == 1
        assert len(watcher.graph().topics["/t"].subscribers) == 1


# ---- graph, counts and shutdown


def test_graph_shows_the_bridge_and_counts_are_published_on_both_sides(pair):
    a, b = pair
    with bridged(a, b, topic("/t")) as bridge:
        on_a, on_b = a.node("a"), b.node("b")
        assert f"bridge-test-to-{b.backend}" in {each.name for each in on_a.graph().nodes.values()}
        assert f"bridge-test-to-{a.backend}" in {each.name for each in on_b.graph().nodes.values()}
        pub = on_a.new_pub("/t")
        for number in range(7):
            pub.publish(number)
        settled(route(bridge, "a", "/t"), 7)
        for node in (on_a, on_b):
            sub = node.new_sub(BRIDGES_TOPIC)
            told = {}
            while told.get("sent") != 7:
                status = sub.listen(timeout_s=30.0)[1]
                told = {each["from"]["side"]: each for each in status["routes"]}["a"]
            assert (status["bridge"], told["received"], told["lost"], told["thinned"]) == ("test", 7, 0, 0)
            assert [each["backend"] for each in status["sides"]] == [a.backend, b.backend]


def test_close_delivers_received_messages_and_is_idempotent(pair):
    a, b = pair
    sub, pub = b.node("b").new_sub("/t"), a.node("a").new_pub("/t")
    with bridged(a, b, topic("/t")) as bridge:
        for number in range(500):
            pub.publish(number)
        settled(route(bridge, "a", "/t"), 500)
    bridge.close()
    assert taken(sub, 500) == list(range(500))
    assert bridge.routes[0].counts().sent == 500


def test_close_while_waiting_for_a_network_returns_promptly():
    with nets("memory") as (a,):
        away = Net("memory")
        away.backend, away.master = "zeromq", "127.0.0.1:9"
        with Bridge(configured(a, away, topic("/t"))) as bridge:
            assert not bridge.wait_until_ready(0.1)
        assert not bridge.wait_until_ready(None), "closed"


def test_unknown_back_end_or_identical_sides_are_rejected():
    with pytest.raises(NepError, match="unknown back end 'zeromk'; did you mean 'zeromq'"):
        side_configuration("zeromk")
    with nets("memory") as (a,), pytest.raises(NepError, match="both sides are the network"):
        check_different_networks(
            side_configuration(a.backend, a.master), side_configuration(a.backend, a.master)
        )
