"""Tests of the parameters of the selected node in Nodes: live values, setting and rejected input."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

import nep
from app.core.networks.parameters import ReportedParameter
from app.ui.panels.watch.nodes.panel import PANEL, NodesPanel
from app.ui.panels.watch.nodes.parameters import CHOICE, LINE, allowed_values_text
from nep.messages.message import Message
from nep.patterns.parameters.node_parameters import parameters_topic
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, ServerInfo, ServiceInfo, TopicInfo
from tests.pseudo import untranslated
from tests.ui.clipping import clipped
from tests.ui.fakes import Session
from tests.ui.panel_case import OUT_OF_SIGHT, Window, ticks
from tests.ui.panels.test_words import said_by


class World:
    """Robot with parameters on a network in memory, and the Nodes panel."""

    def __init__(self, window: Window, robot: nep.Node) -> None:
        self.window, self.robot = window, robot
        self.panel = window.make(PANEL)
        assert isinstance(self.panel, NodesPanel)
        self.part = self.panel.parameters

    def hear(self) -> None:
        """Pass the robot's latched parameters to the session and refresh the panel."""
        topic = parameters_topic(self.robot.id)
        with self.window.session.live.source.node.new_sub(topic, "json") as kept:
            message = kept.receive(60.0)
        assert message is not None
        self.window.session.live.source.send(
            Message(topic, bytes(message.data), "json", "json", seq=message.seq)
        )
        ticks(self.window, self.panel, 2)

    def choose(self, node: str) -> None:
        row = next(row for row in self.panel.model._rows.rows if row.node.name == node)
        self.panel.table.select_key(row.key)
        ticks(self.window, self.panel, 2)

    def settle(self, qtbot) -> None:
        """Wait until the robot has replied, then update the panel with its parameters."""
        qtbot.waitUntil(lambda: self._refreshed() == "", timeout=60_000)
        self.hear()

    def _refreshed(self) -> str:
        ticks(self.window, self.panel)
        return self.panel._parameters.pending_name

    def cells(self) -> list[tuple[str, ...]]:
        model = self.part.model
        return [
            tuple(str(model.data(model.index(row, column))) for column in range(3))
            for row in range(model.rowCount())
        ]


def graph(robot: nep.Node, *, may_set: bool = True) -> GraphView:
    place = parameters_topic(robot.id)
    told = PublisherInfo(1, robot.id, (), True, 1, 1, 1, None, None, None)
    nodes = (
        NodeInfo(robot.id, "robot", "", 7, "Python", "native", 5),
        NodeInfo("b", "bare", "", 8, "", "native", 5),
    )
    served = {place: ServiceInfo(place, "json", (ServerInfo(1, robot.id, (), 0, 0, 0),))} if may_set else {}
    return GraphView(
        1, 1, {n.id: n for n in nodes}, {place: TopicInfo(place, "json", "json", (told,))}, services=served
    )


@pytest.fixture
def robot(qapp, request: pytest.FixtureRequest) -> Iterator[tuple[Window, nep.Node]]:
    session = Session()
    with nep.node("robot", "memory", master=session.live.source._master) as node:
        node.parameters.declare("speed", 0.5, min=0, max=2, description="in m/s")
        node.parameters.declare("gait", "walk", choices=("walk", "run"))
        node.parameters.declare("lights", True)
        node.parameters.declare("serial", "7", read_only=True)
        node.parameters.declare("<b>long</b>", "x" * 5000)
        session.live.source.find_master()
        session.live.source.tell(graph(node))
        session.take_over()
        yield Window(session), node


@pytest.fixture
def world(qtbot, robot: tuple[Window, nep.Node]) -> Iterator[World]:
    made = World(*robot)
    qtbot.addWidget(made.panel)
    made.choose("robot")
    made.hear()
    yield made
    made.panel.dispose()


def test_parameters_are_shown_with_their_allowed_values(world: World) -> None:
    assert world.part.isVisibleTo(world.panel)
    assert world.part.title.text() == "Parameters of robot"
    assert world.cells()[:4] == [
        ("speed", "0.5", "0 to 2"),
        ("gait", "walk", "walk or run"),
        ("lights", "true", ""),
        ("serial", "7", "read-only"),
    ]
    assert world.cells()[4][1].endswith("x… (5000 characters)")
    assert len(world.cells()[4][1]) < 250
    assert world.window.session.watched == [parameters_topic(world.robot.id)]
    assert world.part.status_label.text() == "Choose a parameter to change its value."


def test_value_is_set_with_return_and_rejected_input_is_kept(qtbot, world: World) -> None:
    part = world.part
    part.table.select_key("speed")
    assert (part.editors.currentIndex(), part.field.text()) == (LINE, "0.5")
    assert part.status_label.text() == "in m/s; 0 to 2"
    QTest.keyClick(part.table, Qt.Key.Key_Return)
    part.field.selectAll()
    QTest.keyClicks(part.field, "9")
    QTest.keyClick(part.field, Qt.Key.Key_Return)
    world.settle(qtbot)
    assert part.status_label.text() == "The parameter 'speed' can't be 9.0: the maximum is 2."
    assert (part.field.text(), part.field.property("wrong")) == ("9", "true")
    part.field.selectAll()
    QTest.keyClicks(part.field, "fast")
    part.set_button.click()
    assert part.status_label.text() == "Enter a number."
    part.field.selectAll()
    QTest.keyClicks(part.field, "1.25")
    part.set_button.click()
    world.settle(qtbot)
    assert world.robot.parameters["speed"] == 1.25
    assert (part.field.text(), part.field.property("wrong")) == ("1.25", "false")
    assert world.cells()[0][1] == "1.25"
    speed = part.model.cell_at(0, 1)
    assert (speed.role, speed.tint) == ("changed", "changedTint")
    later = part.clock() + 5
    part.clock = lambda: later
    assert part.model.cell_at(0, 1).tint == ""


def test_typed_text_is_not_overwritten_by_updates_and_is_discarded_by_esc(world: World) -> None:
    part = world.part
    part.table.select_key("speed")
    part.field.selectAll()
    QTest.keyClicks(part.field, "1.")
    world.robot.parameters["speed"] = 0.75
    world.hear()
    assert (part.field.text(), world.cells()[0][1]) == ("1.", "0.75")
    QTest.keyClick(part.field, Qt.Key.Key_Escape)
    assert part.field.text() == "0.75"
    world.robot.parameters["speed"] = 1
    world.hear()
    assert part.field.text() == "1.0"


def test_selected_parameter_choice_is_applied_immediately(qtbot, world: World) -> None:
    part = world.part
    part.table.select_key("gait")
    assert part.editors.currentIndex() == CHOICE
    assert not part.set_button.isVisibleTo(part)
    part.choice_field.set_value("run")
    part.choice_field.activated.emit(1)
    world.settle(qtbot)
    assert world.robot.parameters["gait"] == "run"
    part.table.select_key("lights")
    choice = part.choice_field
    assert [choice.itemData(place) for place in range(choice.count())] == ["false", "true"]
    part.choice_field.set_value("false")
    part.choice_field.activated.emit(0)
    world.settle(qtbot)
    assert world.robot.parameters["lights"] is False


def test_disabled_field_explains_why_a_parameter_cannot_be_set(world: World) -> None:
    part = world.part
    part.table.select_key("serial")
    assert not part.field.isEnabled()
    assert not part.set_button.isEnabled()
    assert part.status_label.text() == "Only the node itself can change this parameter."
    world.window.session.live.source.tell(GraphView(1, 2, {}))
    ticks(world.window, world.panel, 2)
    part.table.select_key("speed")
    assert (part.field.isEnabled(), part.status_label.text()) == (False, "The node has left.")
    assert part.model.cell_at(0, 0).role == "textDisabled"


def test_node_without_parameters_explains_how_they_are_declared(world: World) -> None:
    world.choose("bare")
    assert not world.part.isVisibleTo(world.panel)
    assert (
        "This node has no parameters. Programs declare them with node.parameters.declare."
        in world.panel.foot.text()
    )
    assert world.window.session.watched == []
    world.choose("robot")
    assert "no parameters" not in world.panel.foot.text()


def test_hidden_panel_does_not_watch_the_parameters(world: World) -> None:
    world.panel.suspend()
    assert world.window.session.watched == []
    world.panel.resume()
    assert world.window.session.watched == [parameters_topic(world.robot.id)]
    world.panel.dispose()
    assert world.window.session.watched == []


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        (ReportedParameter("a", 1, "int"), ""),
        (ReportedParameter("a", 1, "int", minimum=0), "0 or more"),
        (ReportedParameter("a", 1, "float", maximum=0.5), "0.5 or less"),
        (ReportedParameter("a", 1, "int", choices=tuple(range(9))), "0, 1, 2, 3, 4, 5 …"),
        (ReportedParameter("a", 1, "int", minimum=0, is_read_only=True), "read-only"),
    ],
)
def test_allowed_values_of_a_parameter_are_described(parameter: ReportedParameter, words: str) -> None:
    assert allowed_values_text(parameter) == words


@pytest.mark.parametrize("size", [(430, 340), (900, 700)])
def test_texts_are_translated_and_fit(
    qtbot, pseudo, robot: tuple[Window, nep.Node], size: tuple[int, int]
) -> None:
    made = World(*robot)
    qtbot.addWidget(made.panel)
    made.panel.resize(*size)
    made.choose("robot")
    made.hear()
    names = ("speed", "gait", "lights", "serial", "<b>long</b>")
    data = (*names, "robot", "bare", "walk", "run", "true", "false", "in m/s", "x" * 5000, "Python", "native")
    for name in names:
        made.part.table.select_key(name)
        ticks(made.window, made.panel, 2)
        if name == "speed":
            QTest.keyClicks(made.part.field, "fast")
            QTest.keyClick(made.part.field, Qt.Key.Key_Return)
        said = [text for _where, text in said_by(made.part) if "xxx" not in text and "long" not in text]
        assert [text for text in said if untranslated(text, *data)] == []
        qtbot.waitUntil(lambda: visible_faults(made.panel) == [])  # a wrapped footer gets its height later
    made.panel.dispose()


def visible_faults(panel: NodesPanel) -> list[str]:
    """Return the clipped texts of the panel, except texts that are scrolled out of sight."""
    return [fault for fault in clipped(panel) if f"at {9 - OUT_OF_SIGHT}," not in fault]
