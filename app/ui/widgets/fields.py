"""The filter in a panel's title."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent

from app.ui.theme.theme import Theme
from app.ui.widgets.labels import SearchField
from app.ui.widgets.plain_key import is_plain


class FilterField(SearchField):
    """Filters a list: Down and Return go on into the list (`leave`), Esc clears it."""

    leave = Signal()

    def __init__(self, theme: Theme, name: str) -> None:
        """``name`` is what a screen reader says: "Filter topics"."""
        super().__init__(theme, "Filter", "/")
        self.setAccessibleName(name)
        self.setMaximumWidth(190)
        self.setMinimumWidth(90)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and self.text():
            self.clear()
        elif event.key() in {Qt.Key.Key_Down, Qt.Key.Key_Return, Qt.Key.Key_Enter} and is_plain(event):
            self.leave.emit()
        else:
            super().keyPressEvent(event)
