"""Drag and drop of message fields from a tree to a plot."""

from __future__ import annotations

import json
from collections.abc import Callable

from PySide6.QtCore import QEvent, QMimeData, QObject, QPoint, Qt, QTimer
from PySide6.QtGui import QDrag, QKeyEvent, QKeySequence, QPixmap
from PySide6.QtWidgets import QApplication, QWidget

from app.ui.widgets.labels import label

MIME_TYPE = "application/x-nep-field"
MODIFIER_KEYS = {Qt.Key.Key_Shift, Qt.Key.Key_Control, Qt.Key.Key_Alt, Qt.Key.Key_Meta, Qt.Key.Key_AltGr}
"""Modifier keys, which are ignored during a drag because Qt uses them for the drop action."""


def field_mime_data(topic: str, path: str) -> QMimeData:
    """Return the drag data of a message field, which can also be dropped as text.

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


class DragKeyFilter(QObject):
    """Event filter that makes keyboard shortcuts work during a drag, when Qt grabs all keys.

    A key other than Esc or a modifier cancels the drag and runs its shortcut. This is needed for Stop.
    """

    def __init__(self, press: Callable[[str], object]) -> None:
        # `press` runs the shortcut with this name, such as "F12".
        super().__init__()
        self._press = press

    def begin(self) -> None:
        """Install the filter.

        Call this after the start of the drag: the last installed filter is called first, so it precedes
        Qt's own.
        """
        application = QApplication.instance()
        if application is not None:
            application.installEventFilter(self)

    def end(self) -> None:
        """Remove the filter."""
        application = QApplication.instance()
        if application is not None:
            application.removeEventFilter(self)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        if event.type() != QEvent.Type.KeyPress or not isinstance(event, QKeyEvent):
            return False
        if event.key() in {Qt.Key.Key_Escape, *MODIFIER_KEYS}:
            return False
        name = QKeySequence(event.keyCombination()).toString(QKeySequence.SequenceFormat.PortableText)
        QDrag.cancel()
        QTimer.singleShot(0, lambda: self._press(name))  # after the end of the drag
        return True


def drag_field(source: QWidget, topic: str, path: str, *, press: Callable[[str], object]) -> None:
    """Drag a message field; returns after the drop.

    Args:
        source: Widget in which the drag starts.
        topic: Key of the topic.
        path: Field path.
        press: Runs a shortcut that is pressed during the drag, such as "F12".
    """
    keys = DragKeyFilter(press)
    QTimer.singleShot(0, keys.begin)  # runs in the event loop of the drag, after Qt has installed its filter
    drag = QDrag(source)
    data = field_mime_data(topic, path)
    drag.setMimeData(data)
    drag.setPixmap(_drag_pixmap(data.text()))
    drag.setHotSpot(QPoint(-12, -4))
    try:
        drag.exec(Qt.DropAction.CopyAction)
    finally:
        keys.end()


def _drag_pixmap(text: str) -> QPixmap:
    widget = label(text, "code")
    widget.setProperty("raised", "true")
    widget.setContentsMargins(8, 4, 8, 4)
    widget.adjustSize()
    return widget.grab()
