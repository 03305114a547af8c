"""A field for texts that may be long: one line high, and it grows with the text to five."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPlainTextEdit, QSizePolicy, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.menus import EditMenu

MOST_LINES = 5
LEAST_HEIGHT = 34
SHEET_PADDING = 9  # what the style sheet gives texts above and below, and a pixel for rounding


class _Text(QPlainTextEdit):
    """The text itself; Tab leaves it."""

    left = Signal()
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
        self.left.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        held = event.modifiers() & (Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.MetaModifier)
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter} and held:
            event.ignore()  # the card's: try it
        else:
            super().keyPressEvent(event)


class LongText(QWidget):
    """Several lines of text in the frame of a field; `finished` when a person leaves it."""

    changed = Signal()
    finished = Signal()

    def __init__(self, theme: Theme, name: str) -> None:
        super().__init__()
        self._theme = theme
        self._wrong = False
        self.setAccessibleName(name)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setProperty("focusRadius", theme.radius("control"))
        self.edit = _Text()
        self.edit.setAccessibleName(name)
        EditMenu(theme, self.edit)
        self.setFocusProxy(self.edit)
        row = QHBoxLayout(self)
        row.setContentsMargins(3, 2, 3, 1)
        row.addWidget(self.edit)
        self.edit.textChanged.connect(self._grow)
        self.edit.textChanged.connect(self.changed)
        self.edit.left.connect(self.finished)
        self.edit.left.connect(self.update)
        self.edit.entered.connect(self.update)
        theme.changed.connect(self._grow)
        self._grow()

    def text(self) -> str:
        """What stands in it."""
        return self.edit.toPlainText()

    def set_text(self, text: str) -> None:
        """Put another text into it."""
        if text != self.text():
            self.edit.setPlainText(text)

    @property
    def wrong(self) -> bool:
        """Whether it is marked as wrong."""
        return self._wrong

    def mark(self, *, wrong: bool) -> None:
        """Give it the edge of a wrong value, or take it away."""
        if wrong != self._wrong:
            self._wrong = wrong
            self.update()

    def _lines(self) -> int:
        lines = 0
        block = self.edit.document().firstBlock()
        while block.isValid() and lines < MOST_LINES:
            lines += max(1, block.layout().lineCount())
            block = block.next()
        return min(MOST_LINES, max(1, lines))

    def _line_height(self) -> float:
        return paint.height_of(self.edit.font())

    def _grow(self) -> None:
        lines = self._lines()
        text = round(lines * self._line_height()) + SHEET_PADDING
        high = max(round(self._theme.scaled(LEAST_HEIGHT)), text + 8)
        self.edit.setFixedHeight(text)
        shown = Qt.ScrollBarPolicy.ScrollBarAsNeeded if lines == MOST_LINES else None
        self.edit.setVerticalScrollBarPolicy(shown or Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        if high != self.height():
            self.setFixedHeight(high)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._grow()  # other words may wrap now

    def sizeHint(self) -> QSize:
        return QSize(240, self.height())

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        edge = "error" if self._wrong else "accent" if self.edit.hasFocus() else "controlBorder"
        fill = theme.colour("sunken" if theme.dark else "panel")
        width = 2.0 if self.edit.hasFocus() else 1.0
        paint.box(painter, QRectF(self.rect()), theme.radius("control"), fill, theme.colour(edge), width)
        painter.end()
