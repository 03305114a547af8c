"""Base class of sheets over the window, with a scrim that leaves every Stop button accessible."""

from __future__ import annotations

from PySide6.QtCore import (
    QEasingCurve,
    QEvent,
    QObject,
    QPoint,
    QRect,
    QRectF,
    QSize,
    Qt,
    QVariantAnimation,
    Signal,
)
from PySide6.QtGui import QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QRegion
from PySide6.QtWidgets import QApplication, QGraphicsOpacityEffect, QHBoxLayout, QWidget
from shiboken6 import isValid

from app.ui.theme.theme import Theme
from app.ui.widgets import IconButton, StopButton, paint
from app.ui.widgets.keyboard import tab_stops
from app.ui.widgets.menus import round_region
from nep.i18n import _

SHADOW_PX = 28
SHADOW_OFFSET_PX = 10
EDGE_MARGIN = 16
STOP_GAP = 5
STOP_INSET = 4  # margin in px of the button around its body, for the focus ring


def stop_buttons_in(window: QWidget) -> list[StopButton]:
    """Return the visible Stop buttons of a window."""
    return [stop for stop in window.findChildren(StopButton) if stop.isVisible() and stop.window() is window]


class StopButtonWatcher(QObject):
    """Observer of the geometry of all Stop buttons in a window.

    `changed` is emitted when a Stop button or one of its parents is shown, hidden, moved or resized. A
    signal is needed because a change of the text size causes several layout passes.
    """

    changed = Signal()
    GEOMETRY_EVENTS = frozenset({QEvent.Type.Move, QEvent.Type.Resize, QEvent.Type.Show, QEvent.Type.Hide})

    def __init__(self, window: QWidget, parent: QObject) -> None:
        super().__init__(parent)
        self._window = window
        self._watched_widgets: list[QWidget] = []

    def watch(self) -> None:
        """Observe all Stop buttons, including hidden ones, until `unwatch` is called."""
        self.unwatch()
        for stop in self._window.findChildren(StopButton):
            widget: QWidget | None = stop
            while widget is not None and widget is not self._window and widget not in self._watched_widgets:
                self._watched_widgets.append(widget)
                widget.installEventFilter(self)
                widget = widget.parentWidget()

    def unwatch(self) -> None:
        """Stop observing the buttons."""
        widgets, self._watched_widgets = self._watched_widgets, []
        for widget in widgets:
            if isValid(widget):
                widget.removeEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in self.GEOMETRY_EVENTS:
            self.changed.emit()
        return super().eventFilter(watched, event)


class Scrim(QWidget):
    """Translucent layer that dims a window except for its Stop buttons, which stay clickable.

    `pressed` is emitted on a click elsewhere.
    """

    pressed = Signal()

    def __init__(self, theme: Theme, window: QWidget) -> None:
        super().__init__(window)
        self._theme = theme
        self.opacity = 0.0
        self.surface: QWidget | None = None
        self.hide()

    def cover(self) -> None:
        """Resize to the whole window and cut a hole for each visible Stop button."""
        window = self.parentWidget()
        if window is None:
            return
        self.setGeometry(window.rect())
        region = QRegion(self.rect())
        for stop in stop_buttons_in(window):
            body = stop.size() - QSize(2 * STOP_INSET, 2 * STOP_INSET)
            hole = round_region(body, float(stop.property("focusRadius") or 0))
            region -= hole.translated(stop.mapTo(window, QPoint(STOP_INSET, STOP_INSET)))
        self.setMask(region)
        self.update()

    def set_opacity(self, opacity: float) -> None:
        """Set the opacity, from 0 (transparent) to 1."""
        self.opacity = opacity
        self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        event.accept()
        self.pressed.emit()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        scrim_colour = self._theme.colour("scrim")
        scrim_colour.setAlphaF(scrim_colour.alphaF() * self.opacity)
        painter.fillRect(self.rect(), scrim_colour)
        if self.surface is not None:
            self._paint_shadow(painter, QRectF(self.surface.geometry()))
        painter.end()

    def _paint_shadow(self, painter: QPainter, rect: QRectF) -> None:
        # Painted as many thin boxes, because QGraphicsDropShadowEffect would repaint the sheet on every key.
        steps = SHADOW_PX // 2
        shadow_colour = self._theme.colour("shadow")
        shadow_colour.setAlphaF(min(1.0, shadow_colour.alphaF() * self.opacity * 2.2 / steps))
        radius = self._theme.radius("palette")
        for step in range(steps):
            outset = 2.0 * step - SHADOW_PX / 2
            box = rect.translated(0, SHADOW_OFFSET_PX).adjusted(-outset, -outset, outset, outset)
            paint.box(painter, box, radius + max(0.0, outset), shadow_colour)


class Overlay(QWidget):
    """Base class of sheets over a window.

    An open sheet has the focus. Esc or a click outside closes the sheet and restores the previous
    focus. Subclasses implement `preferred_size` and `initial_focus`.
    """

    closed = Signal()
    top = EDGE_MARGIN
    is_docked_right = False
    """True if the sheet is docked at the right edge of the window; toasts are placed to its left."""
    is_nested = False
    """True if the sheet is opened from another sheet, which stays open below it and gets the focus back."""

    def __init__(self, theme: Theme, window: QWidget, name: str) -> None:
        # `name` is read by screen readers. `open` shows the sheet.
        super().__init__(window)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.theme = theme
        self.setAccessibleName(name)
        self._scrim = Scrim(theme, window)
        self._scrim.surface = self
        self._scrim.pressed.connect(self.dismiss)
        self._stop_watcher = StopButtonWatcher(window, self)
        self._stop_watcher.changed.connect(self._on_stop_moved)
        self._previous_focus: QWidget | None = None
        self._open_animation = QVariantAnimation(self)
        self._open_animation.setStartValue(0.0)
        self._open_animation.setEndValue(1.0)
        self._open_animation.setEasingCurve(QEasingCurve.Type.OutCubic)
        self._open_animation.valueChanged.connect(self._set_progress)
        self._open_animation.finished.connect(self._finish_opening)
        theme.changed.connect(self.place)
        self.hide()

    def preferred_size(self, room: QSize) -> QSize:
        """Return the preferred size of the sheet.

        Args:
            room: Maximum size that fits into the window.
        """
        return self.sizeHint().boundedTo(room)

    def initial_focus(self) -> QWidget:
        """Return the widget that gets the focus when the sheet opens."""
        return self

    def open(self) -> None:
        """Open the sheet, animated unless motion is reduced."""
        if self.isVisible():
            return
        self._previous_focus = QApplication.focusWidget()
        window = self.covered_window()
        window.installEventFilter(self)
        self._stop_watcher.watch()
        self.place()
        self._scrim.show()
        self._scrim.raise_()
        duration = self.theme.duration("palette")
        if duration:
            self.setGraphicsEffect(QGraphicsOpacityEffect(self))
            self._set_progress(0.0)
            self._open_animation.setDuration(duration)
            self._open_animation.start()
        else:
            self._scrim.set_opacity(1.0)
        self.show()
        self.raise_()
        self.initial_focus().setFocus(Qt.FocusReason.PopupFocusReason)
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._focus_changed)

    def create_header(self, heading: QWidget) -> QHBoxLayout:
        """Return a layout for the top of the sheet, with a heading and a close button."""
        close = IconButton(self.theme, "x", _("Close"), "Esc")
        close.clicked.connect(self.dismiss)
        row = QHBoxLayout()
        row.addWidget(heading, 1)
        row.addWidget(close)
        return row

    def dismiss(self) -> None:
        """Close the sheet and restore the previous focus."""
        if not self.isVisible():
            return
        had_focus = self._has_focus()
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.disconnect(self._focus_changed)
        self.covered_window().removeEventFilter(self)
        self._stop_watcher.unwatch()
        self._open_animation.stop()
        self._finish_opening()
        before = self._previous_focus
        if had_focus and before is not None and isValid(before) and before.isVisible():
            before.setFocus(Qt.FocusReason.PopupFocusReason)
        self.hide()
        self._scrim.hide()
        self.closed.emit()

    def covered_window(self) -> QWidget:
        """Return the window that the sheet covers."""
        parent = self.parentWidget()
        return parent if parent is not None else self

    def place(self) -> None:
        """Set the geometry of the sheet, horizontally centred and `top` px below the top of the window.

        The sheet is moved further down if it would cover Stop.
        """
        window = self.covered_window()
        geometry = self._geometry_at(self.top)
        stop_rects = [QRect(stop.mapTo(window, QPoint()), stop.size()) for stop in stop_buttons_in(window)]
        covered_stops = [stop for stop in stop_rects if stop.intersects(geometry)]
        if covered_stops:
            geometry = self._geometry_at(max(stop.bottom() for stop in covered_stops) + STOP_GAP)
        if geometry != self.geometry() or self._scrim.size() != window.size() or not self.isVisible():
            self.setGeometry(geometry)
            self._scrim.cover()

    def _on_stop_moved(self) -> None:
        self.place()
        self._scrim.cover()

    def _geometry_at(self, top: int) -> QRect:
        window = self.covered_window()
        size = self.preferred_size(
            QSize(window.width() - 2 * EDGE_MARGIN, window.height() - top - 2 * EDGE_MARGIN)
        )
        return QRect(QPoint((window.width() - size.width()) // 2, top), size)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and watched is self.parentWidget():
            self.place()
        return super().eventFilter(watched, event)

    def event(self, event: QEvent) -> bool:
        handled = super().event(event)
        if event.type() == QEvent.Type.LayoutRequest and self.isVisible():
            self.place()
        return handled

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.dismiss()
        event.accept()  # keys must not reach the window below

    def focusNextPrevChild(self, forward: bool) -> bool:
        """Move the focus by Tab within the sheet only."""
        focus = QApplication.focusWidget()
        step: QWidget = focus if focus is not None and self.isAncestorOf(focus) else self
        stop = next(tab_stops(self, step, forward=forward), None)
        if stop is not None:
            reason = Qt.FocusReason.TabFocusReason if forward else Qt.FocusReason.BacktabFocusReason
            stop.setFocus(reason)
        return True

    def _has_focus(self) -> bool:
        focus = QApplication.focusWidget()
        return focus is not None and (focus is self or self.isAncestorOf(focus))

    def _focus_changed(self, _old: QWidget | None, new: QWidget | None) -> None:
        if new is None or QApplication.activePopupWidget() is not None or new.window() is not self.window():
            return
        ancestor: QWidget | None = new
        while ancestor is not None and not (isinstance(ancestor, Overlay) and ancestor.is_nested):
            ancestor = ancestor.parentWidget()
        if ancestor is None and new is not self and not self.isAncestorOf(new):
            self.dismiss()

    def _set_progress(self, progress: object) -> None:
        opacity = float(progress) if isinstance(progress, float) else 1.0
        self._scrim.set_opacity(opacity)
        effect = self.graphicsEffect()
        if isinstance(effect, QGraphicsOpacityEffect):
            effect.setOpacity(max(0.01, opacity))

    def _finish_opening(self) -> None:
        self.setGraphicsEffect(None)  # type: ignore[arg-type]  # None removes the effect
        self._scrim.set_opacity(1.0)
