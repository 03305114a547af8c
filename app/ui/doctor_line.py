"""The line below an empty panel that leads to the connection doctor."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.ui.theme import Theme
from app.ui.widgets import Button, Line, label

COMMAND = "help.doctor"


class DoctorLine(QWidget):
    """``Expected to see something?`` with its button."""

    def __init__(self, theme: Theme, run: Callable[[str], None]) -> None:
        """``run`` does a command of the window by its name."""
        super().__init__()
        words = label("Expected to see something?", "small", role="textSecondary", wrap=True)
        words.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.button = Button(theme, "Open the connection doctor", kind="ghost", size="small")
        self.button.let_shrink()
        self.button.clicked.connect(lambda: run(COMMAND))
        row = QHBoxLayout()
        row.setContentsMargins(12, 3, 12, 3)
        row.setSpacing(2)
        row.addStretch(1)
        row.addWidget(words, 4)
        row.addWidget(self.button, 4)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(Line(theme))
        column.addLayout(row)
