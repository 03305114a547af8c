"""Frame of fields, which shows the focus and invalid texts. The style sheet paints it."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from app.ui.widgets import paint


def set_invalid(field: QWidget, *, is_invalid: bool) -> None:
    """Show the text of a field as invalid if `is_invalid`, else as valid."""
    paint.set_style_property(field, "wrong", "true" if is_invalid else "false")


class FieldFrame(QWidget):
    """Frame of a field around its editor, which is the focus proxy."""

    def __init__(self) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)

    @property
    def is_invalid(self) -> bool:
        """True while the text is shown as invalid."""
        return bool(self.property("wrong") == "true")

    def set_invalid(self, *, is_invalid: bool) -> None:
        """Show the text as invalid if `is_invalid`, else as valid."""
        set_invalid(self, is_invalid=is_invalid)

    def update_focus(self) -> None:
        """Show whether the editor has the focus."""
        paint.set_style_property(self, "focused", self.hasFocus())
