"""The line below an empty panel that leads to the connection doctor."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.ui.theme import Theme
from app.ui.widgets import Elided, Line
from app.ui.widgets.button import LinkButton

COMMAND = "help.doctor"


class DoctorLine(QWidget):
    """``Expected to see something?`` with its button."""

    def __init__(self, theme: Theme, run: Callable[[str], None]) -> None:
        """``run`` does a command of the window by its name."""
        super().__init__()
        words = Elided("small", "textSecondary")
        words.setText("Expected to see something?")
        self.button = LinkButton(theme, "Open the connection doctor")
        self.button.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        self.button.clicked.connect(lambda: run(COMMAND))
        row = QHBoxLayout()
        row.setContentsMargins(12, 3, 12, 3)
        row.setSpacing(6)
        row.addStretch(1)
        row.addWidget(words)
        row.addWidget(self.button)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(Line(theme))
        column.addLayout(row)
