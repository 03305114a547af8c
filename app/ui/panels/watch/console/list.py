"""List model of log records, newest first, and the delegate that paints them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import (
    QAbstractListModel,
    QModelIndex,
    QPersistentModelIndex,
    QRect,
    QRectF,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QFont, QKeyEvent, QPainter, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QListView, QStyle, QStyledItemDelegate, QStyleOptionViewItem

from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import SearchField, paint
from app.ui.widgets.keyboard import has_no_modifiers
from nep.i18n import _, lazy, ngettext

if TYPE_CHECKING:
    from app.core.world.console import ConsoleRecord

Index = QModelIndex | QPersistentModelIndex
RECORD_ROLE = int(Qt.ItemDataRole.UserRole)
LEVEL_STYLES = {
    "debug": ("circle-dashed", "textTertiary"),
    "info": ("circle-check", "textTertiary"),
    "warn": ("triangle-alert", "warn"),
    "error": ("circle-x", "error"),
    "critical": ("octagon-x", "error"),
}
LEVEL_NAMES = {
    "debug": lazy("debug"),
    "info": lazy("info"),
    "warn": lazy("warn"),
    "error": lazy("error"),
    "critical": lazy("fatal"),
}
"""Names of the levels, which must fit into a narrow column."""
ROW_HEIGHTS = {"compact": 22, "comfortable": 30}
ICON_SIZE = 14
MIN_TEXT_CHARS = 24  # characters of the text that should stay visible
_ROOT = QModelIndex()


def format_line(record: ConsoleRecord, level: str = "") -> str:
    """Format a record as a line of text for the clipboard.

    Args:
        record: Record to format.
        level: Displayed name of the level; by default the level's id.
    """
    moment = time.localtime(record.stamp_s)
    clock = f"{time.strftime('%H:%M:%S', moment)}.{int(record.stamp_s % 1 * 1000):03d}"
    logger = f" [{record.logger}]" if record.logger else ""
    return f"{clock} {level or record.level} {record.origin}{logger} {record.text}"


def tooltip_text(record: ConsoleRecord) -> str:
    """Return the tooltip of a record: the full text, time, level, origin, and location of the log call."""
    source = "  ".join(part for part in (record.logger, record.location) if part)
    clock = time.strftime("%H:%M:%S", time.localtime(record.stamp_s))
    text = f"{record.text}\n{clock} {_level_name(record)}"
    return f"{text}  {record.origin}\n{source}" if source else f"{text}  {record.origin}"


def first_line(text: str) -> str:
    """Return the first line of a text, followed by the number of further lines, if any."""
    first, _end, remaining_text = text.partition("\n")
    if not remaining_text:
        return first
    further_lines = remaining_text.count("\n") + 1
    template = ngettext("{text} (and {count} more line)", "{text} (and {count} more lines)", further_lines)
    return template.format(text=first, count=further_lines)


def _level_name(record: ConsoleRecord) -> str:
    return _("critical") if record.level == "critical" else _(LEVEL_NAMES.get(record.level, record.level))


class RecordFilter:
    """Filter that matches records by level, node and words.

    Args:
        levels: Accepted levels.
        node: Accepted origin; "" for all nodes.
        text: Words that a record must contain, separated by spaces; case is ignored.
    """

    def __init__(self, levels: frozenset[str], node: str, text: str) -> None:
        self._levels, self._node, self._keywords = levels, node, text.casefold().split()

    def __call__(self, record: ConsoleRecord) -> bool:
        if record.level not in self._levels or (self._node and record.origin != self._node):
            return False
        if not self._keywords:
            return True
        searchable = f"{record.origin} {record.logger} {record.text}".casefold()
        return all(keyword in searchable for keyword in self._keywords)


class ConsoleModel(QAbstractListModel):
    """List model of the records that match a filter, newest first."""

    def __init__(self) -> None:
        super().__init__()
        self._records: deque[ConsoleRecord] = deque()  # oldest first
        self._newest_number = 0

    def rowCount(self, parent: Index = _ROOT) -> int:
        return 0 if parent.isValid() else len(self._records)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if not index.isValid():
            return None
        record = self._records[-1 - index.row()]
        if role == RECORD_ROLE:
            return record
        if role in {Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.AccessibleTextRole}:
            return format_line(record, _level_name(record))
        return plain.tip(tooltip_text(record)) if role == Qt.ItemDataRole.ToolTipRole else None

    def reset_records(
        self, records: Sequence[ConsoleRecord], accepts: Callable[[ConsoleRecord], bool]
    ) -> None:
        """Replace all rows.

        Args:
            records: Records, oldest first.
            accepts: Returns True for records to show.
        """
        self.beginResetModel()
        self._records = deque(record for record in records if accepts(record))
        self._newest_number = records[-1].number if records else 0
        self.endResetModel()

    def update_records(
        self, records: Sequence[ConsoleRecord], accepts: Callable[[ConsoleRecord], bool]
    ) -> int:
        """Add rows for new records and remove the rows of evicted ones.

        Args:
            records: Stored records, oldest first.
            accepts: Returns True for records to show.

        Returns:
            The number of rows added.
        """
        if (
            not records
            or records[-1].number < self._newest_number
            or records[0].number > self._newest_number + 1
        ):
            self.reset_records(records, accepts)
            return len(self._records)
        self._evict_older_than(records[0].number)
        added: list[ConsoleRecord] = []
        for record in reversed(records):
            if record.number <= self._newest_number:
                break
            if accepts(record):
                added.append(record)
        self._newest_number = records[-1].number
        if added:
            self.beginInsertRows(_ROOT, 0, len(added) - 1)
            self._records.extend(reversed(added))
            self.endInsertRows()
        return len(added)

    def _evict_older_than(self, oldest: int) -> None:
        evicted_count = 0
        for record in self._records:
            if record.number >= oldest:
                break
            evicted_count += 1
        if evicted_count:
            rows = len(self._records)
            self.beginRemoveRows(_ROOT, rows - evicted_count, rows - 1)
            for _each in range(evicted_count):
                self._records.popleft()
            self.endRemoveRows()


class LineDelegate(QStyledItemDelegate):
    """Delegate that paints a record: time, level (icon and name), origin, text.

    Time and level are aligned in columns; the text directly follows the origin.
    """

    def __init__(self, theme: Theme, density: Callable[[], str], font: Callable[[], QFont]) -> None:
        super().__init__()
        self._theme, self._density, self._font = theme, density, font

    def sizeHint(self, _option: QStyleOptionViewItem, _index: Index) -> QSize:
        return QSize(100, self.row_height())

    def row_height(self) -> int:
        """Return the height of a row in pixels, scaled with the text size."""
        return round(self._theme.scaled(ROW_HEIGHTS[self._density()]))

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        record: ConsoleRecord | None = index.data(RECORD_ROLE)
        if record is None:
            return
        theme, font = self._theme, self._font()
        box = QRect(option.rect)
        if option.state & QStyle.StateFlag.State_Selected:
            painter.fillRect(box, theme.colour("selected"))
        rect = QRectF(box).adjusted(10, 0, -8, 0)
        time_font = theme.font("code")
        widths = self.columns(record, rect.width())
        if "time" in widths:
            clock = time.strftime("%H:%M:%S", time.localtime(record.stamp_s))
            paint.text_line(painter, rect, clock, time_font, theme.colour("textTertiary"))
            rect.setLeft(rect.left() + widths["time"])
        icon, role = LEVEL_STYLES.get(record.level, LEVEL_STYLES["info"])
        icon_rect = QRectF(rect.left(), rect.center().y() - ICON_SIZE / 2, ICON_SIZE, ICON_SIZE)
        paint_icon(painter, icon_rect, icon, theme.colour(role))
        rect.setLeft(rect.left() + widths["icon"])
        if "level" in widths:
            level = _(LEVEL_NAMES.get(record.level, record.level))
            paint.text_line(painter, rect, level, font, theme.colour(role))
            rect.setLeft(rect.left() + widths["level"])
        for text, colour, max_share in self._parts(record, has_logger="logger" in widths):
            part = QRectF(rect)
            part.setWidth(min(paint.width_of(font, text) + 1, rect.width() * max_share))
            paint.text_line(painter, part, text, font, theme.colour(colour))
            rect.setLeft(part.right() + 7)

    def columns(self, record: ConsoleRecord, width: float) -> dict[str, float]:
        """Return the width in px of each part before the text, for a row of the given width.

        When space is short, the logger is omitted first, then the name of the level (its icon stays), then
        the time. The tooltip contains all parts.
        """
        font = self._font()
        min_text_width = MIN_TEXT_CHARS * paint.width_of(font, "n")
        widths = {
            "time": paint.width_of(self._theme.font("code"), "00:00:00") + 14,
            "icon": float(ICON_SIZE + 4),
            "level": max(paint.width_of(font, _(level_name)) for level_name in LEVEL_NAMES.values()) + 10,
            "origin": min(paint.width_of(font, record.origin), 0.3 * width) + 7,
            "logger": paint.width_of(font, record.logger.rpartition(".")[2]),
        }
        for name in ("logger", "level", "time"):
            if width - sum(widths.values()) >= min_text_width:
                break
            del widths[name]
        return widths

    @staticmethod
    def _parts(record: ConsoleRecord, *, has_logger: bool) -> list[tuple[str, str, float]]:
        parts = [(record.origin, "textTertiary", 0.4), (first_line(record.text), "text", 1.0)]
        name = record.logger.rpartition(".")[2] if has_logger else ""
        if name:
            parts.insert(1, (name, "textDisabled", 0.3))
        return parts


class LineList(QListView):
    """List view of the records.

    Signals:
        find_requested: The key ``/`` was pressed.
        resized: The size of the view changed.
    """

    find_requested = Signal()
    resized = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName(_("Events, newest first"))
        self.setUniformItemSizes(True)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.text() == "/":
            self.find_requested.emit()
        else:
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.resized.emit()


class LogFindField(SearchField):
    """Search field of the console. Down moves the focus to the list; Esc clears and hides the field."""

    exited = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, _("Find text"))
        self.setAccessibleName(_("Find text in the lines"))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.clear()
            self.hide()
        if event.key() in {Qt.Key.Key_Escape, Qt.Key.Key_Down} and has_no_modifiers(event):
            self.exited.emit()
        else:
            super().keyPressEvent(event)
