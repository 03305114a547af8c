"""Widgets of the start page: cards, examples, recent files and the line for developers."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QPainter
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QVBoxLayout

from app.core.storage.settings import RecentFile
from app.ui.shell.start_page.art import Art, upper_corners
from app.ui.shell.start_page.preview import Row, paint_rows
from app.ui.text import plain
from app.ui.text.dates import relative_day_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Card, Chip, ElidedLabel, label, paint
from app.ui.widgets.buttons import LinkButton, PaintedButton
from app.ui.widgets.labels import IconLabel, LinedWidget
from nep.i18n import _

EXAMPLE_ART_HEIGHT = 112
RECENT_HEIGHT = 48
TILE_SIZE = 30
TERMINAL_COMMAND = "nep topic list"


class CardTitle(QLabel):
    """Heading with a chip after it.

    The label is as wide as its text, and wraps the text if there is too little space.
    """

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setProperty("kind", "heading")
        self.setWordWrap(True)

    def sizeHint(self) -> QSize:
        width = self.fontMetrics().horizontalAdvance(self.text()) + 2
        return QSize(width, self.heightForWidth(width))


class StartCard(Card):
    """Card with an illustration, a heading with an optional chip, text, and buttons."""

    def __init__(self, theme: Theme, art: Art, title: str, text: str, buttons: list[Button]) -> None:
        super().__init__()
        self.art = art
        self.chip = Chip(theme, "", "ok")
        self.text: QLabel = label(text, "bodyLarge", role="textSecondary", wrap=True)
        self.text.setAlignment(Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft)
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 1, 1, 1)
        column.setSpacing(0)
        column.addWidget(art)
        body = QVBoxLayout()
        body.setContentsMargins(20, 16, 20, 20)
        body.setSpacing(0)
        header = QHBoxLayout()
        header.setSpacing(10)
        self.title = CardTitle(title)
        header.addWidget(self.title)
        header.addWidget(self.chip)
        header.addStretch(1)
        body.addLayout(header)
        body.addSpacing(4)
        body.addWidget(self.text, 1)
        body.addSpacing(14)
        row = QHBoxLayout()
        row.setSpacing(8)
        for button in buttons:
            row.addWidget(button)
        row.addStretch(1)
        body.addLayout(row)
        column.addLayout(body, 1)

    def set_texts(self, title: str, text: str) -> None:
        """Set the heading and the text."""
        self.title.setText(title)
        self.text.setText(text)


class ExampleCard(PaintedButton):
    """Button for an example, painted as a card with a preview, the name and a description."""

    def __init__(self, theme: Theme, path: Path, name: str, text: str, rows: tuple[Row, ...]) -> None:
        super().__init__(theme, radius="card")
        self._text, self._rows = text, rows
        self.path = path
        self.set_text(name, _("Open the example {name}. {description}").format(name=name, description=text))
        self.setToolTip(plain.tip(text))  # a narrow card elides the text
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def _line_heights(self) -> tuple[float, float]:
        title, text = self._theme.font("button"), self._theme.font("body")
        return paint.height_of(title), paint.height_of(text)

    def sizeHint(self) -> QSize:
        title, text = self._line_heights()
        return QSize(240, EXAMPLE_ART_HEIGHT + round(title + text) + 33)

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        edge = "borderStrong" if self.is_highlighted else "border"
        paint.box(painter, rect, theme.radius("card"), theme.colour("panel"), theme.colour(edge))
        art = QRectF(1, 1, rect.width() - 2, EXAMPLE_ART_HEIGHT)
        painter.save()
        painter.setClipPath(upper_corners(art, theme.radius("card") - 1))
        painter.fillRect(art, theme.colour("workspace"))
        paint_rows(painter, art.adjusted(19, 16, -19, 0), theme, self._rows)
        painter.restore()
        paint.hairline(painter, art, Qt.Edge.BottomEdge, theme.colour("border"))
        title, text = self._line_heights()
        line = QRectF(17, art.bottom() + 14, rect.width() - 34, title)
        paint.text_line(painter, line, self.text(), theme.font("button"), theme.colour("text"))
        line = QRectF(17, line.bottom() + 2, line.width(), text)
        paint.text_line(painter, line, self._text, theme.font("body"), theme.colour("textSecondary"))


class RecentRow(PaintedButton):
    """Button for a recent file, painted as a row with icon, name and time."""

    def __init__(self, theme: Theme, recent: RecentFile, now: dt.datetime) -> None:
        super().__init__(theme, radius="panel")
        self.path = recent.path
        opened = dt.datetime.fromtimestamp(recent.opened_s, tz=now.tzinfo)
        self._when = relative_day_text(opened, now)
        self.set_text(recent.name, _("Open {name}, {day}").format(name=recent.name, day=self._when))
        self.setToolTip(plain.tip(str(recent.path)))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def sizeHint(self) -> QSize:
        return QSize(240, max(RECENT_HEIGHT, round(paint.height_of(self._theme.font("label"))) + 20))

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        if self.is_highlighted:
            paint.box(painter, rect, theme.radius("panel"), theme.colour("hover"))
        tile = QRectF(12, rect.center().y() - TILE_SIZE / 2, TILE_SIZE, TILE_SIZE)
        paint.box(painter, tile, theme.radius("control"), theme.block_colour("robot"))
        icon = tile.adjusted(7, 7, -7, -7)
        paint_icon(painter, icon, theme.icon_name("behaviour"), theme.block_text("robot"))
        small = theme.font("body")
        when_width = paint.width_of(small, self._when) + 12
        area = rect.adjusted(54, 0, -when_width - 8, 0)
        paint.text_line(painter, area, self.text(), theme.font("label"), theme.colour("text"))
        area = rect.adjusted(54, 0, -12, 0)
        paint.text_line(painter, area, self._when, small, theme.colour("textTertiary"), paint.RIGHT)


class DevelopersLine(LinedWidget):
    """Line at the bottom of the page with a command and a link for programmers."""

    developer_pressed = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, Qt.Edge.TopEdge)
        self.setMinimumHeight(44)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        link = LinkButton(theme, _("Open the Developer layout"))
        link.clicked.connect(self.developer_pressed)
        row = QHBoxLayout(self)
        row.setSpacing(6)
        row.addStretch(1)
        row.addWidget(IconLabel(theme, "terminal", side=14, scales=False))
        question = ElidedLabel("body", "textSecondary")
        question.setText(_("Are you a developer?"))
        row.addWidget(question)
        row.addWidget(link)
        row.addWidget(label(_("or type"), "body", role="textSecondary"))
        command = label(TERMINAL_COMMAND, "code", role="textSecondary")
        command.setProperty("keyCap", "true")
        row.addWidget(command)
        row.addStretch(1)
