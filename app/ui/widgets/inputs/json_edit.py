"""JSON editor with line numbers, syntax highlighting, and a marker for an invalid line."""

from __future__ import annotations

import re

from PySide6.QtCore import QRect, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QKeyEvent,
    QPainter,
    QPaintEvent,
    QResizeEvent,
    QSyntaxHighlighter,
    QTextBlock,
    QTextCharFormat,
    QTextCursor,
    QTextDocument,
    QTextFormat,
)
from PySide6.QtWidgets import QFrame, QPlainTextEdit, QTextEdit, QVBoxLayout, QWidget

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.inputs.frame import FieldFrame
from app.ui.widgets.menus import FieldContextMenu

INDENT = 2
# The first matching rule applies: strings before their contents, keys before strings.
_HIGHLIGHT_RULES: tuple[tuple[str, str], ...] = (
    ("textSecondary", r'"(?:\\.|[^"\\])*"(?=\s*:)'),
    ("ok", r'"(?:\\.|[^"\\])*"?'),
    ("accentText", r"\{ ?[^\W\d][\w ]* ?\}"),
    ("changed", r"\b(?:true|false|null)\b"),
    ("warn", r"-?\b\d+(?:\.\d+)?(?:[eE][+-]?\d+)?\b"),
)
_TOKEN_PATTERN = re.compile(
    "|".join(f"(?P<r{index}>{rule})" for index, (_role, rule) in enumerate(_HIGHLIGHT_RULES))
)


class _JsonHighlighter(QSyntaxHighlighter):
    def __init__(self, document: QTextDocument, theme: Theme) -> None:
        super().__init__(document)
        self._theme = theme
        self.is_on = True

    def highlightBlock(self, text: str) -> None:
        if not self.is_on:
            return
        for match in _TOKEN_PATTERN.finditer(text):
            role = _HIGHLIGHT_RULES[int((match.lastgroup or "r0")[1:])][0]
            text_format = QTextCharFormat()
            text_format.setForeground(self._theme.colour(role))
            if role == "accentText":
                text_format.setBackground(self._theme.colour("accentTint"))
            self.setFormat(match.start(), match.end() - match.start(), text_format)


class _LineNumberArea(QWidget):
    """Line numbers to the left of the text."""

    def __init__(self, text: JsonLinesEdit) -> None:
        super().__init__(text)
        self._text = text

    def paintEvent(self, event: QPaintEvent) -> None:
        self._text.paint_numbers(self, event.rect())


class JsonLinesEdit(QPlainTextEdit):
    """Text edit for JSON, which keeps the indentation on Enter. Tab moves the focus.

    `submitted` is emitted on Ctrl+Enter.
    """

    submitted = Signal()
    focus_changed = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.invalid_line = 0
        self.setProperty("bare", "true")
        self.setProperty("ownFocus", "true")
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setTabChangesFocus(True)
        self.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.highlighter = _JsonHighlighter(self.document(), theme)
        self._numbers = _LineNumberArea(self)
        FieldContextMenu(theme, self)
        self.blockCountChanged.connect(self._update_margins)
        self.updateRequest.connect(self._on_scrolled)
        theme.changed.connect(self._restyle)
        self._restyle()

    def _restyle(self) -> None:
        font = self._theme.font("code")
        font.setPixelSize(round(self._theme.scaled(13)))
        self.setFont(font)
        self.highlighter.rehighlight()
        self._update_margins()
        self.mark_line(self.invalid_line)

    def _margin_width(self) -> int:
        digits = max(2, len(str(self.blockCount())))
        return round(paint.width_of(self.font(), "0" * digits)) + 30

    def _update_margins(self) -> None:
        self.setViewportMargins(self._margin_width(), 0, 0, 0)
        self._place_numbers()

    def _place_numbers(self) -> None:
        contents = self.contentsRect()
        self._numbers.setGeometry(
            QRect(contents.left(), contents.top(), self._margin_width(), contents.height())
        )

    def _on_scrolled(self, rect: QRect, dy: int) -> None:
        if dy:
            self._numbers.scroll(0, dy)
        else:
            self._numbers.update(0, rect.y(), self._numbers.width(), rect.height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._place_numbers()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.focus_changed.emit()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.focus_changed.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        modifiers = event.modifiers() & (
            Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.MetaModifier
        )
        if event.key() not in {Qt.Key.Key_Return, Qt.Key.Key_Enter} or self.isReadOnly():
            super().keyPressEvent(event)
        elif modifiers:
            self.submitted.emit()
        else:
            before = self.textCursor().block().text()[: self.textCursor().positionInBlock()]
            indent = len(before) - len(before.lstrip(" "))
            indent += INDENT if before.rstrip().endswith(("{", "[")) else 0
            self.textCursor().insertText("\n" + " " * indent)
            self.ensureCursorVisible()

    def mark_line(self, line: int) -> None:
        """Mark a line, counted from 1, as invalid; 0 removes the marker."""
        self.invalid_line = line
        marks = []
        if line:
            mark = QTextEdit.ExtraSelection()
            mark.format.setBackground(self._theme.colour("errorTint"))
            mark.format.setProperty(QTextFormat.Property.FullWidthSelection, True)
            mark.cursor = QTextCursor(self.document().findBlockByNumber(line - 1))
            marks.append(mark)
        self.setExtraSelections(marks)
        self._numbers.update()

    def paint_numbers(self, widget: QWidget, rect: QRect) -> None:
        """Paint the numbers of the visible lines.

        Args:
            widget: Widget on which the numbers are painted.
            rect: Rectangle to repaint.
        """
        theme, painter = self._theme, QPainter(widget)
        block = self.firstVisibleBlock()
        while block.isValid():
            area = self.blockBoundingGeometry(block).translated(self.contentOffset())
            if area.top() > rect.bottom():
                break
            if block.isVisible() and area.bottom() >= rect.top():
                self._paint_number(painter, block, area, theme.colour("textTertiary"))
            block = block.next()
        painter.end()

    def _paint_number(self, painter: QPainter, block: QTextBlock, area: QRectF, colour: QColor) -> None:
        theme, number = self._theme, block.blockNumber() + 1
        if number == self.invalid_line:
            colour = theme.colour("error")
            row = QRectF(0, area.top(), self._numbers.width(), area.height())
            painter.fillRect(row, theme.colour("errorTint"))
            paint_icon(painter, QRectF(2, area.center().y() - 7, 14, 14), theme.status("error").icon, colour)
        box = QRectF(0, area.top(), self._numbers.width() - 10, area.height())
        paint.text_line(painter, box, str(number), self.font(), colour, paint.RIGHT)


class JsonEdit(FieldFrame):
    """JSON editor in the frame of a field.

    `changed` is emitted on every edit, and `submitted` on Ctrl+Enter.
    """

    changed = Signal()
    submitted = Signal()

    def __init__(self, theme: Theme, name: str, *, min_lines: int = 6) -> None:
        # `name` is the accessible name; `min_lines` determines the minimum height.
        super().__init__()
        self._min_lines = min_lines
        self.edit = JsonLinesEdit(theme)
        self.edit.setAccessibleName(name)
        self.setFocusProxy(self.edit)
        self.setProperty("focusRadius", theme.radius("control"))
        column = QVBoxLayout(self)
        column.setContentsMargins(2, 2, 2, 2)
        column.addWidget(self.edit)
        self.edit.textChanged.connect(self.changed)
        self.edit.submitted.connect(self.submitted)
        self.edit.focus_changed.connect(self.update_focus)

    def text(self) -> str:
        """Return the text."""
        return self.edit.toPlainText()

    def set_text(self, text: str) -> None:
        """Set the text and clear the undo stack. Has no effect if the text is the same."""
        if text != self.text():
            self.edit.setPlainText(text)

    def replace(self, start: int, end: int, text: str) -> None:
        """Replace the characters from ``start`` to ``end`` as one undoable edit."""
        cursor = QTextCursor(self.edit.document())
        cursor.setPosition(start)
        cursor.setPosition(end, QTextCursor.MoveMode.KeepAnchor)
        cursor.insertText(text)

    def go_to(self, line: int, column: int) -> None:
        """Move the cursor to a line and column, counted from 1."""
        block = self.edit.document().findBlockByNumber(line - 1)
        cursor = QTextCursor(block)
        cursor.setPosition(block.position() + min(column - 1, max(0, block.length() - 1)))
        self.edit.setTextCursor(cursor)

    def set_highlighting(self, is_json: bool) -> None:
        """Enable syntax highlighting if the text is JSON, else disable it."""
        if self.edit.highlighter.is_on != is_json:
            self.edit.highlighter.is_on = is_json
            self.edit.highlighter.rehighlight()

    def mark_line(self, line: int) -> None:
        """Mark a line, counted from 1, as invalid; 0 removes the marker."""
        if line != self.edit.invalid_line or bool(line) != self.is_invalid:
            self.edit.mark_line(line)
            self.set_invalid(is_invalid=bool(line))

    @property
    def invalid_line(self) -> int:
        """Number of the line that is marked as invalid, or 0."""
        return self.edit.invalid_line

    def _height_for(self, lines: int) -> int:
        return round(lines * paint.height_of(self.edit.font())) + 12

    def minimumSizeHint(self) -> QSize:
        return QSize(150, self._height_for(self._min_lines))

    def sizeHint(self) -> QSize:
        return QSize(320, self._height_for(max(self._min_lines, 12)))
