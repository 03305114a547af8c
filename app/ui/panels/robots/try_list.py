"""The last tries of an action: when, with what, how it ended; a press takes the values back into the form."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QAbstractButton, QSizePolicy, QVBoxLayout, QWidget

from app.robots.description.description import Action
from app.ui.panels.robots.input_text import input_words
from app.ui.panels.robots.tries import end_words, output_words
from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

if TYPE_CHECKING:
    from app.core.robots.robot_link import Invocation

ROW = 28
SHOWN = 5


class TryRow(QAbstractButton):
    """One try that has ended."""

    def __init__(self, theme: Theme, action: Action, made: Invocation) -> None:
        super().__init__()
        self._theme, self.made = theme, made
        said, status, sentence = end_words(made)
        self.when = time.strftime("%H:%M:%S", time.localtime(made.at_s))
        self.given = input_words(action, made.given)
        told = output_words(action, made.output) if made.state == "succeeded" else ""
        self.result = f"{said}, {told}" if told else sentence.rstrip(".") or said
        self.status = status
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setProperty("focusRadius", theme.radius("small"))
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        self.setAccessibleName(f"{self.when}, {self.given}, {self.result}; take these values")
        self.setToolTip(plain.tip(f"{self.result}. Press to take these values"))

    def sizeHint(self) -> QSize:
        return QSize(200, round(self._theme.scaled(ROW)))

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect = QRectF(self.rect())
        if self.underMouse() or self.isDown():
            paint.box(painter, rect, theme.radius("small"), theme.colour("hover"))
        font = theme.font("body")
        quiet = theme.colour("textSecondary")
        left = rect.left() + 6
        wide = paint.width_of(font, "00:00:00") + 14
        paint.words(
            painter,
            QRectF(left, rect.top(), wide, rect.height()),
            self.when,
            font,
            theme.colour("textTertiary"),
        )
        left += wide
        shown = min(paint.width_of(font, self.result) + 2, (rect.right() - left) * 0.6)
        right = QRectF(rect.right() - 6 - shown, rect.top(), shown, rect.height())
        status = theme.status(self.status)
        mark = QRectF(right.left() - 20, rect.center().y() - 7, 14, 14)
        paint_icon(painter, mark, status.icon, theme.colour(status.colour))
        paint.words(painter, right, self.result, font, quiet)
        middle = QRectF(left, rect.top(), mark.left() - left - 8, rect.height())
        paint.words(painter, middle, self.given, font, theme.colour("text"))
        painter.end()


class TryList(QWidget):
    """The newest tries of one action, the newest at the top."""

    chosen = Signal(dict)

    def __init__(self, theme: Theme, action: Action) -> None:
        super().__init__()
        self._theme, self._action = theme, action
        self._shown: tuple[str, ...] = ()
        self.rows: list[TryRow] = []
        self.setAccessibleName(f"The last tries of {action.title}")
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 2, 0, 0)
        self._column.setSpacing(0)

    def show_tries(self, tries: Sequence[Invocation]) -> None:
        """Show the last of these that have ended."""
        ended = [made for made in tries if made.action == self._action.name and not made.running][-SHOWN:]
        ids = tuple(made.id for made in ended)
        if ids == self._shown:
            return
        self._shown = ids
        for row in self.rows:
            self._column.removeWidget(row)
            row.deleteLater()
        self.rows = []
        for made in reversed(ended):
            row = TryRow(self._theme, self._action, made)
            row.clicked.connect(lambda _on=False, made=made: self.chosen.emit(dict(made.given)))
            self._column.addWidget(row)
            self.rows.append(row)
