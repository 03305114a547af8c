"""Tests of dragging message fields with the mouse."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QDragEnterEvent, QDragLeaveEvent, QDropEvent, QGuiApplication, QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from app.ui.widgets.field_drag import FieldDrag, dropped_field


class Target(QWidget):
    """Widget that accepts dropped fields and records the events of drags."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAcceptDrops(True)
        self.events: list[object] = []

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        self.events.append("entered")
        event.acceptProposedAction()

    def dragLeaveEvent(self, _event: QDragLeaveEvent) -> None:
        self.events.append("left")

    def dropEvent(self, event: QDropEvent) -> None:
        self.events.append(dropped_field(event.mimeData()))


@pytest.fixture
def widgets(qtbot) -> Iterator[tuple[QWidget, Target]]:
    """Source on the left and target on the right of a window."""
    window = QWidget()
    window.setGeometry(0, 0, 400, 200)
    source, target = QWidget(window), Target(window)
    source.setGeometry(0, 0, 200, 200)
    target.setGeometry(200, 0, 200, 200)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitExposed(window)
    yield source, target
    window.close()


def send(
    source: QWidget,
    kind: QEvent.Type,
    position: QPoint,
    button: Qt.MouseButton = Qt.MouseButton.LeftButton,
    held: Qt.MouseButton = Qt.MouseButton.LeftButton,
) -> None:
    """Send a mouse event at a position in `source`, by default with the left button held."""
    location, plain = QPointF(source.mapToGlobal(position)), Qt.KeyboardModifier.NoModifier
    QApplication.sendEvent(source, QMouseEvent(kind, QPointF(position), location, button, held, plain))


def test_field_is_dropped_on_the_widget_under_the_mouse(qapp, widgets) -> None:
    source, target = widgets
    FieldDrag(source, "/odom", "speed")
    send(source, QEvent.Type.MouseMove, QPoint(300, 100))
    assert target.events == ["entered"]
    send(source, QEvent.Type.MouseButtonRelease, QPoint(310, 100))
    assert target.events == ["entered", ("/odom", "speed")]
    assert QGuiApplication.overrideCursor() is None
    send(source, QEvent.Type.MouseMove, QPoint(320, 100))  # the drag has ended
    assert len(target.events) == 2


def test_field_is_not_dropped_outside_a_target(qapp, widgets) -> None:
    source, target = widgets
    FieldDrag(source, "/odom", "speed")
    send(source, QEvent.Type.MouseMove, QPoint(300, 100))
    send(source, QEvent.Type.MouseButtonRelease, QPoint(100, 100))
    assert target.events == ["entered", "left"]
    assert QGuiApplication.overrideCursor() is None


def test_escape_cancels_the_drag(qapp, widgets) -> None:
    source, target = widgets
    source.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    source.window().activateWindow()
    source.setFocus()
    FieldDrag(source, "/odom", "speed")
    send(source, QEvent.Type.MouseMove, QPoint(300, 100))
    QTest.keyClick(source, Qt.Key.Key_Escape)
    send(source, QEvent.Type.MouseButtonRelease, QPoint(300, 100))
    assert target.events == ["entered", "left"]
    assert QGuiApplication.overrideCursor() is None


def test_another_button_does_not_end_the_drag(qapp, widgets) -> None:
    source, target = widgets
    FieldDrag(source, "/odom", "speed")
    send(source, QEvent.Type.MouseMove, QPoint(300, 100))
    send(source, QEvent.Type.MouseButtonRelease, QPoint(300, 100), Qt.MouseButton.RightButton)
    assert target.events == ["entered"]
    send(source, QEvent.Type.MouseButtonRelease, QPoint(300, 100))
    assert target.events == ["entered", ("/odom", "speed")]


def test_drag_ends_if_another_widget_received_the_release(qapp, widgets) -> None:
    source, target = widgets
    source.setMouseTracking(True)  # as the tree of the Inspector
    FieldDrag(source, "/odom", "speed")
    send(source, QEvent.Type.MouseMove, QPoint(300, 100))
    send(source, QEvent.Type.MouseMove, QPoint(300, 100), held=Qt.MouseButton.NoButton)
    assert target.events == ["entered", "left"]
    assert QGuiApplication.overrideCursor() is None


def test_hidden_source_ends_the_drag(qapp, widgets) -> None:
    source, target = widgets
    FieldDrag(source, "/odom", "speed")
    send(source, QEvent.Type.MouseMove, QPoint(300, 100))
    source.hide()
    assert target.events == ["entered", "left"]
    assert QGuiApplication.overrideCursor() is None
