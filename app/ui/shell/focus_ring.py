"""Focus ring around the focused widget, which is shown only while the keyboard is used.

The ring is 2 px wide, at a distance of 2 px. Style sheets can't draw outside a widget, therefore the
ring is an overlay. QFocusFrame is unsuitable: it becomes a child of the surrounding scroll area and is
deleted with it, and the style defines the same margin for all widgets.
"""

from __future__ import annotations

from typing import cast

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QRectF, Qt, QTimer
from PySide6.QtGui import QGuiApplication, QKeyEvent, QPainter, QPaintEvent, QWindow
from PySide6.QtWidgets import (
    QAbstractItemView,
    QAbstractScrollArea,
    QApplication,
    QDockWidget,
    QMainWindow,
    QMenu,
    QMenuBar,
    QWidget,
)
from shiboken6 import isValid

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.keyboard import is_keyboard_navigation, set_keyboard_navigation

_GEOMETRY_EVENTS = frozenset(
    {QEvent.Type.Move, QEvent.Type.Resize, QEvent.Type.Show, QEvent.Type.Hide, QEvent.Type.ParentChange}
)
_PRESS_EVENTS = frozenset({QEvent.Type.MouseButtonPress, QEvent.Type.TouchBegin, QEvent.Type.TabletPress})
_Key = Qt.Key
_NAVIGATION_KEYS = frozenset(
    {
        _Key.Key_Tab, _Key.Key_Backtab, _Key.Key_F6, _Key.Key_Home, _Key.Key_End, _Key.Key_PageUp,
        _Key.Key_PageDown, _Key.Key_Left, _Key.Key_Right, _Key.Key_Up, _Key.Key_Down,
    }
)  # fmt: skip
"""Keys that move the focus. Other keys, such as letters, don't count as keyboard navigation."""


class FocusRing(QWidget):
    """Focus ring for a window and its floating panels.

    The ring is shown if the last input was a key that moves the focus, and not a mouse button. Qt's
    focus reason can't be used, because it is also Tab when a focused widget is hidden.

    These dynamic properties of a widget are used: ``focusRadius``, the radius of its corners;
    ``focusInset``, the margin around its painted shape; and ``ownFocus``, True if the widget paints its
    focus itself, as all tables and trees do.
    """

    def __init__(self, theme: Theme, window: QWidget) -> None:
        super().__init__(window)
        self._theme = theme
        self._main_window = self._window = window
        set_keyboard_navigation(False)
        self._target: QWidget | None = None
        self._watched_widgets: list[QWidget] = []
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.hide()
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._focus_changed)
            application.focusWindowChanged.connect(self._window_changed)
        self._window_changed(window.windowHandle())
        window.installEventFilter(self)  # the native window is created when it is first shown

    @property
    def target(self) -> QWidget | None:
        """Widget that the ring surrounds, or None if the ring is hidden."""
        return self._target

    def _window_changed(self, window: QWindow | None) -> None:
        # Filters the events of every window of the application that becomes active.
        if window is not None:
            window.removeEventFilter(self)
            window.installEventFilter(self)

    def _focus_changed(self, _old: QWidget | None, new: QWidget | None) -> None:
        is_mouse_pressed = QGuiApplication.mouseButtons() != Qt.MouseButton.NoButton
        if is_mouse_pressed or not is_keyboard_navigation() or new is None or not self._accepts_ring(new):
            self._set_target(None)
            return
        if new.window() is not self._window:
            self._window = new.window()
            self.setParent(self._window)
        self._set_target(new)

    def _accepts_ring(self, widget: QWidget) -> bool:
        window = widget.window()
        is_own_window = window is self._main_window or (
            isinstance(window, QDockWidget) and self._main_window.isAncestorOf(window)
        )
        if not is_own_window or widget is window or widget.property("ownFocus"):
            return False
        parent = widget.parentWidget()
        if parent is not None and parent.inherits("QWebEngineView"):  # the page draws its focus itself
            return False
        excluded_types = QAbstractItemView | QAbstractScrollArea | QMainWindow | QMenu | QMenuBar
        return not isinstance(widget, excluded_types)

    def _set_target(self, target: QWidget | None) -> None:
        for widget in self._watched_widgets:
            if isValid(widget):  # the focus also changes when a widget is deleted
                widget.removeEventFilter(self)
        self._watched_widgets = []
        self._target = target
        if target is None:
            self.hide()
            return
        step: QWidget | None = target
        while step is not None and step is not self._window:
            step.installEventFilter(self)
            self._watched_widgets.append(step)
            step = step.parentWidget()
        self._reposition()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if isinstance(watched, QWindow):
            if kind in _PRESS_EVENTS:
                set_keyboard_navigation(False)
                self._set_target(None)
            elif (
                kind == QEvent.Type.KeyPress
                and _moves_focus(cast("QKeyEvent", event))
                and not is_keyboard_navigation()
            ):
                set_keyboard_navigation(True)
                QTimer.singleShot(
                    0, self, self._show_at_focus
                )  # after the key had a chance to move the focus
        elif kind == QEvent.Type.Show and watched is self._main_window:
            self._window_changed(self._main_window.windowHandle())
        elif kind in _GEOMETRY_EVENTS:
            self._reposition()
        return super().eventFilter(watched, event)

    def _show_at_focus(self) -> None:
        if self._target is None:
            self._focus_changed(None, QApplication.focusWidget())

    def _reposition(self) -> None:
        target = self._target
        if target is None or not isValid(target) or not target.isVisible():
            self.hide()
            return
        inset = int(target.property("focusInset") or 0)
        outset = self._theme.size("focusRing", "offset") + self._theme.size("focusRing", "width") - inset
        target_rect = QRect(target.mapTo(self._window, QPoint(0, 0)), target.size())
        rect = target_rect.adjusted(-outset, -outset, outset, outset)
        visible_rect = rect
        for widget in self._watched_widgets[1:]:
            scroll_area = widget.parentWidget()
            if isinstance(scroll_area, QAbstractScrollArea) and scroll_area.viewport() is widget:
                view = QRect(widget.mapTo(self._window, QPoint(0, 0)), widget.size())
                visible_rect = visible_rect.intersected(view)
        self.setGeometry(rect)
        if visible_rect.isEmpty():
            self.hide()
            return
        if visible_rect == rect:
            self.clearMask()
        else:
            self.setMask(visible_rect.translated(-rect.topLeft()))
        self.show()
        self.raise_()
        self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        if self._target is None or not isValid(self._target):
            return
        width = self._theme.size("focusRing", "width")
        radius = int(self._target.property("focusRadius") or self._theme.radius("small"))
        outer_radius = radius + width + self._theme.size("focusRing", "offset")
        painter = QPainter(self)
        paint.box(painter, QRectF(self.rect()), outer_radius, None, self._theme.colour("focus"), width)
        painter.end()


def _moves_focus(event: QKeyEvent) -> bool:
    # Tab, arrows, F6, and Ctrl+1 to Ctrl+9, which focus a panel.
    is_panel_key = _Key.Key_1 <= event.key() <= _Key.Key_9
    return event.key() in _NAVIGATION_KEYS or (
        is_panel_key and event.modifiers() == Qt.KeyboardModifier.ControlModifier
    )
