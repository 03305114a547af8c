"""What Studio is: a small sheet over the window. Esc closes it."""

from __future__ import annotations

from PySide6.QtCore import QSize
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.ui.shell.dialogs.overlay import Overlay
from app.ui.theme.theme import Theme
from app.ui.widgets import IconButton, label
from nep.i18n import _, lazy

TITLE = "NEP Studio"
LINES = (
    lazy("See what robots say, and tell them what to do."),
    lazy("NEP Studio is free software (MIT licence)."),
    lazy("Inter and JetBrains Mono: SIL Open Font License 1.1. Icons: Lucide, ISC licence."),
)
WIDE = 420


class AboutSheet(Overlay):
    """It is gone when it is closed."""

    top = 96

    def __init__(self, theme: Theme, window: QWidget) -> None:
        super().__init__(theme, window, TITLE)
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 16, 20, 18)
        column.setSpacing(10)
        head = QHBoxLayout()
        head.addWidget(label(TITLE, "heading", wrap=True), 1)
        self._close = IconButton(theme, "x", _("Close"), "Esc")
        self._close.clicked.connect(self.shut)
        head.addWidget(self._close)
        column.addLayout(head)
        lines = QVBoxLayout()
        lines.setSpacing(6)
        for words in LINES:
            lines.addWidget(label(_(words), "body", role="textSecondary", wrap=True))
        column.addLayout(lines)
        self.closed.connect(self.deleteLater)
        self.closed.connect(self._scrim.deleteLater)

    def first(self) -> QWidget:
        return self._close

    def wanted_size(self, room: QSize) -> QSize:
        wide = min(room.width(), round(self.theme.scaled(WIDE)))
        layout = self.layout()
        high = layout.totalHeightForWidth(wide) if layout is not None else 0
        return QSize(wide, min(room.height(), high))
