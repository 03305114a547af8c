"""Tests of additional networks: selected by the user, distinguished by name, grey without a connection."""

from __future__ import annotations

import json
import sys
import uuid
from pathlib import Path

import pytest

import nep
from app.core.network.mailbox import Batch
from app.core.network.source import GraphReceived, MasterFound, MasterLost, WatchFailed
from app.core.network.topics import Topic, Topics, key_of, split_key
from app.core.networks.kinds import KINDS, find_kind
from app.core.networks.networks import lost_message
from app.core.networks.source import OtherSource
from app.core.session import Session
from app.core.storage.settings import Settings
from app.errors import SettingsError
from nep.errors import BackendUnavailableError, NepError
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView
from tests.core.networks.fake_networks import World, graph
from tests.core.waiting import tick_until
from tests.e2e.waiting import until


@pytest.fixture
def world(tmp_path: Path) -> World:
    return World(Settings(tmp_path))


def message(size: int = 10) -> Message:
    return Message("/a", bytes(size), "bytes", "bytes")


def test_topic_keys_are_split_into_network_and_topic() -> None:
    assert split_key(key_of("ros2", "/camera")) == ("ros2", "/camera")
    assert split_key(key_of("", "/camera")) == ("", "/camera")
    assert split_key(key_of("ros", "/a b c")) == ("ros", "/a b c"), "strangers may name a topic anything"
    assert Topic("/camera", network="ros").key == "ros /camera"


def test_network_is_observed_only_when_selected_and_again_at_next_start(world: World) -> None:
    world.networks.start()
    assert (world.made, world.networks.selected_networks) == ([], [])
    world.networks.select("ros2", " 7 ")
    world.networks.select("zenoh", "")
    assert [(fake.kind.name, fake.address, fake.said) for fake in world.made] == [
        ("ros2", "7", ["start"]),
        ("zenoh", "local", ["start"]),
    ]
    assert [network.state for network in world.networks] == ["off", "looking", "looking"]
    again = World(Settings(world.settings.path.parent))
    again.networks.start()
    assert [(fake.kind.name, fake.address) for fake in again.made] == [("ros2", "7"), ("zenoh", "local")]
    again.networks.deselect("ros2")
    assert again.made[0].said == ["start", "end"], "the window does not wait for its thread"
    third = World(Settings(world.settings.path.parent))
    third.networks.start()
    assert [fake.kind.name for fake in third.made] == ["zenoh"]
    again.networks.close()
    assert [fake.said for fake in again.made] == [["start", "end", "close"]] * 2


@pytest.mark.parametrize(
    "kept", [[], {"ros2": "999"}, {"ros2": 5}, {"roz": "1"}, {"zenoh": "nowhere at all"}, {"ros": None}]
)
def test_invalid_network_settings_are_ignored(kept: object, tmp_path: Path) -> None:
    (tmp_path / "settings.json").write_text(json.dumps({Settings.networks.key: kept}))
    world = World(Settings(tmp_path))
    world.networks.start()
    assert world.made == []


@pytest.mark.parametrize(
    ("kind", "address", "said"),
    [
        ("ros2", "-1", "isn't a ROS 2 domain; use a number from 0 to 232"),
        ("ros2", "233", "isn't a ROS 2 domain"),
        ("ros2", str(2**64 - 1), "isn't a ROS 2 domain"),
        ("zenoh", "somewhere", "isn't a zenoh address; use 'local'"),
        ("ros", "::", "isn't a valid address of a ROS master"),
        ("ros", "http://", "isn't a valid address of a ROS master"),
    ],
)
def test_invalid_address_is_rejected_with_reason_and_selection_is_unchanged(
    world: World, kind: str, address: str, said: str
) -> None:
    world.networks.select(kind, "")
    before = list(world.made)
    with pytest.raises(NepError, match=said):
        world.networks.select(kind, address)
    assert world.made == before
    assert world.networks.get(kind) is not None
    assert [network.kind.name for network in world.networks.selected_networks] == [kind]


def test_network_is_observed_even_if_selection_cannot_be_saved(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_setting: object, _value: object) -> None:
        raise SettingsError(Path("settings.json"), "no space left on device")

    monkeypatch.setattr(world.settings, "set_value", refuse)
    with pytest.raises(SettingsError):
        world.networks.select("zenoh", "")
    assert [network.kind.name for network in world.networks.selected_networks] == ["zenoh"]


def test_topics_and_nodes_are_listed_with_their_network(world: World) -> None:
    before = world.networks.revision
    world.networks.select("ros", "")
    assert world.networks.revision > before
    world.tell(MasterFound("127.0.0.1:11311"))
    world.tell(GraphReceived(graph("/a"), 0.0))
    assert [(topic.key, topic.network, topic.rate_hz) for topic in world.networks.topics] == [
        ("ros /a", "ros", None)
    ]
    (node,) = world.networks.nodes
    assert (node.key, node.network, node.is_original, node.published_topics) == (
        "ros /arm",
        "ros",
        False,
        ("/a",),
    )
    assert world.networks.topic("ros /a") is world.networks.topics[0]
    assert world.networks.topic("/a") is None
    assert world.networks.topic("zenoh /a") is None


def test_unreachable_network_is_stale_with_reason_until_it_reconnects(world: World) -> None:
    world.networks.select("ros", "")
    world.tell(GraphReceived(graph("/a"), 0.0))
    revision = world.networks.revision
    world.tell(MasterLost("", "no ROS master answers"), 5.0)
    (network,) = world.networks.selected_networks
    assert (network.state, network.sentence) == ("lost", "no ROS master answers")
    assert [topic.is_stale for topic in network.topics] == [node.is_stale for node in network.nodes] == [True]
    assert lost_message(network) == "ROS 1: no ROS master answers."
    (alert,) = world.alerts.active
    assert (alert.title, alert.detail) == ("ROS 1 can't be shown now.", "No ROS master answers.")
    assert world.networks.revision > revision
    world.networks.update_ages(100.0, 0)
    assert [topic.name for topic in network.topics] == ["/a"], "it may be there: who is connected goes on"
    world.tell(GraphReceived(graph("/a", revision=2), 0.0), 101.0)
    assert (network.state, network.sentence, lost_message(network)) == ("there", "", "")
    assert world.alerts.active == ()
    assert (
        [topic.is_stale for topic in network.topics] == [node.is_stale for node in network.nodes] == [False]
    )
    world.tell(GraphReceived(GraphView(1, 3), 0.0), 102.0)
    assert [topic.gone_s for topic in network.topics] == [0.0]
    world.networks.update_ages(113.0, 0)
    assert list(network.topics) == []


def test_events_of_closed_source_are_ignored(world: World) -> None:
    world.networks.select("ros", "127.0.0.1:1")
    world.networks.select("ros", "127.0.0.1:2")
    world.tell(GraphReceived(graph("/of/the/first"), 0.0), source=0)
    assert world.networks.topics == []
    world.tell(MasterLost("", "no ROS master answers"))
    world.networks.deselect("ros")
    assert world.alerts.active == (), "nobody wants to know any more"
    world.tell(GraphReceived(graph("/a"), 0.0))
    assert (world.networks.topics, world.networks.nodes) == ([], [])
    world.networks.select("ros", "127.0.0.1:2")
    world.networks.select("ros", "127.0.0.1:2")
    assert len(world.made) == 3, "the same address again changes nothing"


def test_watch_before_network_is_selected_takes_effect_later(world: World) -> None:
    world.networks.watch("ros /a")
    world.networks.watch("ros /b")
    world.networks.unwatch("ros /b")
    world.networks.add("ros /a", Batch([message()]), 0.0)  # from a network that isn't selected
    world.networks.select("ros", "")
    assert world.made[0].wanted == {"/a"}
    world.networks.add("ros /a", Batch([message(), message()], dropped=3), 1.0)
    world.networks.add("ros /b", Batch([message()]), 1.0)
    found = world.networks.topic("ros /a")
    assert found is not None
    assert (found.received, found.dropped, found.is_watched) == (5, 3, True)
    assert world.networks.topic("ros /b") is None
    world.networks.unwatch("ros /a")
    assert (found.newest, found.received, found.is_watched) == (None, 0, False)
    assert world.made[0].wanted == set()


def test_reason_for_undecodable_topic_is_available_while_watched(world: World) -> None:
    world.networks.select("ros2", "")
    world.networks.watch("ros2 /a")
    world.tell(WatchFailed("/a", "there is no type 'my/Own'"))
    assert world.networks.read_problem("ros2 /a") == "there is no type 'my/Own'"
    assert world.networks.read_problem("ros2 /b") == world.networks.read_problem("/a") == ""
    world.networks.add("ros2 /a", Batch([message()]), 0.0)
    assert world.networks.read_problem("ros2 /a") == ""
    world.tell(WatchFailed("/a", "again"))
    world.networks.unwatch("ros2 /a")
    assert world.networks.read_problem("ros2 /a") == ""


def test_rate_is_measured_from_arrivals_where_network_reports_no_rate() -> None:
    topics = Topics(("", 0), "ros")
    topics.update(graph("/a", "/b"), 0.0)
    topics["/a"].is_watched = True
    before = topics.measure_rates(0.0, {})
    topics.add("/a", Batch([message(100)] * 4, dropped=6), 1.0)
    before = topics.measure_rates(2.0, before)
    assert topics["/a"].measured_rates == (5.0, 500.0)
    topics.update(graph("/a", "/b"), 2.0)
    assert (topics["/a"].rate_hz, topics["/a"].bandwidth_Bps) == (5.0, 500.0), (
        "a graph without does not undo it"
    )
    assert topics["/b"].rate_hz is None
    topics.update(graph("/a", rate_hz=9.0, revision=2), 3.0)
    assert topics["/a"].rate_hz == 9.0, "who publishes knows better"
    topics.unwatch("/a")
    assert (topics["/a"].measured_rates, topics.measure_rates(1.0, before)) == (None, {})


def test_network_kinds_are_found_by_name_and_missing_zenoh_has_install_advice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for kind in KINDS:
        assert find_kind(kind.name) is kind
        assert kind.validate_address(kind.default_address) == kind.validate_address("")
        assert kind.unknown_text == f"unknown on {kind.product_name}"
    assert find_kind("") is find_kind("zeromq") is None
    monkeypatch.setitem(sys.modules, "zenoh", None)
    with pytest.raises(BackendUnavailableError, match=r"pip install .*nep-studio\[zenoh\]"):
        nep.node("n", "zenoh")


def test_zenoh_network_is_observed_beside_the_native_network(session: Session) -> None:
    pytest.importorskip("zenoh")
    place = f"local/{uuid.uuid4().hex}"
    with nep.node("talker") as native, nep.node("arm", "zenoh", master=place) as arm:
        ours, theirs = native.new_pub("/pose"), arm.new_pub("/pose")
        watches = [session.live.watch("/pose"), session.live.watch("zenoh /pose")]
        session.live.networks.select("zenoh", place)
        until(lambda: theirs.subscribers == 1, "Studio hears it")
        until(lambda: ours.subscribers == 1, "and this")
        ours.publish({"x": 1})
        theirs.publish({"x": 2})

        def shown(key: str) -> object:
            topic = session.shown.topic(key)
            return topic.newest.payload if topic is not None and topic.newest is not None else None

        tick_until(session, lambda: shown("/pose") == {"x": 1})
        tick_until(session, lambda: shown("zenoh /pose") == {"x": 2})
        assert session.live.networks.topic("zenoh /pose") is not session.live.topics.get("/pose")
        tick_until(session, lambda: {"arm", "studio"} <= {node.name for node in session.live.networks.nodes})
        assert "arm" not in {node.name for node in session.live.nodes}
        session.live.networks.deselect("zenoh")
        until(lambda: theirs.subscribers == 0, "its thread has left the network")
        assert session.live.networks.topics == []
        for watch in watches:
            watch.close()


class Teller:
    """Fake node that returns the next of the given graphs on each query."""

    def __init__(self, *views: GraphView) -> None:
        self._views = list(views)

    def graph(self, timeout_s: float) -> GraphView:
        return self._views.pop(0)


def test_graph_revision_increases_only_when_nodes_or_topics_change() -> None:
    views = [graph("/a"), graph("/a", rate_hz=5.0), graph("/b"), graph("/b"), GraphView(1, 1), graph("/b")]
    source = OtherSource(KINDS[0], "", [], lambda _event: None)
    teller = Teller(*views)
    revisions = [source.query_graph(teller).revision for _view in views]  # type: ignore[arg-type]
    assert revisions == [1, 1, 2, 2, 3, 4]


def test_exception_of_a_network_library_is_raised_as_nep_error() -> None:
    class Breaks:
        def graph(self, timeout_s: float) -> GraphView:
            raise OSError(5, "it broke")

    source = OtherSource(KINDS[2], "", [], lambda _event: None)
    with pytest.raises(NepError, match=r"OSError: .*it broke"):
        source.query_graph(Breaks())  # type: ignore[arg-type]


def test_missing_package_is_reported_in_one_sentence(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "zenoh", None)
    session.live.networks.select("zenoh", "local/nobody")
    network = session.live.networks.get("zenoh")
    assert network is not None
    tick_until(session, lambda: network.state == "lost")
    assert "nep-studio[zenoh]" in network.sentence
    assert "\n" not in network.sentence
