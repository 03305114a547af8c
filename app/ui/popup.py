"""A small sheet over the window: keyboard shortcuts, or what Studio is. Esc closes it."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QPoint, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QVBoxLayout, QWidget

from app.ui.theme import Theme
from app.ui.widgets import label, paint


class KeyCap(QWidget):
    """The name of a key in its cap."""

    def __init__(self, theme: Theme, key: str) -> None:
        super().__init__()
        self._theme, self._key = theme, key
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(key)

    def sizeHint(self) -> QSize:
        return QSize(round(paint.key_width(self._theme, self._key)) + 2, round(self._theme.scaled(20)))

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        paint.key_cap(painter, self._theme, self.width() - 1, self.height() / 2, self._key)
        painter.end()


class Sheet(QWidget):
    """Lines of words, each perhaps with its key, under a heading."""

    def __init__(
        self, theme: Theme, window: QWidget, title: str, lines: Sequence[tuple[str, str]], *, wide: int = 360
    ) -> None:
        super().__init__(window, Qt.WindowType.Popup | Qt.WindowType.FramelessWindowHint)
        self._theme = theme
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setAttribute(Qt.WidgetAttribute.WA_TranslucentBackground)
        self.setAccessibleName(title)
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 16, 20, 18)
        column.setSpacing(10)
        column.addWidget(label(title, "heading"))
        grid = QGridLayout()
        grid.setHorizontalSpacing(24)
        grid.setVerticalSpacing(6)
        for row, (words, key) in enumerate(lines):
            shown = label(words, "body", role="text" if key else "textSecondary", wrap=not key)
            grid.addWidget(shown, row, 0, 1, 1 if key else 2)
            if key:
                grid.addWidget(KeyCap(theme, key.replace("+", " ").strip() or key), row, 1)
        column.addLayout(grid)
        self.setMinimumWidth(wide)

    def show_over(self) -> None:
        """In the middle of the window, a little above its half."""
        window = self.parentWidget()
        self.adjustSize()
        if window is not None:
            left = (window.width() - self.width()) // 2
            self.move(window.mapToGlobal(QPoint(left, max(40, (window.height() - self.height()) // 3))))
        self.show()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        theme = self._theme
        fill, edge = theme.colour("raised"), theme.colour("border")
        paint.box(painter, QRectF(self.rect()), theme.radius("card"), fill, edge)
        painter.end()
