"""One robot in a list: its name, where it is, its state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QContextMenuEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QAbstractButton, QHBoxLayout, QSizePolicy

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.chips import Chip

if TYPE_CHECKING:
    from app.core.robots.robot_link import RobotLink

STATUS = {
    "ready": "ok", "busy": "running", "stopping": "running", "silent": "warn", "not stopped": "error",
    "away": "off",
}  # fmt: skip
LIST_WIDTH = 300


class RobotItem(QAbstractButton):
    """One robot in the list at the left; `menu_wanted` tells where on the screen its menu is wanted."""

    menu_wanted = Signal(QPoint)

    def __init__(self, theme: Theme, name: str) -> None:
        super().__init__()
        self._theme = theme
        self.name = name
        self.where = ""
        self._away = self.may_be_forgotten = False
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

    def show_link(self, link: RobotLink, seen: str = "") -> None:
        """Its state now; ``seen`` says when it was last seen, for one that is away."""
        where = "virtual, this computer" if link.virtual else link.robot.title
        away = not link.connected
        self._show(link.state, seen if away and seen else where, away=away)
        self.may_be_forgotten = self._away and not link.virtual

    def show_away(self, seen: str) -> None:
        """It was here at another start, and is not now: a press opens its menu."""
        self.setAutoExclusive(False)
        self.setCheckable(False)
        self._show("away", seen, away=True)
        self.may_be_forgotten = True

    def _show(self, state: str, where: str, *, away: bool) -> None:
        self.chip.set(state, STATUS.get(state, "ok"))
        self.where, self._away = where, away
        self.setAccessibleName(f"{self.name}, {where}, {state}")
        self.update()

    def sizeHint(self) -> QSize:
        return QSize(LIST_WIDTH - 16, round(self._theme.scaled(56)))

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        by_mouse = event.reason() == QContextMenuEvent.Reason.Mouse
        self.menu_wanted.emit(event.globalPos() if by_mouse else self.mapToGlobal(self.rect().center()))
        event.accept()

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect = QRectF(self.rect())
        if self.isChecked() or self.underMouse():
            fill = "selected" if self.isChecked() else "hover"
            paint.box(painter, rect, theme.radius("panel"), theme.colour(fill))
        quiet = self._away and not self.isChecked()
        tile = QRectF(12, rect.center().y() - 18, 36, 36)
        paint.box(painter, tile, theme.radius("panel"), theme.colour("sunken"))
        icon = theme.colour("textTertiary" if quiet else "textSecondary")
        paint_icon(painter, tile.adjusted(9, 9, -9, -9), "bot", icon)
        bold = theme.font("bodyLarge")
        bold.setWeight(bold.Weight.DemiBold)
        ink = theme.colour("selectedText" if self.isChecked() else "textTertiary" if quiet else "text")
        high = max(19.0, paint.height_of(bold) - 2)
        words = QRectF(60, rect.center().y() - high, rect.width() - 66 - self.chip.width() - 12, high)
        paint.words(painter, words, self.name, bold, ink)
        where = theme.colour("textTertiary" if quiet else "textSecondary")
        paint.words(painter, words.translated(0, high), self.where, theme.font("small"), where)
        painter.end()
