"""Errors of a running program, with messages for the user."""

from __future__ import annotations

from app.errors import AppError
from nep.i18n import _, format_list, lazy

_TYPE_NAMES = {
    "int": lazy("a number"),
    "float": lazy("a number"),
    "bool": lazy("true or false"),
    "str": lazy("a text"),
    "list": lazy("a list"),
    "dict": lazy("a message"),
    "NoneType": lazy("nothing"),
}
_OTHER_TYPE_NAME = lazy("something else")


class BehaviourError(AppError):
    """Error at a block.

    Attributes:
        block: Id of the block; None if it is not known.
        is_value_unknown: True if the error is caused by a value that is not known yet.
    """

    def __init__(self, message: str, block: str | None = None, *, is_value_unknown: bool = False) -> None:
        super().__init__(message)
        self.block = block
        self.is_value_unknown = is_value_unknown


def explain(error: Exception, label: str, block: str | None) -> BehaviourError:
    """Convert an exception raised by a block to an error with a message for the user.

    A `BehaviourError` is returned itself, with `block` if it has none.

    Args:
        error: Exception.
        label: Label of the block; "" if it is not known.
        block: Id of the block; None if it is not known.
    """
    if isinstance(error, BehaviourError):
        error.block = error.block or block
        return error
    name = _("“{name}”").format(name=label) if label else _("this block")
    if isinstance(error, AppError):
        return BehaviourError(f"{name}: {error.sentence}.", block)
    if isinstance(error, ZeroDivisionError):
        return BehaviourError(_("{name} can't divide by 0.").format(name=name), block)
    if isinstance(error, (OverflowError, MemoryError)):
        return BehaviourError(_("The result of {name} is too large.").format(name=name), block)
    if isinstance(error, RecursionError):
        return BehaviourError(_("{name} is nested too deeply.").format(name=name), block)
    if isinstance(error, TypeError):
        if "NoneType" in str(error):
            return BehaviourError(
                _("{name} can't run: one of its values isn't known yet.").format(name=name),
                block,
                is_value_unknown=True,
            )
        return BehaviourError(
            _("{name} doesn't work with {kinds}.").format(name=name, kinds=_type_names_in(str(error))), block
        )
    return BehaviourError(_("{name} failed: {error}.").format(name=name, error=error), block)


def type_name(value: object) -> str:
    """Return the type of a value with its article, such as "a text"."""
    return _(_TYPE_NAMES.get(type(value).__name__, _OTHER_TYPE_NAME))


def _type_names_in(message: str) -> str:
    display_names = [
        display_name for python_name, display_name in _TYPE_NAMES.items() if f"'{python_name}'" in message
    ]
    return format_list([_(display_name) for display_name in dict.fromkeys(display_names)]) or _(
        "these values"
    )
