"""Answer choices of a question as large buttons, operated by mouse, arrow keys and number keys."""

from __future__ import annotations

import math
from collections.abc import Sequence

from PySide6.QtCore import QRect, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QFont, QFontMetricsF, QKeyEvent, QPainter, QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import PaintedButton
from app.ui.widgets.keyboard import has_no_modifiers, is_activation_key

GAP = 8
PADDING = 14
MIN_HEIGHT = 52
MAX_COLUMNS = 3
NUMBER_KEY_COUNT = 9
_WRAP_FLAGS = int(Qt.TextFlag.TextWordWrap | Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)


class ChoiceButton(PaintedButton):
    """Button for one choice, with its number key and wrapped text."""

    def __init__(self, theme: Theme, text: str, key: str) -> None:
        # `key` is "" for choices beyond the number keys.
        super().__init__(theme, text, radius="large")
        self.key = key
        self._display_text = plain.make_breakable(text)
        self.setProperty("ownFocus", True)

    def _font(self) -> QFont:
        return self._theme.font("button")

    def _text_left(self) -> float:
        return PADDING + (paint.key_width(self._theme, self.key) + 10 if self.key else 0)

    def one_line_width(self) -> int:
        """Return the width in px that the button needs to show its text on one line."""
        return math.ceil(self._text_left() + paint.width_of(self._font(), self.text()) + PADDING) + 1

    def height_for(self, width: int) -> int:
        """Return the height in px that the button needs at a width in px."""
        room = QRectF(0, 0, max(1.0, width - self._text_left() - PADDING), 1e6)
        text_height = QFontMetricsF(self._font()).boundingRect(room, _WRAP_FLAGS, self._display_text).height()
        return max(round(self._theme.scaled(MIN_HEIGHT)), math.ceil(text_height) + 2 * PADDING)

    def sizeHint(self) -> QSize:
        width = self.one_line_width()
        return QSize(width, self.height_for(width))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Handle Enter and Space, and pass all other keys on to `ChoiceGrid`.

        Qt's buttons would handle the arrow keys themselves.
        """
        if is_activation_key(event.key()):
            super().keyPressEvent(event)
        else:
            event.ignore()

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme, role = self._theme, self._theme.colour
        is_focused = self.hasFocus()
        fill = "pressed" if self.isDown() else "hover" if self.is_hovered else None
        edge = "accent" if is_focused else "borderStrong" if self.isEnabled() else "border"
        if fill is None and self.isEnabled():
            fill = "accentTint" if is_focused else "panel"
        radius = theme.radius("large")
        paint.box(painter, rect, radius, role(fill) if fill else None, role(edge), 2 if is_focused else 1)
        if self.key:
            right = PADDING + paint.key_width(theme, self.key)
            paint.key_cap(painter, theme, right, rect.center().y(), self.key)
        painter.setFont(self._font())
        painter.setPen(role("text" if self.isEnabled() else "textDisabled"))
        painter.drawText(rect.adjusted(self._text_left(), 0, -PADDING, 0), _WRAP_FLAGS, self._display_text)


class ChoiceGrid(QWidget):
    """Grid of buttons for the choices of a question.

    There are as many columns as fit with each text on one line. `selected` is emitted with the text of
    the activated button.
    """

    selected = Signal(str)
    focus_moved = Signal(QWidget)
    """Emitted with the button that got the focus by an arrow key, so that it can be scrolled into view."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.buttons: list[ChoiceButton] = []
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)

    def show_choices(self, choices: Sequence[str]) -> None:
        """Replace the buttons by one for each choice."""
        for button in self.buttons:
            button.hide()
            button.deleteLater()
        self.buttons = []
        for number, choice in enumerate(choices, 1):
            button = ChoiceButton(self._theme, choice, str(number) if number <= NUMBER_KEY_COUNT else "")
            button.clicked.connect(lambda _on=False, words=choice: self.selected.emit(words))
            button.setParent(self)
            button.show()
            self.buttons.append(button)
        self._arrange()
        self.updateGeometry()

    def focus_first(self) -> None:
        """Set the focus to the first choice."""
        if self.buttons:
            self.buttons[0].setFocus(Qt.FocusReason.PopupFocusReason)

    def set_paused(self, *, paused: bool) -> None:
        """Disable all choices if `paused`, else enable them."""
        for button in self.buttons:
            button.setEnabled(not paused)

    def columns(self, width: int) -> int:
        """Return the number of columns that fit into a width in px."""
        widest = max((each.one_line_width() for each in self.buttons), default=1)
        fitting_columns = (width - GAP) // (widest + GAP)
        return max(1, min(MAX_COLUMNS, len(self.buttons), fitting_columns))

    def button_rects(self, width: int) -> list[QRect]:
        """Return the rectangles of the buttons for a width in px.

        Buttons of the same row have equal heights.
        """
        columns = self.columns(width)
        button_width = (width - GAP) // columns - GAP
        rects: list[QRect] = []
        top = 0
        for first in range(0, len(self.buttons), columns):
            row = self.buttons[first : first + columns]
            row_height = max(each.height_for(button_width) for each in row)
            rects += [
                QRect(column * (button_width + GAP), top, button_width, row_height)
                for column in range(len(row))
            ]
            top += row_height + GAP
        return rects

    def heightForWidth(self, width: int) -> int:
        rects = self.button_rects(width)
        return rects[-1].bottom() + 1 if rects else 0

    def hasHeightForWidth(self) -> bool:
        return True

    def sizeHint(self) -> QSize:
        width = max(1, self.width())
        return QSize(width, self.heightForWidth(width))

    def minimumSizeHint(self) -> QSize:
        return QSize(60, 0)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._arrange()

    def _arrange(self) -> None:
        for button, rect in zip(self.buttons, self.button_rects(max(60, self.width())), strict=True):
            button.setGeometry(rect)

    def handle_key(self, event: QKeyEvent) -> bool:
        """Move the focus on an arrow key, or activate a choice on a number key; return True if handled."""
        key = event.key()
        number = key - Qt.Key.Key_1
        if not has_no_modifiers(event) or not self.buttons or not self.buttons[0].isEnabled():
            return False
        if 0 <= number < min(len(self.buttons), NUMBER_KEY_COUNT):
            if not event.isAutoRepeat():
                self.buttons[number].click()
            return True
        columns = self.columns(self.width())
        steps = {
            Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1, Qt.Key.Key_Up: -columns, Qt.Key.Key_Down: columns,
        }  # fmt: skip
        if key not in steps:
            return False
        current = next((index for index, each in enumerate(self.buttons) if each.hasFocus()), 0)
        target = min(max(current + steps[Qt.Key(key)], 0), len(self.buttons) - 1)
        self.buttons[target].setFocus(Qt.FocusReason.OtherFocusReason)
        self.focus_moved.emit(self.buttons[target])
        return True

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not self.handle_key(event):
            super().keyPressEvent(event)
