"""Tests that no message loops: rings of bridges, both directions, and networks without trails of origins."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import replace

import pytest

from nep.backends import memory
from nep.errors import WireError
from nep.messages.message import received_message
from nep.programs.bridges import Bridge, BridgeConfiguration, SideConfiguration, side_configuration
from nep.programs.bridges.other_bridges import OtherBridge, OtherBridges
from nep.programs.bridges.trail import ECHO_WINDOW_S, MAX_HOPS, TRAIL_KEY, LoopGuard, Trail, read_trail
from nep.protocol.graph_view import BRIDGES_TOPIC
from tests.nep.bridges.joined import bridged, nets, route, settled, silent, taken, topic
from tests.nep.programs import eventually


def quiet(*bridges: Bridge) -> None:
    """Wait until the message counts of the bridges no longer change."""
    before: list[tuple[int, int]] = []

    def is_still() -> bool:
        nonlocal before
        now = [(each.counts().received, each.counts().returned) for one in bridges for each in one.routes]
        before, was = now, before
        return now == was

    for _time in range(5):
        eventually(is_still)


RINGS = [("zeromq", "memory"), ("zeromq", "nanomsg"), ("zenoh", "memory")]


@pytest.mark.parametrize("backends", RINGS, ids="-".join)
def test_two_bridges_between_the_same_networks_deliver_one_copy_each(backends):
    with (
        nets(*backends) as (a, b),
        bridged(a, b, topic("/t"), name="one") as one,
        bridged(a, b, topic("/t"), name="two") as two,
    ):
        hears_a, hears_b = a.node("hears").new_sub("/t"), b.node("hears").new_sub("/t")
        pub = a.node("says").new_pub("/t")
        for number in range(20):
            pub.publish(number)
        for bridge in (one, two):
            counts = settled(route(bridge, "a", "/t"), 20)
            assert (counts.received, counts.sent) == (20, 20)
        assert sorted(taken(hears_b, 40)) == sorted([*range(20)] * 2)
        assert taken(hears_a, 20) == list(range(20))
        quiet(one, two)
        assert silent(hears_a)
        assert silent(hears_b)
        for bridge in (one, two):
            found = route(bridge, "b", "/t")
            eventually(lambda found=found: found.counts().returned == 20)  # what the other bridge brought
            assert found.counts().received == 0


def test_three_bridges_in_a_ring_deliver_each_message_once_per_direction():
    with nets("zeromq", "memory", "zenoh") as (a, b, c), ExitStack() as opened:
        ring = [
            opened.enter_context(bridged(x, y, topic("/t"), name=name))
            for x, y, name in ((a, b, "ab"), (b, c, "bc"), (c, a, "ca"))
        ]
        hears = [net.node("hears").new_sub("/t") for net in (a, b, c)]
        pub = a.node("says").new_pub("/t")
        for number in range(10):
            pub.publish(number)
        assert taken(hears[0], 10) == list(range(10))
        for each in hears[1:]:
            assert sorted(taken(each, 20)) == sorted([*range(10)] * 2), "one by each way round"
        quiet(*ring)
        assert all(silent(each) for each in hears)


def test_three_one_way_bridges_in_a_ring_stop_at_the_origin():
    with nets("memory", "zeromq", "memory") as (a, b, c), ExitStack() as opened:
        ring = [
            opened.enter_context(bridged(x, y, topic("/t", direction="a->b"), name=name))
            for x, y, name in ((a, b, "ab"), (b, c, "bc"), (c, a, "ca"))
        ]
        hears = [net.node("hears").new_sub("/t") for net in (a, b, c)]
        b.node("says").new_pub("/t").publish("once")
        assert [taken(each, 1) for each in hears] == [["once"]] * 3
        quiet(*ring)
        assert all(silent(each) for each in hears)
        eventually(lambda: ring[0].routes[0].counts().returned == 1)


def test_loop_within_one_bridge_stops():
    with (
        nets("memory", "zeromq") as (a, b),
        bridged(
            a, b, topic("/x", "/y", "a->b"), topic("/x", "/y2", "b->a"), topic("/z", "/y", "b->a")
        ) as one,
    ):
        hears = a.node("hears").new_sub("/x"), a.node("hears too").new_sub("/z")
        a.node("says").new_pub("/x").publish(1)
        assert settled(route(one, "a", "/x"), 1).sent == 1
        assert taken(hears[0], 1) == [1]
        quiet(one)
        assert all(silent(each) for each in hears)


def test_chain_of_bridges_forwards_messages():
    with (
        nets("zeromq", "memory", "nanomsg") as (a, b, c),
        bridged(a, b, topic("/t"), name="one"),
        bridged(b, c, topic("/t"), name="two"),
    ):
        sub = c.node("c").new_sub("/t")
        a.node("a").new_pub("/t").publish("far")
        message = sub.receive(30.0)
        assert message.payload == "far"
        trail = read_trail(message.extension)
        assert len(trail.bridges) == 2
        assert [each.partition(":")[0] for each in trail.networks] == ["zeromq", "memory", "nanomsg"]


def test_loop_is_stopped_by_bridge_id_if_network_names_differ():
    """Each bridge has its own name for every network, as on two computers."""
    with nets("memory", "zeromq") as (a, b):

        def named(name):
            sides = [
                replace(side_configuration(net.backend, net.master), network=f"{name}-{net.backend}")
                for net in (a, b)
            ]
            return BridgeConfiguration(name, *sides, (topic("/t"),))

        with Bridge(named("one")) as one, Bridge(named("two")) as two:
            assert one.wait_until_ready(30.0)
            assert two.wait_until_ready(30.0)
            hears = a.node("hears").new_sub("/t")
            a.node("says").new_pub("/t").publish("x")
            assert taken(hears, 1) == ["x"]
            quiet(one, two)
            came = 0
            while hears.receive(0.2) is not None:
                came += 1
            assert 1 <= came <= 4, "each bridge once from each copy, and no more"


# ---- networks without extensions


class Nameless(memory.MemoryTransport):
    """Transport like ROS 1: it delivers own messages, without a publisher, and can't carry extensions."""

    def create_publisher(self, spec):
        made = super().create_publisher(spec)
        send = made.send

        def bare(encoded):
            if encoded.extension:
                raise WireError("no room for an extension", len(encoded.data))
            send(encoded)

        made.send = bare
        return made

    def create_subscriber(self, spec):
        sink = spec.sink
        if sink is not None:
            spec = replace(spec, sink=lambda messages: sink([nameless(each) for each in messages]))
        return super().create_subscriber(spec)


def nameless(message):
    made = received_message(message.kind, message.raw, message.stamp_ns, 0, 0)
    made.publisher = made.seq = None
    return made


@pytest.fixture(params=[False, True], ids=["says that it has no room", "does not say so"])
def nameless_side(request, monkeypatch):
    backend = replace(
        memory.BACKEND, name="nameless", open=Nameless, has_extensions=request.param, is_in_process=True
    )
    monkeypatch.setattr("nep.nodes.node.find_backend", lambda name: NAMED[name])
    NAMED["nameless"] = backend
    return SideConfiguration(backend, "somewhere", "nameless:somewhere")


NAMED = {"memory": memory.BACKEND}


def test_echo_is_recognised_by_its_bytes_if_the_network_carries_no_trail(nameless_side):
    import nep

    with nets("memory") as (a,):
        told = BridgeConfiguration(
            "test", side_configuration(a.backend, a.master), nameless_side, (topic("/t"),)
        )
        with Bridge(told) as bridge, nep.node("ros", "nameless", master="somewhere") as ros:
            assert bridge.wait_until_ready(30.0)
            hears_a, hears_ros = a.node("hears").new_sub("/t"), ros.new_sub("/t")
            says = a.node("says").new_pub("/t")
            for payload in ("same", "same", "same", "other"):
                says.publish(payload)
            assert taken(hears_a, 4) == taken(hears_ros, 4) == ["same", "same", "same", "other"]
            back = route(bridge, "b", "/t")
            eventually(lambda: back.counts().returned == 4)
            assert back.counts().received == 0
            assert silent(hears_a)
            ros.new_pub("/t").publish("same")
            assert taken(hears_a, 1) == ["same"], "somebody else may say the same"
            assert settled(back, 1).sent == 1
            there = route(bridge, "a", "/t")
            assert there.counts().failed == 0
            assert sum(each.refused for each in there._publishers.values()) <= 1, "it is tried only once"


def test_two_bridges_over_a_network_without_trails_do_not_loop(nameless_side):
    import nep

    with nets("memory") as (a,), ExitStack() as opened:
        pair = []
        for name in ("one", "two"):
            told = BridgeConfiguration(
                name, side_configuration(a.backend, a.master), nameless_side, (topic("/t"),)
            )
            pair.append(opened.enter_context(Bridge(told)))
            assert pair[-1].wait_until_ready(30.0)
        ros = opened.enter_context(nep.node("ros", "nameless", master="somewhere"))
        hears_a, hears_ros = a.node("hears").new_sub("/t"), ros.new_sub("/t")
        for number in range(10):
            a.node(f"says{number}").new_pub("/t").publish(number)
        quiet(*pair)
        count = 0
        while hears_a.receive(0.2) is not None:
            count += 1
        assert 10 <= count <= 40
        count = 0
        while hears_ros.receive(0.2) is not None:
            count += 1
        assert 20 <= count <= 40


# ---- other bridges between the same networks


def test_one_of_two_parallel_bridges_without_trails_suspends_until_the_other_ends(monkeypatch, caplog):
    import nep

    monkeypatch.setattr("nep.programs.bridges.other_bridges._EXPIRY_S", 3.0)
    monkeypatch.setattr("nep.programs.bridges.side.HEARTBEAT_S", 0.5)
    backend = replace(memory.BACKEND, name="nameless", open=Nameless, has_extensions=False)
    monkeypatch.setattr("nep.nodes.node.find_backend", lambda name: NAMED[name])
    NAMED["nameless"] = backend
    sides = [SideConfiguration(backend, place, f"nameless:{place}") for place in ("here", "there")]

    def joined(name, *ends):
        return BridgeConfiguration(name, *ends, (topic("/t"),))

    with ExitStack() as opened:
        pair = [Bridge(joined("one", *sides)), Bridge(joined("two", *reversed(sides)))]
        for each in pair:
            opened.callback(each.close)
        weak = max(pair, key=lambda bridge: bridge.id)
        strong = min(pair, key=lambda bridge: bridge.id)
        eventually(lambda: all(each.rival == strong.configuration.name for each in weak.routes))
        assert not any(each.rival for each in strong.routes)
        warning = f"the bridge '{strong.configuration.name}' also connects '/t' and '/t'"
        eventually(lambda: warning in caplog.text)  # logged after `rival` was set
        here, there = (opened.enter_context(nep.node(at, "nameless", master=at)) for at in ("here", "there"))
        hears_here, hears_there, says = here.new_sub("/t"), there.new_sub("/t"), here.new_pub("/t")
        for number in range(20):
            says.publish(number)
        assert taken(hears_there, 20) == taken(hears_here, 20) == list(range(20))
        quiet(*pair)
        assert silent(hears_here)
        assert silent(hears_there)
        eventually(lambda: sum(each.counts().returned for each in weak.routes) == 40)
        strong.close()
        eventually(lambda: not any(each.rival for each in weak.routes))
        says.publish("again")
        assert taken(hears_there, 1) == ["again"]


def test_second_bridge_between_the_same_networks_is_reported_once(caplog):
    with (
        nets("zeromq", "memory") as (a, b),
        bridged(a, b, topic("/t"), topic("/u"), name="one"),
        bridged(b, a, topic("/u"), name="two"),
    ):
        eventually(lambda: caplog.text.count("the bridge 'one' also connects '/u' and '/u'") == 1)
        eventually(lambda: caplog.text.count("the bridge 'two' also connects '/u' and '/u'") == 1)
        assert "'/t' and" not in caplog.text


def test_bridges_with_different_topics_or_networks_do_not_conflict(caplog):
    with (
        nets("zeromq", "memory", "memory") as (a, b, c),
        bridged(a, b, topic("/t"), name="one") as one,
        bridged(a, b, topic("/u"), name="two"),
        bridged(a, c, topic("/t"), name="three"),
    ):
        told = b.node("watches").new_sub(BRIDGES_TOPIC)
        for _time in range(6):
            told.receive(30.0)
        eventually(
            lambda: {each.name for each in one._other_bridges.parallel_bridges(time.monotonic())} == {"two"}
        )
        assert "too: messages arrive twice" not in caplog.text


STATUS = {
    "id": "other",
    "bridge": "lab",
    "side": "a",
    "routes": [{"from": {"side": "a", "topic": "/t"}, "to": {"side": "b", "topic": "/u"}}],
}


def test_other_bridge_counts_only_if_seen_recently_on_both_sides():
    known = OtherBridges("own")
    known.add_status("b", STATUS, 0.0)
    assert known.parallel_bridges(0.0) == []
    known.add_status("a", STATUS, 1.0)
    assert known.parallel_bridges(1.0) == [], "twice the same side of it: one network has two names"
    known.add_status("a", {**STATUS, "side": "b"}, 1.0)
    assert known.parallel_bridges(2.0) == [OtherBridge("other", "lab", frozenset({("b", "/t", "/u")}))]
    assert known.parallel_bridges(30.0) == []


@pytest.mark.parametrize(
    "status",
    [
        None, 7, [], "text", {}, {**STATUS, "id": 7}, {**STATUS, "id": "x" * 1000}, {**STATUS, "side": "c"},
        {**STATUS, "side": []}, {**STATUS, "id": "own"},
    ],
)  # fmt: skip
def test_invalid_bridge_status_is_ignored(status):
    known = OtherBridges("own")
    for side in ("a", "b"):
        known.add_status(side, status, 0.0)
        known.add_status(
            side, {**status, "side": "b"} if isinstance(status, dict) and side == "b" else status, 0.0
        )
    assert known.parallel_bridges(0.0) == []


@pytest.mark.parametrize(
    "routes",
    [
        None, 7, "text", {}, [7], [{}], [{"from": 7, "to": {}}], [{"from": {"side": []}, "to": {}}],
        [{"from": {"side": "a", "topic": 1}, "to": {"topic": "/u"}}], [[]] * 100_000,
    ],
)  # fmt: skip
def test_invalid_routes_in_a_bridge_status_are_ignored(routes):
    known = OtherBridges("own")
    known.add_status("a", {**STATUS, "routes": routes}, 0.0)
    known.add_status("b", {**STATUS, "side": "b"}, 0.0)
    assert known.parallel_bridges(0.0)[0].routes == frozenset()


def test_known_bridges_are_bounded():
    known = OtherBridges("own")
    for number in range(1000):
        for side in ("a", "b"):
            known.add_status(side, {**STATUS, "id": str(number), "side": side}, 0.0)
    assert len(known.parallel_bridges(0.0)) == 64


# ---- trails and echoes, unit tests


def test_trail_determines_where_a_message_may_be_forwarded():
    trail = Trail().with_hop("a", "b", "one")
    assert trail == Trail(("a", "b"), ("one",))
    assert not trail.may_forward("a", "two")
    assert not trail.may_forward("c", "one")
    assert trail.may_forward("c", "two")
    assert trail.with_hop("b", "c", "two") == Trail(("a", "b", "c"), ("one", "two"))
    assert read_trail({TRAIL_KEY: trail.to_plain()}) == trail


def test_trail_length_is_limited():
    trail = Trail()
    for number in range(MAX_HOPS):
        assert trail.may_forward(f"n{number + 1}", f"b{number}")
        trail = trail.with_hop(f"n{number}", f"n{number + 1}", f"b{number}")
    assert not read_trail({TRAIL_KEY: trail.to_plain()}).may_forward("new", "new")


@pytest.mark.parametrize(
    "found",
    [
        None, 7, "text", [], {}, {"networks": 7}, {"networks": [7, None, {}], "bridges": "one"},
        {"networks": ["x" * 10**6], "bridges": [b"x"]}, {"networks": ["n"] * 10**5, "bridges": ["b"] * 10**5},
    ],
)  # fmt: skip
def test_invalid_trail_data_is_parsed_into_a_bounded_trail(found):
    trail = read_trail({TRAIL_KEY: found})
    assert len(trail.networks) <= MAX_HOPS + 2
    assert len(trail.bridges) <= MAX_HOPS + 2


def test_message_with_an_invalid_trail_is_forwarded():
    with nets("memory", "zeromq") as (a, b), bridged(a, b, topic("/t")):
        sub = b.node("b").new_sub("/t")
        a.node("a").new_pub("/t").publish_bytes(b"1", {TRAIL_KEY: ["oops"], "mine": 7})
        message = sub.receive(30.0)
        assert message.extension["mine"] == 7
        assert len(read_trail(message.extension).bridges) == 1


def test_echo_is_recognised_once_per_sent_message_until_it_expires():
    echoes = LoopGuard()
    echoes.record_sent(b"x", 0.0)
    echoes.record_sent(b"x", 1.0)
    echoes.record_sent(memoryview(b"y"), 1.0)
    assert [echoes.is_echo(b"x", 2.0) for _time in range(3)] == [True, True, False]
    assert not echoes.is_echo(b"z", 2.0)
    assert not echoes.is_echo(b"y", 1.0 + ECHO_WINDOW_S + 0.1)
    echoes.record_sent(b"x", 10.0)
    echoes.disable()
    assert not echoes.is_echo(b"x", 10.0)
    echoes.record_sent(b"x", 10.0)
    assert not echoes.is_echo(b"x", 10.0), "nothing is remembered any more"


def test_number_of_remembered_echoes_is_bounded():
    echoes = LoopGuard()
    for number in range(10_000):
        echoes.record_sent(str(number).encode(), 0.0)
    assert not echoes.is_echo(b"0", 0.0)
    assert echoes.is_echo(b"9999", 0.0)
    assert len(echoes._sent_counts) < 5_000
