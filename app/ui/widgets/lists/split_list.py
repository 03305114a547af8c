"""View with a filtered list next to the details of the selected entry, or above them if narrow."""

from __future__ import annotations

from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QHBoxLayout, QVBoxLayout, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets.labels import Separator

LIST_SHARE = 0.4
QWIDGETSIZE_MAX = 16_777_215
"""Qt's constant for an unlimited widget size (QWIDGETSIZE_MAX)."""


class ListDetailView(QWidget):
    """Widget with a filter, a list, and the details of the selected entry.

    Args:
        theme: Theme.
        parts: Filter, list and details.
        list_px: Width of the list at 100 % text size, limited to two fifths of the widget's width.
        list_height_px: Height of the list at 100 % text size if it is above the details.
        narrow_px: Width at 100 % text size below which the list is above the details.
    """

    def __init__(
        self,
        theme: Theme,
        parts: tuple[QWidget, QWidget, QWidget],
        *,
        list_px: float,
        list_height_px: float,
        narrow_px: float,
    ) -> None:
        # `parts` are filter, list, and details.
        super().__init__()
        self._theme, (filter_field, list_widget, detail) = theme, parts
        self._list_px, self._list_height_px, self._narrow_px = list_px, list_height_px, narrow_px
        self._list_side = QWidget()
        side = QVBoxLayout(self._list_side)
        side.setContentsMargins(0, 8, 0, 0)
        side.setSpacing(6)
        row = QHBoxLayout()
        row.setContentsMargins(8, 0, 8, 0)
        row.addWidget(filter_field)
        side.addLayout(row)
        side.addWidget(list_widget, 1)
        self._separator = Separator(theme, upright=True)
        self._main_layout = QBoxLayout(QBoxLayout.Direction.LeftToRight, self)
        self._main_layout.setContentsMargins(0, 0, 0, 0)
        self._main_layout.setSpacing(0)
        self._main_layout.addWidget(self._list_side)
        self._main_layout.addWidget(self._separator)
        self._main_layout.addWidget(detail, 1)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.fit()

    def fit(self) -> None:
        """Update the arrangement, for example after a change of the text size."""
        is_horizontal = self.width() >= self._theme.scaled(self._narrow_px)
        direction = QBoxLayout.Direction.LeftToRight if is_horizontal else QBoxLayout.Direction.TopToBottom
        self._main_layout.setDirection(direction)
        self._separator.setVisible(is_horizontal)
        list_width = round(min(self._theme.scaled(self._list_px), self.width() * LIST_SHARE))
        self._list_side.setMinimumWidth(list_width if is_horizontal else 0)
        self._list_side.setMaximumWidth(list_width if is_horizontal else QWIDGETSIZE_MAX)
        self._list_side.setMaximumHeight(
            QWIDGETSIZE_MAX if is_horizontal else round(self._theme.scaled(self._list_height_px))
        )
