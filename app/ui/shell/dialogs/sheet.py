"""A small sheet over the window: keyboard shortcuts, or what Studio is. Esc closes it."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QSize
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.ui.shell.dialogs.overlay import Overlay
from app.ui.text.numbers import spoken_key
from app.ui.theme.theme import Theme
from app.ui.widgets import IconButton, label, paint


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


class Sheet(Overlay):
    """Lines of words, each perhaps with its key, under a heading; it is gone when it is closed."""

    top = 96

    def __init__(
        self, theme: Theme, window: QWidget, title: str, lines: Sequence[tuple[str, str]], *, wide: int = 420
    ) -> None:
        super().__init__(theme, window, title)
        self._wide = wide
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 16, 20, 18)
        column.setSpacing(10)
        head = QHBoxLayout()
        head.addWidget(label(title, "heading", wrap=True), 1)
        self._close = IconButton(theme, "x", "Close", "Esc")
        self._close.clicked.connect(self.shut)
        head.addWidget(self._close)
        column.addLayout(head)
        grid = QGridLayout()
        grid.setHorizontalSpacing(24)
        grid.setVerticalSpacing(6)
        grid.setColumnStretch(0, 1)
        for row, (words, key) in enumerate(lines):
            shown = label(words, "body", role="text" if key else "textSecondary", wrap=True)
            grid.addWidget(shown, row, 0, 1, 1 if key else 2)
            if key:
                grid.addWidget(KeyCap(theme, spoken_key(key)), row, 1)
        column.addLayout(grid)
        self.closed.connect(self.deleteLater)
        self.closed.connect(self._scrim.deleteLater)

    def first(self) -> QWidget:
        return self._close

    def wanted_size(self, room: QSize) -> QSize:
        wide = min(room.width(), round(self.theme.scaled(self._wide)))
        layout = self.layout()
        high = layout.totalHeightForWidth(wide) if layout is not None else 0
        return QSize(wide, min(room.height(), high))

    def show_over(self) -> None:
        """Show it; Esc or a press beside it closes it."""
        self.open()
