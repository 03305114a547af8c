"""A field of a message in the hand of a person: dragged from a tree, dropped on a plot."""

from __future__ import annotations

import json

from PySide6.QtCore import QMimeData, QPoint, Qt
from PySide6.QtGui import QDrag, QPixmap
from PySide6.QtWidgets import QWidget

from app.ui.widgets.labels import label

MIME = "application/x-nep-field"


def field_in_hand(topic: str, path: str) -> QMimeData:
    """The field ``path`` of a topic, by the name that it has among those of all networks; also as text."""
    data = QMimeData()
    data.setData(MIME, json.dumps([topic, path]).encode())
    data.setText(f"{topic}{'' if path.startswith('[') else '.'}{path}")
    return data


def dropped_field(data: QMimeData) -> tuple[str, str] | None:
    """(topic, path) of what is in the hand; None when it is something else."""
    if not data.hasFormat(MIME):
        return None
    try:
        found = json.loads(bytes(data.data(MIME).data()))
    except ValueError:
        return None
    if isinstance(found, list) and len(found) == 2 and all(isinstance(each, str) for each in found):
        return found[0], found[1]
    return None


def drag_field(source: QWidget, topic: str, path: str) -> None:
    """Let a person drag a field away; returns when it is dropped."""
    drag = QDrag(source)
    data = field_in_hand(topic, path)
    drag.setMimeData(data)
    drag.setPixmap(_words(data.text()))
    drag.setHotSpot(QPoint(-12, -4))
    drag.exec(Qt.DropAction.CopyAction)


def _words(text: str) -> QPixmap:
    shown = label(text, "code")
    shown.setProperty("raised", "true")
    shown.setContentsMargins(8, 4, 8, 4)
    shown.adjustSize()
    return shown.grab()
