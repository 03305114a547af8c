"""Tests of native programs with published packages: listings, restarts, unusual payloads and other modes."""

from __future__ import annotations

import json
import sys

import pytest
import zmq

import nep

pytestmark = [pytest.mark.ports, pytest.mark.interop, pytest.mark.timeout(300)]


@pytest.fixture
def node(master):
    with nep.node("test") as made:
        yield made


@pytest.fixture
def graph_shows(node):
    """Return a function that waits until the graph meets a condition and returns the graph."""

    def wait(wanted, timeout_s=60.0):
        watch = nep.node("watch")
        with watch, watch.new_sub("nothing") as idle:
            for _ in range(int(timeout_s / 0.1)):
                view = node.graph()
                if wanted(view):
                    return view
                idle.receive(0.1)
        raise AssertionError(view)

    return wait


def tell_until_heard(publisher, value, *subscribers):
    """Publish a value repeatedly until all subscribers receive it, because they join late."""
    for _ in range(60):
        publisher.tell(value)
        if all(each.hears(value, 0.3) for each in subscribers):
            return
    pytest.fail(f"{value} is not heard: {[each.printed for each in subscribers]}")


@pytest.mark.parametrize("kind", ["0.5.3.5", "0.5.4.5", "0.5.4.8", "nep-js"])
def test_original_is_listed_with_its_rate_and_removed_when_its_process_ends(peers, node, graph_shows, kind):
    publisher = peers.start(kind, "publisher", "t", name="sender").wait_ready()
    subscriber = peers.start(kind, "subscriber", "t", name="receiver").wait_ready()
    tell_until_heard(publisher, {"n": -1}, subscriber)

    def is_complete(view):
        topic = view.topics.get("t")
        if topic is None or topic.rate_hz is None or topic.rate_hz <= 0:
            publisher.tell({"n": 1})
            return False
        return len(named(view, topic.publishers)) == len(named(view, topic.subscribers)) == 1

    def named(view, ends):
        return [
            view.nodes[end.node_id].name for end in ends if view.nodes[end.node_id].generation in {"A", "B"}
        ]

    view = graph_shows(is_complete)
    by_name = {each.name: each for each in view.nodes.values()}
    assert by_name["sender"].generation == ("B" if kind == "0.5.4.8" else "A")
    assert by_name["sender"].language == ("JavaScript" if kind == "nep-js" else "Python")
    assert by_name["sender"].pid == publisher.process.pid
    assert named(view, view.topics["t"].publishers) == ["sender"]
    assert named(view, view.topics["t"].subscribers) == ["receiver"]
    publisher.kill()
    graph_shows(lambda view: "sender" not in {each.name for each in view.nodes.values()})
    subscriber.kill()
    graph_shows(lambda view: "t" not in view.topics)


def test_originals_exchange_messages_again_after_the_master_is_killed_and_restarted(
    peers, nep_home, master, start_again
):
    kinds = ("0.5.3.5", "0.5.4.8", "nep-js", "native")
    subscribers = [
        peers.start(kind, "subscriber", "t", name=f"to_{at}").wait_ready() for at, kind in enumerate(kinds)
    ]
    publishers = [
        peers.start(kind, "publisher", "t", name=f"from_{at}").wait_ready() for at, kind in enumerate(kinds)
    ]
    for number, publisher in enumerate(publishers):
        tell_until_heard(publisher, {"before": number}, *subscribers)
    master.kill()
    again = start_again()
    for number, publisher in enumerate(publishers):
        tell_until_heard(publisher, {"after": number}, *subscribers)
    for number in range(40):
        for at, publisher in enumerate(publishers):
            value = {"n": number, "from": at}
            publisher.tell(value)
            assert all(each.hears(value) for each in subscribers)
            assert [each.got.count(value) for each in subscribers] == [1] * len(kinds)
    with nep.node("test") as node:
        names = {each.name for each in node.graph().nodes.values()}
    assert {f"{way}_{at}" for way in ("to", "from") for at in range(4)} <= names
    assert "Traceback" not in again.printed


def test_payload_that_contains_its_topic_name_does_not_crash_nep_js(peers, master):
    subscriber = peers.start("nep-js", "subscriber", "camera").wait_ready()
    for kind in ("native", "0.5.3.5", "0.5.4.8"):
        publisher = peers.start(kind, "publisher", "camera").wait_ready()
        tell_until_heard(publisher, {"camera": "the camera of a cameraman", "from": kind}, subscriber)
    assert subscriber.process.poll() is None


def test_dictionary_type_of_0548_is_exchanged_with_every_peer(peers, master):
    kinds = ("0.5.3.5", "nep-js", "native")
    others = [peers.start(kind, "subscriber", "t").wait_ready() for kind in kinds]
    mine = peers.start("0.5.4.8", "subscriber", "t", "dictionary").wait_ready()
    tell_until_heard(
        peers.start("0.5.4.8", "publisher", "t", "dictionary").wait_ready(), {"n": 1}, mine, *others
    )
    for kind in kinds:
        tell_until_heard(peers.start(kind, "publisher", "t").wait_ready(), {"from": kind}, mine)


@pytest.mark.parametrize("mode", ["one2many", "many2one"])
@pytest.mark.parametrize("kind", ["0.5.3.5", "0.5.4.5", "0.5.4.8"])
def test_one_sided_modes_exchange_messages_with_native_programs(peers, master, kind, mode):
    native = peers.start("native", "subscriber", "t").wait_ready()
    subscriber = peers.start(kind, "subscriber", "t", mode=mode).wait_ready()
    tell_until_heard(
        peers.start(kind, "publisher", "t", mode=mode).wait_ready(), {"n": 1}, subscriber, native
    )
    tell_until_heard(peers.start("native", "publisher", "t").wait_ready(), {"n": 2}, subscriber, native)


@pytest.mark.parametrize(
    ("asks", "answers"), [("0.5.3.5", "0.5.3.5"), ("0.5.4.8", "0.5.4.8"), ("0.5.3.5", "0.5.4.8")]
)
def test_clients_and_servers_of_originals_connect_to_each_other(peers, master, asks, answers):
    peers.start(answers, "server", "sum").wait_ready()
    client = peers.start(asks, "client", "sum").wait_ready()
    client.tell({"a": 1})
    assert client.hears({"echo": {"a": 1}})


def test_nep_0546_and_0547_are_named_with_their_nodes_and_do_not_affect_other_programs(
    peers, master, node, graph_shows
):
    heard = peers.start("0.5.4.8", "subscriber", "t", name="served").wait_ready()
    peers.start("0.5.4.6", "subscriber", "t", name="viewer").wait_ready()
    sender = peers.start("0.5.4.7", "publisher", "t", name="sender").wait_ready()

    def both_are_named(view):
        sender.tell({"n": 1})
        told = {alert.id: alert.sentence for alert in view.alerts}
        wires = {each.name: each.generation for each in view.nodes.values()}
        return (
            "0.5.4.6" in told.get("version:t:subscriber", "")
            and told.get("version:t:publisher", "").startswith("“sender” on “t” uses nep 0.5.4.7")
            and wires.get("sender") == "0.5.4.7"
        )

    view = graph_shows(both_are_named)
    told = {alert.id: alert.sentence for alert in view.alerts}["version:t:subscriber"]
    assert "“viewer”" in told
    assert "“served”" in told, "which of two subscribers it is can't be told"
    heard.kill()
    graph_shows(
        lambda view: (
            {"0.5.4.6"} == {n.generation for n in view.nodes.values() if n.name == "viewer"}
            and any(alert.sentence.startswith("“viewer” on “t” uses nep 0.5.4.6") for alert in view.alerts)
        )
    )
    sender.kill()
    graph_shows(lambda view: "version:t:publisher" not in {alert.id for alert in view.alerts})
    served = peers.start("0.5.4.8", "subscriber", "t", name="again").wait_ready()
    tell_until_heard(peers.start("native", "publisher", "t").wait_ready(), {"n": 2}, served)


def test_broadcast_on_7777_lists_programs_of_every_kind(peers, master):
    context = zmq.Context()
    try:
        with context.socket(zmq.SUB) as tool:
            tool.setsockopt(zmq.SUBSCRIBE, b"master")
            tool.setsockopt(zmq.RCVTIMEO, 60_000)
            tool.connect("tcp://127.0.0.1:7777")
            for at, kind in enumerate(("0.5.3.5", "0.5.4.5", "0.5.4.8", "nep-js")):
                peers.start(kind, "subscriber", f"t{at}", name=f"n{at}").wait_ready()
            told = {}
            while len(told) < 4:
                frame = tool.recv()
                assert frame.startswith(b"master {")
                told = json.loads(frame.partition(b" ")[2])
        assert {topic: list(entry["nodes"]) for topic, entry in told.items()} == {
            f"t{at}": [f"n{at}"] for at in range(4)
        }
        assert {entry["mode"] for entry in told.values()} == {"many2many"}
        assert len({entry["port"] for entry in told.values()}) == 4
    finally:
        context.destroy(linger=0)


def test_invalid_requests_do_not_affect_a_running_master(peers, master, node):
    context = zmq.Context()
    try:
        for bad in (b"", b"\x00\xff", b"[1]", b'{"node":1}', b"{" * 9000):
            for port in (7000, 50000):
                with context.socket(zmq.REQ) as asking:
                    asking.setsockopt(zmq.RCVTIMEO, 60_000)
                    asking.connect(f"tcp://127.0.0.1:{port}")
                    asking.send(bad)
                    assert json.loads(asking.recv())["state"] == "failure"
    finally:
        context.destroy(linger=0)
    subscriber = peers.start("0.5.3.5", "subscriber", "t").wait_ready()
    tell_until_heard(peers.start("native", "publisher", "t").wait_ready(), {"n": 1}, subscriber)


def test_native_topics_are_not_subscribed_while_no_original_requests_them(peers, master, node):
    pub = node.new_pub("busy")
    pub.publish({"n": 1})
    assert pub.subscribers == 0
    assert {each.generation for each in node.graph().nodes.values()} == {"native"}
    peers.start("0.5.3.5", "subscriber", "other").wait_ready()
    assert pub.subscribers == 0


def test_topic_pub_command_reaches_an_original(peers, master):
    subscriber = peers.start("0.5.4.8", "subscriber", "t").wait_ready()
    for _ in range(30):
        done = peers.run_native(["-m", "nep", "topic", "pub", "t", '{"by": "hand"}'])
        done.process.wait(60)
        if subscriber.hears({"by": "hand"}, 0.5):
            return
    pytest.fail(f"not heard {sys.argv}")
