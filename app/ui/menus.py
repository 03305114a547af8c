"""Menus with round corners: of the menu bar, of panels, and the editing menus of fields.

Where the system mixes windows (Wayland, macOS, Windows) the corners are transparent. X11 may have nobody who
does that, and would show them black: there the window itself is cut to its round shape.
"""

from __future__ import annotations

from PySide6.QtCore import QObject, QPoint, QRectF, Qt
from PySide6.QtGui import QGuiApplication, QPainterPath, QRegion, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QLineEdit, QMenu, QPlainTextEdit, QWidget

from app.ui.theme import Theme

CUT_ON = frozenset({"xcb", "offscreen", "minimal"})


def make_round(widget: QWidget) -> None:
    """Prepare a popup before its first show: no frame of the system, corners that may be seen through."""
    widget.setWindowFlag(Qt.WindowType.FramelessWindowHint, True)
    widget.setWindowFlag(Qt.WindowType.NoDropShadowWindowHint, QGuiApplication.platformName() in CUT_ON)
    if QGuiApplication.platformName() not in CUT_ON:
        widget.setAttribute(Qt.WidgetAttribute.WA_TranslucentBackground)


def cut(widget: QWidget, radius: float) -> None:
    """Cut a popup to its round corners where nobody mixes windows."""
    if QGuiApplication.platformName() in CUT_ON:
        path = QPainterPath()
        path.addRoundedRect(QRectF(widget.rect()), radius, radius)
        widget.setMask(QRegion(path.toFillPolygon().toPolygon()))


class Menu(QMenu):
    """A menu in the design's look."""

    def __init__(self, theme: Theme, parent: QWidget | None = None, title: str = "") -> None:
        super().__init__(title, parent)
        self._theme = theme
        make_round(self)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        cut(self, self._theme.radius("panel"))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        cut(self, self._theme.radius("panel"))


class EditMenu(QObject):
    """Gives a field its editing menu in our look."""

    def __init__(self, theme: Theme, field: QLineEdit | QPlainTextEdit) -> None:
        super().__init__(field)
        self._theme, self._field = theme, field
        field.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        field.customContextMenuRequested.connect(self._show)

    def _show(self, at: QPoint) -> None:
        standard = self._field.createStandardContextMenu()
        menu = Menu(self._theme, self._field)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        standard.setParent(menu)  # its actions live as long as the menu that shows them
        menu.addActions(standard.actions())
        menu.popup(self._field.mapToGlobal(at))
