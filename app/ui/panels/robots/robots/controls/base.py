"""Interface between a form and the input control of a parameter, and helpers for controls."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QLineEdit, QWidget

from app.robots.description.description import Parameter
from app.ui.theme.theme import Theme
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _

VALUE_WIDTH, ROW_HEIGHT = 104, 36

Callback = Callable[[], None]


class Control:
    """Input control of one parameter, composed of a widget and functions.

    Args:
        widget: Widget of the control.
        value: Returns the current value.
        show: Shows a value in the widget.
        changed: Connects a callback to every change of the value.
        finished: Connects a callback to the end of editing.
        error_text: Returns the error message that the control shows itself, or "".
        close: Releases resources, such as an image stream.
    """

    def __init__(
        self,
        widget: QWidget,
        value: Callable[[], object],
        show: Callable[[object], None],
        changed: Callable[[Callback], None],
        *,
        finished: Callable[[Callback], None] | None = None,
        error_text: Callable[[], str] | None = None,
        close: Callback | None = None,
    ) -> None:
        self.widget = widget
        self.changed = changed
        self._value, self._show = value, show
        self._finished, self._error_text, self._close = finished, error_text, close

    def value(self) -> object:
        """Return the value for the action.

        Returns:
            The value, the typed text if it is invalid, or None to omit the parameter.
        """
        return self._value()

    def show_value(self, value: object) -> None:
        """Show a value; invalid values are ignored."""
        self._show(value)

    def finished(self, callback: Callback) -> None:
        """Connect a callback to the end of editing.

        Args:
            callback: Called whenever the user finishes editing.
        """
        if self._finished is not None:
            self._finished(callback)

    @property
    def error_text(self) -> str:
        """Error message that the control shows itself; "" if there is none."""
        return "" if self._error_text is None else self._error_text()

    def close(self) -> None:
        """Release resources before the form is deleted."""
        if self._close is not None:
            self._close()


def connect(signal: object, callback: Callback) -> None:
    """Connect a callback without arguments to a signal with any arguments."""
    signal.connect(lambda *_values: callback())  # type: ignore[attr-defined]  # any Qt signal


def line_field(theme: Theme, parameter: Parameter) -> QLineEdit:
    """Create the line edit for a parameter, with a context menu and an accessible name.

    The line edit accepts any text, because validation explains errors afterwards.
    """
    field = QLineEdit()
    FieldContextMenu(theme, field)
    field.setAccessibleName(parameter.title)
    field.setMinimumHeight(ROW_HEIGHT - 2)
    if not parameter.is_required and parameter.default is None:
        field.setPlaceholderText(_("Optional"))
    return field


def sentence_case(text: str) -> str:
    """Return the text with its first letter in upper case."""
    return text[:1].upper() + text[1:]
