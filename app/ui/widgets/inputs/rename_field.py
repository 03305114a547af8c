"""Text field that is placed over an item to rename it."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QRect, Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent
from PySide6.QtWidgets import QLineEdit, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets.keyboard import has_no_modifiers
from app.ui.widgets.menus import FieldContextMenu


class RenameField(QLineEdit):
    """Text field over an item to edit its name; `closed` is emitted at the end.

    Args:
        theme: Theme.
        parent: Widget that contains the item.
        rect: Rectangle of the item.
        name: Current name.
        callback: Called with the new name on Enter and when the field loses the focus. If it returns
            False after Enter, the field stays open.
        accessible_name: Accessible name of the field.
    """

    closed = Signal()

    def __init__(
        self,
        theme: Theme,
        parent: QWidget,
        rect: QRect,
        name: str,
        callback: Callable[[str], bool],
        accessible_name: str,
    ) -> None:
        super().__init__(name, parent)
        self._callback, self._is_closed = callback, False
        self.setAccessibleName(accessible_name)
        self.setProperty("focusRadius", theme.radius("control"))
        FieldContextMenu(theme, self)
        self.setGeometry(rect)
        self.selectAll()
        self.show()
        self.setFocus(Qt.FocusReason.OtherFocusReason)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.close_field()
        elif event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter} and has_no_modifiers(event):
            if self._callback(self.text()):
                self.close_field()
        else:
            super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        if event.reason() != Qt.FocusReason.PopupFocusReason and not self._is_closed:
            self._callback(self.text())
            self.close_field()

    def close_field(self) -> None:
        """Close and delete the field without applying the text."""
        if not self._is_closed:
            self._is_closed = True
            self.hide()
            self.closed.emit()
            self.deleteLater()
