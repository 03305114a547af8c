"""The bar above every layout: logo, menus, layout switch, palette field, robots, on the start page Stop."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from PySide6.QtCore import QRectF, Qt, Signal
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QMenuBar, QSizePolicy, QWidget

from app.ui.shell.bars.palette_field import PaletteField
from app.ui.shell.docking.layouts import Layout
from app.ui.shell.logo import Logo
from app.ui.theme.theme import Theme
from app.ui.widgets import Chip, Segments, StopButton, paint


class AppBar(QWidget):
    """Menus at the left, the layouts in the middle, the robots at the right."""

    layout_chosen = Signal(str)
    stop_pressed = Signal()

    def __init__(self, theme: Theme, layouts: Sequence[Layout], platform: str = sys.platform) -> None:
        """``platform`` as `sys.platform` says it."""
        super().__init__()
        self._theme = theme
        self.setMinimumHeight(theme.size("appBar"))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Menus and layouts")
        self.menus = QMenuBar()
        self.native = platform == "darwin"  # a Mac shows the menus at the top of its screen
        self.menus.setNativeMenuBar(self.native)
        self.menus.setSizePolicy(QSizePolicy.Policy.Minimum, QSizePolicy.Policy.Preferred)
        self.switch = Segments(
            theme, [(layout.name, layout.title, layout.icon) for layout in layouts], name="Layout"
        )
        self.switch.changed.connect(self.layout_chosen)
        self.search = PaletteField(theme)
        self.chip = Chip(theme, "", "off", large=True)
        self.stop = StopButton(theme, "appBar")
        self.stop.clicked.connect(self.stop_pressed)
        self._build()
        theme.changed.connect(self._restyle)
        self._restyle()

    def _build(self) -> None:
        left, right = QWidget(), QWidget()
        menus = QHBoxLayout(left)
        menus.setContentsMargins(0, 0, 0, 0)
        menus.setSpacing(10)
        menus.addWidget(Logo(self._theme))
        menus.addWidget(self.menus, 0, Qt.AlignmentFlag.AlignVCenter)
        menus.addStretch(1)
        robots = QHBoxLayout(right)
        robots.setContentsMargins(0, 0, 0, 0)
        robots.setSpacing(6)
        robots.addStretch(1)
        robots.addWidget(self.search)
        robots.addSpacing(6)
        robots.addWidget(self.chip)
        robots.addWidget(self.stop)
        grid = QGridLayout(self)
        grid.setContentsMargins(11, 0, 12, 1)
        grid.setHorizontalSpacing(12)
        grid.addWidget(left, 0, 0)
        grid.addWidget(self.switch, 0, 1)
        grid.addWidget(right, 0, 2)
        grid.setColumnStretch(0, 1)
        grid.setColumnStretch(2, 1)

    def _restyle(self) -> None:
        font = self._theme.font("body")
        font.setWeight(font.Weight.Medium)
        self.menus.setFont(font)

    def show_layout(self, name: str | None) -> None:
        """Mark the layout that shows; None is the start page, which has no switch but a Stop."""
        if name is not None:
            self.switch.set_value(name)
        self.switch.setVisible(name is not None)
        self.stop.setVisible(name is None)

    def show_robots(self, text: str, status: str) -> None:
        """The chip: which robots there are and how they are."""
        self.chip.set(text, status)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        rect = self.rect()
        painter.fillRect(rect, self._theme.colour("window"))
        paint.hairline(painter, QRectF(rect), Qt.Edge.BottomEdge, self._theme.colour("border"))
        painter.end()
