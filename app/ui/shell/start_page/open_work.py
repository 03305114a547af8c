"""Section of the start page with the open behaviours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QPainter
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QVBoxLayout, QWidget

from app.core.session import Session
from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import label, paint
from app.ui.widgets.buttons import PaintedButton
from nep.i18n import _

MIN_HEIGHT, TILE_SIZE, TEXT_LEFT = 56, 30, 54
COLUMNS = 3
DOT_SIZE = 7.0


@dataclass(frozen=True)
class OpenWork:
    """Open behaviour, as shown on the start page.

    Attributes:
        key: Key of its project.
        name: Name of the behaviour.
        is_unsaved: True if there are unsaved changes.
        is_running: True while its program runs.
        path: Path of its file, or "" if it has none.
    """

    key: str
    name: str
    is_unsaved: bool = False
    is_running: bool = False
    path: str = ""


def open_work(session: Session) -> tuple[OpenWork, ...]:
    """Return the open behaviours that aren't blank, the current one first."""
    current, runs = session.document, session.runs
    projects = sorted(session.documents, key=lambda each: each is not current)
    return tuple(
        OpenWork(
            each.key,
            each.name,
            each.dirty,
            runs.active and runs.document is each,
            str(each.path) if each.path is not None else "",
        )
        for each in projects
        if not each.is_blank
    )


class OpenRow(PaintedButton):
    """Button for an open behaviour, painted as a row with icon, name, state and "Resume"."""

    def __init__(self, theme: Theme, work: OpenWork) -> None:
        super().__init__(theme, radius="panel")
        self.work = work
        self._state = state_text(work)
        self.set_text(work.name, _("Continue with {name}, {state}").format(name=work.name, state=self._state))
        self.setToolTip(plain.tip(work.path or self._state))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def sizeHint(self) -> QSize:
        theme = self._theme
        text_height = paint.height_of(theme.font("label")) + paint.height_of(theme.font("body"))
        return QSize(240, max(MIN_HEIGHT, round(text_height) + 18))

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        edge = theme.colour("borderStrong" if self.is_highlighted else "border")
        fill = theme.colour("hover" if self.is_highlighted else "panel")
        paint.box(painter, rect, theme.radius("panel"), fill, edge)
        tile = QRectF(12, rect.center().y() - TILE_SIZE / 2, TILE_SIZE, TILE_SIZE)
        paint.box(painter, tile, theme.radius("control"), theme.block_colour("robot"))
        icon = tile.adjusted(7, 7, -7, -7)
        paint_icon(painter, icon, theme.icon_name("behaviour"), theme.block_text("robot"))
        link_font, text = theme.font("button"), _("Resume")
        side = theme.scaled(14)
        link_width = paint.width_of(link_font, text) + 6 + side
        room = QRectF(TEXT_LEFT, rect.top(), rect.width() - TEXT_LEFT - link_width - 26, rect.height())
        self._paint_text(painter, room)
        accent = theme.colour("accentText")
        area = QRectF(rect.right() - 14 - link_width, rect.top(), link_width - side - 6, rect.height())
        paint.text_line(painter, area, text, link_font, accent)
        arrow = QRectF(rect.right() - 14 - side, rect.center().y() - side / 2, side, side)
        paint_icon(painter, arrow, "arrow-right", accent)

    def _paint_text(self, painter: QPainter, room: QRectF) -> None:
        theme, work = self._theme, self.work
        name_font, state_font = theme.font("label"), theme.font("body")
        name_height = paint.height_of(name_font)
        top = room.center().y() - (name_height + paint.height_of(state_font)) / 2
        line = QRectF(room.left(), top, room.width() - (DOT_SIZE + 8 if work.is_unsaved else 0), name_height)
        paint.text_line(painter, line, work.name, name_font, theme.colour("text"))
        if work.is_unsaved:
            left = room.left() + min(paint.width_of(name_font, work.name), line.width()) + 8
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(theme.colour("textSecondary"))
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.drawEllipse(QRectF(left, line.center().y() - DOT_SIZE / 2, DOT_SIZE, DOT_SIZE))
        line = QRectF(room.left(), top + name_height, room.width(), paint.height_of(state_font))
        paint.text_line(painter, line, self._state, state_font, theme.colour("textTertiary"))


def state_text(work: OpenWork) -> str:
    """Return the state of an open behaviour as text: running, unsaved changes, saved or no changes."""
    if work.is_running:
        return _("running")
    if work.is_unsaved:
        return _("unsaved changes")
    return _("saved") if work.path else _("no changes yet")


class OpenWorkList(QWidget):
    """Section with a heading and a row for each open behaviour; hidden if there are none."""

    selected = Signal(str)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._shown_items: tuple[OpenWork, ...] = ()
        self.rows: list[OpenRow] = []
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 24)
        column.setSpacing(10)
        column.addWidget(label(_("Open now"), "heading"))
        self._grid = QGridLayout()
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(8)
        for index in range(COLUMNS):
            self._grid.setColumnStretch(index, 1)
        column.addLayout(self._grid)
        self.hide()

    def show_work(self, items: Sequence[OpenWork]) -> None:
        """Set the open behaviours; the rows are recreated only if a behaviour or its state has changed."""
        if tuple(items) == self._shown_items:
            return
        self._shown_items = tuple(items)
        focused_key = self._focused_key(self.rows)
        for row in self.rows:
            self._grid.removeWidget(row)
            row.hide()
            row.deleteLater()
        self.rows = [OpenRow(self._theme, each) for each in items]
        for index, row in enumerate(self.rows):
            row.clicked.connect(lambda _on=False, key=row.work.key: self.selected.emit(key))
            self._grid.addWidget(row, index // COLUMNS, index % COLUMNS)
        paint.show_when(self, bool(self.rows))
        for row in self.rows:
            if row.work.key == focused_key:
                row.setFocus(Qt.FocusReason.OtherFocusReason)

    def _focused_key(self, rows: Iterable[OpenRow]) -> str:
        return next((row.work.key for row in rows if row.hasFocus()), "")
