"""The robots at the left of the Robots panel, and what to do when one is not among them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.ui.robot_item import LIST_WIDTH, RobotItem
from app.ui.theme import Theme
from app.ui.widgets import Button, Card, label

if TYPE_CHECKING:
    from app.core.robot_link import RobotLink


TURTLE = "diffdrive"


class RobotList(QWidget):
    """One row for each robot; `chosen` tells the name of the one that was pressed."""

    chosen = Signal(str)

    def __init__(self, theme: Theme, run: Callable[[str], object]) -> None:
        """``run`` does a command by its name."""
        super().__init__()
        self._theme = theme
        self.items: dict[str, RobotItem] = {}
        self.setFixedWidth(LIST_WIDTH)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(8, 8, 8, 8)
        self._column.setSpacing(2)
        self._column.addStretch(1)
        self._column.addWidget(self._make_help(run))

    def _make_help(self, run: Callable[[str], object]) -> QWidget:
        card = Card(self._theme, fill="sunken")
        column = QVBoxLayout(card)
        column.setContentsMargins(14, 12, 14, 12)
        column.setSpacing(6)
        column.addWidget(label("Robot not in the list?", "label"))
        said = "Check that it is on and that its driver runs."
        column.addWidget(label(said, "body", role="textSecondary", wrap=True))
        self.why = Button(self._theme, "Find out why", "stethoscope", size="small")
        self.why.clicked.connect(lambda: run("help.doctor"))
        self.turtle = Button(self._theme, "Use a virtual Turtle", "bot", kind="ghost", size="small")
        self.turtle.setAccessibleName("Use the virtual Turtle")
        self.turtle.clicked.connect(lambda: run("robots.turtle"))
        for button in (self.why, self.turtle):  # below each other: large text needs the width
            column.addWidget(button, 0, Qt.AlignmentFlag.AlignLeft)
        return card

    def show_links(self, links: Sequence[RobotLink]) -> None:
        """Add the robots that are new."""
        for link in links:
            if link.name not in self.items:
                item = RobotItem(self._theme, link)
                item.clicked.connect(lambda _on=False, name=link.name: self.chosen.emit(name))
                self.items[link.name] = item
                self._column.insertWidget(self._column.count() - 2, item)
        self.turtle.setVisible(not any(link.robot.model == TURTLE and link.connected for link in links))
