"""Tests of editing the room of the virtual robots by mouse and keyboard."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMainWindow, QMenu

from app.robots.description.description import parse, thing_description
from app.robots.simulated import ROBOT as PEPPER
from app.robots.turtle import ROBOT as TURTLE
from app.robots.virtual.body import Body
from app.robots.virtual.room import Room
from app.robots.virtual.simulation import drawing_state, room_state
from app.ui.panels.robots.robot.large_room import LargeRoom
from app.ui.panels.robots.robot.panel import ADDABLE_THINGS, PANEL, RobotPanel
from app.ui.widgets import IconButton
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, has_keys, press

pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
LEFT = Qt.MouseButton.LeftButton


def of_turtle(**more: object) -> dict[str, object]:
    return {
        "figure": "turtle", "x": 0.9, "y": -1.2, "theta_deg": 35.0, "moving": False, "held": False,
        **room_state(Room()), **more,
    }  # fmt: skip


@pytest.fixture
def window(qapp) -> Window:
    made = Window(Session())
    for kind, name in ((PEPPER, "Pepper"), (TURTLE, "Turtle")):
        made.session.join(parse(thing_description(kind.thing_model, name)))
    made.session.fleet.links[0].drawing = drawing_state(Body())
    made.session.fleet.links[1].drawing = of_turtle()
    return made


@pytest.fixture
def panel(qtbot, window) -> RobotPanel:
    made = window.make(PANEL, (600, 500))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, RobotPanel)
    return made


def point(panel: RobotPanel, part: str) -> QPoint:
    place = panel.view.position_of(part)
    assert place is not None
    return place.toPoint()


def drag(panel: RobotPanel, part: str, by: QPoint) -> None:
    start = point(panel, part)
    QTest.mouseMove(panel.view, start)
    QTest.mousePress(panel.view, LEFT, pos=start)
    for step in range(1, 5):
        QTest.mouseMove(panel.view, start + by * step / 4)
    QTest.mouseRelease(panel.view, LEFT, pos=start + by)


def thing(window: Window, name: str) -> tuple[float, float]:
    found = window.session.room.room.thing(name)
    assert found is not None
    return found.x, found.y


def test_both_robots_are_shown_in_one_drawing(panel, window) -> None:
    both = panel.view.grab().toImage()
    assert panel.view.position_of("Turtle/body") is not None
    window.session.fleet.links[1].drawing = of_turtle(x=0.2, y=1.5)
    panel.refresh()
    assert panel.view.grab().toImage() != both
    assert window.session.looked_at == ["Pepper", "Turtle"]
    panel.dispose()
    assert window.session.looked_at == []


@pytest.mark.parametrize("name", ["ball", "Aiko", "marker 7", "table", "shelf"])
def test_each_object_is_dragged_over_the_floor(panel, window, name) -> None:
    before = thing(window, name)
    drag(panel, name, QPoint(-40 if before[1] > 0 else 40, 10))
    after = thing(window, name)
    assert (after[1] > before[1]) == (before[1] <= 0)
    panel.refresh()
    assert next((t.x, t.y) for t in panel.view.state.objects if t.name == name) == after
    assert window.session.changes("Pepper") == []  # the room belongs to no single robot


def test_dragged_object_keeps_its_offset_to_the_mouse_and_stops_at_the_walls(panel, window) -> None:
    before = thing(window, "table")
    drag(panel, "table", QPoint(5, 0))
    after = thing(window, "table")
    assert abs(after[0] - before[0]) < 0.05
    assert 0 <= after[1] - before[1] < 0.2
    drag(panel, "table", QPoint(400, 300))
    table = window.session.room.room.thing("table")
    assert (table.x, table.y) == (3.0 - table.width / 2, 2.5 - table.depth / 2)


def test_robot_is_picked_up_moved_and_put_down(panel, window) -> None:
    drag(panel, "Turtle/body", QPoint(-50, 0))
    changes = window.session.changes("Turtle")
    assert changes[0] == {"hold": True}
    assert changes[-1] == {"hold": False}
    assert {change["move"] for change in changes[1:-1]} == {"robot"}
    assert changes[-2]["y"] < -1.3
    assert window.session.changes("Pepper") == []
    drag(panel, "body", QPoint(30, 0))
    assert window.session.changes("Pepper")[0] == {"hold": True}


def test_click_without_a_drag_moves_no_object(panel, window) -> None:
    QTest.mouseClick(panel.view, LEFT, pos=point(panel, "body"))
    QTest.mouseClick(panel.view, LEFT, pos=point(panel, "ball"))
    assert window.session.changes("Pepper") == []
    assert window.session.room.room == Room()


@pytest.mark.parametrize(
    ("at", "side"), [(0, "front"), (35, "front"), (90, "right"), (-90, "left"), (180, "back")]
)
def test_click_on_the_turtle_robot_presses_the_bumper_on_that_side(panel, window, at, side) -> None:
    window.session.fleet.links[1].drawing = of_turtle(theta_deg=at)
    panel.refresh()
    toes = point(panel, "Turtle/body") + QPoint(0, round(panel.view.height() / 286 * 31 * 1.1))
    QTest.mouseClick(panel.view, LEFT, pos=toes)  # on the viewer's side, low on the body
    assert window.session.changes("Turtle") == [{"happen": "bump", "side": side}]


def test_double_click_and_keyboard_press_the_bumper_and_a_drag_does_not(panel, window) -> None:
    place = point(panel, "Turtle/body")
    QTest.mouseClick(panel.view, LEFT, pos=place)
    QTest.mouseDClick(panel.view, LEFT, pos=place)
    QTest.mouseRelease(panel.view, LEFT, pos=place)
    front = {"happen": "bump", "side": "front"}  # click from above
    assert window.session.changes("Turtle") == [front, front]
    panel.view.selected_item = "Turtle/body"
    QTest.keyClick(panel.view, Qt.Key.Key_Space)
    assert window.session.changes("Turtle") == [front]
    drag(panel, "Turtle/body", QPoint(-50, 0))
    changes = window.session.changes("Turtle")
    assert changes[0] == {"hold": True}
    assert front not in changes


def test_movable_object_under_the_mouse_is_outlined(panel) -> None:
    plain = panel.view.grab().toImage()
    QTest.mouseMove(panel.view, point(panel, "ball"))
    assert panel.view.cursor().shape() == Qt.CursorShape.OpenHandCursor
    assert panel.view.grab().toImage() != plain
    QTest.mouseMove(panel.view, point(panel, "head"))
    assert panel.view.cursor().shape() == Qt.CursorShape.PointingHandCursor
    QTest.mouseMove(panel.view, QPoint(3, 3))
    assert panel.view.cursor().shape() == Qt.CursorShape.ArrowCursor


def test_object_selected_with_tab_is_moved_and_removed_by_keyboard(panel, window) -> None:
    panel.view.setFocus()
    seen = []
    for _turn in range(7):
        QTest.keyClick(panel.view, Qt.Key.Key_Tab)
        seen.append(panel.view.selected_item)
    assert seen == ["body", "Turtle/body", "ball", "Aiko", "marker 7", "table", "shelf"]
    QTest.keyClick(panel.view, Qt.Key.Key_Right)
    assert thing(window, "shelf")[1] == pytest.approx(Room().thing("shelf").y + 0.1)
    QTest.keyClick(panel.view, Qt.Key.Key_Delete)
    assert window.session.room.room.thing("shelf") is None
    panel.refresh()
    panel.view.selected_item = "Turtle/body"
    QTest.keyClick(panel.view, Qt.Key.Key_Down, Qt.KeyboardModifier.ShiftModifier)
    assert window.session.changes("Turtle") == [{"move": "robot", "x": 0.92, "y": -1.2}]
    QTest.keyClick(panel.view, Qt.Key.Key_Delete)  # robots can't be deleted
    assert window.session.changes("Turtle") == []


def test_tab_moves_focus_out_of_the_room_after_the_last_object(panel, window) -> None:
    panel.view.setFocus()
    for _turn in range(8):
        QTest.keyClick(panel.view, Qt.Key.Key_Tab)
    assert panel.view.selected_item is None
    assert not has_keys(panel.view)


def menu(panel: RobotPanel) -> QMenu:
    return next(each for each in panel.findChildren(QMenu) if each.isVisible())


def choose(panel: RobotPanel, words: str) -> None:
    opened = menu(panel)
    (action,) = [each for each in opened.actions() if each.text() == words]
    QTest.mouseClick(opened, LEFT, pos=opened.actionGeometry(action).center())


def test_objects_are_added_and_removed_and_the_room_is_reset(panel, window) -> None:
    press(panel.add_button)
    choose(panel, "Add a ball")
    panel.refresh()
    at = point(panel, "ball 2")
    QApplication.sendEvent(
        panel.view, QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, panel.view.mapToGlobal(at))
    )
    choose(panel, "Remove ball 2")
    assert window.session.room.room.thing("ball 2") is None
    for words, _icon in ADDABLE_THINGS.values():
        press(panel.add_button)
        choose(panel, words)
    room = window.session.room.room
    assert {"ball 2", "Ben", "marker 8", "table 2", "shelf 2"} <= {thing.name for thing in room.things}
    press(panel.add_button)
    choose(panel, "Reset room")
    assert window.session.room.room == Room()
    assert window.session.changes("Pepper") == window.session.changes("Turtle") == [{"reset": True}]


def test_adding_beyond_the_limit_of_a_kind_is_rejected_with_a_toast(panel, window) -> None:
    for _turn in range(9):
        press(panel.add_button)
        choose(panel, "Add a ball")
    assert window.toasts == ["The room is full. Remove something first"] * 2


# ---- a larger room ----------------------------------------------------------------------------------------


@pytest.fixture
def large(qtbot, panel) -> LargeRoom:
    around = QMainWindow()
    qtbot.addWidget(around)
    around.setCentralWidget(panel)
    around.resize(900, 700)
    around.show()
    around.activateWindow()
    qtbot.waitUntil(around.isActiveWindow)
    QTest.mouseDClick(panel.view, LEFT, pos=QPoint(4, 4))
    found = around.findChild(LargeRoom)
    assert found is not None
    return found


def test_double_click_enlarges_the_room_and_another_double_click_restores_its_size(panel, large) -> None:
    assert panel.view.width() == 900
    assert large.isAncestorOf(panel.view)
    large.parentWidget().resize(1000, 720)
    assert large.width() == 1000
    QTest.mouseDClick(panel.view, LEFT, pos=QPoint(4, 4))
    assert panel.isAncestorOf(panel.view)
    assert panel.pages.currentWidget() is panel.stage


def test_esc_closes_the_large_room_also_with_focus_in_the_drawing(qtbot, panel, large) -> None:
    panel.view.setFocus()
    QTest.keyClick(panel.view, Qt.Key.Key_Escape)
    assert panel.isAncestorOf(panel.view)
    panel.refresh()
    assert panel.view.isVisible()


def test_room_fills_the_screen_and_esc_leaves_full_screen(panel, large) -> None:
    window = large.window()
    press(large.screen_button)
    assert window.windowState() & Qt.WindowState.WindowFullScreen
    QTest.keyClick(large, Qt.Key.Key_Escape)
    assert not window.windowState() & Qt.WindowState.WindowFullScreen
    assert panel.isAncestorOf(panel.view)


def test_room_is_furnished_and_reset_by_buttons_of_the_enlarged_view(panel, large, window) -> None:
    buttons = {each.accessibleName(): each for each in large.findChildren(IconButton)}
    press(buttons["Add something to the room"])
    choose(panel, "Add a ball")
    assert window.session.room.room.thing("ball 2") is not None
    press(buttons["Reset the robot and its room"])
    assert window.session.room.room.thing("ball 2") is None


def test_enlarged_room_keeps_updating(panel, large, window) -> None:
    before = panel.view.grab().toImage()
    window.session.fleet.links[1].drawing = of_turtle(x=0.2, y=1.5)
    panel.refresh()
    assert panel.view.grab().toImage() != before
