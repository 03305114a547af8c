"""Drag and drop of message fields from a tree to a plot."""

from __future__ import annotations

import json

from PySide6.QtCore import QEvent, QMimeData, QObject, QPoint, QPointF, Qt
from PySide6.QtGui import (
    QCursor,
    QDragEnterEvent,
    QDragLeaveEvent,
    QDragMoveEvent,
    QDropEvent,
    QGuiApplication,
    QKeyEvent,
    QMouseEvent,
)
from PySide6.QtWidgets import QApplication, QWidget
from shiboken6 import isValid

from app.ui.widgets.labels import label

MIME_TYPE = "application/x-nep-field"
_LABEL_OFFSET = QPoint(14, 10)
"""Distance of the label from the mouse pointer in px; the label must not be under the pointer."""


def field_mime_data(topic: str, path: str) -> QMimeData:
    """Return the drag data of a message field.

    Args:
        topic: Key of the topic, including its network.
        path: Field path.
    """
    data = QMimeData()
    data.setData(MIME_TYPE, json.dumps([topic, path]).encode())
    data.setText(f"{topic}{'' if path.startswith('[') else '.'}{path}")
    return data


def dropped_field(data: QMimeData) -> tuple[str, str] | None:
    """Return the key of the topic and the field path in dropped data, or None for other data."""
    if not data.hasFormat(MIME_TYPE):
        return None
    try:
        decoded = json.loads(bytes(data.data(MIME_TYPE).data()))
    except (ValueError, RecursionError):
        return None
    if isinstance(decoded, list) and len(decoded) == 2 and all(isinstance(each, str) for each in decoded):
        return decoded[0], decoded[1]
    return None


class FieldDrag(QObject):
    """Drag of a message field with the mouse, until the button is released or Esc is pressed.

    Doesn't use `QDrag`, because Qt grabs all keys during a `QDrag`: F12 would not stop the robots. Widgets
    that accept drops receive the same events as with `QDrag`. Fields can't be dropped on other programs.

    Args:
        source: Widget in which the mouse button is pressed; it receives the mouse until the button is
            released.
        topic: Key of the topic.
        path: Field path.
    """

    def __init__(self, source: QWidget, topic: str, path: str) -> None:
        super().__init__(source)
        self._data = field_mime_data(topic, path)
        self._target: QWidget | None = None
        self._is_accepted = False
        self._source = source
        self._label = _floating_label(self._data.text(), source.window())
        self._watched_widgets = {source, QApplication.focusWidget() or source}
        for widget in self._watched_widgets:
            widget.installEventFilter(self)
        QGuiApplication.setOverrideCursor(Qt.CursorShape.ForbiddenCursor)
        self._move(QCursor.pos())

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if watched is self._source and kind == QEvent.Type.Hide:
            self.cancel()
        elif watched is self._source and isinstance(event, QMouseEvent):
            return self._handle_mouse(event)
        if kind in {QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress} and isinstance(event, QKeyEvent):
            if event.key() != Qt.Key.Key_Escape:
                return False
            event.accept()
            if kind == QEvent.Type.KeyPress:
                self.cancel()
            return True
        return False

    def cancel(self) -> None:
        """End the drag without a drop."""
        self._leave()
        self._end()

    def _handle_mouse(self, event: QMouseEvent) -> bool:
        position = event.globalPosition().toPoint()
        if event.type() == QEvent.Type.MouseButtonRelease and event.button() == Qt.MouseButton.LeftButton:
            self._move(position)
            self._drop(position)
        elif event.buttons() & Qt.MouseButton.LeftButton:
            self._move(position)
        else:
            self.cancel()  # another widget, such as a menu, received the release
        return True

    def _move(self, position: QPoint) -> None:
        self._label.move(position + _LABEL_OFFSET)
        target = _drop_target(position)
        if target is not self._target:
            self._leave()
            self._target = target
            if target is not None:
                self._is_accepted = self._send(QDragEnterEvent, target, position)
        elif target is not None:
            self._is_accepted = self._send(QDragMoveEvent, target, position)
        cursor = Qt.CursorShape.DragCopyCursor if self._is_accepted else Qt.CursorShape.ForbiddenCursor
        QGuiApplication.changeOverrideCursor(cursor)

    def _drop(self, position: QPoint) -> None:
        target, is_accepted = self._target, self._is_accepted
        self._end()
        if target is not None and is_accepted:
            event = QDropEvent(target.mapFromGlobal(QPointF(position)), *self._event_arguments())
            QApplication.sendEvent(target, event)

    def _leave(self) -> None:
        target, self._target, self._is_accepted = self._target, None, False
        if target is not None and isValid(target):
            QApplication.sendEvent(target, QDragLeaveEvent())

    def _end(self) -> None:
        for widget in self._watched_widgets:
            if isValid(widget):
                widget.removeEventFilter(self)
        self._target, self._is_accepted = None, False
        QGuiApplication.restoreOverrideCursor()
        if isValid(self._label):
            self._label.close()
        self.deleteLater()

    def _send(self, kind: type[QDragEnterEvent | QDragMoveEvent], target: QWidget, position: QPoint) -> bool:
        event = kind(target.mapFromGlobal(position), *self._event_arguments())
        event.setAccepted(self._is_accepted)  # as in Qt, accepting the enter event suffices
        QApplication.sendEvent(target, event)
        return event.isAccepted()

    def _event_arguments(self) -> tuple[Qt.DropAction, QMimeData, Qt.MouseButton, Qt.KeyboardModifier]:
        no_modifiers = Qt.KeyboardModifier.NoModifier
        return Qt.DropAction.CopyAction, self._data, Qt.MouseButton.LeftButton, no_modifiers


def _drop_target(position: QPoint) -> QWidget | None:
    widget = QApplication.widgetAt(position)
    while widget is not None and not widget.acceptDrops():
        widget = widget.parentWidget()
    return widget


def _floating_label(text: str, window: QWidget) -> QWidget:
    widget = label(text, "code")
    widget.setProperty("raised", "true")
    widget.setContentsMargins(8, 4, 8, 4)
    flags = Qt.WindowType.ToolTip | Qt.WindowType.FramelessWindowHint
    widget.setParent(window, flags | Qt.WindowType.WindowTransparentForInput)
    widget.setAttribute(Qt.WidgetAttribute.WA_ShowWithoutActivating)
    widget.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
    widget.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    widget.adjustSize()
    widget.show()
    return widget
