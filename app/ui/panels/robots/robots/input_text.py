"""Short descriptions of the input of an action, such as "happy, for 2 s" or "“Hello”"."""

from __future__ import annotations

from collections.abc import Mapping

from app.robots.description.description import Action, Parameter
from app.robots.description.inputs import format_for_editing
from nep.i18n import _, number, translate

UNITS = {"s": "seconds", "min": "minutes"}
MAX_TEXT_LENGTH = 32


def input_summary(action: Action, values: Mapping[str, object], *, include_texts: bool = True) -> str:
    """Format the most important values of an input, in the order of the parameters.

    Args:
        action: Action with the parameters.
        values: Input by parameter name.
        include_texts: False to omit texts, which are formatted in quotation marks.
    """
    parts = (
        _value_text(parameter, values.get(parameter.name), include_texts=include_texts)
        for parameter in action.parameters
    )
    return ", ".join(text for text in parts if text)


def is_unit(title: str, unit: str | None) -> bool:
    """Return True if the title of a parameter is only the name of its unit, such as "seconds"."""
    english = UNITS.get(unit or "")
    return english is not None and title in {english, translate("robot", english)}


def _value_text(parameter: Parameter, value: object, *, include_texts: bool) -> str:
    title = next((choice.title for choice in parameter.choices if choice.value == value), None)
    if title is not None:
        return title
    if parameter.kind in NUMBER_KINDS and isinstance(value, (int, float)):
        amount = number(value) if isinstance(value, float) else str(value)
        amount += f"{'' if parameter.unit in {'°', None} else ' '}{parameter.unit or ''}"
        if is_unit(parameter.title, parameter.unit):
            return _("for {duration}").format(duration=amount)
        return f"{parameter.title} {amount}"
    if not include_texts:
        return ""
    if parameter.kind == "image" and value:
        return _("an image")
    if parameter.kind == "text" and isinstance(value, str) and value:
        text = " ".join(value.split())
        return f"“{text if len(text) <= MAX_TEXT_LENGTH else text[: MAX_TEXT_LENGTH - 1] + '…'}”"
    if parameter.kind in ("list", "object") and value:
        formatted = format_for_editing(value)
        return formatted if len(formatted) <= MAX_TEXT_LENGTH else f"{formatted[: MAX_TEXT_LENGTH - 1]}…"
    return str(value) if parameter.kind == "colour" and value else ""


NUMBER_KINDS = frozenset({"number", "integer", "angle"})
