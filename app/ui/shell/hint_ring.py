"""Ring that highlights a button for some seconds, or until the button or Esc is pressed."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QRectF, Qt, QTimer
from PySide6.QtGui import QKeyEvent, QPainter, QPaintEvent, QWindow
from PySide6.QtWidgets import QAbstractButton, QWidget
from shiboken6 import isValid

from app.ui.theme.theme import Theme
from app.ui.widgets import paint

RING_OFFSET, HALO_WIDTH = 5, 5
CORNER_RADIUS = 12
POLL_MS = 100
TIMEOUT_MS = 15_000


class HintRing(QWidget):
    """Overlay that paints a ring around a button. Mouse events pass through the overlay."""

    def __init__(self, theme: Theme, window: QWidget) -> None:
        super().__init__(window)
        self._theme, self._window = theme, window
        self.target: QAbstractButton | None = None
        self._filtered_window: QWindow | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._poll_timer = QTimer(self)
        self._poll_timer.setInterval(POLL_MS)
        self._poll_timer.timeout.connect(self._reposition)
        self._timeout_timer = QTimer(self)
        self._timeout_timer.setSingleShot(True)
        self._timeout_timer.setInterval(TIMEOUT_MS)
        self._timeout_timer.timeout.connect(self.clear)
        self.hide()

    def point_at(self, command: str) -> bool:
        """Highlight the button of a command, given by name; return False if no such button is visible."""
        self.clear()
        buttons = self._window.findChildren(QAbstractButton)
        matches = (each for each in buttons if each.isVisible() and each.property("command") == command)
        self.target = next(matches, None)
        if self.target is None:
            return False
        self.target.clicked.connect(self.clear)
        self._filtered_window = self._window.windowHandle()
        if self._filtered_window is not None:
            self._filtered_window.installEventFilter(self)
        self._reposition()
        self._poll_timer.start()
        self._timeout_timer.start()
        return True

    def clear(self) -> None:
        """Remove the highlight."""
        if self.target is not None and isValid(self.target):
            self.target.clicked.disconnect(self.clear)
        if self._filtered_window is not None and isValid(self._filtered_window):
            self._filtered_window.removeEventFilter(self)
        self._filtered_window = None
        self.target = None
        self._poll_timer.stop()
        self._timeout_timer.stop()
        self.hide()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if (
            event.type() == QEvent.Type.KeyPress
            and isinstance(event, QKeyEvent)
            and event.key() == Qt.Key.Key_Escape
        ):
            self.clear()
        return super().eventFilter(watched, event)

    def _reposition(self) -> None:
        target = self.target
        if target is None or not isValid(target) or not target.isVisible():
            self.clear()
            return
        inset = int(target.property("focusInset") or 0)
        outset = RING_OFFSET + HALO_WIDTH - inset
        target_rect = QRect(target.mapTo(self._window, QPoint()), target.size())
        geometry = target_rect.adjusted(-outset, -outset, outset, outset)
        if geometry != self.geometry():
            self.setGeometry(geometry)
        self.show()
        self.raise_()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter, accent = QPainter(self), self._theme.colour("accent")
        halo = self._theme.colour("accent")
        halo.setAlphaF(0.28)
        rect = QRectF(self.rect())
        halo_rect = rect.adjusted(0.5, 0.5, -0.5, -0.5)
        ring_rect = rect.adjusted(HALO_WIDTH, HALO_WIDTH, -HALO_WIDTH, -HALO_WIDTH)
        paint.box(painter, halo_rect, CORNER_RADIUS + HALO_WIDTH, None, halo, HALO_WIDTH)
        paint.box(painter, ring_rect, CORNER_RADIUS, None, accent, 2)
        painter.end()
