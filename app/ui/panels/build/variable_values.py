"""Values that a person assigns to variables of the running program."""

from __future__ import annotations

from app.blocks.model.workspace import parse_workspace
from app.robots.description.typed_number import TypedNumberError, parse_number
from app.ui.panels.base import PanelContext
from nep.i18n import _


def ask_value(context: PanelContext, id: str) -> None:
    """Ask for a value and assign it to a variable of the running program."""
    runs = context.session.runs
    name = parse_workspace(context.session.document.workspace).variables.get(id)
    current_value = runs.values.get(id)
    if name is None or not runs.active:
        return

    def set_value(text: str) -> None:
        if not runs.set_variable(id, parse_value(text)):
            context.show_toast(_("The behaviour ended: “{name}” wasn't changed").format(name=name))

    is_number = current_value is not None and current_value.kind == "number"
    context.ask_name(
        _("New value for “{name}”").format(name=name),
        _("Apply"),
        lambda words: separator_problem(words) if is_number else "",
        set_value,
        current_value.text
        if current_value is not None and current_value.kind in ("number", "text", "boolean")
        else "",
    )


def separator_problem(text: str) -> str:
    """Return an error sentence if the text is a number with ambiguous separators, else ""."""
    try:
        parse_number(text)
    except TypedNumberError as error:
        return str(error) if error.has_separators else ""
    return ""


def parse_value(text: str) -> str | float | bool:
    """Parse a typed value of a variable.

    Returns:
        A number, a boolean for "yes", "no" (in the user's language), "true" or "false", or else the
        text.
    """
    stripped = text.strip()
    folded = stripped.casefold()
    if folded in ("true", _("yes").casefold()):
        return True
    if folded in ("false", _("no").casefold()):
        return False
    try:
        number = parse_number(stripped)
        return int(stripped) if stripped.lstrip("+-").isdecimal() else number
    except ValueError:
        return text
