"""Tests of Topics, Nodes and Inspector with other networks, where some values are unknown."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtWidgets import QLabel

from app.core.network.source import GraphReceived, MasterLost, WatchFailed
from app.intents import BrowseNetworks
from app.ui.panels.watch.image.panel import PANEL as IMAGE
from app.ui.panels.watch.inspector.panel import PANEL as INSPECTOR
from app.ui.panels.watch.inspector.panel import InspectorPanel
from app.ui.panels.watch.nodes.panel import PANEL as NODES
from app.ui.panels.watch.nodes.panel import NodesPanel
from app.ui.panels.watch.topics.panel import PANEL as TOPICS
from app.ui.panels.watch.topics.panel import TopicsPanel
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo
from tests.core.networks.fake_networks import Fake
from tests.pseudo import untranslated
from tests.ui.clipping import clipped
from tests.ui.fakes import Session
from tests.ui.panel_case import OUT_OF_SIGHT, Window, ticks
from tests.ui.panels.test_words import rows_of

REASON = "no ROS master replied at '127.0.0.1:11311'; start one with 'roscore'"
Look = Callable[[str], Fake]


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def look(window: Window) -> Look:
    """Function that selects a network kind and returns its fake; its reports are applied at the next tick."""
    made: list[Fake] = []

    def make(*told: object) -> Fake:
        made.append(Fake(*told))  # type: ignore[arg-type]
        return made[-1]

    window.session.shown.networks._create_source = make  # type: ignore[assignment]

    def choose(kind: str) -> Fake:
        window.session.shown.networks.select(kind, "")
        return made[-1]

    return choose


def ros_graph(codec: str = "ros") -> GraphView:
    publisher = PublisherInfo(1, "/arm", (), False, 0, 0, 0, None, None, None)
    ours = SubscriberInfo(2, "own", 3, None)
    infos = (
        TopicInfo("/camera", "sensor_msgs/Image", "image", (publisher,)),
        TopicInfo("/blackboard", "std_msgs/String", codec, (publisher,), (ours,)),
    )
    nodes = (
        NodeInfo("/arm", "arm", "", None, "", "ros", 0),
        NodeInfo("own", "studio", "", None, "", "ros", 0),
    )
    return GraphView(1, 1, {n.id: n for n in nodes}, {t.name: t for t in infos})


def message(topic: str, payload: bytes, seq: int | None = None) -> Message:
    return Message(topic, payload, "json", "json", stamp_ns=None, seq=seq, publisher=1)


def cells(panel: TopicsPanel | NodesPanel, key: str) -> dict[str, object]:
    row = panel.model.index_of(key).row()
    assert row >= 0, key
    return {
        column.name: panel.model.data(panel.model.index(row, place))
        for place, column in enumerate(panel.table.columns)
    }


def tips(panel: TopicsPanel | NodesPanel, key: str) -> dict[str, str]:
    row = panel.model.row_at(panel.model.index_of(key))
    assert row is not None
    return {column.name: column.tip(row) for column in panel.table.columns if column.tip}  # type: ignore[arg-type]


def test_network_column_is_hidden_without_other_networks(qtbot, window: Window, look: Look) -> None:
    panel = window.make(TOPICS)
    qtbot.addWidget(panel)
    assert isinstance(panel, TopicsPanel)
    place = [column.name for column in panel.table.columns].index("network")
    assert panel.table.isColumnHidden(place)
    assert "Network" not in [action.text() for action in panel.table.column_menu().actions()]
    look("zenoh")
    ticks(window, panel, 2)
    assert not panel.table.isColumnHidden(place)
    window.session.shown.networks.deselect("zenoh")
    ticks(window, panel, 2)
    assert panel.table.isColumnHidden(place)


def test_ros_topics_are_listed_with_native_topics_and_mark_unknown_values(
    qtbot, window: Window, look: Look
) -> None:
    panel = window.make(TOPICS)
    qtbot.addWidget(panel)
    assert isinstance(panel, TopicsPanel)
    ros = look("ros")
    ros.tell(GraphReceived(ros_graph(), 0.0))
    ticks(window, panel, 2)
    assert panel.count_label.text() == "15 topics, 9 nodes"
    assert cells(panel, "/blackboard")["network"] == "NEP"
    theirs = cells(panel, "ros /blackboard")
    assert (theirs["topic"], theirs["network"], theirs["type"]) == ("/blackboard", "ROS 1", "String")
    assert (theirs["rate"], theirs["bandwidth"], theirs["loss"]) == ("", "", "unknown on ROS 1")
    told = tips(panel, "ros /blackboard")
    assert "doesn't report this" in told["rate"]
    assert "doesn't count" in told["loss"]
    assert "ROS 1 report neither rates nor losses" in panel.foot.text()
    panel.filter.setText("ros 1 camera")
    assert [panel.model.key_of(row) for row in panel.model._rows.rows] == ["ros /camera"]
    panel.filter.clear()
    panel.table.opened.emit("ros /camera")
    assert window.opened == ["ros /camera"]


def test_messages_of_watched_topics_on_another_network_are_counted_locally(
    qtbot, window: Window, look: Look
) -> None:
    session = window.session
    panel = window.make(TOPICS)
    qtbot.addWidget(panel)
    assert isinstance(panel, TopicsPanel)
    ros = look("ros")
    ros.tell(GraphReceived(ros_graph(), 0.0))
    watch = session.live.watch("ros /blackboard")
    ticks(window, panel, 40)
    for _ in range(60):
        for sink in ros.sinks:
            sink("ros /blackboard", [message("/blackboard", b"1")])
        ticks(window, panel)
    theirs = cells(panel, "ros /blackboard")
    assert 25 < float(str(theirs["rate"])) < 35
    assert (str(theirs["bandwidth"]).partition(" ")[2], theirs["loss"]) == ("B/s", "")
    assert "doesn't report this; Studio measures it" in tips(panel, "ros /blackboard")["rate"]
    watch.close()


def test_rows_of_a_lost_network_are_grey_and_show_the_reason(qtbot, window: Window, look: Look) -> None:
    topics, nodes = window.make(TOPICS), window.make(NODES)
    for each in (topics, nodes):
        qtbot.addWidget(each)
    assert isinstance(topics, TopicsPanel)
    assert isinstance(nodes, NodesPanel)
    ros = look("ros")
    ros.tell(GraphReceived(ros_graph(), 0.0))
    ros.tell(MasterLost("", REASON))
    ticks(window, topics, 2)
    nodes.refresh()
    for panel, key in ((topics, "ros /camera"), (nodes, "ros /arm  ")):
        assert panel.networks.isVisibleTo(panel)
        assert panel.networks.text_label.text() == f"ROS 1: {REASON}."
        assert panel.model.cell_at(panel.model.index_of(key).row(), 0).role == "textDisabled"
    assert topics.model.cell_at(topics.model.index_of("/odom").row(), 0).role == "text"
    topics.networks.button.click()
    assert window.commands == [BrowseNetworks()]
    ros.tell(GraphReceived(ros_graph(), 0.0))
    ticks(window, topics, 2)
    assert not topics.networks.isVisibleTo(topics)
    assert topics.model.cell_at(topics.model.index_of("ros /camera").row(), 0).role == "text"


def test_ros_nodes_show_their_network_and_mark_unknown_values(qtbot, window: Window, look: Look) -> None:
    panel = window.make(NODES)
    qtbot.addWidget(panel)
    assert isinstance(panel, NodesPanel)
    ros = look("ros")
    ros.tell(GraphReceived(ros_graph(), 0.0))
    ticks(window, panel, 2)
    arm = cells(panel, "ros /arm  ")
    assert (arm["node"], arm["generation"], arm["cpu"], arm["publishes"]) == (
        "arm",
        "ROS 1",
        "not reported",
        "2",
    )
    assert "doesn't report" in tips(panel, "ros /arm  ")["cpu"]
    panel.table.opened.emit("ros /arm  ")
    topic = next(row for row in panel.model._rows.rows if row.topic == "/camera")
    assert topic.direction == "publishes"
    panel.table.opened.emit(topic.key)
    assert window.opened == ["ros /camera"]


def test_inspector_shows_messages_of_another_network(qtbot, window: Window, look: Look) -> None:
    panel = window.make(INSPECTOR)
    qtbot.addWidget(panel)
    assert isinstance(panel, InspectorPanel)
    ros = look("ros")
    ros.tell(GraphReceived(ros_graph(), 0.0))
    panel.show_topic("ros /blackboard")
    ticks(window, panel, 2)
    assert panel.subtitle() == "/blackboard on ROS 1"
    assert ros.wanted == {"/blackboard"}
    assert "/blackboard" not in window.session.watched, "the native one of the same name is another topic"
    for sink in ros.sinks:
        sink("ros /blackboard", [message("/blackboard", b'{"x": 7}')])
    ticks(window, panel, 5)
    assert panel.model.value() == {"x": 7}
    assert panel.foot.info.text() == "8 B   ROS 1 doesn't report sequence numbers or latency"
    ros.tell(MasterLost("", REASON))
    ticks(window, panel, 2)
    assert panel.live.accessibleName() == "not responding"
    for _ in range(80):  # connected nodes continue without a master
        for sink in ros.sinks:
            sink("ros /blackboard", [message("/blackboard", b'{"x": 8}')])
        ticks(window, panel)
    assert (panel.live.accessibleName(), panel.model.value()) == ("live", {"x": 8})
    panel.dispose()
    assert ros.wanted == set()


def test_inspector_shows_why_a_topic_cannot_be_decoded(qtbot, window: Window, look: Look) -> None:
    panel = window.make(INSPECTOR)
    qtbot.addWidget(panel)
    assert isinstance(panel, InspectorPanel)
    ros = look("ros2")
    ros.tell(GraphReceived(ros_graph(), 0.0))
    panel.show_topic("ros2 /blackboard")
    ros.tell(WatchFailed("/blackboard", "no type 'my/Own' is known here; install its package"))
    ticks(window, panel, 2)
    said = [each.text() for each in panel.body.empty.findChildren(QLabel) if each.text()]
    assert said[0] == "Can't decode the messages"
    assert said[1] == "/blackboard on ROS 2: no type 'my/Own' is known here; install its package."
    panel.dispose()


def test_image_panel_subscribes_to_a_topic_of_another_network(qtbot, window: Window, look: Look) -> None:
    panel = window.make(IMAGE)
    qtbot.addWidget(panel)
    ros = look("ros")
    ros.tell(GraphReceived(ros_graph(), 0.0))
    panel.show_topic("ros /camera")
    ticks(window, panel, 3)
    assert panel.subtitle() == "/camera on ROS 1"
    assert "/camera" in ros.wanted
    assert "ros /camera" in panel.topics()  # type: ignore[attr-defined]
    panel.dispose()


@pytest.mark.parametrize("panel", [TOPICS, NODES, INSPECTOR], ids=lambda panel: panel.name)
def test_texts_are_translated_and_fit(qtbot, pseudo, window: Window, look: Look, panel) -> None:
    made = window.make(panel)
    qtbot.addWidget(made)
    ros = look("ros")
    ros.tell(GraphReceived(ros_graph(), 0.0))
    made.show_topic("ros /blackboard")
    ticks(window, made, 3)
    ros.tell(MasterLost("", "Ñó ŕóš"))
    ticks(window, made, 3)
    if not isinstance(made, InspectorPanel):
        said = [text for text in rows_of(made.model) if "ROS" in text]  # type: ignore[attr-defined]
        assert len(said) > 5
        data = ("ROS 1", "/camera", "/blackboard", "/arm", "arm", "studio", "std_msgs/String", "String")
        assert [text for text in said if untranslated(text, *data)] == []
        assert [untranslated(made.networks.text_label.text(), "ROS 1")] == [[]]  # type: ignore[attr-defined]
    faults = [fault for fault in clipped(made) if f"at {9 - OUT_OF_SIGHT}," not in fault]  # not the title
    assert faults == []
    made.dispose()
