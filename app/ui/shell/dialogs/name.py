"""Sheet that asks for a name and shows an error if the typed name is invalid."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QVBoxLayout, QWidget

from app.ui.shell.dialogs.overlay import Overlay
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label, paint
from app.ui.widgets.inputs.frame import set_invalid
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _

WIDTH = 420


class NameSheet(Overlay):
    """Sheet with a text field and a button, opened by `ask`."""

    top = 128

    def __init__(self, theme: Theme, window: QWidget) -> None:
        super().__init__(theme, window, _("Name"))
        self._rejection_reason: Callable[[str], str] = lambda _name: ""
        self._callback: Callable[[str], object] = lambda _name: None
        self.heading = label("", "heading")
        self.field = QLineEdit()
        self.field.setProperty("focusRadius", theme.radius("control"))
        FieldContextMenu(theme, self.field)
        self.error_label = label("", "body", role="error", wrap=True)
        self.button = Button(theme, "", kind="primary", size="form")
        cancel = Button(theme, _("Cancel"), size="form")
        cancel.clicked.connect(self.dismiss)
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(cancel)
        row.addWidget(self.button)
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 16, 20, 16)
        column.setSpacing(10)
        for widget in (self.heading, self.field, self.error_label):
            column.addWidget(widget)
        column.addLayout(row)
        self.field.textEdited.connect(self._on_edited)
        self.button.clicked.connect(self._submit)

    def ask(
        self,
        question: str,
        verb: str,
        rejection_reason: Callable[[str], str],
        callback: Callable[[str], object],
        name: str = "",
    ) -> None:
        """Open the sheet to ask for a name.

        Args:
            question: Title of the sheet.
            verb: Text of the button.
            rejection_reason: Returns the reason why a name is invalid, as a sentence, or "".
            callback: Called with the name if it is valid.
            name: Initial text.
        """
        self._rejection_reason, self._callback = rejection_reason, callback
        self.setAccessibleName(question)
        self.heading.setText(question)
        self.field.setAccessibleName(question)
        self.field.setText(name)
        self.field.selectAll()
        self.button.set_label(verb)
        self._on_edited(name)
        self.open()

    def initial_focus(self) -> QWidget:
        return self.field

    def preferred_size(self, room: QSize) -> QSize:
        width = min(room.width(), round(self.theme.scaled(WIDTH)))
        layout = self.layout()
        height = layout.totalHeightForWidth(width) if layout is not None else 0
        return QSize(width, min(room.height(), max(height, self.sizeHint().height())))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self._submit()
        super().keyPressEvent(event)

    def _show_error(self, message: str) -> None:
        self.error_label.setText(message)
        paint.show_when(self.error_label, bool(message))
        set_invalid(self.field, is_invalid=bool(message))
        self.place()
        if message:
            paint.announce(self.error_label, message)

    def _on_edited(self, text: str) -> None:
        # No error is shown for an empty field until the button is pressed.
        name = text.strip()
        message = self._rejection_reason(name) if name else ""
        self._show_error(message)
        self.button.setEnabled(not message and bool(name or not self._rejection_reason("")))

    def _submit(self) -> None:
        name = self.field.text().strip()
        message = self._rejection_reason(name)
        if message:
            self._show_error(message)
            return
        self.dismiss()
        self._callback(name)
