"""Text fields for search, filters, numbers with units, and long texts."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLineEdit, QPlainTextEdit, QSizePolicy

from app.robots.description.typed_number import parse_number
from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.inputs.frame import FieldFrame, set_invalid
from app.ui.widgets.keyboard import has_no_modifiers
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _
from nep.i18n import number as number_text

MAX_LINES = 5
MIN_HEIGHT = 34
MIN_FILTER_WIDTH, MIN_FILTER_TEXT_WIDTH = 40, 80  # px
STYLE_SHEET_PADDING = 9  # padding of the style sheet above and below, and a pixel for rounding


class SearchField(QLineEdit):
    """Search field with an icon on the left and its shortcut on the right."""

    icon_name = "search"

    def __init__(self, theme: Theme, placeholder: str, key: str = "") -> None:
        super().__init__()
        self._theme, self._key = theme, key
        self.setPlaceholderText(placeholder)
        self.setAccessibleName(placeholder)
        self.setProperty("quiet", "true")
        self.setProperty("focusRadius", theme.radius("control"))
        self.setMinimumHeight(26)
        FieldContextMenu(theme, self)
        self._arrange()
        theme.changed.connect(self._arrange)

    def set_key(self, key: str) -> None:
        """Set the shortcut to show; "" for none."""
        if key != self._key:
            self._key = key
            self._arrange()
            self.update()

    def _arrange(self) -> None:
        right = round(paint.key_width(self._theme, self._key)) + 2 if self._key else 0
        self.setTextMargins(20, 0, right, 0)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        painter = QPainter(self)
        middle = self.height() / 2
        paint_icon(painter, QRectF(9, middle - 7, 14, 14), self.icon_name, self._theme.colour("textTertiary"))
        if self._key and not self.text():
            paint.key_cap(painter, self._theme, self.width() - 5, middle, self._key)
        painter.end()


class FilterField(SearchField):
    """Field to filter a list. Esc clears the field. In a narrow title bar only the icon is shown.

    `exited` is emitted on Down and Enter, which move the focus to the list.
    """

    exited = Signal()

    def __init__(self, theme: Theme, name: str) -> None:
        # `name` is the accessible name, such as "Filter topics".
        super().__init__(theme, _("Filter"), "/")
        self.setAccessibleName(name)
        self.setMaximumWidth(190)

    def minimumSizeHint(self) -> QSize:
        # not a minimum width, because a crowded layout would place other widgets over the field
        return QSize(MIN_FILTER_WIDTH, super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        is_icon_only = self.width() < MIN_FILTER_TEXT_WIDTH
        self.set_key("" if is_icon_only else "/")
        self.setPlaceholderText("" if is_icon_only else _("Filter"))
        self.setToolTip(plain.tip(self.accessibleName()) if is_icon_only else "")

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and self.text():
            self.clear()
        elif event.key() in {Qt.Key.Key_Down, Qt.Key.Key_Return, Qt.Key.Key_Enter} and has_no_modifiers(
            event
        ):
            self.exited.emit()
        else:
            super().keyPressEvent(event)


class NumberEdit(QLineEdit):
    """Field for a number, with its unit inside. Invalid text stays in the field and is reported.

    Args:
        theme: Theme.
        minimum: Minimum, or None for no limit.
        maximum: Maximum, or None for no limit.
        unit: Unit, or "".
        decimals: Number of decimals.
        may_be_empty: True if the field may be empty; `cleared` is then emitted when the text is deleted.
    """

    number_entered = Signal(float)
    cleared = Signal()
    problem_changed = Signal(str)

    def __init__(
        self,
        theme: Theme,
        minimum: float | None,
        maximum: float | None,
        unit: str = "",
        decimals: int = 0,
        *,
        may_be_empty: bool = False,
    ) -> None:
        super().__init__()
        self._may_be_empty = may_be_empty
        self._theme, self._unit, self._decimals = theme, unit, decimals
        self._minimum, self._maximum = minimum, maximum
        self.problem = ""
        self.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.setMinimumHeight(theme.size("control", "form") - 2)
        self.setProperty("focusRadius", theme.radius("control"))
        self.editingFinished.connect(self._parse_text)
        theme.changed.connect(self._arrange)
        self._arrange()

    def _arrange(self) -> None:
        unit_width = paint.width_of(self._theme.font("body"), self._unit)
        self.setTextMargins(0, 0, round(unit_width) + (6 if self._unit else 0), 0)

    def show_number(self, value: float) -> None:
        """Show a number and clear the error state."""
        self.setText(self.format_number(value))
        self._set_problem("")

    def format_number(self, value: float) -> str:
        """Format a number with the decimals of the field."""
        return number_text(value, f".{self._decimals}f")

    def _parse_text(self) -> None:
        if self._may_be_empty and not self.text().strip():
            self._set_problem("")
            self.cleared.emit()
            return
        try:
            value = parse_number(self.text())
        except ValueError as error:
            self._set_problem(str(error))
            return
        if self._minimum is not None and value < self._minimum:
            self._set_problem(_("The minimum is {value}.").format(value=self._limit_text(self._minimum)))
        elif self._maximum is not None and value > self._maximum:
            self._set_problem(_("The maximum is {value}.").format(value=self._limit_text(self._maximum)))
        else:
            self._set_problem("")
            self.number_entered.emit(value)

    def _limit_text(self, value: float) -> str:
        return f"{number_text(value)} {self._unit}".rstrip()

    def _set_problem(self, message: str) -> None:
        if message == self.problem:
            return
        self.problem = message
        set_invalid(self, is_invalid=bool(message))
        self.problem_changed.emit(message)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        theme = self._theme
        painter = QPainter(self)
        rect = QRectF(self.rect()).adjusted(8, 0, -10, 0)
        paint.text_line(
            painter, rect, self._unit, theme.font("body"), theme.colour("textTertiary"), paint.RIGHT
        )
        if self.problem:
            icon_rect = QRectF(7, self.height() / 2 - 7, 14, 14)
            paint_icon(painter, icon_rect, theme.status("error").icon, theme.colour("error"))
        painter.end()


class _MultiLineEdit(QPlainTextEdit):
    """Multi-line text edit in which Tab moves the focus."""

    exited = Signal()
    entered = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setProperty("bare", "true")
        self.setProperty("ownFocus", "true")
        self.setTabChangesFocus(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setLineWrapMode(QPlainTextEdit.LineWrapMode.WidgetWidth)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.document().setDocumentMargin(0)
        self.viewport().setAutoFillBackground(False)

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.entered.emit()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.exited.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        modifiers = event.modifiers() & (
            Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.MetaModifier
        )
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter} and modifiers:
            event.ignore()  # handled by the card, which tries the action
        else:
            super().keyPressEvent(event)


class LongTextField(FieldFrame):
    """Multi-line text field; `finished` is emitted when the field loses the focus."""

    changed = Signal()
    finished = Signal()

    def __init__(self, theme: Theme, name: str) -> None:
        super().__init__()
        self._theme = theme
        self.setAccessibleName(name)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setProperty("focusRadius", theme.radius("control"))
        self.edit = _MultiLineEdit()
        self.edit.setAccessibleName(name)
        FieldContextMenu(theme, self.edit)
        self.setFocusProxy(self.edit)
        row = QHBoxLayout(self)
        row.setContentsMargins(3, 2, 3, 1)
        row.addWidget(self.edit)
        self.edit.textChanged.connect(self._grow)
        self.edit.textChanged.connect(self.changed)
        self.edit.exited.connect(self.finished)
        self.edit.exited.connect(self.update_focus)
        self.edit.entered.connect(self.update_focus)
        theme.changed.connect(self._grow)
        self._grow()

    def text(self) -> str:
        """Return the text."""
        return self.edit.toPlainText()

    def set_text(self, text: str) -> None:
        """Set the text."""
        if text != self.text():
            self.edit.setPlainText(text)

    def _line_count(self) -> int:
        lines = 0
        block = self.edit.document().firstBlock()
        while block.isValid() and lines < MAX_LINES:
            lines += max(1, block.layout().lineCount())
            block = block.next()
        return min(MAX_LINES, max(1, lines))

    def _line_height(self) -> float:
        return paint.height_of(self.edit.font())

    def _grow(self) -> None:
        line_count = self._line_count()
        text_height = round(line_count * self._line_height()) + STYLE_SHEET_PADDING
        height = max(round(self._theme.scaled(MIN_HEIGHT)), text_height + 8)
        self.edit.setFixedHeight(text_height)
        policy = Qt.ScrollBarPolicy.ScrollBarAsNeeded if line_count == MAX_LINES else None
        self.edit.setVerticalScrollBarPolicy(policy or Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        if height != self.height():
            self.setFixedHeight(height)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._grow()  # the number of lines may have changed

    def sizeHint(self) -> QSize:
        return QSize(240, self.height())
