"""List with headings, and with entries that show highlighted matches and shortcuts.

Used by the command palette and the sheet of shortcuts.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

from PySide6.QtCore import QAbstractListModel, QModelIndex, QPersistentModelIndex, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QFont, QFontMetricsF, QPainter
from PySide6.QtWidgets import QAbstractItemView, QListView, QStyle, QStyledItemDelegate, QStyleOptionViewItem

from app.ui.text import plain
from app.ui.text.numbers import shortcut_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.lists.fuzzy import Entry, Match
from nep.i18n import _

ROW_HEIGHT, HEADING_HEIGHT, INSET = 40, 30, 8
ICON_LEFT, TEXT_LEFT, RIGHT_MARGIN = 10, 38, 10
Index = QModelIndex | QPersistentModelIndex


@dataclass(frozen=True, slots=True)
class Heading:
    """Heading above a group of entries."""

    text: str


Line = Heading | Match


class EntryModel(QAbstractListModel):
    """List model of headings and entries, of which only entries can be selected."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: Sequence[Line] = ()

    def show_lines(self, lines: Sequence[Line]) -> None:
        """Replace all headings and entries."""
        self.beginResetModel()
        self.lines = lines
        self.endResetModel()

    def update_entry(self, id: str, note: str, reason: str) -> None:
        """Update an entry in place.

        Args:
            id: Id of the entry.
            note: Text on the right.
            reason: Reason why the entry is unavailable, or "".
        """
        for row, line in enumerate(self.lines):
            if isinstance(line, Match) and line.entry.id == id:
                updated = replace(line, entry=replace(line.entry, note=note, reason=reason))
                self.lines = [*self.lines[:row], updated, *self.lines[row + 1 :]]
                self.dataChanged.emit(self.index(row), self.index(row))

    def rowCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self.lines)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        line = self.lines[index.row()]
        if isinstance(line, Heading):
            return line.text if role == Qt.ItemDataRole.DisplayRole else None
        entry = line.entry
        if role == Qt.ItemDataRole.DisplayRole:
            return entry.text
        if role == Qt.ItemDataRole.AccessibleTextRole:
            return accessible_text(entry)
        if role == Qt.ItemDataRole.ToolTipRole:
            return plain.tip(entry.reason or entry.text)
        return None

    def flags(self, index: Index) -> Qt.ItemFlag:
        if isinstance(self.lines[index.row()], Heading):
            return Qt.ItemFlag.NoItemFlags
        return Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable


def accessible_text(entry: Entry) -> str:
    """Return the text of an entry for screen readers."""
    key = _("key {key}").format(key=shortcut_text(entry.key)) if entry.key else ""
    return ", ".join(part for part in (entry.text, entry.note, key, entry.reason) if part)


class EntryDelegate(QStyledItemDelegate):
    """Delegate that paints headings and entries."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.waiting_entry_id = ""  # id of the entry that waits for a new shortcut

    def sizeHint(self, _option: QStyleOptionViewItem, index: Index) -> QSize:
        model = index.model()
        is_heading = isinstance(model, EntryModel) and isinstance(model.lines[index.row()], Heading)
        return QSize(100, round(self._theme.scaled(HEADING_HEIGHT if is_heading else ROW_HEIGHT)))

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        model = index.model()
        if not isinstance(model, EntryModel):
            return
        line = model.lines[index.row()]
        rect = QRectF(option.rect)
        painter.save()
        if isinstance(line, Heading):
            font = self._theme.font("small")
            font.setWeight(QFont.Weight.DemiBold)
            area = rect.adjusted(INSET + ICON_LEFT, 2, -INSET, 0)
            paint.text_line(painter, area, line.text, font, self._theme.colour("textSecondary"))
        else:
            is_selected = bool(option.state & QStyle.StateFlag.State_Selected)
            self._paint_row(painter, rect.adjusted(INSET, 0, -INSET, 0), line, is_selected=is_selected)
        painter.restore()

    def _paint_row(self, painter: QPainter, rect: QRectF, match: Match, *, is_selected: bool) -> None:
        theme, entry = self._theme, match.entry
        if is_selected:
            edge = theme.colour("controlBorder") if theme.is_high_contrast else None
            paint.box(painter, rect, theme.radius("panel"), theme.colour("selected"), edge)
        text_role = (
            "textDisabled" if entry.reason and not is_selected else "selectedText" if is_selected else "text"
        )
        secondary_role = "selectedText" if is_selected else "textSecondary"
        side = theme.scaled(16)
        icon_rect = QRectF(rect.left() + ICON_LEFT, rect.center().y() - side / 2, side, side)
        if entry.icon:
            icon_role = text_role if is_selected or entry.reason else "textSecondary"
            paint_icon(painter, icon_rect, entry.icon, theme.colour(icon_role))
        right = self._paint_right(painter, rect, entry, secondary_role, is_selected=is_selected)
        left = rect.left() + (TEXT_LEFT if entry.icon else ICON_LEFT) + (side - 16 if entry.icon else 0)
        area = QRectF(left, rect.top(), max(20.0, right - left - 12), rect.height())
        match_role = text_role if is_selected or entry.reason else "accentText"
        self._paint_text(painter, area, match, text_role, match_role)

    def _paint_right(
        self, painter: QPainter, rect: QRectF, entry: Entry, secondary_role: str, *, is_selected: bool
    ) -> float:
        # Paints note, shortcut and Enter sign; returns their left edge.
        theme, right, middle = self._theme, rect.right() - RIGHT_MARGIN, rect.center().y()
        if entry.id == self.waiting_entry_id:
            font = theme.font("body")
            font.setWeight(QFont.Weight.Medium)
            prompt = _("Press the new shortcut")
            width = paint.width_of(font, prompt)
            area = QRectF(right - width, rect.top(), width, rect.height())
            paint.text_line(painter, area, prompt, font, theme.colour(secondary_role))
            return right - width
        if is_selected and not entry.reason:
            side = theme.scaled(15)
            icon_rect = QRectF(right - side, middle - side / 2, side, side)
            paint_icon(painter, icon_rect, "corner-down-left", theme.colour("selectedText"))
            right -= side + 12
        for key in reversed(entry.key.split("\n") if entry.key else ()):
            right = paint.key_cap(painter, theme, right, middle, shortcut_text(key)).left() - 8
        text = entry.reason or entry.note
        if text:
            font = theme.font("body")
            room = min(paint.width_of(font, text), rect.width() * 0.55)
            right -= room + 4
            area = QRectF(right, rect.top(), room, rect.height())
            paint.text_line(painter, area, text, font, theme.colour(secondary_role), paint.RIGHT)
        return right

    def _paint_text(
        self, painter: QPainter, area: QRectF, match: Match, text_role: str, match_role: str
    ) -> None:
        # Paints the text with matching letters in bold.
        theme = self._theme
        regular = theme.font("code" if match.entry.kind == "topic" else "bodyLarge")
        if match.entry.kind == "topic":
            regular.setPixelSize(round(theme.scaled(13)))
        bold = QFont(regular)
        bold.setWeight(QFont.Weight.Bold)
        room = area.width() - 4 * len(match.spans)
        elided = QFontMetricsF(regular).elidedText(match.entry.text, Qt.TextElideMode.ElideRight, room)
        end = len(elided) - 1 if elided != match.entry.text else len(elided)
        cuts = sorted({0, len(elided), *(min(position, end) for span in match.spans for position in span)})
        ranges = [range(*span) for span in match.spans]
        for begin, stop in itertools.pairwise(cuts):
            is_match = any(begin in span for span in ranges)
            font = bold if is_match else regular
            piece = elided[begin:stop]
            painter.setFont(font)
            painter.setPen(theme.colour(match_role if is_match else text_role))
            painter.drawText(area, int(paint.LEFT), piece)
            area.setLeft(area.left() + paint.width_of(font, piece))


class EntryList(QListView):
    """List view with one selected entry.

    `selection_moved` is emitted when the selection changes, and `row_activated` when an entry is
    clicked.
    """

    selection_moved = Signal()
    row_activated = Signal()

    def __init__(self, theme: Theme, name: str) -> None:
        super().__init__()
        self._theme = theme
        self.line_model = EntryModel()
        self.delegate = EntryDelegate(theme)
        self.setModel(self.line_model)
        self.setItemDelegate(self.delegate)
        self.setAccessibleName(name)
        self.setProperty("raised", "true")
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setMouseTracking(True)
        self.clicked.connect(self._on_clicked)

    def show_lines(self, lines: Sequence[Line], selected_id: str = "") -> None:
        """Replace all headings and entries, and select an entry.

        Args:
            lines: Headings and entries.
            selected_id: Id of the entry to select; "" or an unknown id selects the first entry.
        """
        self.line_model.show_lines(lines)
        rows = [row for row, line in enumerate(lines) if isinstance(line, Match)]
        matching_rows = (row for row in rows if selected_id and _id(lines[row]) == selected_id)
        self._select_row(next(matching_rows, rows[0] if rows else -1))
        if not selected_id:
            self.scrollToTop()

    def update_entry(self, id: str, note: str, reason: str = "") -> None:
        """Update an entry in place.

        Args:
            id: Id of the entry.
            note: Text on the right.
            reason: Reason why the entry is unavailable, or "".
        """
        self.line_model.update_entry(id, note, reason)

    @property
    def entry(self) -> Entry | None:
        """Selected entry, or None."""
        row = self.currentIndex().row()
        line = self.line_model.lines[row] if 0 <= row < len(self.line_model.lines) else None
        return line.entry if isinstance(line, Match) else None

    def content_height(self) -> int:
        """Return the total height in px of all headings and entries."""
        heights = {Heading: self._theme.scaled(HEADING_HEIGHT), Match: self._theme.scaled(ROW_HEIGHT)}
        return sum(round(heights[type(line)]) for line in self.line_model.lines)

    def step(self, steps: int) -> None:
        """Move the selection by a number of entries, up to the first or last one."""
        rows = [row for row, line in enumerate(self.line_model.lines) if isinstance(line, Match)]
        if rows:
            current = self.currentIndex().row()
            index = rows.index(current) if current in rows else 0
            self._select_row(rows[max(0, min(len(rows) - 1, index + steps))])

    def handle_key(self, key: int) -> bool:
        """Move the selection on Up, Down, Page Up, Page Down, Home and End; return False for other keys."""
        page = max(1, self.viewport().height() // round(self._theme.scaled(ROW_HEIGHT)) - 1)
        row_count = len(self.line_model.lines)
        steps = {
            Qt.Key.Key_Up: -1,
            Qt.Key.Key_Down: 1,
            Qt.Key.Key_PageUp: -page,
            Qt.Key.Key_PageDown: page,
            Qt.Key.Key_Home: -row_count,
            Qt.Key.Key_End: row_count,
        }.get(Qt.Key(key))
        if steps is None:
            return False
        self.step(steps)
        return True

    def _select_row(self, row: int) -> None:
        index = self.line_model.index(row) if row >= 0 else QModelIndex()
        self.setCurrentIndex(index)
        if row >= 1 and isinstance(self.line_model.lines[row - 1], Heading):
            self.scrollTo(self.line_model.index(row - 1))
        self.scrollTo(index)
        self.selection_moved.emit()

    def _on_clicked(self, index: QModelIndex) -> None:
        if isinstance(self.line_model.lines[index.row()], Match):
            self._select_row(index.row())
            self.row_activated.emit()


def _id(line: Line) -> str:
    return line.entry.id if isinstance(line, Match) else ""
