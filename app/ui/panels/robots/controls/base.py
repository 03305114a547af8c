"""What a form needs of one parameter's control, and what the controls share."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QLineEdit, QWidget

from app.robots.description.description import Parameter
from app.ui.theme.theme import Theme
from app.ui.widgets.menus import EditMenu
from nep.i18n import _

VALUE_WIDTH, ROW_HEIGHT = 104, 36

Tell = Callable[[], None]


class Control:
    """One parameter's control, made from functions.

    ``sentence`` is what the control itself says about what was typed, empty when it is fine: then a form need
    not say it again. ``finished`` is told when a person has left a field, ``changed`` with every change.
    """

    def __init__(
        self,
        widget: QWidget,
        value: Callable[[], object],
        show: Callable[[object], None],
        changed: Callable[[Tell], None],
        *,
        finished: Callable[[Tell], None] | None = None,
        sentence: Callable[[], str] | None = None,
        close: Tell | None = None,
    ) -> None:
        self.widget = widget
        self.changed = changed
        self._value, self._show = value, show
        self._finished, self._sentence, self._close = finished, sentence, close

    def value(self) -> object:
        """The value as the robot wants it, or what was typed when it is none; None leaves it out."""
        return self._value()

    def show_value(self, value: object) -> None:
        """Show a value; one that does not fit changes nothing."""
        self._show(value)

    def finished(self, tell: Tell) -> None:
        """Call `tell` when a person has finished with the control for now."""
        if self._finished is not None:
            self._finished(tell)

    @property
    def sentence(self) -> str:
        """What the control itself says about a wrong value."""
        return "" if self._sentence is None else self._sentence()

    def close(self) -> None:
        """The form goes: let go of what the control watches."""
        if self._close is not None:
            self._close()


def connect(signal: object, tell: Tell) -> None:
    """Call `tell` with any signal, without what it carries."""
    signal.connect(lambda *_values: tell())  # type: ignore[attr-defined]  # any Qt signal


def line_field(theme: Theme, parameter: Parameter) -> QLineEdit:
    """A field of one line with our editing menu and the parameter's name.

    It takes more than the parameter allows: what a person typed or pasted is kept, the check says why not.
    """
    field = QLineEdit()
    EditMenu(theme, field)
    field.setAccessibleName(parameter.title)
    field.setMinimumHeight(ROW_HEIGHT - 2)
    if not parameter.required and parameter.default is None:
        field.setPlaceholderText(_("Optional"))
    return field


def sentence_case(words: str) -> str:
    """The words with a capital at their beginning."""
    return words[:1].upper() + words[1:]
