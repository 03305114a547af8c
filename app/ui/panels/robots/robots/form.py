"""Form for the input of a robot's action, generated from its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGridLayout, QLabel, QLineEdit, QVBoxLayout, QWidget

from app.errors import InputProblem
from app.robots.description.description import Action, Parameter
from app.robots.description.inputs import value_problem
from app.ui.panels.robots.robots.controls.chooser import (
    ROW_HEIGHT,
    Control,
    ImageSource,
    control_for,
    sentence_case,
)
from app.ui.panels.robots.robots.controls.colour import ColourChoice
from app.ui.panels.robots.robots.input_text import input_summary
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Segments, label
from app.ui.widgets.inputs.fields import LongTextField
from app.ui.widgets.inputs.frame import set_invalid
from nep.i18n import _

LABEL_WIDTH = 92
ROW_GAP = 10
MIN_TALL_ROW_HEIGHT = 60  # px; in taller rows the label is vertically centred


class ActionForm(QWidget):
    """Form with one row per parameter. The button "Show more" shows the advanced parameters.

    Args:
        theme: Theme of the window.
        action: Action of the robot.
        options: Returns the values that a property of the robot currently offers.
        pictures: Source of images for image parameters.

    Signals:
        changed: The user changed the input.
    """

    changed = Signal()

    def __init__(
        self,
        theme: Theme,
        action: Action,
        options: Callable[[str], Sequence[str]] = lambda _property: (),
        pictures: ImageSource | None = None,
    ) -> None:
        super().__init__()
        self.action = action
        self.controls: dict[str, Control] = {}
        self._error_labels: dict[str, QLabel] = {}
        self._rows: dict[str, tuple[QWidget, QWidget]] = {}
        self._heights: dict[QWidget, int] = {}
        self._is_stacked = False
        self._theme, self._pictures = theme, pictures
        self._grid = QGridLayout()
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(10)
        self._grid.setVerticalSpacing(ROW_GAP)
        self._fit()
        theme.changed.connect(self._fit)
        self._grid.setColumnStretch(1, 1)
        self.more = Button(theme, _("Show more"), "chevron-down", kind="ghost", size="small")
        self.more.setCheckable(True)
        self.more.toggled.connect(self._show_advanced)
        self.problem = label("", "small", role="error", wrap=True)
        self.problem.hide()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(ROW_GAP)
        column.addLayout(self._grid)
        column.addWidget(self.more)
        column.addWidget(self.problem)
        for parameter in sorted(action.parameters, key=lambda one: one.is_advanced):
            self._add_row(parameter, options(parameter.options_from) if parameter.options_from else ())
        self.more.setVisible(any(parameter.is_advanced for parameter in action.parameters))
        self._show_advanced(False)

    def _add_row(self, parameter: Parameter, options: Sequence[str]) -> None:
        control = control_for(self._theme, parameter, options, self._pictures)
        # escaped because "&" would define a mnemonic in a label with a buddy
        title = plain.escape_menu_text(sentence_case(parameter.title))
        name = label(title, "bodyLarge", role="textSecondary", wrap=True)
        name.setBuddy(control.widget)
        error_label = label("", "small", role="error", wrap=True)
        error_label.hide()
        cell = QWidget()
        layout = QVBoxLayout(cell)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        layout.addWidget(control.widget)
        layout.addWidget(error_label)
        control.widget.setMinimumHeight(ROW_HEIGHT)
        self._heights[name] = max(ROW_HEIGHT, min(MIN_TALL_ROW_HEIGHT, control.widget.sizeHint().height()))
        self._position_row(2 * len(self._rows), name, cell)
        self.controls[parameter.name] = control
        self._error_labels[parameter.name] = error_label
        self._rows[parameter.name] = (name, cell)
        control.changed(self._control_changed)
        control.finished(lambda: self._validate_field(parameter))

    # -- layout -------------------------------------------------------------------------------------------

    def _fit(self) -> None:
        # Labels are beside the controls if all controls fit there, else above them.
        label_width = round(self._theme.scaled(LABEL_WIDTH))
        is_stacked = self.width() < label_width + self._grid.horizontalSpacing() + self._control_width()
        self._grid.setColumnMinimumWidth(0, 0 if is_stacked else label_width)
        if is_stacked != self._is_stacked:
            self._is_stacked = is_stacked
            for index, (name, cell) in enumerate(self._rows.values()):
                self._position_row(2 * index, name, cell)

    def _control_width(self) -> int:
        # Wrapping controls count with the width that they need for a single row.
        widgets = [control.widget for control in self.controls.values()]
        in_one_row = (
            widget.sizeHint().width() for widget in widgets if isinstance(widget, Segments | ColourChoice)
        )
        return max((*in_one_row, *(widget.minimumSizeHint().width() for widget in widgets)), default=0)

    def _position_row(self, row: int, name: QWidget, cell: QWidget) -> None:
        for widget in (name, cell):
            self._grid.removeWidget(widget)
        name.setMinimumHeight(0 if self._is_stacked else self._heights[name])
        if self._is_stacked:
            self._grid.addWidget(name, row, 0, 1, 2)
            self._grid.addWidget(cell, row + 1, 0, 1, 2)
        else:
            self._grid.addWidget(name, row, 0, Qt.AlignmentFlag.AlignTop)
            self._grid.addWidget(cell, row, 1)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def minimumSizeHint(self) -> QSize:
        # Minimum width with labels above the controls.
        min_width = max((cell.minimumSizeHint().width() for _name, cell in self._rows.values()), default=0)
        return QSize(min_width, super().minimumSizeHint().height())

    def _control_changed(self) -> None:
        self.show_problems(())
        self.changed.emit()

    def _validate_field(self, parameter: Parameter) -> None:
        # Validates when a field loses the focus, so that errors are shown before a try.
        value = self.controls[parameter.name].value()
        problem = None if value is None else value_problem(parameter, value)
        problems = [] if problem is None else [problem]
        self._show_errors_of(parameter, problems)

    def _show_advanced(self, is_visible: bool) -> None:
        if is_visible:
            self.more.set_label(_("Show less"), "chevron-up")
        else:
            self.more.set_label(_("Show more"), "chevron-down")
        for parameter in self.action.parameters:
            if parameter.is_advanced:
                for widget in self._rows[parameter.name]:
                    widget.setVisible(is_visible)

    def input(self) -> dict[str, object]:
        """Return the input for the action; empty fields are omitted."""
        values = {name: control.value() for name, control in self.controls.items()}
        return {name: value for name, value in values.items() if value is not None}

    def set_input(self, values: Mapping[str, object]) -> None:
        """Fill the form with an input, such as the input of an earlier try."""
        for name, value in values.items():
            if name in self.controls:
                self.controls[name].show_value(value)

    def show_problems(self, problems: Sequence[InputProblem]) -> None:
        """Show each error below its parameter, and errors without a parameter at the end of the form."""
        for parameter in self.action.parameters:
            self._show_errors_of(
                parameter, [each.message for each in problems if each.parameter == parameter.name]
            )
        rows = {parameter.name for parameter in self.action.parameters}
        self._set_errors(self.problem, [each.message for each in problems if each.parameter not in rows])

    def _show_errors_of(self, parameter: Parameter, problems: Sequence[str]) -> None:
        control = self.controls[parameter.name]
        self._set_errors(self._error_labels[parameter.name], () if control.error_text else problems)
        self._set_invalid(control.widget, is_invalid=bool(problems or control.error_text))
        if problems and parameter.is_advanced:
            self.more.setChecked(True)

    def _set_errors(self, error_label: QLabel, messages: Sequence[str]) -> None:
        error_label.setText(" ".join(f"{sentence_case(message)}." for message in messages))
        error_label.setVisible(bool(messages))

    def _set_invalid(self, widget: QWidget, *, is_invalid: bool) -> None:
        if isinstance(widget, LongTextField):
            widget.set_invalid(is_invalid=is_invalid)
            return
        for field in [widget, *widget.findChildren(QLineEdit)]:
            if isinstance(field, QLineEdit):
                set_invalid(field, is_invalid=is_invalid)

    def summary(self) -> str:
        """Return a short description of the input, such as "happy, for 2 s"."""
        values = {name: control.value() for name, control in self.controls.items()}
        return input_summary(self.action, values, include_texts=False)

    def dispose(self) -> None:
        """Release the resources of all controls."""
        for control in self.controls.values():
            control.close()
