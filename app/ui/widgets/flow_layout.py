"""Layout of a row that wraps into several rows if there is too little space."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtWidgets import QLabel, QLayout, QLayoutItem, QWidget

_ATTACHED = "attachedInFlow"
"""Property of widgets without a gap before them."""


class Flow(QLayout):
    """Layout that arranges items in one row if they fit, else in several, vertically centred in each row.

    In a single row, spare space is inserted at the position of `push`, and elastic items can be
    narrower than their size hints. A label with word wrap takes the rest of its row.
    """

    def __init__(self, parent: QWidget | None = None, *, gap: int = 10, row_gap: int = 6) -> None:
        super().__init__(parent)
        self._items: list[QLayoutItem] = []
        self._gap, self._row_gap = gap, row_gap
        self._push_index = -1
        self._greedy_by_widget: dict[QWidget, bool] = {}
        self.setContentsMargins(0, 0, 0, 0)

    def push(self) -> None:
        """Align all items that are added later to the right, if everything is in one row."""
        self._push_index = len(self._items)

    def add_elastic(self, widget: QWidget, *, is_greedy: bool = False) -> None:
        """Add a widget that can be narrower than its size hint.

        Args:
            widget: Widget to add.
            is_greedy: True to expand the widget into the spare space.
        """
        self._greedy_by_widget[widget] = is_greedy
        self.addWidget(widget)

    def add_attached(self, widget: QWidget) -> None:
        """Add a widget without a gap or line break before it, such as a punctuation mark."""
        widget.setProperty(_ATTACHED, True)
        self.addWidget(widget)

    # -- overrides of QLayout
    # ---------------------------------------------------------------------------------

    def addItem(self, item: QLayoutItem) -> None:
        self._items.append(item)

    def count(self) -> int:
        return len(self._items)

    def itemAt(self, index: int) -> QLayoutItem | None:
        return self._items[index] if 0 <= index < len(self._items) else None

    def takeAt(self, index: int) -> QLayoutItem | None:
        return self._items.pop(index) if 0 <= index < len(self._items) else None

    def expandingDirections(self) -> Qt.Orientation:
        return Qt.Orientation(0)

    def hasHeightForWidth(self) -> bool:
        return True

    def heightForWidth(self, width: int) -> int:
        return self._arrange(QRect(0, 0, width, 0), should_move=False)

    def sizeHint(self) -> QSize:
        items = [*self._visible_items()]
        width = sum(self._preferred_width(item) for item in items) + self._total_gap(items)
        height = max((item.sizeHint().height() for item in items), default=0)
        return self._with_margins(QSize(width, height))

    def minimumSize(self) -> QSize:
        items = [*self._visible_items()]
        width = max((self._minimum_width(item) for item in items), default=0)
        height = max((item.minimumSize().height() for item in items), default=0)
        return self._with_margins(QSize(width, height))

    def setGeometry(self, rect: QRect) -> None:
        super().setGeometry(rect)
        self._arrange(rect, should_move=True)

    # -- arrangement
    # ------------------------------------------------------------------------------------------

    def _visible_items(self) -> Iterator[QLayoutItem]:
        return (item for item in self._items if not item.isEmpty())

    def _with_margins(self, size: QSize) -> QSize:
        margins = self.contentsMargins()
        return size + QSize(margins.left() + margins.right(), margins.top() + margins.bottom())

    def _preferred_width(self, item: QLayoutItem) -> int:
        widget = item.widget()
        if isinstance(widget, QLabel) and widget.wordWrap():  # Qt's own size hint is for several lines
            return widget.fontMetrics().horizontalAdvance(widget.text()) + 2
        return item.sizeHint().width()

    def _minimum_width(self, item: QLayoutItem) -> int:
        can_shrink = self._is_elastic(item) or item.hasHeightForWidth()
        min_size = item.minimumSize()
        return min_size.width() if can_shrink else min_size.expandedTo(item.sizeHint()).width()

    def _maximum_width(self, item: QLayoutItem, room: int) -> int:
        widget = item.widget()
        is_greedy = widget is not None and self._greedy_by_widget.get(widget, False)
        return room if is_greedy else self._preferred_width(item)

    def _is_elastic(self, item: QLayoutItem) -> bool:
        widget = item.widget()
        return widget in self._greedy_by_widget

    def _is_attached(self, item: QLayoutItem) -> bool:
        widget = item.widget()
        return widget is not None and widget.property(_ATTACHED) is True

    def _gap_before(self, item: QLayoutItem) -> int:
        return 0 if self._is_attached(item) else self._gap

    def _total_gap(self, items: Sequence[QLayoutItem]) -> int:
        return sum(self._gap_before(item) for item in items[1:])

    def _attached_width(self, items: Sequence[QLayoutItem]) -> int:
        # Width of the attached widgets at the beginning of `items`.
        return sum(self._preferred_width(item) for item in itertools.takewhile(self._is_attached, items))

    def _arrange(self, rect: QRect, *, should_move: bool) -> int:
        # Returns the height; places the items only if `should_move`.
        margins = self.contentsMargins()
        room = rect.marginsRemoved(margins)
        items = [*self._visible_items()]
        rows = [self._one_row(items, room.width())] if items else []
        if rows and not rows[0]:
            rows = self._rows(items, room.width())
        top = room.top()
        for row in rows:
            row_height = max(_height_for_width(item, width) for item, _rect, width in row)
            for item, left, width in row:
                if should_move:
                    height = min(row_height, _height_for_width(item, width))
                    item.setGeometry(
                        QRect(room.left() + left, top + (row_height - height) // 2, width, height)
                    )
            top += row_height + self._row_gap
        used_height = top - room.top() - (self._row_gap if rows else 0)
        return used_height + margins.top() + margins.bottom()

    def _one_row(self, items: list[QLayoutItem], room: int) -> list[tuple[QLayoutItem, int, int]]:
        # Returns the row as (item, left, width); empty if the items don't fit.
        widths = [
            item.minimumSize().width() if self._is_elastic(item) else self._preferred_width(item)
            for item in items
        ]
        spare = room - sum(widths) - self._total_gap(items)
        if spare < 0:
            return []
        for index, item in enumerate(items):
            if self._is_elastic(item):
                extra = max(0, min(spare, self._maximum_width(item, room) - widths[index]))
                widths[index] += extra
                spare -= extra
        pushed_items = self._items[self._push_index :] if self._push_index >= 0 else []
        first = next((index for index, item in enumerate(items) if item in pushed_items), len(items))
        row, left = [], 0
        for index, (item, width) in enumerate(zip(items, widths, strict=True)):
            left += self._gap_before(item) if index else 0
            left += spare if index == first else 0
            row.append((item, left, width))
            left += width
        return row

    def _rows(self, items: list[QLayoutItem], room: int) -> list[list[tuple[QLayoutItem, int, int]]]:
        # An item that is wider than the space gets its own row.
        rows: list[list[tuple[QLayoutItem, int, int]]] = []
        right = 0
        for index, item in enumerate(items):
            row_width = room - self._attached_width(items[index + 1 :])
            width = min(row_width, self._maximum_width(item, row_width))
            left = right + self._gap_before(item)
            remaining_width = row_width - left
            if width > remaining_width >= self._minimum_width(item):
                width = remaining_width
            if not rows or (width > remaining_width and not self._is_attached(item)):
                rows.append([])
                left = 0
                width = min(row_width, self._maximum_width(item, row_width))
            rows[-1].append((item, left, width))
            right = left + width
        return rows


def _height_for_width(item: QLayoutItem, width: int) -> int:
    if item.hasHeightForWidth():
        return max(item.heightForWidth(width), item.minimumSize().height())
    return item.sizeHint().expandedTo(item.minimumSize()).height()
