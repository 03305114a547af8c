"""Tab of one open behaviour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QPoint, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QFocusEvent,
    QFont,
    QKeyEvent,
    QMouseEvent,
    QPainter,
)
from PySide6.QtWidgets import QApplication, QLineEdit, QToolTip, QWidget

from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import PaintedButton
from app.ui.widgets.inputs.frame import set_invalid
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _

MAX_NAME_WIDTH = 220
MAX_NAME_LENGTH = 200
PROBLEM_TIP_MS = 20_000
PADDING = 12
ICON_SIZE = 16
SLOT_WIDTH = 18  # place of the unsaved dot or, on hover, the close button


@dataclass(frozen=True)
class TabState:
    """Data that a tab displays.

    Attributes:
        key: Key of the behaviour.
        name: Displayed name.
        is_dirty: True if there are unsaved changes.
        is_running: True while the behaviour is running.
        tip: Tooltip.
        has_file: True if the behaviour has been saved to a file.
    """

    key: str
    name: str
    is_dirty: bool = False
    is_running: bool = False
    tip: str = ""
    plain_name: str = ""
    """Name in the rename field, without the folder that distinguishes equal names."""
    has_file: bool = False


class BehaviourTab(PaintedButton):
    """Tab of one behaviour.

    An amber dot in place of the icon indicates a running behaviour; a small dot indicates unsaved changes.
    """

    selected = Signal()
    close_pressed = Signal()
    dragged = Signal(int)
    step_requested = Signal(int)
    rename_requested = Signal()

    def __init__(self, theme: Theme, parent: QWidget) -> None:
        super().__init__(theme, checkable=True, parent=parent)
        self.state = TabState("", "")
        self._press_position: QPointF | None = None
        self._is_close_hovered = self._is_close_pressed = False
        self.setMouseTracking(True)

    def show_state(self, state: TabState, is_current: bool) -> bool:
        """Update the tab. Return True if its width changed."""
        if state == self.state and is_current == self.isChecked():
            return False
        is_width_changed = (
            state.name != self.state.name
            or is_current != self.isChecked()
            or state.is_running != self.state.is_running
        )
        self.state = state
        self.setChecked(is_current)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus if is_current else Qt.FocusPolicy.ClickFocus)
        states = [
            label_text
            for label_text, is_active in ((_("not saved"), state.is_dirty), (_("running"), state.is_running))
            if is_active
        ]
        self.set_text(state.name, ", ".join([state.name, *states]))
        description = _("The active behaviour") if is_current else _("Another open behaviour")
        self.setAccessibleDescription(description)
        self.setToolTip(plain.tip(state.tip or self.accessibleName()))
        self.update()
        return is_width_changed

    def _icon_size(self) -> int:
        return round(self._theme.scaled(ICON_SIZE))

    def _has_icon(self) -> bool:
        return self.isChecked() or self.state.is_running

    def sizeHint(self) -> QSize:
        font = self._font(is_current=True)
        name = min(self._theme.scaled(MAX_NAME_WIDTH), paint.width_of(font, self.state.name) + 1)
        icon = self._icon_size() + 8 if self._has_icon() else 0
        height = max(28, round(paint.height_of(font)) + 6)
        return QSize(round(PADDING + icon + name + SLOT_WIDTH + 4), height)

    def _font(self, *, is_current: bool) -> QFont:
        font = self._theme.font("label")
        font.setWeight(font.Weight.DemiBold if is_current else font.Weight.Medium)
        return font

    def close_rect(self) -> QRectF:
        """Return the rectangle of the close button."""
        rect = QRectF(self.rect())
        return QRectF(rect.right() - SLOT_WIDTH - 1, rect.center().y() - 8, 16, 16)

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        is_current, is_highlighted = self.isChecked(), self.is_hovered or self._press_position is not None
        if is_current or is_highlighted:
            role = "selected" if is_current else "hover"
            paint.box(painter, rect, theme.radius("small"), theme.colour(role))
        colour = theme.colour("selectedText" if is_current else "textSecondary")
        left = float(PADDING)
        if self._has_icon():
            side = self._icon_size()
            self._paint_mark(painter, QRectF(left, rect.center().y() - side / 2, side, side))
            left += side + 8
        text_rect = rect.adjusted(left, 0, -SLOT_WIDTH - 2, 0)
        paint.text_line(painter, text_rect, self.state.name, self._font(is_current=is_current), colour)
        self._paint_slot(painter, is_highlighted or self.hasFocus())

    def _paint_mark(self, painter: QPainter, icon_rect: QRectF) -> None:
        theme = self._theme
        if not self.state.is_running:
            paint_icon(painter, icon_rect, "blocks", theme.colour("selectedText"))
            return
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        halo = theme.colour("running")
        halo.setAlphaF(0.3)
        for colour, radius in ((halo, 7.0), (theme.colour("running"), 4.5)):
            painter.setBrush(colour)
            painter.drawEllipse(icon_rect.center(), radius, radius)

    def _paint_slot(self, painter: QPainter, is_highlighted: bool) -> None:
        theme, slot = self._theme, self.close_rect()
        colour = theme.colour("selectedText" if self.isChecked() else "textSecondary")
        if is_highlighted:
            if self._is_close_hovered:
                paint.box(painter, slot, theme.radius("key"), theme.colour("pressed"))
            paint_icon(painter, slot.adjusted(2, 2, -2, -2), "x", colour)
        elif self.state.is_dirty:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(colour)
            painter.drawEllipse(slot.center(), 3.5, 3.5)

    # -- mouse and keyboard -------------------------------------------------------------------------------

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._is_close_pressed = self.close_rect().contains(event.position())
            self._press_position = None if self._is_close_pressed else event.position()
            if not self._is_close_pressed:
                self.selected.emit()
        event.accept()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and not self.close_rect().contains(event.position()):
            self._press_position = None
            self.rename_requested.emit()
            event.accept()
        else:
            self.mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        is_over_close = self.close_rect().contains(event.position())
        if is_over_close != self._is_close_hovered:
            self._is_close_hovered = is_over_close
            self.update()
        if self._press_position is not None:
            is_dragging = (
                abs(event.position().x() - self._press_position.x()) >= QApplication.startDragDistance()
            )
            if is_dragging:
                self.dragged.emit(round(self.mapToParent(event.position()).x()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        is_inside = QRectF(self.rect()).contains(event.position())
        is_close_pressed, self._is_close_pressed, self._press_position = self._is_close_pressed, False, None
        if (event.button() == Qt.MouseButton.MiddleButton and is_inside) or (
            is_close_pressed and self.close_rect().contains(event.position())
        ):
            self.close_pressed.emit()
        self.update()

    def leaveEvent(self, event: QEvent) -> None:
        self._is_close_hovered = False
        super().leaveEvent(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        steps = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}
        if event.key() in steps:
            self.step_requested.emit(steps[Qt.Key(event.key())])
        elif event.key() == Qt.Key.Key_F2:
            self.rename_requested.emit()
        elif event.key() == Qt.Key.Key_Delete:
            self.close_pressed.emit()
        elif event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space}:
            self.selected.emit()
        else:
            super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.update()


class NameField(QLineEdit):
    """Field for renaming a tab in place: Enter accepts, Esc cancels.

    When the field loses the focus, it accepts a valid name and cancels otherwise.

    Args:
        name: Current name.
        validate: Returns the reason why a name is invalid, or "".

    Signals:
        committed: New name.
        exited: The field should be closed.
    """

    committed = Signal(str)
    exited = Signal()

    def __init__(self, theme: Theme, name: str, validate: Callable[[str], str], parent: QWidget) -> None:
        super().__init__(name, parent)
        self._theme, self._validate, self._has_ended = theme, validate, False
        self.setAccessibleName(_("Behaviour name"))
        self.setProperty("focusRadius", theme.radius("small"))
        self.setMaxLength(MAX_NAME_LENGTH)
        self.setFont(theme.font("label"))
        FieldContextMenu(theme, self)
        self.textEdited.connect(lambda _text: self._show_problem(""))
        self.selectAll()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self._commit()
        elif event.key() == Qt.Key.Key_Escape:
            self._finish()
        elif event.key() in {Qt.Key.Key_Tab, Qt.Key.Key_F2}:
            event.accept()
        else:
            super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        ignored_reasons = {Qt.FocusReason.PopupFocusReason, Qt.FocusReason.ActiveWindowFocusReason}
        if event.reason() in ignored_reasons:
            return
        if self._validate(self.text()):
            self._finish()
        else:
            self._commit()

    def _commit(self) -> None:
        problem = self._validate(self.text())
        if problem:
            self._show_problem(problem)
        elif not self._has_ended:
            self._has_ended = True
            self.committed.emit(self.text().strip())
            self.exited.emit()

    def _finish(self) -> None:
        if not self._has_ended:
            self._has_ended = True
            self.exited.emit()

    def _show_problem(self, problem: str) -> None:
        set_invalid(self, is_invalid=bool(problem))
        self.setAccessibleDescription(problem)
        if problem:
            paint.announce(self, problem)
            below = self.mapToGlobal(QPoint(0, self.height() + 2))
            QToolTip.showText(below, plain.tip(problem), self, self.rect(), PROBLEM_TIP_MS)
        else:
            QToolTip.hideText()
