"""Form for the request of a service, whose fields are derived from the keys and values of the request."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGridLayout, QLineEdit, QVBoxLayout, QWidget

from app.core.run.acting.json_text import parse_typed_value
from app.robots.description.typed_number import TypedNumberError, parse_number
from app.ui.theme.theme import Theme
from app.ui.widgets import Switch, label
from app.ui.widgets.inputs.frame import set_invalid
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _, lazy

LABEL_WIDTH_PX = 80
MAX_FIELDS = 60
WIDENING_KINDS = {("float", "int")}
TYPE_ERRORS = {
    "int": lazy("{name} needs a whole number."),
    "float": lazy("{name} needs a number."),
    "separators": lazy("{name} needs a number with at most one comma or point."),
    "json": lazy("{name} needs JSON, such as {example}."),
}


def kind_of(value: object) -> str:
    """Return the kind of a value: "bool", "int", "float", "str" or "json"."""
    if isinstance(value, bool):
        return "bool"
    if isinstance(value, (int, float)):
        return "int" if isinstance(value, int) else "float"
    return "str" if isinstance(value, str) else "json"


class RequestForm(QWidget):
    """Form with one field per key of the request.

    Signals:
        typed: Edited request.
    """

    typed = Signal(object)  # a dict

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._request: dict[str, object] = {}
        self._kinds: dict[str, str] = {}
        self.fields: dict[str, QLineEdit | Switch] = {}
        self.problems: dict[str, str] = {}
        """Error messages by field name."""
        self.hint_label = label("", "small", role="textSecondary", wrap=True)
        self.hint_label.setMinimumWidth(0)
        self._grid = QGridLayout()
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(10)
        self._grid.setVerticalSpacing(8)
        self._grid.setColumnMinimumWidth(0, round(theme.scaled(LABEL_WIDTH_PX)))
        self._grid.setColumnStretch(1, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(8)
        column.addWidget(self.hint_label)
        column.addLayout(self._grid)
        column.addStretch(1)

    def reset_kinds(self) -> None:
        """Discard the types of the fields; called before the request of another service is shown."""
        self._kinds, self._request = {}, {}

    def show_request(self, request: object) -> None:
        """Show the first `MAX_FIELDS` fields of a request. Only requests that are objects have fields."""
        values = dict(request) if isinstance(request, Mapping) else {}
        if values == self._request and self._kinds and not self.problems:
            return
        displayed = dict(list(values.items())[:MAX_FIELDS])
        kinds = {name: self._kind(name, value) for name, value in displayed.items()}
        if kinds != self._kinds or list(kinds) != list(self.fields):
            self._rebuild(kinds)
        self._request = values
        for name, value in displayed.items():
            self._show_value(name, value)
        if not isinstance(request, Mapping):
            self.hint_label.setText(
                _("The request must be an object with names and values. Edit it as JSON.")
            )
        elif not values:
            hint = _("This service doesn't describe its request. Studio sends {} or the JSON you write.")
            self.hint_label.setText(hint)
        elif len(values) > MAX_FIELDS:
            self.hint_label.setText(_("Some fields aren't shown. Edit the request as JSON to see them all."))
        self.hint_label.setVisible(not values or len(values) > MAX_FIELDS)

    def _kind(self, name: str, value: object) -> str:
        # A field keeps its kind: a float field when an integer is typed, a JSON field for any value.
        kind, previous_kind = kind_of(value), self._kinds.get(name)
        return (
            previous_kind
            if (previous_kind is not None and (previous_kind, kind) in WIDENING_KINDS)
            or previous_kind == "json"
            else kind
        )

    def _show_value(self, name: str, value: object) -> None:
        field, kind = self.fields[name], self._kinds[name]
        self.problems.pop(name, None)
        if isinstance(field, Switch):
            field.setChecked(value is True)
            return
        text = value if isinstance(value, str) and kind == "str" else json.dumps(value, ensure_ascii=False)
        # don't replace "12" by "12.0" while the user types
        if field.text() != text and not (
            field.hasFocus() and self._parse_value(name, field.text()) == (value,)
        ):
            field.setText(text)
        set_invalid(field, is_invalid=False)

    def _rebuild(self, kinds: Mapping[str, str]) -> None:
        while (item := self._grid.takeAt(0)) is not None:
            widget = item.widget()
            if widget is not None:
                widget.hide()
                widget.deleteLater()
        self.fields, self._kinds, self.problems = {}, dict(kinds), {}
        for row, (name, kind) in enumerate(kinds.items()):
            name_label = label(name, "body", role="textSecondary", wrap=True)
            name_label.setTextFormat(Qt.TextFormat.PlainText)
            name_label.setMinimumHeight(26)
            field = self._make_field(name, kind)
            field.setAccessibleName(name)
            self._grid.addWidget(name_label, row, 0, Qt.AlignmentFlag.AlignTop)
            self._grid.addWidget(field, row, 1)
            self.fields[name] = field

    def _make_field(self, name: str, kind: str) -> QLineEdit | Switch:
        if kind == "bool":
            switch = Switch(self._theme, "")
            switch.clicked.connect(lambda: self._set_value(name, switch.isChecked()))
            return switch
        line = QLineEdit()
        line.setProperty("focusRadius", self._theme.radius("control"))
        FieldContextMenu(self._theme, line)
        line.textEdited.connect(lambda text: self._on_typed(name, text))
        return line

    def _on_typed(self, name: str, text: str) -> None:
        parsed = self._parse_value(name, text)
        field = self.fields[name]
        if parsed is None:
            template = TYPE_ERRORS["separators" if self._has_separators(name, text) else self._kinds[name]]
            self.problems[name] = _(template).format(name=name, example="[1, 2]")
            if isinstance(field, QLineEdit):
                set_invalid(field, is_invalid=True)
            self.typed.emit(dict(self._request))
        else:
            self.problems.pop(name, None)
            if isinstance(field, QLineEdit):
                set_invalid(field, is_invalid=False)
            self._set_value(name, parsed[0])

    def _parse_value(self, name: str, text: str) -> tuple[object] | None:
        # Returns the value in a tuple, or None if the text is invalid.
        kind = self._kinds[name]
        if kind == "str":
            return (text,)
        value = parse_typed_value(text)
        if isinstance(value, str) and value == text:
            return None  # invalid JSON
        if kind == "json":
            return (value,)
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not is_number or (isinstance(value, float) and not math.isfinite(value)):
            return None
        return None if kind == "int" and isinstance(value, float) else (value,)

    def _has_separators(self, name: str, text: str) -> bool:
        if self._kinds[name] not in {"int", "float"}:
            return False
        try:
            parse_number(text)
        except TypedNumberError as error:
            return error.has_separators
        return False

    def _set_value(self, name: str, value: object) -> None:
        self._request = {**self._request, name: value}
        self.typed.emit(dict(self._request))
