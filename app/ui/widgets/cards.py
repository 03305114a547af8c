"""Surfaces: cards, tiles, and boxes in the colours of a status."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QHBoxLayout, QVBoxLayout, QWidget

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import Button
from app.ui.widgets.indicators import status_name
from app.ui.widgets.labels import label
from nep.i18n import _

TILE_SIZE = 28
BORDER_ROLES = {"error": "errorBorder", "warn": "warnBorder", "ok": "okBorder", "info": "borderStrong"}


class Card(QWidget):
    """Frame with a border and large rounded corners."""

    def __init__(self, *, is_sunken: bool = False) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("sunken", is_sunken)

    @property
    def is_accented(self) -> bool:
        """True if the card has a border in the accent colour."""
        return self.property("accented") is True

    def set_accented(self, is_accented: bool) -> None:
        """Set whether the card has a border in the accent colour."""
        paint.set_style_property(self, "accented", is_accented)


class Tile(QWidget):
    """Icon on a square in the colour of a block category."""

    def __init__(self, theme: Theme, icon: str, category: str = "robot", side: int = TILE_SIZE) -> None:
        super().__init__()
        self._theme, self._icon, self._category = theme, icon, category
        self.setFixedSize(side, side)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        rect = QRectF(self.rect())
        paint.box(painter, rect, self._theme.radius("small"), self._theme.block_colour(self._category))
        inset = rect.width() * 0.22
        colour = self._theme.block_text(self._category)
        paint_icon(painter, rect.adjusted(inset, inset, -inset, -inset), self._icon, colour)
        painter.end()


class AlertBox(QWidget):
    """Base class of boxes for alerts, in the colours and with the icon of a status.

    Buttons are to the right of the text or, if there is too little space, below it.
    """

    icon_side, icon_left, left, vertical_margin, gap = 18, 12, 40, 10, 10
    min_text_width = 220  # minimum width of the text beside the buttons, in px at 100 %

    def __init__(self, theme: Theme, *, is_framed: bool = True) -> None:
        # Without a frame only the icon shows the status; used for "ok".
        super().__init__()
        self._theme, self._is_framed = theme, is_framed
        self._status = "info"
        self.text_column, self.button_row = QVBoxLayout(), QHBoxLayout()
        self.button_row.setSpacing(self.gap)
        self._main_layout = QBoxLayout(QBoxLayout.Direction.LeftToRight, self)
        vertical_margin = self.vertical_margin if is_framed else 4
        self._main_layout.setContentsMargins(self.left, vertical_margin, 12, vertical_margin)
        self._main_layout.setSpacing(self.gap)
        self._main_layout.addLayout(self.text_column, 1)
        self._main_layout.addLayout(self.button_row)

    def set_status(self, status: str) -> None:
        """Set the status, which determines the colours and the icon."""
        self._status = status
        self.update()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest:
            self._fit()
        return super().event(event)

    def _fit(self) -> None:
        # If the text is large or long, the buttons are below it.
        room = self.width() - self.button_row.sizeHint().width()
        fits_beside = self.button_row.isEmpty() or room >= self._theme.scaled(self.min_text_width)
        direction = QBoxLayout.Direction.LeftToRight if fits_beside else QBoxLayout.Direction.TopToBottom
        if self._main_layout.direction() != direction:
            self._main_layout.setDirection(direction)
            right = Qt.AlignmentFlag.AlignRight
            self._main_layout.setAlignment(self.button_row, Qt.AlignmentFlag(0) if fits_beside else right)

    def icon_top(self) -> float:
        """Return the distance in px between the upper edges of the box and the icon."""
        return 11.0 if self._is_framed else 4.0

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        status = theme.status(self._status)
        if self._is_framed:
            edge = theme.colour(BORDER_ROLES.get(self._status, "borderStrong"))
            fill = theme.colour(status.tint or "panel")
            paint.box(painter, QRectF(self.rect()), theme.radius("panel"), fill, edge)
        icon_rect = QRectF(self.icon_left, self.icon_top(), self.icon_side, self.icon_side)
        paint_icon(painter, icon_rect, status.icon, theme.colour(status.colour))
        painter.end()


class AlertRow(AlertBox):
    """Row of an alert: title in bold, detail, shell command, note and button."""

    def __init__(self, theme: Theme, *, is_framed: bool = True) -> None:
        super().__init__(theme, is_framed=is_framed)
        self.text_column.setSpacing(2)
        self._lines = (
            label("", "title" if is_framed else "body", wrap=True),
            label("", "body", role="textSecondary", wrap=True),
            label("", "code", role="textSecondary", wrap=True),
            label("", "small", role="textTertiary"),
        )
        self._lines[2].setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        for line in self._lines:
            self.text_column.addWidget(line)
        self.button = Button(theme, "", size="small")
        self.button_row.addWidget(self.button)

    def set_texts(
        self, status: str, title: str, detail: str, *, command: str = "", note: str = "", button: str = ""
    ) -> None:
        """Set the contents of the row; empty texts are hidden.

        The button widget is reused, so that a click in progress isn't lost.

        Args:
            status: Status that determines the colours and the icon.
            title: Problem, described in one sentence.
            detail: Explanation.
            command: Shell command that the user can copy.
            note: Text in a small font, such as a time.
            button: Text of the button for the next step.
        """
        self.set_status(status)
        for line, text in zip(self._lines, (title, detail, command, note), strict=True):
            line.setText(text)
            paint.show_when(line, bool(text))
        self.button.set_label(button)
        paint.show_when(self.button, bool(button))
        spoken_text = _("{status}: {sentence}").format(
            status=status_name(status), sentence=f"{title} {detail}".strip()
        )
        self.setAccessibleName(spoken_text)

    def minimumSizeHint(self) -> QSize:
        return QSize(160, super().minimumSizeHint().height())
