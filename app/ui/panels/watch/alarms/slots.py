"""Slots in an alarm's sentence: buttons, and the text field for their values."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QPoint, QRect, QRectF, QSize, QStringListModel, Qt, QTimer, Signal
from PySide6.QtGui import QFocusEvent, QFont, QKeyEvent, QMoveEvent, QPainter, QPen, QResizeEvent
from PySide6.QtWidgets import QApplication, QCompleter, QLineEdit, QStyledItemDelegate, QToolTip, QWidget

from app.ui.panels.watch.alarms.phrases import PhrasePart
from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import PaintedButton
from app.ui.widgets.inputs.frame import set_invalid
from app.ui.widgets.keyboard import has_no_modifiers, next_in_focus_chain
from app.ui.widgets.menus import FieldContextMenu

HEIGHT, PADDING, ICON, GAP, MAX_WIDTH = 24, 7, 14, 5, 300
FIELD_WIDTH = 240
MOUSE_POLL_MS = 50


class AlarmSlot(PaintedButton):
    """Button for a slot of an alarm's sentence.

    `removed` is emitted when Delete or Backspace is pressed on an action, `geometry_changed` when the layout
    moved or resized the slot.
    """

    elides_text = True
    removed = Signal()
    geometry_changed = Signal()

    def __init__(self, theme: Theme, part: PhrasePart, name: str) -> None:
        super().__init__(theme)
        self.part, self._name = part, name
        self._reserved_width = 0
        self._update_text(part)

    def show_part(self, part: PhrasePart) -> None:
        """Update the button after the value of its slot changed."""
        if part != self.part:
            self.part = part
            self._update_text(part)

    def _update_text(self, part: PhrasePart) -> None:
        self.set_text(part.text, f"{self._name}: {part.text}" if part.text else self._name)
        self.updateGeometry()
        self.update()

    def reserve_width(self, width: int) -> None:
        """Widen the slot, so that the layout makes room for a text field over it."""
        self._reserved_width = width
        self._update_layout()

    def release_width(self) -> None:
        """Undo `reserve_width`, as soon as no mouse button is pressed."""
        if QApplication.mouseButtons() != Qt.MouseButton.NoButton:
            # A button that moves between press and release would miss the click.
            QTimer.singleShot(MOUSE_POLL_MS, self, self.release_width)
            return
        self._reserved_width = 0
        self._update_layout()

    def _update_layout(self) -> None:
        self.updateGeometry()
        parent = self.parentWidget()
        layout = parent.layout() if parent is not None else None
        if layout is not None:
            layout.activate()

    def moveEvent(self, event: QMoveEvent) -> None:
        super().moveEvent(event)
        self.geometry_changed.emit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.geometry_changed.emit()

    def sizeHint(self) -> QSize:
        theme = self._theme
        width = paint.width_of(self._font(), self.text()) + 2 * PADDING
        if self.part.icon:
            width += theme.scaled(ICON) + (GAP if self.text() else 0)
        height = max(HEIGHT, round(paint.height_of(self._font())) + 6)
        width = min(round(width) + 2, round(theme.scaled(MAX_WIDTH)))
        return QSize(max(width, self._reserved_width), height)

    def minimumSizeHint(self) -> QSize:
        return QSize(min(self.sizeHint().width(), 40), self.sizeHint().height())

    def _font(self) -> QFont:
        font = self._theme.font("mono" if self.part.mono else "body")
        font.setWeight(font.Weight.Medium)
        return font

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in {Qt.Key.Key_Delete, Qt.Key.Key_Backspace} and self.part.role == "action":
            self.removed.emit()
        else:
            super().keyPressEvent(event)

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme, is_dashed = self._theme, self.part.kind == "dashed"
        fill = "pressed" if self.isDown() else "hover" if self.is_hovered else None
        radius = theme.radius("small")
        outline = theme.colour("controlBorder" if is_dashed else "borderStrong")
        if is_dashed:
            painter.setPen(QPen(outline, 1, Qt.PenStyle.DashLine))
            painter.setBrush(theme.colour(fill) if fill else Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(rect.adjusted(0.5, 0.5, -0.5, -0.5), radius, radius)
        else:
            paint.box(painter, rect, radius, theme.colour(fill or "panel"), outline)
        colour = theme.colour("textSecondary" if is_dashed else "text")
        left = rect.left() + PADDING
        if self.part.icon:
            icon_size = theme.scaled(ICON)
            icon_rect = QRectF(left, rect.center().y() - icon_size / 2, icon_size, icon_size)
            if not self.text():
                icon_rect.moveCenter(rect.center())
            paint_icon(painter, icon_rect, self.part.icon, colour, is_filled=self.part.icon == "square")
            left += icon_size + GAP
        paint.text_line(
            painter, rect.adjusted(left - rect.left(), 0, 2 - PADDING, 0), self.text(), self._font(), colour
        )


class SlotField(QLineEdit):
    """Text field over a slot, for editing its value with completion.

    Enter and Tab accept the text, Esc cancels. `closed` is emitted when the field closes.

    Args:
        row: Parent widget, because the field is taller than the slot.
        slot: Slot to edit.
        text: Initial text.
        example: Placeholder text.
        apply: Receives the text and returns False if it is invalid. The field then stays open with a red
            outline and shows `rejection`.
        rejection: Message that explains the valid values.
    """

    closed = Signal()

    def __init__(
        self,
        theme: Theme,
        row: QWidget,
        slot: AlarmSlot,
        text: str,
        example: str,
        apply: Callable[[str], bool],
        *,
        rejection: str = "",
    ) -> None:
        super().__init__(text, row)
        self.slot, self._row, self._apply, self._is_closed = slot, row, apply, False
        self._rejection = rejection
        self.setAccessibleName(slot.accessibleName())
        self.setPlaceholderText(example)
        self.setProperty("focusRadius", theme.radius("small"))
        FieldContextMenu(theme, self)
        self._completion_model = QStringListModel(self)
        completer = QCompleter(self._completion_model, self)
        completer.setFilterMode(Qt.MatchFlag.MatchContains)
        completer.setCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        completer.setMaxVisibleItems(10)
        completer.activated.connect(self._completion_selected)
        popup = completer.popup()
        if popup is not None:
            popup.setProperty("offers", "true")
            popup.setItemDelegate(QStyledItemDelegate(popup))  # lets the style sheet set the padding of items
        self.setCompleter(completer)
        self.textEdited.connect(lambda _text: self._set_invalid(is_invalid=False))
        slot.reserve_width(max(slot.sizeHint().width() + 24, round(theme.scaled(FIELD_WIDTH))))
        slot.geometry_changed.connect(self._position_over_slot)
        self.closed.connect(slot.release_width)
        self._position_over_slot()
        self.selectAll()
        self.show()
        self.setFocus(Qt.FocusReason.OtherFocusReason)

    def _position_over_slot(self) -> None:
        rect = QRect(self.slot.mapTo(self._row, QPoint()), self.slot.size())
        middle, height = rect.center().y(), max(rect.height() + 4, self.sizeHint().height())
        rect.setHeight(height)
        rect.moveTop(middle - height // 2)
        self.setGeometry(rect)

    def set_completions(self, completions: Sequence[str]) -> None:
        """Set the completions."""
        if list(completions) == self._completion_model.stringList():
            return
        self._completion_model.setStringList(list(completions))
        if self.hasFocus() and completions and self.text() == "":
            self._show_all_completions()

    def _show_all_completions(self) -> None:
        completer = self.completer()
        completer.setCompletionPrefix("")
        completer.complete()

    def _completion_selected(self, _text: str) -> None:
        # QCompleter sets the text after this signal.
        QTimer.singleShot(0, self, self._commit_and_dismiss)

    def _commit_and_dismiss(self) -> None:
        if not self._is_closed and self._commit():
            self.dismiss()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        popup = self.completer().popup()
        is_offering = popup is not None and popup.isVisible()
        if event.key() == Qt.Key.Key_Escape and not is_offering:
            self.dismiss()
        elif event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter} and has_no_modifiers(event):
            self._commit_and_dismiss()
        elif event.key() == Qt.Key.Key_Down and not is_offering:
            self._show_all_completions()
        else:
            super().keyPressEvent(event)

    def focusNextPrevChild(self, forward: bool) -> bool:
        if self._commit():
            slot = self.slot
            self.dismiss()
            next_in_focus_chain(slot, forward=forward).setFocus(Qt.FocusReason.TabFocusReason)
        return True

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        if event.reason() != Qt.FocusReason.PopupFocusReason and not self._is_closed:
            self._commit()
            self.dismiss(keeps_focus=False)

    def _commit(self) -> bool:
        is_valid = self._apply(self.text())
        self._set_invalid(is_invalid=not is_valid)
        return is_valid

    def _set_invalid(self, *, is_invalid: bool) -> None:
        if (self.property("wrong") == "true") != is_invalid:
            set_invalid(self, is_invalid=is_invalid)
            self.setToolTip(plain.tip(self._rejection) if is_invalid else "")
            if is_invalid and self.hasFocus():
                QToolTip.showText(self.mapToGlobal(self.rect().bottomLeft()), self.toolTip(), self)
            elif not is_invalid:
                QToolTip.hideText()

    def dismiss(self, *, keeps_focus: bool = True) -> None:
        """Close the field and, if `keeps_focus` is True, return the focus to its slot."""
        if self._is_closed:
            return
        self._is_closed = True
        if keeps_focus:
            self.slot.setFocus(Qt.FocusReason.OtherFocusReason)
        self.hide()
        self.closed.emit()
        self.deleteLater()
