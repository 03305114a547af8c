from __future__ import annotations

import platform
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QContextMenuEvent, QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMenu, QWidget

from app.core.graph.activity import QUIET_TIMEOUT_S
from app.core.graph.layout import GraphLayout, LayoutSizes
from app.core.graph.node_graph import DrawnNode, GraphLine, NodeGraph
from app.core.graph.walk import GraphSelection
from app.core.network.master import MasterState
from app.ui.intents import PublishMessage, RecordTopic, SelectService
from app.ui.panels.row_actions import departure_alarm, silence_alarm
from app.ui.panels.watch.graph.panel import DOT_KIND, PANEL, SVG_KIND, GraphPanel
from app.ui.panels.watch.graph.scene import GraphScene
from app.ui.panels.watch.graph.texts import line_width, short_rate
from nep.protocol.graph_view import (
    ClientInfo,
    GraphView,
    NodeInfo,
    PublisherInfo,
    ServerInfo,
    ServiceInfo,
    SubscriberInfo,
    TopicInfo,
)
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, press

HERE = platform.node()
NODES = tuple(
    NodeInfo(id, name, host, 100, "Python", generation, number, 0.012)
    for number, (id, name, host, generation) in enumerate(
        (
            ("1", "pepper_driver", "pepper", "native"),
            ("2", "blackboard", HERE, "native"),
            ("3", "program greeting", HERE, "native"),
            ("4", "studio", HERE, "native"),
            ("5", "RIZE", HERE, "B"),
        )
    )
)


def topic(name: str, by: str, to: str, rate: float, count: int, lost: int = 0) -> TopicInfo:
    return TopicInfo(
        name, "json", "json",
        tuple(PublisherInfo(9, id, (), False, count, 10 * count, count, 1, rate, rate * 500) for id in by),
        tuple(SubscriberInfo(8, id, count, lost) for id in to),
        rate, rate * 500, 1, lost, lost / count,
    )  # fmt: skip


def graph(revision: int = 1, count: int = 100, nodes: tuple[NodeInfo, ...] = NODES) -> GraphView:
    topics = (
        topic("/touch", "1", "2", 20.0, count),
        topic("/blackboard", "2", "34", 10.0, count, lost=2),
        topic("robot_action", "35", "1", 0.5, count),
        topic("/nep/log", "1235", "4", 1.0, count),
    )
    service = ServiceInfo(
        "remember", "", (ServerInfo(1, "2", (), 7, 1, 9),), (ClientInfo(1, "4", 6, 1),), 7, 1
    )
    there = {node.id for node in nodes}
    kept = [
        replace(
            each,
            publishers=tuple(one for one in each.publishers if one.node_id in there),
            subscribers=tuple(one for one in each.subscribers if one.node_id in there),
        )
        for each in topics
    ]
    return GraphView(
        1,
        revision,
        {node.id: node for node in nodes},
        {each.name: each for each in kept if each.publishers},
        services={"remember": service},
    )


@pytest.fixture
def window(qapp) -> Window:
    made = Window(Session())
    made.session.live.master = MasterState("connected", "127.0.0.1:7780")
    show(made, graph())
    return made


@pytest.fixture
def panel(qtbot, window: Window) -> Iterator[GraphPanel]:
    made = window.make(PANEL, (1376, 748))
    qtbot.addWidget(made)
    assert isinstance(made, GraphPanel)
    settle(qtbot, made)
    yield made
    made.dispose()


def show(window: Window, view: GraphView) -> None:
    window.session.live.source.tell(view)
    window.session.take_over()


def settle(qtbot, panel: GraphPanel) -> None:
    """Wait until the requested graph is laid out and shown."""
    panel.refresh()

    def is_there() -> bool:
        panel.refresh()
        scene = panel.canvas.scene
        is_shown = scene is not None and scene.graph == panel._requested_graph
        return not panel._thread.is_busy and is_shown and not panel.canvas._pending_items

    qtbot.waitUntil(is_there, timeout=60_000)


def key_of(panel: GraphPanel, name: str) -> str:
    assert panel.canvas.scene is not None
    return next(node.key for node in panel.canvas.scene.graph.nodes if node.name == name)


def names(panel: GraphPanel) -> set[str]:
    assert panel.canvas.scene is not None
    return {node.name for node in panel.canvas.scene.graph.nodes}


def at(panel: GraphPanel, place: QPointF) -> QPoint:
    """Convert a scene position to canvas pixels."""
    canvas = panel.canvas
    return ((place - canvas.visible_rect().topLeft()) * canvas.scale).toPoint()


def middle(panel: GraphPanel, name: str) -> QPoint:
    assert panel.canvas.scene is not None
    return at(panel, panel.canvas.scene.nodes[key_of(panel, name)].rect.center())


def click(widget: QWidget, place: QPoint) -> None:
    QTest.mouseClick(widget, Qt.MouseButton.LeftButton, pos=place)


def words_at(panel: GraphPanel) -> set[str]:
    assert panel.canvas.scene is not None
    return {item.stats.label for item in panel.canvas.scene.lines}


def test_graph_shows_nodes_edges_and_rates(panel: GraphPanel) -> None:
    assert panel.count.text() == "5 nodes, 3 topics, 1 service"
    assert names(panel) == {"pepper_driver", "blackboard", "greeting", "studio", "RIZE"}
    assert words_at(panel) == {"/touch 20/s", "/blackboard 10/s", "robot_action 0.5/s", "remember"}
    scene = panel.canvas.scene
    assert scene is not None
    lines = {item.node.name: item.elided_detail for item in scene.nodes.values()}
    assert lines == {
        "pepper_driver": "Python, 1.2 %", "blackboard": "Python, 1.2 %", "greeting": "behaviour, 1.2 %",
        "studio": "this window", "RIZE": "NEP 0.5.4.8",
    }  # fmt: skip
    assert {item.name for item in scene.groups} == {"This computer", "pepper"}
    assert all(item.label is not None for item in scene.lines if item.line.kind == "topic")


def scene_with_edge_at_the_left(panel: GraphPanel, topic: str, **others: tuple[float, float]) -> GraphScene:
    """Return a graph with an edge from a to b along its left border, and other nodes at these positions."""
    line = GraphLine("topic", ("a",), ("b",), (topic,))
    positions = {"a": (0.0, 0.0), "b": (250.0, 200.0), **others}
    layout = GraphLayout(
        positions, routes={(line.key, "a", "b"): ((-100.0, 24.0), (-100.0, 200.0), (174.0, 200.0))}
    )
    graph = NodeGraph(tuple(DrawnNode(key, key, "", "program") for key in positions), (line,))
    scene = GraphScene(panel.theme, graph, layout, LayoutSizes(), HERE)
    scene.complete(panel._stats_of)
    return scene


def test_edge_labels_are_within_the_bounds_and_do_not_overlap_nodes(panel: GraphPanel) -> None:
    scene = scene_with_edge_at_the_left(panel, "/Pepper/battery_of_the_robot")
    label = scene.lines[0].label
    assert label is not None
    assert scene.bounds.contains(label)
    assert not any(item.rect.intersects(label) for item in scene.nodes.values())


def test_edge_label_without_room_within_the_bounds_is_not_drawn(panel: GraphPanel) -> None:
    topic = "/Pepper/battery_of_the_robot_and_its_charging_station"  # longer than the horizontal segment
    scene = scene_with_edge_at_the_left(panel, topic, c=(0.0, 60.0), d=(0.0, 120.0), e=(0.0, 180.0))
    assert scene.lines[0].label is None


def test_only_changed_items_are_repainted(panel: GraphPanel, window: Window, qtbot) -> None:
    def renewed() -> int:
        panel.canvas.schedule_update()
        return panel.canvas.update_stats(panel._stats_of)

    def rests() -> bool:
        painted = panel.canvas.paint_count
        qtbot.wait(1)
        return panel.canvas.paint_count == painted

    qtbot.waitUntil(rests)
    painted = panel.canvas.paint_count
    show(window, graph())  # an unchanged graph
    assert renewed() == 0
    panel.refresh()
    qtbot.wait(1)
    assert panel.canvas.paint_count == painted
    more = graph()
    touch = replace(more.topics["/touch"], rate_hz=31.0)
    show(window, replace(more, topics={**more.topics, "/touch": touch}))
    assert renewed() == 1
    qtbot.waitUntil(lambda: panel.canvas.paint_count > painted)
    assert "/touch 31/s" in words_at(panel)


def test_items_outside_the_viewport_are_updated_when_scrolled_into_view(
    panel: GraphPanel, window: Window
) -> None:
    panel.canvas.zoom_to(3.0)
    panel.canvas.move_by(20_000, 0)
    more = graph()
    touch = replace(more.topics["/touch"], rate_hz=31.0)
    show(window, replace(more, topics={**more.topics, "/touch": touch}))
    panel.refresh()
    assert "/touch 20/s" in words_at(panel)
    panel.canvas.show_all()
    panel.refresh()
    assert "/touch 31/s" in words_at(panel)


def test_click_on_an_edge_shows_its_topic_and_inspect_opens_the_topic(
    panel: GraphPanel, window: Window
) -> None:
    scene = panel.canvas.scene
    assert scene is not None
    item = next(each for each in scene.lines if each.line.topics == ("/blackboard",))
    assert item.label is not None
    click(panel.canvas, at(panel, item.label.center()))
    assert panel.canvas.selection == GraphSelection("topic", "/blackboard", key_of(panel, "blackboard"))
    content = panel.card.content
    assert content is not None
    assert (content.title, content.kind) == ("/blackboard", "json")
    assert [figure.value for figure in content.stats] == ["10.0 /s", "5.0 kB/s", "2.0 %", ""]
    assert [[row[1:] for row in table.rows] for table in content.tables] == [
        [("blackboard", ("10.0", "100"))],
        [("greeting", ("100", "2")), ("studio", ("100", "2"))],
    ]
    assert panel.card.isVisible()
    press(panel.card.record)
    assert window.commands == [RecordTopic("/blackboard")]
    press(panel.card.inspect)
    assert window.opened == ["/blackboard"]
    press(panel.card.plot)
    assert window.plotted == [("/blackboard", "")]
    press(panel.card.alarm)
    assert window.commands == [RecordTopic("/blackboard"), silence_alarm("/blackboard")]
    press(panel.card.close_button)
    assert panel.canvas.selection is None
    assert not panel.card.isVisible()


def test_double_click_on_an_edge_opens_its_topic(panel: GraphPanel, window: Window) -> None:
    scene = panel.canvas.scene
    assert scene is not None
    item = next(each for each in scene.lines if each.line.topics == ("/touch",))
    points = next(iter(item.routes.values()))
    half = QPointF((points[0][0] + points[1][0]) / 2, (points[0][1] + points[1][1]) / 2)
    QTest.mouseDClick(panel.canvas, Qt.MouseButton.LeftButton, pos=at(panel, half))
    assert window.opened == ["/touch"]


def test_node_card_links_to_its_topics(panel: GraphPanel, window: Window) -> None:
    click(panel.canvas, middle(panel, "blackboard"))
    content = panel.card.content
    assert content is not None
    assert [(table.title, [row[1] for row in table.rows]) for table in content.tables] == [
        ("Publishes", ["/blackboard"]),
        ("Subscribes", ["/touch"]),
        ("Serves", ["remember"]),
    ]
    assert not panel.card.inspect.isVisible()
    assert not panel.card.plot.isVisible()
    press(panel.card.alarm)
    assert window.commands == [departure_alarm("blackboard")]
    press(button(panel.card, "/touch"))
    assert panel.canvas.selection == GraphSelection("topic", "/touch")
    press(button(panel.card, "pepper_driver"))
    assert panel.canvas.selection == GraphSelection("node", key_of(panel, "pepper_driver"))
    assert window.opened == []


def test_service_card_shows_its_details(panel: GraphPanel) -> None:
    panel.canvas.select(GraphSelection("topic", "remember"))
    content = panel.card.content
    assert content is not None
    assert [(figure.title, figure.value) for figure in content.stats] == [("Calls", "7"), ("Errors", "1")]
    assert not panel.card.button_row.isVisible()
    panel.canvas.opened.emit("remember")  # Enter: a service can't be inspected


def menu_at(panel: GraphPanel, place: QPoint, *, by_keys: bool = False) -> QMenu:
    """Return the context menu that a right click or the menu key opens at a canvas position."""
    reasons = QContextMenuEvent.Reason
    reason = reasons.Keyboard if by_keys else reasons.Mouse
    event = QContextMenuEvent(reason, place, panel.canvas.mapToGlobal(place))
    QApplication.sendEvent(panel.canvas, event)
    menu = QApplication.activePopupWidget()
    assert isinstance(menu, QMenu)
    menu.close()
    return menu


def run_all(menu: QMenu) -> list[str]:
    """Trigger every action of a menu and return their texts."""
    words = [action.text() for action in menu.actions()]
    for action in menu.actions():
        action.trigger()
    return words


@pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
def test_context_menu_of_an_edge_lists_the_commands_of_its_topic(panel: GraphPanel, window: Window) -> None:
    scene = panel.canvas.scene
    assert scene is not None
    item = next(each for each in scene.lines if each.line.topics == ("/blackboard",))
    assert item.label is not None
    words = run_all(menu_at(panel, at(panel, item.label.center())))
    assert words == [
        "Show messages", "Open in another panel", "Plot a field", "Publish to this topic",
        "New alarm", "Record topic", "Copy name",
    ]  # fmt: skip
    assert panel.canvas.selection == GraphSelection("topic", "/blackboard", key_of(panel, "blackboard"))
    assert (window.opened, window.beside, window.plotted) == (
        ["/blackboard"], ["/blackboard"], [("/blackboard", "")],
    )  # fmt: skip
    assert window.commands == [
        PublishMessage("/blackboard"),
        silence_alarm("/blackboard"),
        RecordTopic("/blackboard"),
    ]
    assert QGuiApplication.clipboard().text() == "/blackboard"
    assert run_all(panel.menu_of(GraphSelection("topic", "remember"))) == ["Call service", "Copy name"]
    assert window.commands[-1] == SelectService("remember")


@pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
def test_menu_key_opens_the_menu_of_the_selected_node(panel: GraphPanel, window: Window) -> None:
    panel.canvas.select(GraphSelection("node", key_of(panel, "pepper_driver")))
    assert run_all(menu_at(panel, QPoint(1, 1), by_keys=True)) == ["New alarm", "Copy name"]
    assert window.commands == [departure_alarm("pepper_driver")]


def test_edge_with_several_topics_has_a_submenu_for_each(qtbot, panel: GraphPanel, window: Window) -> None:
    more = graph(2)
    twin = replace(more.topics["/touch"], name="/touch&go")
    show(window, replace(more, topics={**more.topics, twin.name: twin}))
    settle(qtbot, panel)
    assert panel.canvas.scene is not None
    line = panel.canvas.scene.graph.line_of(twin.name)
    assert line is not None
    assert set(line.topics) == {"/touch", "/touch&go"}
    menu = panel.menu_of(GraphSelection("topic", twin.name))
    assert [action.text() for action in menu.actions()] == ["/touch&&go", "/touch"]
    part = menu.actions()[0].menu()
    assert isinstance(part, QMenu)
    run_all(part)
    assert window.commands == [
        PublishMessage("/touch&go"),
        silence_alarm("/touch&go"),
        RecordTopic("/touch&go"),
    ]


@pytest.mark.parametrize("rate", [float("nan"), float("inf"), 0.0, 2.0**64, -1.0])
def test_extreme_and_invalid_rates_and_counts_do_not_break_the_graph(
    panel: GraphPanel, window: Window, rate: float
) -> None:
    more = graph()
    odd = replace(more.topics["/touch"], rate_hz=rate, bandwidth_Bps=rate, loss_ratio=rate, lost=2**64 - 1)
    odd = replace(
        odd, publishers=tuple(replace(each, rate_hz=rate, last_seq=2**64 - 1) for each in odd.publishers)
    )
    show(window, replace(more, topics={**more.topics, "/touch": odd}))
    panel.canvas.select(GraphSelection("topic", "/touch"))
    panel.refresh()
    panel.canvas.grab()
    assert panel.card.content is not None
    assert any(words.startswith("/touch") for words in words_at(panel))


def test_theme_change_keeps_the_layout_and_larger_text_recomputes_the_layout(
    panel: GraphPanel, window: Window, qtbot
) -> None:
    scene = panel.canvas.scene
    window.theme.set_mode("dark")
    panel.refresh()
    assert panel.canvas.scene is scene
    window.theme.set_text_percent(150)
    settle(qtbot, panel)
    assert panel.canvas.scene is not scene
    node = panel.canvas.scene.nodes[key_of(panel, "RIZE")]  # type: ignore[union-attr]
    assert node.rect.width() == 228


def test_arrow_keys_move_along_edges_and_announce_the_selection(panel: GraphPanel, window: Window) -> None:
    canvas = panel.canvas
    canvas.select(GraphSelection("node", key_of(panel, "pepper_driver")))
    QTest.keyClick(canvas, Qt.Key.Key_Right)
    assert canvas.selection is not None
    assert canvas.selection.key == "/touch"
    assert canvas.accessibleDescription() == "/touch, 20/s, 10 kB/s, from pepper_driver to blackboard"
    QTest.keyClick(canvas, Qt.Key.Key_Right)
    assert canvas.selection.key == key_of(panel, "blackboard")
    assert canvas.accessibleDescription().startswith("blackboard, Python, 1.2 %. Outgoing lines: 1.")
    QTest.keyClick(canvas, Qt.Key.Key_Right)
    QTest.keyClick(canvas, Qt.Key.Key_Return)
    assert window.opened == ["/blackboard"]
    QTest.keyClick(canvas, Qt.Key.Key_Escape)
    assert canvas.selection is None


def test_enter_on_a_node_moves_focus_into_its_card(panel: GraphPanel) -> None:
    panel.canvas.select(GraphSelection("node", key_of(panel, "studio")))
    panel.activateWindow()
    panel.canvas.setFocus()
    QTest.keyClick(panel.canvas, Qt.Key.Key_Return)
    assert panel.card.first_focus_widget().accessibleName() == "/blackboard"


def test_filter_dims_items_that_do_not_match(panel: GraphPanel) -> None:
    panel.canvas.setFocus()
    QTest.keyClick(panel.canvas, Qt.Key.Key_Slash)
    panel.tools.filter.setText("TOUCH")
    scene = panel.canvas.scene
    assert scene is not None
    faded = {item.node.name for item in scene.nodes.values() if item.is_dim}
    assert faded == {"greeting", "studio", "RIZE"}
    assert {item.line.topics[0] for item in scene.lines if not item.is_dim} >= {"/touch"}
    panel.tools.filter.clear()
    assert scene.dimmed_count == 0


def test_idle_nodes_are_hidden_after_a_minute_and_shown_by_a_button(
    panel: GraphPanel, window: Window, qtbot, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [time.monotonic()]
    monkeypatch.setattr("app.ui.panels.watch.graph.panel.time.monotonic", lambda: now[0])
    panel._update_quiet_nodes()
    now[0] += QUIET_TIMEOUT_S + 1
    more = graph(count=200)
    show(window, replace(more, topics={**more.topics, "robot_action": graph().topics["robot_action"]}))
    panel._update_quiet_nodes()
    settle(qtbot, panel)
    assert panel.tools.quiet.text() == "1 quiet node hidden"
    assert names(panel) == {"pepper_driver", "blackboard", "greeting", "studio"}
    assert panel.count.text() == "4 of 5 nodes, 3 topics, 1 service"
    scene = panel.canvas.scene
    assert scene is not None
    chip = next(item.quiet_rect for item in scene.groups if item.quiet_rect is not None)
    click(panel.canvas, at(panel, chip.center()))
    settle(qtbot, panel)
    assert "RIZE" in names(panel)
    QTest.keyClick(panel.canvas, Qt.Key.Key_H)
    QTest.keyClick(panel.canvas, Qt.Key.Key_H)
    settle(qtbot, panel)
    assert "RIZE" not in names(panel)
    press(panel.tools.quiet)
    settle(qtbot, panel)
    assert "RIZE" in names(panel)


def test_large_scene_is_built_in_one_tick_and_painted_in_the_next(
    panel: GraphPanel, window: Window, qtbot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.ui.panels.watch.graph.panel.MAX_LINES_PER_TICK", 0)
    before = panel.canvas.scene
    show(window, graph(revision=2, nodes=NODES[:-1]))

    def is_coming() -> bool:
        panel.refresh()
        return panel._pending_scene is not None

    qtbot.waitUntil(is_coming, timeout=60_000)
    coming = panel._pending_scene
    assert panel.canvas.scene is before
    panel.refresh()
    assert (panel.canvas.scene, panel._pending_scene) == (coming, None)
    assert coming is not None
    assert coming.graph == panel._requested_graph


def test_click_toggles_a_group_and_keys_change_grouping_and_services(panel: GraphPanel, qtbot) -> None:
    scene = panel.canvas.scene
    assert scene is not None
    head = next(item.rect for item in scene.groups if item.name == "This computer")
    click(panel.canvas, at(panel, head.topLeft() + QPointF(30, 14)))
    settle(qtbot, panel)
    assert names(panel) == {"pepper_driver", HERE}
    box = panel.canvas.scene.nodes[f"host:{HERE}"]  # type: ignore[union-attr]
    assert (box.name, box.elided_detail) == ("This computer", "4 nodes")
    click(panel.canvas, at(panel, box.rect.center()))
    settle(qtbot, panel)
    assert len(names(panel)) == 5
    QTest.keyClick(panel.canvas, Qt.Key.Key_G)
    settle(qtbot, panel)
    assert panel.tools.group.value == "robot"
    QTest.keyClick(panel.canvas, Qt.Key.Key_S)
    settle(qtbot, panel)
    assert panel.count.text() == "5 nodes, 3 topics"
    assert panel.save_state() == {"group_by": "robot", "services": False, "hides_quiet": True, "own": False}


def test_view_options_are_restored_and_invalid_state_is_ignored(panel: GraphPanel) -> None:
    panel.restore_state({"group_by": "nothing", "services": False, "hides_quiet": False, "own": True})
    assert panel.save_state() == {"group_by": "nothing", "services": False, "hides_quiet": False, "own": True}
    panel.restore_state({"group_by": 7, "services": "no", "hides_quiet": None, "own": 1})
    assert panel.save_state() == {"group_by": "nothing", "services": False, "hides_quiet": False, "own": True}


def test_positions_are_stable_when_nodes_leave_and_join(panel: GraphPanel, window: Window, qtbot) -> None:
    def places() -> dict[str, tuple[float, float]]:
        assert panel.canvas.scene is not None
        return {key: item.rect.center().toTuple() for key, item in panel.canvas.scene.nodes.items()}

    before = places()
    show(window, graph(2, nodes=NODES[:-1]))
    settle(qtbot, panel)
    scene = panel.canvas.scene
    assert scene is not None
    gone = scene.nodes[key_of(panel, "RIZE")]
    assert gone.node.is_gone
    assert gone.elided_detail == "gone for 0 s"
    show(
        window,
        graph(3, nodes=(*NODES[:-1], replace(NODES[-1], id="55"), replace(NODES[1], id="66", name="new"))),
    )
    settle(qtbot, panel)
    assert {key: place for key, place in places().items() if key in before} == before
    assert len(places()) == 6


def test_groups_of_a_graph_with_many_nodes_are_collapsed_initially(qtbot, window: Window) -> None:
    many = tuple(NodeInfo(f"{n:x}", f"n{n}", f"host{n % 3}", 1, "", "native", n) for n in range(1, 202))
    show(window, GraphView(1, 2, {node.id: node for node in many}))
    window.session.shown.nodes.update_ages(window.session.clock() + 100)
    window.session.shown.topics.update_ages(window.session.clock() + 100, 0)
    made = window.make(PANEL, (900, 600))
    qtbot.addWidget(made)
    assert isinstance(made, GraphPanel)
    settle(qtbot, made)
    scene = made.canvas.scene
    assert scene is not None
    assert {item.elided_detail for item in scene.nodes.values()} == {"67 nodes"}
    made.dispose()


def test_graph_is_panned_and_zoomed(panel: GraphPanel) -> None:
    canvas = panel.canvas
    fits = canvas.scale
    assert canvas.visible_rect().contains(canvas.scene.bounds)  # type: ignore[union-attr]
    QTest.keyClick(canvas, Qt.Key.Key_Plus)
    assert canvas.scale == pytest.approx(fits * 1.2)
    for _ in range(40):
        canvas.zoom_by(1.2)
    assert canvas.scale == 3.0
    assert panel.tools.scale.text() == "300 %"
    assert panel.overview.isVisible()
    left = canvas.visible_rect().left()
    QTest.keyClick(canvas, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)
    assert canvas.visible_rect().left() == pytest.approx(left + 20)
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=QPoint(100, 100))
    QTest.mouseMove(canvas, QPoint(160, 130))
    QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=QPoint(160, 130))
    assert canvas.selection is None
    for _ in range(80):
        canvas.zoom_by(1 / 1.2)
    assert canvas.scale == 0.05
    press(panel.tools.show_all_button)
    assert canvas.scale == fits
    assert not panel.overview.isVisible()


def test_click_in_the_overview_moves_the_viewport(panel: GraphPanel) -> None:
    panel.canvas.zoom_to(3.0)
    scene = panel.canvas.scene
    assert scene is not None
    scale, offset = panel.overview._fit_transform(scene)
    wanted = scene.nodes[key_of(panel, "pepper_driver")].rect.center()
    click(panel.overview, (wanted * scale + offset).toPoint())
    assert panel.canvas.visible_rect().contains(wanted)


def test_card_is_placed_below_the_graph_when_space_is_narrow(panel: GraphPanel, qtbot) -> None:
    panel.show_topic("/blackboard")
    panel.resize(460, 700)
    qtbot.waitUntil(lambda: panel.card.y() > panel.canvas.y())
    panel.resize(1376, 748)
    qtbot.waitUntil(lambda: panel.card.x() > panel.canvas.width() - 4)


def test_svg_and_dot_are_exported(panel: GraphPanel, window: Window, tmp_path: Path) -> None:
    panel.save(tmp_path / "graph.svg", SVG_KIND)
    panel.save(tmp_path / "graph.dot", DOT_KIND)
    assert window.toasts == ["Saved graph.svg", "Saved graph.dot"]
    root = ET.parse(tmp_path / "graph.svg").getroot()
    said = {"".join(each.itertext()).strip() for each in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {"blackboard", "greeting", "This computer", "/touch", "20/s"} <= said
    dot = (tmp_path / "graph.dot").read_text("utf-8")
    assert 'label="/blackboard 10/s"' in dot
    assert dot.count("subgraph cluster_") == 2
    panel.save(tmp_path / "graph.svg" / "graph.svg", SVG_KIND)
    assert window.toasts[-1].startswith("Can't save the graph: ")


def test_export_menu_opens_a_file_dialog(panel: GraphPanel, window: Window, tmp_path: Path) -> None:
    actions = {action.text(): action for action in panel._export_menu.actions()}
    window.answers.path = tmp_path / "mine.dot"
    actions["Graph (DOT)"].trigger()
    assert window.answers.asked == [f"Export the graph: {Path.home() / 'graph'}"]
    assert window.toasts == ["Saved mine.dot"]
    assert set(actions) == {"Image (SVG)", "Graph (DOT)"}


def test_empty_graph_suggests_next_steps(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.live.master = MasterState("connected", "127.0.0.1:7780")
    made = window.make(PANEL)
    qtbot.addWidget(made)
    assert isinstance(made, GraphPanel)
    press(button(made, "Open the connection doctor"))
    assert window.asked_why == [(made, "")]
    assert made.to_svg() == b""
    made.canvas.show_scene(GraphScene(made.theme, NodeGraph(), GraphLayout(), LayoutSizes(), "here"))
    assert made.to_svg() == b"", "also once nothing was laid out"
    made.save(Path("nowhere.svg"), SVG_KIND)
    assert window.toasts == []
    window.session.live.master = MasterState("none", "127.0.0.1:7780")
    made.refresh()
    button(made, "Start a master here")
    made.dispose()


@pytest.mark.parametrize(
    ("rate", "words"),
    [
        (0.0, "0/s"),
        (0.001, "0/s"),
        (0.0334, "2/min"),
        (0.1, "0.1/s"),
        (9.96, "10/s"),
        (1e6, "1\u2009000\u2009000/s"),
    ],
)
def test_rates_are_abbreviated(rate: float, words: str) -> None:
    assert short_rate(rate) == words


@pytest.mark.parametrize(
    ("sent", "width"),
    [(0.0, 1.25), (-1.0, 1.25), (float("nan"), 1.25), (100.0, 1.25), (1e7, 3.0), (float("inf"), 3.0)],
)
def test_edge_width_follows_the_sent_bandwidth(sent: float, width: float) -> None:
    assert line_width(sent) == pytest.approx(width)
