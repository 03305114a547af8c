from __future__ import annotations

import platform

import pytest
from msgspec.structs import replace
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.core.network.master import MasterState
from app.core.network.nodes import NodeEntry, Nodes
from app.ui.panels.watch.nodes.panel import PANEL, NodesPanel
from app.ui.panels.watch.nodes.rows import (
    NodeRow,
    _name_tip,
    cpu_text,
    details_text,
    generation_cell,
    limits_text,
    name_cell,
)
from app.ui.widgets.table.model import CELL_ROLE
from nep.protocol.graph_view import (
    BRIDGES_TOPIC,
    GraphView,
    NodeInfo,
    PatternInfo,
    PublisherInfo,
    SubscriberInfo,
    TopicInfo,
)
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, press, ticks

NODES = (
    NodeInfo("1", "camera_driver", "lab-pc", 411, "Python", "native", 1, 0.12),
    NodeInfo("2", "rize", platform.node(), 512, "JavaScript", "A", 2, 1.3),
    NodeInfo("3", "studio", platform.node(), 600, "Python", "native", 3, 0.004),
)


def topic(name: str, by: str, to: str = "") -> TopicInfo:
    return TopicInfo(
        name, "json", "json",
        tuple(PublisherInfo(9, id, (), False, 0, 0, 0, None, None, None) for id in by),
        tuple(SubscriberInfo(8, id, 0, 0) for id in to),
    )  # fmt: skip


def graph(revision: int = 1, nodes: tuple[NodeInfo, ...] = NODES) -> GraphView:
    topics = [topic("/robot/camera", "1", "3"), topic("/odom", "1"), topic("robot_action", "2")]
    return GraphView(1, revision, {node.id: node for node in nodes}, {each.name: each for each in topics})


@pytest.fixture
def window(qapp) -> Window:
    made = Window(Session.full())
    made.session.shown.nodes = Nodes()
    made.session.shown.nodes.update(graph(), 0.0)
    return made


@pytest.fixture
def panel(qtbot, window) -> NodesPanel:
    made = window.make(PANEL, (900, 400))
    qtbot.addWidget(made)
    for widget in made.header:
        qtbot.addWidget(widget)
    assert isinstance(made, NodesPanel)
    return made


def shown(panel: NodesPanel) -> list[list[str]]:
    model = panel.model
    names = [column.name for column in panel.table.columns if column.name != "since"]
    places = [place for place, column in enumerate(panel.table.columns) if column.name in names]
    return [[model.data(model.index(row, place)) for place in places] for row in range(model.rowCount())]


def test_every_node_is_listed_with_its_details(panel) -> None:
    here = platform.node()
    assert shown(panel) == [
        ["camera_driver", "native", "Python", "lab-pc", "411", "12 %", "2", "0"],
        ["rize", "NEP up to 0.5.4.5", "JavaScript", here, "512", "130 %", "1", "0"],
        ["studio", "native", "Python", here, "600", "0.4 %", "0", "1"],
    ]


def test_expanded_node_shows_its_topics_and_a_click_opens_a_topic(panel, window) -> None:
    panel.table.select_key(NodeRow(next(iter(window.session.shown.nodes))).key)
    QTest.keyClick(panel.table, Qt.Key.Key_Return)
    assert [line[:2] for line in shown(panel)][:3] == [
        ["camera_driver", "native"],
        ["/odom", "publishes 50.0/s"],
        ["/robot/camera", "publishes 30.0/s"],
    ]
    assert name_cell(NodeRow(window.session.shown.nodes.get("1"), is_expanded=True)).icon == "chevron-down"
    row = panel.table.rowViewportPosition(2)
    QTest.mouseClick(panel.table.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(60, row + 8))
    assert window.opened == ["/robot/camera"]
    QTest.mouseClick(panel.table.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(60, 8))
    assert len(shown(panel)) == 3


def test_arrow_keys_expand_and_collapse(panel, window) -> None:
    panel.table.setFocus(Qt.FocusReason.TabFocusReason)
    QTest.keyClick(panel.table, Qt.Key.Key_Right)
    assert len(shown(panel)) == 5
    QTest.keyClick(panel.table, Qt.Key.Key_Down)
    QTest.keyClick(panel.table, Qt.Key.Key_Right)  # a topic has no children
    assert panel.table.currentIndex().row() == 1
    QTest.keyClick(panel.table, Qt.Key.Key_Return)
    assert window.opened == ["/odom"]
    QTest.keyClick(panel.table, Qt.Key.Key_Left)
    assert len(shown(panel)) == 3
    assert panel.table.selected_key() == NodeRow(window.session.shown.nodes.get("1")).key


def test_node_without_topics_can_be_expanded(panel, window) -> None:
    window.session.shown.nodes.update(graph(2, (*NODES, NodeInfo("4", "idle", "h", 1, "", "native", 1))), 1.0)
    panel.refresh()
    place = [line[0] for line in shown(panel)].index("idle")
    panel.table.opened.emit(panel.model.key_of(panel.model.row_at(panel.model.index(place, 0))))
    assert panel.model.data(panel.model.index(place, 0), CELL_ROLE).icon == "chevron-down"


def test_new_nodes_are_bold_until_expanded_unless_started_by_studio(panel, window) -> None:
    nodes = window.session.shown.nodes
    more = (NodeInfo("4", "arm", "h", 1, "", "native", 1), NodeInfo("5", "Pepper", "h", 1, "", "native", 1))
    window.session.launcher.restart_virtual_robot("Pepper")
    nodes.update(graph(2, (*NODES, *more)), 1.0)
    panel.refresh()

    def chip(name: str) -> str | None:
        place = [line[0] for line in shown(panel)].index(name)
        cell = panel.model.data(panel.model.index(place, 0), CELL_ROLE)
        assert cell.bold is bool(cell.chip)
        return cell.chip  # type: ignore[no-any-return]

    assert (chip("arm"), chip("Pepper"), chip("rize")) == ("new", None, None)
    panel.table.opened.emit(NodeRow(nodes.get("4")).key)
    panel.refresh()
    assert chip("arm") is None


def test_removed_node_is_struck_through_for_ten_seconds(panel, window) -> None:
    nodes = window.session.shown.nodes
    nodes.update(graph(2, NODES[1:]), 1.0)
    nodes.update_ages(5.2)
    panel.refresh()
    line = shown(panel)[0]
    assert (line[0], line[5]) == ("camera_driver", "gone for 4 s")
    cell = panel.model.data(panel.model.index(0, 0), CELL_ROLE)
    assert (cell.is_struck_out, cell.role) == (True, "textDisabled")
    nodes.update_ages(11.1)
    panel.refresh()
    assert [line[0] for line in shown(panel)] == ["rize", "studio"]


def test_limitations_of_a_selected_original_nep_node_are_shown(panel, window) -> None:
    panel.table.select_key(NodeRow(window.session.shown.nodes.get("2")).key)
    assert panel.foot.text().startswith("rize, on this computer, pid 512, JavaScript, running since ")
    assert "up to 0.5.4.5" in panel.foot.text()
    assert "no sequence numbers or time stamps" in panel.foot.text()
    panel.table.select_key(NodeRow(window.session.shown.nodes.get("1")).key)
    assert "no numbers" not in panel.foot.text()
    assert "on lab-pc" in panel.foot.text()


@pytest.mark.parametrize(
    ("generation", "words", "version"),
    [
        ("A", "NEP up to 0.5.4.5", " up to 0.5.4.5."),
        ("B", "NEP 0.5.4.8", " 0.5.4.8."),
        ("C", "NEP C", "NEP."),
    ],
)
def test_nep_generations_have_labels(generation, words, version) -> None:
    node = NodeEntry("1", "old", generation=generation)
    assert generation_cell(NodeRow(node)).text == words
    assert version in limits_text(node)
    assert generation_cell(NodeRow(node)).icon == "plug"
    assert limits_text(NodeEntry("1", "new")) == ""


def test_unsupported_nep_version_is_flagged_with_the_versions_to_install() -> None:
    node = NodeEntry("1", "old", generation="0.5.4.6")
    cell = generation_cell(NodeRow(node))
    assert (cell.text, cell.icon, cell.role) == ("NEP 0.5.4.6", "triangle-alert", "warn")
    assert limits_text(node).endswith("Install 0.5.4.8 or 0.5.4.5.")


def test_unknown_node_details_are_omitted() -> None:
    assert details_text(NodeEntry("1", "bare")) == "bare"
    assert cpu_text(None) == ""
    assert (cpu_text(0.0), cpu_text(0.099), cpu_text(0.0999)) == ("0.0 %", "9.9 %", "10 %")


def test_filter_finds_names_topics_and_languages(panel, window) -> None:
    panel.filter.setText("javascript")
    assert [line[0] for line in shown(panel)] == ["rize"]
    panel.filter.setText("/robot/cam")
    assert [line[0] for line in shown(panel)] == ["camera_driver", "studio"]
    panel.filter.setText("nobody")
    press(button(panel.empty, "Clear the filter"))
    assert len(shown(panel)) == 3


def test_cpu_load_is_updated_when_reported_and_sorted_once_per_second(panel, window) -> None:
    place = [column.name for column in panel.table.columns].index("cpu")
    panel.table.horizontalHeader().sectionClicked.emit(place)
    assert [line[0] for line in shown(panel)] == ["rize", "camera_driver", "studio"]
    busy = NodeInfo("3", "studio", platform.node(), 600, "Python", "native", 3, 2.0)
    window.session.shown.nodes.update(graph(1, (*NODES[:2], busy)), 1.0)
    ticks(window, panel, 2)
    assert shown(panel)[0][0] == "rize"
    ticks(window, panel, 30)
    assert shown(panel)[0][0] == "studio"


@pytest.mark.parametrize(
    ("kind", "words", "pressed"),
    [("none", "No master is running", "Start a master here"), ("connected", "No nodes yet", None)],
)
def test_empty_nodes_panel_names_the_cause_and_can_start_a_master(qtbot, qapp, kind, words, pressed) -> None:
    window = Window(Session())
    window.session.live.master = MasterState(kind, window.session.live.master.address)
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    assert isinstance(panel, NodesPanel)
    assert panel.empty.isVisible()
    assert panel.empty._title.text() == words
    if pressed is not None:
        press(button(panel.empty, pressed))
        assert window.session.launcher.masters_asked_for == 1


def test_sort_order_and_columns_are_restored_with_the_layout(qtbot, panel, window) -> None:
    panel.table.choice.show("pid", False)
    panel.table.horizontalHeader().sectionClicked.emit(3)
    again = window.make(PANEL, (900, 400))
    qtbot.addWidget(again)
    again.restore_state(panel.save_state())
    assert isinstance(again, NodesPanel)
    assert again.table.order.column is again.table.columns[3]
    assert again.save_state() == panel.save_state()


def test_bridge_is_labelled_and_refers_to_its_counters(panel, window) -> None:
    bridge = NodeInfo("7", "bridge-lab-to-ros", "lab-pc", 9, "Python", "native", 1, 0.02)
    view = graph(2, (*NODES, bridge))
    told = {**view.topics, BRIDGES_TOPIC: topic(BRIDGES_TOPIC, "7"), "/chat": topic("/chat", "7", "7")}
    window.session.shown.nodes.update(replace(view, topics=told), 1.0)
    panel.refresh()
    assert [line[:2] for line in shown(panel) if line[0] == bridge.name] == [["bridge-lab-to-ros", "bridge"]]
    assert generation_cell(NodeRow(window.session.shown.nodes.get("7"))).icon == "arrow-left-right"
    panel.table.select_key(NodeRow(window.session.shown.nodes.get("7")).key)
    assert "A bridge that forwards topics between this network and others." in panel.foot.text()
    assert BRIDGES_TOPIC in panel.foot.text()
    assert [each.is_bridge for each in window.session.shown.nodes] == [False, False, False, True]
    panel.filter.setText("bridge")
    panel.refresh()
    panel.rebuild()
    assert [line[0] for line in shown(panel)] == [bridge.name]


def test_wildcard_subscription_is_listed_at_its_node_and_not_as_a_topic(panel, window) -> None:
    wide = PatternInfo("/robot/*/camera", "image", (SubscriberInfo(7, "3", 0, 0),))
    window.session.shown.nodes.update(replace(graph(2), patterns={wide.name: wide}), 1.0)
    window.session.shown.topics.update(replace(graph(2), patterns={wide.name: wide}), 1.0)
    ticks(window, panel, 2)
    panel.table.opened.emit("3  ")
    row = next(row for row in panel.model._rows.rows if row.topic == wide.name)
    assert generation_cell(row).text == "all matching topics"
    assert _name_tip(row) == "studio subscribes to all topics that match /robot/*/camera"
    panel.table.opened.emit(row.key)
    assert window.opened == []
    assert window.toasts == ["/robot/*/camera has wildcards and matches several topics"]
    assert wide.name not in window.session.shown.topics
