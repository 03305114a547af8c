"""Menus with round corners: of the menu bar, of panels, and the editing menus of fields.

Where the system mixes windows (Wayland, macOS, Windows) the corners are transparent. X11 may have nobody who
does that, and would show them black: there the window itself is cut to its round shape.
"""

from __future__ import annotations

import re

from PySide6.QtCore import QObject, QPoint, QRectF, QSize, Qt
from PySide6.QtGui import (
    QAction,
    QGuiApplication,
    QIcon,
    QKeySequence,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QRegion,
    QResizeEvent,
    QShowEvent,
)
from PySide6.QtWidgets import QLineEdit, QMenu, QPlainTextEdit, QWidget

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets.paint import RIGHT, box, words

CUT_ON = frozenset({"xcb"})
MARK, TEXT_LEFT = 15, 33


def make_round(widget: QWidget) -> None:
    """Prepare a popup before its first show: no frame of the system, corners that may be seen through."""
    widget.setWindowFlag(Qt.WindowType.FramelessWindowHint, True)
    widget.setWindowFlag(Qt.WindowType.NoDropShadowWindowHint, QGuiApplication.platformName() in CUT_ON)
    if QGuiApplication.platformName() not in CUT_ON:
        widget.setAttribute(Qt.WidgetAttribute.WA_TranslucentBackground)


def cut(widget: QWidget, radius: float) -> None:
    """Cut a popup to its round corners where nobody mixes windows."""
    if QGuiApplication.platformName() in CUT_ON:
        widget.setMask(round_region(widget.size(), radius))


def round_region(size: QSize, radius: float) -> QRegion:
    """The pixels of a box with round corners."""
    path = QPainterPath()
    path.addRoundedRect(QRectF(0, 0, size.width(), size.height()), radius, radius)
    return QRegion(path.toFillPolygon().toPolygon())


class Menu(QMenu):
    """A menu in the design's look: icons and checks in one column, shortcuts quiet at the right."""

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

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect = QRectF(self.rect())
        box(painter, rect, theme.radius("panel"), theme.colour("raised"), theme.colour("borderStrong"))
        painter.setClipRect(rect.adjusted(1, 1, -1, -1))
        for action in self.actions():
            if action.isVisible():
                self._paint_action(painter, QRectF(self.actionGeometry(action)), action)
        painter.end()

    def _paint_action(self, painter: QPainter, place: QRectF, action: QAction) -> None:
        theme = self._theme
        if action.isSeparator():
            line = QRectF(place.left() + 6, round(place.center().y()), place.width() - 12, 1)
            painter.fillRect(line, theme.colour("border"))
            return
        if action is self.activeAction() and action.isEnabled():
            box(painter, place, theme.radius("small"), theme.colour("hover"))
        mark = QRectF(place.left() + 9, place.center().y() - MARK / 2, MARK, MARK)
        if action.isChecked():
            paint_icon(painter, mark, "check", theme.colour("accentText"))
        elif not action.icon().isNull():
            mode = QIcon.Mode.Normal if action.isEnabled() else QIcon.Mode.Disabled
            action.icon().paint(painter, mark.toRect(), Qt.AlignmentFlag.AlignCenter, mode)
        said, _tab, key = action.text().partition("\t")
        key = action.shortcut().toString(QKeySequence.SequenceFormat.NativeText) or key
        ink = theme.colour("text" if action.isEnabled() else "textDisabled")
        inside = place.adjusted(TEXT_LEFT, 0, -12, 0)
        words(painter, inside, re.sub("&(.)", r"\1", said), self.font(), ink)
        if action.menu() is not None:
            chevron = QRectF(inside.right() - 12, place.center().y() - 7, 14, 14)
            paint_icon(painter, chevron, "chevron-right", theme.colour("textTertiary"))
        elif key:
            quiet = theme.colour("textTertiary" if action.isEnabled() else "textDisabled")
            words(painter, inside, key, self.font(), quiet, RIGHT)


def drop_below(menu: Menu, anchor: QWidget) -> None:
    """Open a menu below a button, at its right edge where it would leave the window."""
    place = anchor.rect().bottomLeft() + QPoint(0, 3)
    over = anchor.mapTo(anchor.window(), place).x() + menu.sizeHint().width() - anchor.window().width()
    if over > 0:
        place.setX(anchor.width() - menu.sizeHint().width())
    menu.popup(anchor.mapToGlobal(place))


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
        menu.destroyed.connect(standard.deleteLater)  # whose actions they are
        menu.addActions(standard.actions())
        menu.popup(self._field.mapToGlobal(at))
