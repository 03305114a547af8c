"""Table model based on `Column` descriptions, for many rows and frequent updates.

Rows are filtered and sorted as Python lists, without a proxy model. Values are read only for visible
rows, and one signal is emitted per refresh.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, Qt

from app.ui.text import plain
from nep.i18n import _

if TYPE_CHECKING:
    from PySide6.QtCore import QRectF
    from PySide6.QtGui import QPainter

    from app.ui.theme.theme import Theme

Row = TypeVar("Row")
Index = QModelIndex | QPersistentModelIndex
CELL_ROLE = int(Qt.ItemDataRole.UserRole)
MAX_REMOVED_RANGES = 40  # with more ranges of removed rows, a reset is cheaper than a signal for each
_ROOT = QModelIndex()


class CellMark(Protocol):
    """Interface of custom cell contents. Marks with the same appearance must be equal."""

    def paint(self, painter: QPainter, box: QRectF, theme: Theme) -> None:
        """Paint the mark into the rectangle ``box``."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Contents of a cell.

    Attributes:
        text: Text.
        icon: Name of the icon before the text, or None.
        role: Colour role of text and icon.
        mono: True for a monospaced font.
        bold: True for a bold font.
        is_struck_out: True for a strikethrough font.
        chip: Text of the chip after the text, such as a state, or None.
        elide_middle: True to elide a long text in its middle instead of its end.
        curve: Values of a sparkline, which replaces the text.
        indent: Indentation in px.
        tint: Colour role of a box behind the text, or "" for none.
        overflows_left: True to extend a long text over blank cells on its left.
        mark: Custom contents, which replace the text.
        accessible_text: Text for screen readers if there is only a mark or an icon.
    """

    text: str = ""
    icon: str | None = None
    role: str = "text"
    mono: bool = False
    bold: bool = False
    is_struck_out: bool = False
    chip: str | None = None
    elide_middle: bool = False
    curve: Sequence[float] = ()
    indent: int = 0
    tint: str = ""
    overflows_left: bool = False
    mark: CellMark | None = None
    accessible_text: str = ""

    @property
    def is_blank(self) -> bool:
        """True if nothing is painted."""
        return not (self.text or self.icon or self.chip or self.curve or self.mark)


@dataclass(frozen=True, slots=True)
class Column(Generic[Row]):
    """Description of a table column.

    Attributes:
        name: Unique name.
        title: Title in the header, wrapped in `lazy`.
        width: Default width in px.
        cell: Returns the contents of the cell in a row.
        key: Returns the sort key of a row; rows with None are last. Without this function the column
            can't be sorted.
        is_numeric: True to align the contents to the right.
        stretch: True to expand the column into the remaining width.
        tip: Returns the tooltip of the cell in a row.
        hide_order: Columns with the largest number are hidden first if there is too little space; 0 for
            never.
        is_hidden_by_default: True to hide the column until the user shows it.
        label: Name for a column with an empty title, wrapped in `lazy`.
        is_available: Returns False to hide the column regardless of the user's choice.
        is_verbatim: True if the title isn't translated.
    """

    name: str
    title: str
    width: int
    cell: Callable[[Row], Cell]
    key: Callable[[Row], object] | None = None
    is_numeric: bool = False
    stretch: bool = False
    tip: Callable[[Row], str] | None = None
    hide_order: int = 0
    is_hidden_by_default: bool = False
    label: str = ""
    is_available: Callable[[], bool] | None = None
    is_verbatim: bool = False

    @property
    def translated_title(self) -> str:
        """Translated title."""
        return self.title if self.is_verbatim else _(self.title) if self.title else ""

    @property
    def display_name(self) -> str:
        """Translated name, which columns with an empty title also have."""
        return _(self.label) if self.label else self.translated_title


@dataclass(slots=True)
class Order(Generic[Row]):
    """Sort order of a table.

    Attributes:
        column: Column to sort by, or None for the original order.
        is_descending: True for descending order.
    """

    column: Column[Row] | None = None
    is_descending: bool = False

    def sort(self, rows: list[Row]) -> list[Row]:
        """Return the sorted rows. The sort is stable; rows whose key is None are last."""
        key = self.column.key if self.column is not None else None
        if key is None:
            return rows
        keyed_rows = [(key(row), row) for row in rows]
        sortable = [pair for pair in keyed_rows if pair[0] is not None]
        sortable.sort(key=lambda pair: pair[0], reverse=self.is_descending)  # type: ignore[arg-type, return-value]
        return [row for _key, row in sortable] + [row for value, row in keyed_rows if value is None]


@dataclass(slots=True)
class _Rows(Generic[Row]):
    rows: list[Row] = field(default_factory=list)
    keys: list[str] = field(default_factory=list)


class TableModel(QAbstractTableModel, Generic[Row]):
    """Qt model of a table with typed rows."""

    def __init__(self, columns: Sequence[Column[Row]], key: Callable[[Row], str]) -> None:
        # `key` identifies a row permanently, so that the selection survives changes of other rows.
        super().__init__()
        self.columns = tuple(columns)
        self._key = key
        self._rows: _Rows[Row] = _Rows()

    # -- overrides of QAbstractTableModel -------------------------------------------------------------

    def rowCount(self, parent: Index = _ROOT) -> int:
        return 0 if parent.isValid() else len(self._rows.rows)

    def columnCount(self, parent: Index = _ROOT) -> int:
        return 0 if parent.isValid() else len(self.columns)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if not index.isValid():
            return None
        column, row = self.columns[index.column()], self._rows.rows[index.row()]
        if role == CELL_ROLE:
            return column.cell(row)
        if role == Qt.ItemDataRole.DisplayRole:
            return column.cell(row).text
        if role == Qt.ItemDataRole.ToolTipRole:
            return plain.tip(column.tip(row)) if column.tip is not None else None
        if role == Qt.ItemDataRole.AccessibleTextRole:
            cell, title = column.cell(row), column.translated_title or column.display_name
            return ", ".join(part for part in (title, cell.text or cell.accessible_text, cell.chip) if part)
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return _alignment(column.is_numeric)
        return None

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> object:
        if orientation != Qt.Orientation.Horizontal or not 0 <= section < len(self.columns):
            return None
        column = self.columns[section]
        if role == Qt.ItemDataRole.DisplayRole:
            return column.translated_title
        if role == Qt.ItemDataRole.ToolTipRole:  # shown if the title is cut off
            return plain.tip(column.display_name) or None
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return _alignment(column.is_numeric)
        return None

    # -- interface of panels --------------------------------------------------------------------------

    def row_at(self, index: Index) -> Row | None:
        """Return the row at an index, or None if the index is invalid."""
        return self._rows.rows[index.row()] if index.isValid() else None

    def key_of(self, row: Row) -> str:
        """Return the key that identifies a row."""
        return self._key(row)

    def cell_at(self, row: int, column: int) -> Cell:
        """Return the contents of a cell."""
        return self.columns[column].cell(self._rows.rows[row])

    def index_of(self, key: str) -> QModelIndex:
        """Return the index of the first cell in the row with a key; invalid if there is no such row."""
        keys = self._rows.keys
        return self.index(keys.index(key), 0) if key in keys else QModelIndex()

    def set_rows(self, rows: Sequence[Row]) -> None:
        """Replace the rows; the selection is kept if the selected row still exists.

        If more than `MAX_REMOVED_RANGES` separate ranges of rows disappear, the model is reset and the
        selection is lost.
        """
        keys = [self._key(row) for row in rows]
        if keys == self._rows.keys:
            self._rows.rows = list(rows)
            return
        new_keys = set(keys)
        removed_rows = [index for index, key in enumerate(self._rows.keys) if key not in new_keys]
        ranges = _consecutive_ranges(removed_rows)
        if len(ranges) > MAX_REMOVED_RANGES:
            self.beginResetModel()
            self._rows = _Rows(list(rows), keys)
            self.endResetModel()
            return
        for first, last in reversed(ranges):
            self.beginRemoveRows(_ROOT, first, last)
            del self._rows.rows[first : last + 1], self._rows.keys[first : last + 1]
            self.endRemoveRows()
        self._append(rows, keys)
        if keys != self._rows.keys:
            self._reorder(rows, keys)
        self._rows.rows = list(rows)

    def notify_changed(self, first: int, last: int) -> None:
        """Emit one `dataChanged` signal for all cells of a range of rows."""
        last = min(last, len(self._rows.rows) - 1)
        if 0 <= first <= last:
            corner = self.index(last, len(self.columns) - 1)
            self.dataChanged.emit(self.index(first, 0), corner, [Qt.ItemDataRole.DisplayRole])

    def _append(self, rows: Sequence[Row], keys: Sequence[str]) -> None:
        existing = set(self._rows.keys)
        new_rows = [(row, key) for row, key in zip(rows, keys, strict=True) if key not in existing]
        if new_rows:
            first = len(self._rows.keys)
            self.beginInsertRows(_ROOT, first, first + len(new_rows) - 1)
            self._rows.rows.extend(row for row, _key in new_rows)
            self._rows.keys.extend(key for _row, key in new_rows)
            self.endInsertRows()

    def _reorder(self, rows: Sequence[Row], keys: list[str]) -> None:
        self.layoutAboutToBeChanged.emit()
        row_by_key = {key: number for number, key in enumerate(keys)}
        before = self.persistentIndexList()
        after = [self.index(row_by_key[self._rows.keys[old.row()]], old.column()) for old in before]
        self._rows = _Rows(list(rows), keys)
        self.changePersistentIndexList(before, after)
        self.layoutChanged.emit()


def _alignment(is_numeric: bool) -> int:
    side = Qt.AlignmentFlag.AlignRight if is_numeric else Qt.AlignmentFlag.AlignLeft
    return int(side | Qt.AlignmentFlag.AlignVCenter)


def _consecutive_ranges(numbers: Sequence[int]) -> list[tuple[int, int]]:
    # Groups consecutive numbers to (first, last).
    ranges: list[tuple[int, int]] = []
    for number in numbers:
        if ranges and ranges[-1][1] == number - 1:
            ranges[-1] = (ranges[-1][0], number)
        else:
            ranges.append((number, number))
    return ranges
