"""Parameters of the selected node: table of their current values, and an editor."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QModelIndex, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QSizePolicy, QStackedWidget, QVBoxLayout, QWidget

from app.core.networks.parameters import (
    MAX_TEXT_LENGTH,
    NodeParameters,
    ReportedParameter,
    format_value,
    read_only_reason,
)
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ComboBox, ElidedLabel, Separator, label, paint, set_role
from app.ui.widgets.inputs.frame import set_invalid
from app.ui.widgets.menus import FieldContextMenu
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, format_list, lazy
from nep.text import shortened

CHANGE_HIGHLIGHT_S = 0.8
MAX_DISPLAYED_CHARS = 200
MAX_DISPLAYED_CHOICES = 6
LINE, CHOICE = range(2)


def allowed_values_text(parameter: ReportedParameter) -> str:
    """Describe the allowed values of a parameter, such as "0 to 2", "walk, run or crawl" or "read-only".

    Return "" if every value is allowed.
    """
    if parameter.is_read_only:
        return _("read-only")
    if parameter.choices:
        texts = [shortened(format_value(each), 40) for each in parameter.choices[:MAX_DISPLAYED_CHOICES]]
        return (
            ", ".join(texts) + " …"
            if len(parameter.choices) > MAX_DISPLAYED_CHOICES
            else format_list(texts, "or")
        )
    minimum, maximum = parameter.minimum, parameter.maximum
    if minimum is not None and maximum is not None:
        return _("{least} to {most}").format(least=format_value(minimum), most=format_value(maximum))
    if minimum is not None:
        return _("{least} or more").format(least=format_value(minimum))
    return _("{most} or less").format(most=format_value(maximum)) if maximum is not None else ""


class ParametersView(QWidget):
    """Table of parameters and, below it, an editor for the selected one."""

    def __init__(self, theme: Theme, parameters: NodeParameters) -> None:
        super().__init__()
        self.theme, self.parameters = theme, parameters
        self.clock: Callable[[], float] = time.monotonic
        self._last_state: tuple[object, ...] = ()
        self._is_edited = self._is_awaiting_reply = False
        self._highlight_end_s = 0.0
        self.title = ElidedLabel("small", "textSecondary")
        self.title.setContentsMargins(12, 5, 12, 3)
        self.model = TableModel(self._columns(), lambda each: each.name)
        self.table = TableView(theme, self.model)
        self.table.setAccessibleName(_("Parameters"))
        self.table.setMinimumHeight(3 * self.table.row_height)
        self.table.opened.connect(lambda _name: self._focus_editor())
        self.table.selectionModel().currentChanged.connect(self._selection_changed)
        self.name_label = label("", "code")
        self.name_label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.field = ValueField(theme, self._submit, self._cancel_edit)
        self.field.textEdited.connect(self._mark_edited)
        self.choice_field = ComboBox(theme)
        self.choice_field.activated.connect(lambda _index: self._submit())
        self.editors = QStackedWidget()
        self.editors.addWidget(self.field)
        self.editors.addWidget(self.choice_field)
        self.editors.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self.set_button = Button(theme, _("Set"), size="small")
        self.set_button.clicked.connect(self._submit)
        self.status_label = label("", "small", role="textTertiary", wrap=True)
        self.status_label.setMinimumWidth(0)
        self._editor_row = QWidget()
        self._lay_out()

    def _lay_out(self) -> None:
        edit = QHBoxLayout()
        edit.setSpacing(8)
        edit.addWidget(self.name_label, 2)
        edit.addWidget(self.editors, 3)
        edit.addWidget(self.set_button)
        strip = QVBoxLayout(self._editor_row)
        strip.setContentsMargins(12, 5, 10, 6)
        strip.setSpacing(3)
        strip.addLayout(edit)
        strip.addWidget(self.status_label)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for widget, stretch in (
            (Separator(self.theme), 0), (self.title, 0), (self.table, 1), (Separator(self.theme), 0),
            (self._editor_row, 0),
        ):  # fmt: skip
            column.addWidget(widget, stretch)

    def _columns(self) -> tuple[Column[ReportedParameter], ...]:
        return (
            Column("parameter", lazy("Parameter"), 96, self._name_cell, stretch=True, tip=_tooltip),
            Column("value", lazy("Value"), 130, self._value_cell, tip=lambda p: p.text[:2000]),
            Column("allowed", lazy("Allowed"), 124, _allowed_cell, tip=allowed_values_text, hide_order=1),
        )

    def _text_role(self, role: str) -> str:
        node = self.parameters.node
        is_current = node is not None and node.gone_s is None and not node.is_stale
        return role if is_current else "textDisabled"

    def _name_cell(self, parameter: ReportedParameter) -> Cell:
        return Cell(parameter.name, role=self._text_role("text"), mono=True, elide_middle=True)

    def _value_cell(self, parameter: ReportedParameter) -> Cell:
        text = shortened(parameter.text, MAX_DISPLAYED_CHARS)
        changed_s = self.parameters.change_times_s.get(parameter.name)
        if changed_s is not None and self.clock() - changed_s < CHANGE_HIGHLIGHT_S:
            return Cell(text, role="changed", mono=True, tint="changedTint")
        return Cell(text, role=self._text_role("text"), mono=True)

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Show the current values; called on every refresh of the panel."""
        parameters = self.parameters
        parameters.refresh(self.clock())
        node = parameters.node
        if node is None:
            return
        state = (parameters.revision, node.key, node.gone_s is None, node.can_set_parameters, node.is_stale)
        if state != self._last_state:
            is_other_node = not self._last_state or state[1] != self._last_state[1]
            self._last_state = state
            if is_other_node:
                self._is_edited = False
            self.title.setText(self._title_text())
            self.model.set_rows(parameters.all)
            self._show_selected()
            self._highlight_end_s = self.clock() + 2 * CHANGE_HIGHLIGHT_S
        if self.clock() < self._highlight_end_s:  # repaint while highlights of changes fade
            self.table.refresh_visible()

    def _title_text(self) -> str:
        parameters = self.parameters
        name = parameters.node.name if parameters.node is not None else ""
        if parameters.problem:
            template = _("The parameters of {node} can't be read: {reason}")
            return template.format(node=name, reason=parameters.problem)
        template = (
            _("Parameters of {node}")
            if parameters.has_received
            else _("Waiting for the parameters of {node}")
        )
        return template.format(node=name)

    @property
    def selected_parameter(self) -> ReportedParameter | None:
        """Selected parameter, or None."""
        row = self.model.row_at(self.table.currentIndex())
        return self.parameters.find(row.name) if row is not None else None

    def _selection_changed(self, _now: QModelIndex, _before: QModelIndex) -> None:
        self._is_edited = False
        self.parameters.rejection_reason = ""
        self._show_selected()

    def _show_selected(self) -> None:
        parameter, node = self.selected_parameter, self.parameters.node
        is_visible = parameter is not None and node is not None
        for widget in (self.name_label, self.editors, self.set_button):
            paint.show_when(widget, is_visible)
        if parameter is None or node is None:
            self._set_status(_("Choose a parameter to change its value."))
            return
        self.name_label.setText(parameter.name)
        self.name_label.setToolTip(plain.tip(_tooltip(parameter)))
        disabled_reason = read_only_reason(node, parameter)
        options = [format_value(each) for each in parameter.choices]
        if parameter.kind == "bool" and not options:
            options = ["false", "true"]
        is_pending = self.parameters.pending_name == parameter.name
        if self._is_awaiting_reply and not self.parameters.pending_name:
            self._is_awaiting_reply = False
            self._is_edited = bool(self.parameters.rejection_reason)
        self._show_editor(parameter, options)
        self.field.setEnabled(not disabled_reason)
        self.choice_field.setEnabled(not disabled_reason)
        self.set_button.setEnabled(not disabled_reason and not is_pending)
        paint.show_when(self.set_button, not options)
        self._update_status(parameter, disabled_reason, is_pending=is_pending)

    def _show_editor(self, parameter: ReportedParameter, options: list[str]) -> None:
        current_text = parameter.text
        self.editors.setCurrentIndex(CHOICE if options else LINE)
        for widget in (self.field, self.choice_field):
            widget.setAccessibleName(_("Value of {parameter}").format(parameter=parameter.name))
        if options:
            if [self.choice_field.itemData(index) for index in range(self.choice_field.count())] != options:
                self.choice_field.clear()
                for option in options:
                    self.choice_field.addItem(shortened(option, MAX_DISPLAYED_CHARS), option)
            self.choice_field.set_value(current_text)
        elif not self._is_edited and self.field.text() != current_text:
            self.field.setText(current_text[:MAX_TEXT_LENGTH])

    def _update_status(self, parameter: ReportedParameter, disabled_reason: str, *, is_pending: bool) -> None:
        rejection = self.parameters.rejection_reason
        self.field.set_invalid(is_invalid=bool(rejection))
        if rejection:
            self._set_status(_as_sentence(rejection), "error")
        elif is_pending:
            self._set_status(_("Waiting for the node's reply"))
        elif disabled_reason:
            self._set_status(_as_sentence(disabled_reason))
        else:
            parts = (shortened(parameter.description, 300), allowed_values_text(parameter))
            self._set_status("; ".join(filter(None, parts)))

    def _set_status(self, text: str, role: str = "textTertiary") -> None:
        set_role(self.status_label, role)
        if text != self.status_label.text():
            self.status_label.setText(text)
            if role == "error":
                paint.announce(self.status_label, text)

    # -- user actions -------------------------------------------------------------------------------------

    def _mark_edited(self, _text: str) -> None:
        self._is_edited = True

    def _focus_editor(self) -> None:
        editor = self.choice_field if self.editors.currentIndex() == CHOICE else self.field
        if editor.isEnabled():
            editor.setFocus(Qt.FocusReason.ShortcutFocusReason)

    def _cancel_edit(self) -> None:
        self._is_edited = False
        self.parameters.rejection_reason = ""
        self._show_selected()
        self.table.setFocus(Qt.FocusReason.ShortcutFocusReason)

    def _submit(self) -> None:
        parameter = self.selected_parameter
        if parameter is None:
            return
        is_choice = self.editors.currentIndex() == CHOICE
        self.parameters.set(parameter.name, self.choice_field.value if is_choice else self.field.text())
        self._is_edited = True  # keep the typed text until the node has confirmed it
        self._is_awaiting_reply = bool(self.parameters.pending_name)
        self._show_selected()


class ValueField(QLineEdit):
    """Text field for the value of a parameter. Return sets the value, Esc restores the current one."""

    def __init__(
        self, theme: Theme, on_submit: Callable[[], object], on_cancel: Callable[[], object]
    ) -> None:
        super().__init__()
        self._on_submit, self._on_cancel = on_submit, on_cancel
        self.setProperty("focusRadius", theme.radius("control"))
        self.setMinimumWidth(60)
        FieldContextMenu(theme, self)

    def set_invalid(self, *, is_invalid: bool) -> None:
        """Show or remove the red outline.

        Args:
            is_invalid: True if the value is invalid.
        """
        set_invalid(self, is_invalid=is_invalid)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self._on_submit()
        elif event.key() == Qt.Key.Key_Escape:
            self._on_cancel()
        else:
            super().keyPressEvent(event)


def _tooltip(parameter: ReportedParameter) -> str:
    return "\n".join(filter(None, (parameter.name, shortened(parameter.description, 1000))))


def _allowed_cell(parameter: ReportedParameter) -> Cell:
    return Cell(allowed_values_text(parameter), role="textTertiary")


def _as_sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."
