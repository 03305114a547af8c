"""Fields for the placeholders of a message, such as ``{yaw}``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QVBoxLayout, QWidget

from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import label
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.frame import set_invalid
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _

FIELD_WIDTH_PX = 120


class ValueFields(QWidget):
    """Text fields for the placeholders of a message.

    Signals:
        typed: Name of a placeholder, and the text that was typed.
    """

    typed = Signal(str, str)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.fields: dict[str, QLineEdit] = {}
        self._parts: list[QWidget] = []
        self._container = QWidget()
        self._flow = Flow(self._container, gap=12, row_gap=6)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self._container)

    def show_fields(self, names: Sequence[str], values: Mapping[str, str]) -> None:
        """Show a field for each placeholder. A field that exists already is reused and keeps the focus.

        Args:
            names: Names of the placeholders.
            values: Texts of the fields by name.
        """
        if list(names) != list(self.fields):
            self._rebuild(names)
        for name, field in self.fields.items():
            value = values.get(name, "")
            if field.text() != value:
                field.setText(value)
            set_invalid(field, is_invalid=not value.strip())

    def _rebuild(self, names: Sequence[str]) -> None:
        focused_name = next((name for name, field in self.fields.items() if field.hasFocus()), "")
        for part in self._parts:
            self._flow.removeWidget(part)
            part.hide()
            part.deleteLater()
        self._parts, self.fields = [], {}
        for name in names:
            self._add_field(name)
        if focused_name in self.fields:
            self.fields[focused_name].setFocus()

    def _add_field(self, name: str) -> None:
        part = QWidget()
        row = QHBoxLayout(part)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(6)
        name_label = label(name, "mono", role="accentText")
        field = QLineEdit()
        field.setMinimumWidth(round(self._theme.scaled(FIELD_WIDTH_PX)))
        field.setAccessibleName(_("Value of {name}").format(name=name))
        hint = _(
            "A number such as 12.5 or 12,5, JSON such as true, or text. Put a number in quotes to send "
            "it as text."
        )
        field.setToolTip(plain.tip(hint))
        field.setProperty("focusRadius", self._theme.radius("control"))
        FieldContextMenu(self._theme, field)
        field.textEdited.connect(lambda text, name=name: self.typed.emit(name, text))
        name_label.setBuddy(field)
        row.addWidget(name_label)
        row.addWidget(field)
        self._flow.addWidget(part)
        self._parts.append(part)
        self.fields[name] = field
