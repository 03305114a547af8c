"""Rows below each other that fill a panel and scroll; what says that there are none stands in their place."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QScrollArea, QStackedWidget, QVBoxLayout, QWidget

from app.ui.widgets.empty_state import EmptyState


class PanelRows(QStackedWidget):
    """Shows ``empty`` until it is told that there are rows."""

    def __init__(self, empty: EmptyState, name: str = "") -> None:
        """``name`` is what a screen reader calls the rows."""
        super().__init__()
        inside = QWidget()
        inside.setProperty("bare", "true")
        self._column = QVBoxLayout(inside)
        self._column.setContentsMargins(8, 8, 8, 8)
        self._column.setSpacing(6)
        self._column.addStretch(1)
        scroll = QScrollArea()
        scroll.setAccessibleName(name)
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        scroll.setWidget(inside)
        self.addWidget(empty)
        self.addWidget(scroll)

    def put(self, place: int, row: QWidget) -> None:
        """Show a row at this place, also one that stands elsewhere."""
        if self._column.indexOf(row) != place:
            self._column.insertWidget(place, row)

    def drop(self, row: QWidget) -> None:
        """A row is not needed any more."""
        self._column.removeWidget(row)
        row.deleteLater()

    def show_rows(self, shown: bool) -> None:
        """Show the rows, or what says that there are none."""
        self.setCurrentIndex(1 if shown else 0)

    def fill(self, panel: QWidget) -> None:
        """Take all of a panel's room."""
        column = QVBoxLayout(panel)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self)
