"""Read-only fields for an address or a token, with buttons inside their frame."""

from __future__ import annotations

from PySide6.QtCore import QSize, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QHBoxLayout, QLineEdit

from app.ui.theme.theme import Theme
from app.ui.widgets import IconButton
from app.ui.widgets.inputs.frame import FieldFrame
from app.ui.widgets.menus import FieldContextMenu

_PADDING, _BUTTON = 10, 26


class _ReadOnlyLine(QLineEdit):
    """Read-only line edit that emits `copy_requested` on Ctrl+C if nothing is selected.

    The owner then copies the full text, even if the displayed text is masked.
    """

    copy_requested = Signal()
    focus_changed = Signal()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.matches(QKeySequence.StandardKey.Copy) and not self.hasSelectedText():
            self.copy_requested.emit()
        else:
            super().keyPressEvent(event)

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.deselect()
        self.focus_changed.emit()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.focus_changed.emit()


class CopyField(FieldFrame):
    """Read-only field with a copy button; the button and Ctrl+C emit `copy_requested`."""

    copy_requested = Signal()

    def __init__(self, theme: Theme, name: str, copy_name: str, *buttons: IconButton) -> None:
        # `copy_name` is the name of the copy button; `buttons` are placed before it.
        super().__init__()
        self._theme = theme
        self.line = _ReadOnlyLine()
        self.line.setReadOnly(True)
        self.line.setAccessibleName(name)
        self.line.setProperty("bare", "true")
        self.line.setProperty("ownFocus", True)
        FieldContextMenu(theme, self.line)
        self.copy = IconButton(theme, "copy", copy_name, size=_BUTTON)
        self.copy.clicked.connect(self.copy_requested)
        self.line.copy_requested.connect(self.copy_requested)
        self.line.focus_changed.connect(self.update_focus)
        self.setFocusProxy(self.line)
        row = QHBoxLayout(self)
        row.setContentsMargins(_PADDING, 2, 4, 2)
        row.setSpacing(0)
        row.addWidget(self.line, 1)
        for button in (*buttons, self.copy):
            row.addWidget(button)
        theme.changed.connect(self._set_font)
        self._set_font()

    def text(self) -> str:
        """Return the displayed text."""
        return self.line.text()

    def show_text(self, text: str, *, can_copy: bool = True) -> None:
        """Set the displayed text and scroll to its start.

        Args:
            text: Text, which may be masked.
            can_copy: True to enable the copy button.
        """
        if text != self.line.text():
            self.line.setText(text)
            self.line.setCursorPosition(0)
        self.copy.setEnabled(can_copy)

    def _set_font(self) -> None:
        self.line.setFont(self._theme.font("code"))
        self.updateGeometry()

    def sizeHint(self) -> QSize:
        height = max(self._theme.size("control", "normal"), super().sizeHint().height())
        return QSize(super().sizeHint().width(), height)

    def minimumSizeHint(self) -> QSize:
        return QSize(round(self._theme.scaled(140)), self.sizeHint().height())
