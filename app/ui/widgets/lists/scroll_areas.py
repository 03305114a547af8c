"""Scroll areas for long texts, and for rows that fill a panel."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QFontMetricsF
from PySide6.QtWidgets import (
    QFrame,
    QScrollArea,
    QSizePolicy,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from app.ui.widgets.keyboard import tab_stops_of


class ContentScrollArea(QScrollArea):
    """Scroll area that prefers the height of its contents."""

    def __init__(self, content: QWidget) -> None:
        super().__init__()
        self._content = content
        content.setProperty("bare", "true")
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.viewport().setAutoFillBackground(False)
        self.setWidget(content)
        content.setAutoFillBackground(False)
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Maximum)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)

    def heightForWidth(self, width: int) -> int:
        content = self._content
        return content.heightForWidth(width) if content.hasHeightForWidth() else content.sizeHint().height()

    def sizeHint(self) -> QSize:
        width = max(1, self.width())
        return QSize(self._content.sizeHint().width(), self.heightForWidth(width))

    def minimumSizeHint(self) -> QSize:
        return QSize(60, round(1.5 * QFontMetricsF(self._content.font()).height()))

    def viewportEvent(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest:
            self.updateGeometry()  # a scroll area doesn't propagate changes of its contents' height
        return super().viewportEvent(event)


class RowsLayout(QVBoxLayout):
    """Vertical layout that keeps the tab order of its rows.

    Qt appends inserted widgets to the end of the window's tab order.
    """

    def __init__(self, parent: QWidget, before: QWidget) -> None:
        # `before` precedes the first row in the tab order.
        super().__init__(parent)
        self._before = before

    def insertWidget(self, index: int, row: QWidget) -> None:  # type: ignore[override]
        super().insertWidget(index, row)
        before = self._before
        above = (item.widget() for number in reversed(range(index)) if (item := self.itemAt(number)))
        for other in above:
            stops = tab_stops_of(other) if other is not None else []
            if stops:
                before = stops[-1]
                break
        for stop in tab_stops_of(row):
            QWidget.setTabOrder(before, stop)
            before = stop


class ScrollColumn(QScrollArea):
    """Scroll area with a column of rows, aligned to the top.

    Attributes:
        column: Layout to insert rows into; its last item is a stretch.
    """

    def __init__(self, name: str, *, margins: tuple[int, int, int, int] = (0, 0, 0, 0), gap: int = 0) -> None:
        # `name` is the accessible name; `margins` are left, top, right, bottom.
        super().__init__()
        content = QWidget()
        content.setProperty("bare", "true")
        self.column = RowsLayout(content, self)
        self.column.setContentsMargins(*margins)
        self.column.setSpacing(gap)
        self.column.addStretch(1)
        self.setAccessibleName(name)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setWidget(content)


class PanelRows(QStackedWidget):
    """Stack of an empty state and a scrolling column of rows."""

    def __init__(self, empty: QWidget, name: str = "") -> None:
        # `name` is the accessible name of the rows.
        super().__init__()
        scroll = ScrollColumn(name, margins=(8, 8, 8, 8), gap=6)
        self._column = scroll.column
        self.addWidget(empty)
        self.addWidget(scroll)

    def insert_row(self, index: int, row: QWidget) -> None:
        """Insert a row at a position, or move it there."""
        if self._column.indexOf(row) != index:
            self._column.insertWidget(index, row)

    def remove_row(self, row: QWidget) -> None:
        """Remove and delete a row."""
        self._column.removeWidget(row)
        row.deleteLater()

    def show_rows(self, visible: bool) -> None:
        """Show the rows if `visible`, else the empty state."""
        self.setCurrentIndex(1 if visible else 0)

    def fill(self, panel: QWidget) -> None:
        """Add this widget to a panel as its only contents."""
        column = QVBoxLayout(panel)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self)
