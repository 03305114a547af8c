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
from app.ui.widgets.labels import IconLabel, label
from nep.i18n import _

TILE_SIZE = 28


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

    icon_side, margin, left, vertical_margin, gap = 18, 12, 40, 10, 10
    icon_alignment = Qt.AlignmentFlag.AlignTop
    min_text_width = 220  # minimum width of the text beside the buttons, in px at 100 %

    def __init__(self, theme: Theme, *, is_framed: bool = True) -> None:
        # Without a frame only the icon shows the status; used for "ok".
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("framed", is_framed)
        self._theme = theme
        self._status_icon = IconLabel(theme, "info", side=self.icon_side, scales=False)
        self.text_column, self.button_row = QVBoxLayout(), QHBoxLayout()
        self.button_row.setSpacing(self.gap)
        self._main_layout = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._main_layout.setSpacing(self.gap)
        self._main_layout.addLayout(self.text_column, 1)
        self._main_layout.addLayout(self.button_row)
        vertical_margin = self.vertical_margin if is_framed else 4
        row = QHBoxLayout(self)
        row.setContentsMargins(self.margin, vertical_margin, self.margin, vertical_margin)
        row.setSpacing(self.left - self.margin - self.icon_side)
        row.addWidget(self._status_icon, 0, self.icon_alignment)
        row.addLayout(self._main_layout, 1)

    def set_status(self, status: str) -> None:
        """Set the status, which determines the colours and the icon."""
        values = self._theme.status(status)
        self._status_icon.set_icon(values.icon, values.colour)
        paint.set_style_property(self, "status", status)

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
