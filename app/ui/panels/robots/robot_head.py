"""The head of the chosen robot: its name, how it is, and its own Stop."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Chip, Elided, SearchField, label
from app.ui.widgets.flow_layout import Flow

FINDER_WIDTH = 180


class RobotHead(QWidget):
    """Widgets in a row; the panel fills them."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.name = label("", "heading")
        self.chip = Chip(theme)
        self.about = Elided("body", "textSecondary")
        self.finder = SearchField(theme, "Find an action")
        self.finder.setFixedWidth(FINDER_WIDTH)
        self.finder.setMinimumHeight(theme.size("control", "form"))
        self.stop = Button(theme, "Stop", "square", kind="stop", size="large")
        self.stop.fill_icon = True
        row = Flow(self)
        row.setContentsMargins(16, 7, 16, 8)
        row.addWidget(self.name)
        row.addWidget(self.chip)
        row.add_elastic(self.about)
        row.push()
        row.addWidget(self.finder)
        row.addWidget(self.stop)
