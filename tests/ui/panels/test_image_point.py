"""Tests of publishing image points by click: only while armed, never by a drag or a double click."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from app.core.run.acting.arming import Target
from app.core.run.acting.picture_point import MESSAGE_TYPES, PicturePoint
from app.core.world.world import World
from app.ui.panels.watch.image.panel import PANEL, ImagePanel
from nep.messages.message import Message
from nep.nodes.subscriber import Subscriber
from tests.pseudo import untranslated_in
from tests.ui.clipping import clipped
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, press, ticks
from tests.ui.test_accessible import unsaid

pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
LEFT, MIDDLE, RIGHT = Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton, Qt.MouseButton.RightButton
CAMERA, POINTS = "/robot/camera", "/robot/camera/point"
STAMP_NS = 1_795_164_093_000_000_007


@pytest.fixture
def window(qapp) -> Window:
    made = Window(Session.full())
    made.session.shown.images.camera = lambda _topic: None
    return made


@pytest.fixture
def panel(qtbot, window) -> Iterator[ImagePanel]:
    made = window.make(PANEL, (640, 560))
    qtbot.addWidget(made)
    assert isinstance(made, ImagePanel)
    made.show_topic(CAMERA)
    frame = np.zeros((240, 320, 3), np.uint8)
    extension = {"shape": list(frame.shape), "encoding": "bgr8"}
    sent = Message(CAMERA, frame.tobytes(), "image", "image", stamp_ns=STAMP_NS, extension=extension)
    window.session.shown.images.offer([sent])
    ticks(window, made)
    assert made.view.picture is not None
    yield made
    made.dispose()


SHIFT = Qt.KeyboardModifier.ShiftModifier


def arm(window: Window, panel: ImagePanel) -> Subscriber:
    """Arm the publishing of points and return a subscriber to them."""
    heard = window.session.live.source.listen(POINTS, "json")
    panel.actions_of["point"].trigger()
    press(panel.point_bar.strip.switch)
    ticks(window, panel)
    assert panel.point_bar.is_armed
    return heard


def at(panel: ImagePanel, x: float, y: float) -> QPoint:
    """Convert a position in the 320 x 240 image to view pixels."""
    view = panel.view
    return view.placement.to_view(view.area()).map(QPointF(x / 320, y / 240)).toPoint()


def click(qtbot, window: Window, panel: ImagePanel, x: float, y: float, key=LEFT) -> PicturePoint:
    """Click at an image position, wait out the double-click time and return the point."""
    with qtbot.waitSignal(panel.view.clicked, timeout=60_000) as told:
        QTest.mouseClick(panel.view, key, Qt.KeyboardModifier.NoModifier, at(panel, x, y))
    ticks(window, panel)
    return told.args[0]


def test_panel_names_the_topic_to_arm_and_one_click_publishes_one_message(qtbot, window, panel) -> None:
    session, points = window.session, panel.point_bar
    assert not points.isVisible()
    QTest.keyClick(panel.view, Qt.Key.Key_P)
    ticks(window, panel)
    assert points.isVisible()
    assert panel.actions_of["point"].isChecked()
    assert points.target == Target("topic", POINTS)
    assert points.strip.text_label.text() == "Clicks aren't sent until you arm sending"
    assert unsaid(panel) == []
    QTest.mouseClick(panel.view, LEFT, Qt.KeyboardModifier.NoModifier, at(panel, 16, 8))
    press(points.close_button)
    assert not points.isVisible()
    assert not panel.actions_of["point"].isChecked()

    heard = arm(window, panel)
    assert session.acting.arming.targets == (Target("topic", POINTS),)
    point = click(qtbot, window, panel, 16.5, 8.5)
    told = {"width": 320, "height": 240, "stamp": {"sec": 1_795_164_093, "nanosec": 7}, "topic": CAMERA}
    assert heard.listen(timeout_s=60.0) == (True, {"x": 16, "y": 8, "button": "left", **told})
    assert panel.view.marked_point == point
    assert not panel.view.grab().isNull()
    assert points.strip.summary_label.text() == "1 point sent, 1 subscriber"
    entry = session.acting.sent_log.records[-1]
    assert (entry.origin, entry.name, entry.result_text) == ("image", POINTS, "Point (16, 8), 1 subscriber")
    qtbot.waitUntil(lambda: panel.view.marked_point is None, timeout=60_000)

    panel.actions_of["right"].trigger()
    panel.actions_of["across"].trigger()
    panel.view.zoom_by(1.5)
    click(qtbot, window, panel, 200.5, 100.5, MIDDLE)
    assert heard.listen(timeout_s=60.0) == (True, {"x": 200, "y": 100, "button": "middle", **told})
    assert points.strip.summary_label.text() == "2 points sent, 1 subscriber"
    assert session.acting.resend(entry.number) == ""
    assert heard.listen(timeout_s=60.0)[1]["x"] == 16
    session.runs.stop()
    ticks(window, panel)
    assert not panel.view.accepts_clicks
    assert session.acting.resend(entry.number).endswith(" isn't armed. Arm it first.")


def test_arrow_keys_move_the_pixel_cursor_and_enter_publishes_its_point(qtbot, window, panel) -> None:
    view = panel.view
    for key in (Qt.Key.Key_Left, Qt.Key.Key_Return):
        QTest.keyClick(view, key)  # not armed: no point is selected
    assert view.cursor_pixel is None
    heard = arm(window, panel)
    QTest.keyClick(view, Qt.Key.Key_Return)  # no point is selected yet
    QTest.keyClick(view, Qt.Key.Key_Left)
    assert view.cursor_pixel == (160, 120)
    plain = view.grab().toImage()
    for key, shift in (
        (Qt.Key.Key_Left, True),
        (Qt.Key.Key_Up, True),
        (Qt.Key.Key_Right, False),
        (Qt.Key.Key_Down, False),
    ):
        before = view.cursor_pixel
        QTest.keyClick(view, key, SHIFT if shift else Qt.KeyboardModifier.NoModifier)
        moved = tuple(now - then for now, then in zip(view.cursor_pixel, before, strict=True))
        wanted = {Qt.Key.Key_Left: (-1, 0), Qt.Key.Key_Up: (0, -1), Qt.Key.Key_Right: (1, 0)}.get(key, (0, 1))
        near = 10 if shift else 1
        assert all(
            abs(is_so - near * way) <= (way != 0) * near * 0.5
            for is_so, way in zip(moved, wanted, strict=True)
        )
    assert view.grab().toImage() != plain
    x, y = view.cursor_pixel
    QTest.keyClick(view, Qt.Key.Key_Return)
    ticks(window, panel)
    told = heard.listen(timeout_s=60.0)[1]
    assert (told["x"], told["y"], told["button"]) == (x, y, "left")
    panel.actions_of["right"].trigger()  # rotated right: the top of the view is the image's left edge
    for _step in range(60):
        QTest.keyClick(view, Qt.Key.Key_Up, SHIFT)
    assert view.cursor_pixel[0] == 0
    view.zoom_by(8)
    for _step in range(12):
        QTest.keyClick(view, Qt.Key.Key_Down, SHIFT)
    view.zoom_by(0.5)
    view.repaint()
    assert view._hovered_pixel_text().startswith(f"({view.cursor_pixel[0]}, {view.cursor_pixel[1]})"), (
        "its value is told"
    )
    assert view.rect().contains(view._view_position(view.cursor_pixel).toPoint()), (
        "an enlarged picture goes along"
    )
    QTest.mouseMove(view, QPoint(30, 30))
    qtbot.waitUntil(lambda: view.cursor_pixel is None)
    QTest.keyClick(view, Qt.Key.Key_Left)
    assert view.cursor_pixel is not None
    small = np.zeros((4, 4, 3), np.uint8)
    sent = Message(
        CAMERA, small.tobytes(), "image", "image", stamp_ns=STAMP_NS + 1,
        extension={"shape": list(small.shape), "encoding": "bgr8"},
    )  # fmt: skip
    window.session.shown.images.offer([sent])
    ticks(window, panel)
    QTest.keyClick(view, Qt.Key.Key_Return)
    ticks(window, panel)
    told = heard.listen(timeout_s=60.0)[1]
    assert (told["x"], told["y"], told["width"]) == (3, 3, 4)
    window.session.runs.stop()
    ticks(window, panel)
    assert view.cursor_pixel is None


def test_drag_double_click_and_click_outside_the_image_publish_no_point(qtbot, window, panel) -> None:
    heard, view = arm(window, panel), panel.view
    told: list[PicturePoint] = []
    view.clicked.connect(told.append)
    none = Qt.KeyboardModifier.NoModifier
    view.resize(view.width(), 600)
    for place in (QPoint(5, 2), QPoint(view.width() - 2, view.height() - 2)):
        assert view.pixel_at(QPointF(place)) is None
        QTest.mouseClick(view, LEFT, none, place)
    QTest.mouseClick(view, RIGHT, none, at(panel, 30, 30))
    QTest.mouseClick(view, LEFT, none, at(panel, 40, 40))
    QTest.mouseDClick(view, LEFT, none, at(panel, 40, 40))
    assert view.placement.zoom is not None, "a double click still zooms"
    start = at(panel, 160, 120)
    QTest.mousePress(view, LEFT, none, start)
    QTest.mouseMove(view, start + QPoint(QApplication.startDragDistance() + 1, 0))
    QTest.mouseMove(view, start)
    QTest.mouseRelease(view, LEFT, none, start)
    QTest.mousePress(view, LEFT, none, start)
    turned = QWheelEvent(
        QPointF(start), view.mapToGlobal(QPointF(start)), QPoint(), QPoint(0, 120), LEFT, none,
        Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(view, turned)
    QTest.mouseRelease(view, LEFT, none, start)
    QTest.mouseClick(view, LEFT, none, at(panel, 100, 100))
    panel.point_bar.topic_field.setText("/elsewhere")
    panel.point_bar.topic_field.textEdited.emit("/elsewhere")
    assert not view.accepts_clicks, "what goes elsewhere is armed anew, also what was clicked before"
    assert not window.session.acting.arming.is_on
    panel.point_bar.topic_field.setText("")
    panel.point_bar.topic_field.textEdited.emit("")
    press(panel.point_bar.strip.switch)
    ticks(window, panel)
    point = click(qtbot, window, panel, 150.5, 110.5)
    assert told == [point]
    assert heard.listen(timeout_s=60.0)[0]
    assert heard.receive(0.0) is None


def test_two_clicks_at_two_positions_publish_two_points(qtbot, window, panel) -> None:
    arm(window, panel)
    with qtbot.waitSignals([panel.view.clicked] * 2, timeout=60_000):
        for x in (20, 300):
            QTest.mouseClick(panel.view, LEFT, Qt.KeyboardModifier.NoModifier, at(panel, x + 0.5, 50.5))
    ticks(window, panel)
    words = [each.result_text for each in window.session.acting.sent_log.records if each.origin == "image"]
    assert words == ["Point (20, 50), 1 subscriber", "Point (300, 50), 1 subscriber"]


def test_arming_elsewhere_does_not_arm_the_image_panel_and_closing_disarms(qtbot, window, panel) -> None:
    acting, points = window.session.acting, panel.point_bar
    acting.arm()
    acting.allow(Target("topic", POINTS))
    acting.allow(Target("topic", "/other"))
    panel.restore_state(
        {**panel.save_state(), "point": {"on": True, "topic": POINTS, "type": MESSAGE_TYPES[1]}}
    )
    ticks(window, panel)
    assert points.isVisible()
    assert not points.is_armed
    assert not panel.view.accepts_clicks
    press(button(panel, f"Send the points to {POINTS}"))
    ticks(window, panel)
    assert points.is_armed
    heard = window.session.live.source.listen(POINTS, MESSAGE_TYPES[1])
    click(qtbot, window, panel, 16.5, 8.5)
    assert heard.listen(timeout_s=60.0) == (True, {"x": 16.0, "y": 8.0, "z": 0.0})
    kept = panel.save_state()
    assert kept["point"] == {"on": True, "topic": POINTS, "type": MESSAGE_TYPES[1]}
    panel.dispose()
    assert acting.arming.targets == (Target("topic", "/other"),)
    assert acting.arming.is_on
    panel.restore_state(kept)
    ticks(window, panel)
    assert not points.is_armed, "a layout arms nothing"
    for broken in (None, 7, {"on": 1, "topic": 3, "type": []}, {"type": "no type", "topic": "two words"}):
        panel.restore_state({**kept, "point": broken})
        ticks(window, panel)
    assert points.problem_label.text()
    assert points.arm() == points.problem_label.text()
    assert points.type_choice.value == MESSAGE_TYPES[1]


def test_robot_command_topic_requires_confirmation_and_a_source_change_disarms(qtbot, window, panel) -> None:
    acting, points = window.session.acting, panel.point_bar
    topic = window.session.fleet.connected[0].robot.topics.command
    panel.restore_state({**panel.save_state(), "point": {"on": True, "topic": topic, "type": "json"}})
    press(points.strip.switch)
    ticks(window, panel)
    assert acting.question is not None
    assert topic in points.strip.question_label.text()
    assert not points.is_armed
    press(points.strip.cancel_button)
    ticks(window, panel)
    assert not points.is_armed
    assert not panel.view.accepts_clicks
    press(points.arm_button)
    ticks(window, panel)
    press(points.strip.allow_button)
    ticks(window, panel)
    assert points.is_armed
    acting.disarm()
    points.topic_field.setText("")
    points.topic_field.textEdited.emit("")
    press(points.strip.switch)
    ticks(window, panel)
    assert points.is_armed
    window.session.show(World())
    ticks(window, panel)
    assert not points.is_armed


def test_texts_are_translated_and_fit(qtbot, pseudo, window, panel) -> None:
    panel.resize(330, 400)
    panel.actions_of["point"].trigger()
    window.session.acting.arm()
    ticks(window, panel)
    assert panel.point_bar.arm_button.isVisible()
    data = ("robot", "camera", "point", "json", "geometry_msgs/Point", "geometry_msgs/PointStamped")
    assert untranslated_in(panel.point_bar, *data) == []
    assert clipped(panel.point_bar) == []
    window.session.acting.disarm()
    ticks(window, panel)
    assert untranslated_in(panel.point_bar, *data) == []
    assert clipped(panel.point_bar) == []
