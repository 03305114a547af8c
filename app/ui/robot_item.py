"""One robot in a list: its name, where it is, its state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QAbstractButton, QHBoxLayout, QSizePolicy

from app.ui.icons import paint_icon
from app.ui.theme import Theme
from app.ui.widgets import Chip, paint

if TYPE_CHECKING:
    from app.core.robot_link import RobotLink

STATUS = {"ready": "ok", "busy": "running", "silent": "warn", "away": "off"}
LIST_WIDTH = 300


class RobotItem(QAbstractButton):
    """One robot in the list at the left."""

    def __init__(self, theme: Theme, link: RobotLink) -> None:
        super().__init__()
        self._theme = theme
        self.name = link.name
        self.setCheckable(True)
        self.setAutoExclusive(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setProperty("focusRadius", theme.radius("panel"))
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        self.chip = Chip(theme)
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 0, 12, 0)
        row.addStretch(1)
        row.addWidget(self.chip)
        self.show_link(link)

    def show_link(self, link: RobotLink) -> None:
        """Its state now."""
        self.chip.set(link.state, STATUS.get(link.state, "ok"))
        self._where = "virtual, this computer" if link.virtual else link.robot.title
        self.setAccessibleName(f"{link.name}, {self._where}, {link.state}")
        self.update()

    def sizeHint(self) -> QSize:
        return QSize(LIST_WIDTH - 16, round(self._theme.scaled(56)))

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect = QRectF(self.rect())
        if self.isChecked() or self.underMouse():
            fill = "selected" if self.isChecked() else "hover"
            paint.box(painter, rect, theme.radius("panel"), theme.colour(fill))
        tile = QRectF(12, rect.center().y() - 18, 36, 36)
        paint.box(painter, tile, theme.radius("panel"), theme.colour("sunken"))
        paint_icon(painter, tile.adjusted(9, 9, -9, -9), "bot", theme.colour("textSecondary"))
        bold = theme.font("bodyLarge")
        bold.setWeight(bold.Weight.DemiBold)
        ink = theme.colour("selectedText" if self.isChecked() else "text")
        high = max(19.0, paint.height_of(bold) - 2)
        words = QRectF(60, rect.center().y() - high, rect.width() - 66 - self.chip.width() - 12, high)
        paint.words(painter, words, self.name, bold, ink)
        where = theme.colour("textSecondary")
        paint.words(painter, words.translated(0, high), self._where, theme.font("small"), where)
        painter.end()
