"""The focus ring: 2 px wide, 2 px outside the control, only when the keyboard led there.

Style sheets cannot move an outline outwards, so one small overlay follows the widget that has the focus.
"""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QRectF, Qt
from PySide6.QtGui import QGuiApplication, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QAbstractScrollArea,
    QApplication,
    QMainWindow,
    QMenu,
    QMenuBar,
    QWidget,
)
from shiboken6 import isValid

from app.ui.theme import Theme
from app.ui.widgets import paint

_MOVES = frozenset(
    {QEvent.Type.Move, QEvent.Type.Resize, QEvent.Type.Show, QEvent.Type.Hide, QEvent.Type.ParentChange}
)


class FocusRing(QWidget):
    """One ring for one top-level window; widgets tell their corners by the property ``focusRadius``.

    Widgets with the property ``ownFocus`` (and tables and trees) draw their focus themselves; ``focusInset``
    is the margin between a widget's edge and what it paints.
    """

    def __init__(self, theme: Theme, window: QWidget) -> None:
        super().__init__(window)
        self._theme = theme
        self._window = window
        self._target: QWidget | None = None
        self._chain: list[QWidget] = []
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.hide()
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._focus_changed)

    @property
    def target(self) -> QWidget | None:
        """The widget that is ringed now."""
        return self._target

    def _focus_changed(self, _old: QWidget | None, new: QWidget | None) -> None:
        by_mouse = QGuiApplication.mouseButtons() != Qt.MouseButton.NoButton
        self._follow(None if by_mouse or new is None or not self._rings(new) else new)

    def _rings(self, widget: QWidget) -> bool:
        if widget.window() is not self._window or widget is self._window or widget.property("ownFocus"):
            return False
        parent = widget.parentWidget()
        if parent is not None and parent.inherits("QWebEngineView"):  # the page shows its own focus
            return False
        own = QAbstractItemView | QAbstractScrollArea | QMainWindow | QMenu | QMenuBar
        return not isinstance(widget, own)

    def _follow(self, target: QWidget | None) -> None:
        for widget in self._chain:
            if isValid(widget):  # the focus also moves on because a widget is being deleted
                widget.removeEventFilter(self)
        self._chain = []
        self._target = target
        if target is None:
            self.hide()
            return
        step: QWidget | None = target
        while step is not None and step is not self._window:
            step.installEventFilter(self)
            self._chain.append(step)
            step = step.parentWidget()
        self._place()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in _MOVES:
            self._place()
        return super().eventFilter(watched, event)

    def _place(self) -> None:
        target = self._target
        if target is None or not isValid(target) or not target.isVisible():
            self.hide()
            return
        inset = int(target.property("focusInset") or 0)
        out = self._theme.size("focusRing", "offset") + self._theme.size("focusRing", "width") - inset
        rect = QRect(target.mapTo(self._window, QPoint(0, 0)), target.size()).adjusted(-out, -out, out, out)
        shown = rect
        for widget in self._chain[1:]:
            scroller = widget.parentWidget()
            if isinstance(scroller, QAbstractScrollArea) and scroller.viewport() is widget:
                view = QRect(widget.mapTo(self._window, QPoint(0, 0)), widget.size())
                shown = shown.intersected(view)
        self.setGeometry(rect)
        if shown.isEmpty():
            self.hide()
            return
        if shown == rect:
            self.clearMask()
        else:
            self.setMask(shown.translated(-rect.topLeft()))
        self.show()
        self.raise_()
        self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        if self._target is None or not isValid(self._target):
            return
        width = self._theme.size("focusRing", "width")
        radius = int(self._target.property("focusRadius") or self._theme.radius("small"))
        outside = radius + width + self._theme.size("focusRing", "offset")
        painter = QPainter(self)
        paint.box(painter, QRectF(self.rect()), outside, None, self._theme.colour("focus"), width)
        painter.end()
