"""One line of words of which some are bold, elided at its end."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QFontMetricsF, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import paint


class BoldInLine(QWidget):
    """``sentence`` with ``subject`` in bold where it stands in it."""

    def __init__(self, theme: Theme, sentence: str, subject: str, kind: str = "bodyLarge") -> None:
        super().__init__()
        self._theme, self._kind = theme, kind
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setAccessibleName(sentence)
        self.setToolTip(plain.tip(sentence))
        before, found, after = sentence.partition(subject) if subject else (sentence, "", "")
        self._parts = ((before, False), (found, True), (after, False))

    def sizeHint(self) -> QSize:
        return QSize(200, round(QFontMetricsF(self._theme.font(self._kind)).height()) + 2)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        rect = QRectF(self.rect())
        for words, strong in self._parts:
            font = self._theme.font(self._kind)
            if strong:
                font.setWeight(font.Weight.Bold)
            if words and rect.width() > 4:
                paint.words(painter, rect, words, font, self._theme.colour("text"))
            rect.setLeft(rect.left() + QFontMetricsF(font).horizontalAdvance(words))
        painter.end()


def is_pressed_key(key: int) -> bool:
    """Whether a key presses what has the focus."""
    return key in {Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space}
