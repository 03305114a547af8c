"""A small sheet over the window: keyboard shortcuts, or what Studio is. Esc closes it."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QApplication, QGridLayout, QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.ui.shortcuts import spoken_key as spoken_key
from app.ui.theme import Theme
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


class Sheet(QWidget):
    """Lines of words, each perhaps with its key, under a heading."""

    def __init__(
        self, theme: Theme, window: QWidget, title: str, lines: Sequence[tuple[str, str]], *, wide: int = 360
    ) -> None:
        super().__init__(window)
        self._theme = theme
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setAccessibleName(title)
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 16, 20, 18)
        column.setSpacing(10)
        head = QHBoxLayout()
        head.addWidget(label(title, "heading"))
        head.addStretch(1)
        self._close = IconButton(theme, "x", "Close", "Esc")
        self._close.clicked.connect(self.close)
        head.addWidget(self._close)
        column.addLayout(head)
        grid = QGridLayout()
        grid.setHorizontalSpacing(24)
        grid.setVerticalSpacing(6)
        for row, (words, key) in enumerate(lines):
            shown = label(words, "body", role="text" if key else "textSecondary", wrap=not key)
            grid.addWidget(shown, row, 0, 1, 1 if key else 2)
            if key:
                grid.addWidget(KeyCap(theme, spoken_key(key)), row, 1)
        column.addLayout(grid)
        self.setMinimumWidth(wide)

    def show_over(self) -> None:
        """In the middle of the window, a little above its half."""
        window = self.parentWidget()
        self.adjustSize()
        if window is not None:
            left = (window.width() - self.width()) // 2
            self.move(left, max(8, (window.height() - self.height()) // 3))
        self.show()
        self.raise_()
        self._close.setFocus(Qt.FocusReason.PopupFocusReason)
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._focus_changed)

    def _focus_changed(self, _old: QWidget | None, new: QWidget | None) -> None:
        if new is not None and not self.isAncestorOf(new):
            self.close()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.close()
        else:
            super().keyPressEvent(event)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        theme = self._theme
        fill, edge = theme.colour("raised"), theme.colour("border")
        paint.box(painter, QRectF(self.rect()), theme.radius("card"), fill, edge)
        painter.end()
