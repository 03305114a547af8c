"""What kind of thing a painted widget is, for screen readers: Qt knows that only of its own widgets."""

from __future__ import annotations

from PySide6.QtCore import QObject
from PySide6.QtGui import QAccessible, QAccessibleInterface
from PySide6.QtWidgets import QAccessibleWidget, QWidget

PROPERTY = "spokenRole"
_kept: dict[int, QAccessibleInterface] = {}
_installed: list[bool] = []


def speak_as(widget: QWidget, role: str, name: str = "") -> None:
    """Give a widget a role ("Graphic", "Pane", "List") and, if one is given, its name."""
    widget.setProperty(PROPERTY, role)
    if name:
        widget.setAccessibleName(name)
    if not _installed:
        _installed.append(True)
        QAccessible.installFactory(_make)


def _make(_kind: str, thing: QObject) -> QAccessibleInterface | None:
    """Qt asks for the interface of a widget when a screen reader does."""
    role = thing.property(PROPERTY)
    if not isinstance(role, str) or not isinstance(thing, QWidget):
        return None
    made = QAccessibleWidget(thing, QAccessible.Role[role], "")  # "" is: ask the widget for its name
    number = id(thing)
    _kept[number] = made
    thing.destroyed.connect(lambda: _kept.pop(number, None))
    return made
