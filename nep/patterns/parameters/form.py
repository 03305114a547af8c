"""Parameters of a class: instances of a dataclass, TypedDict or Enum, sent to others as plain values.

`nep.messages.typed`, which analyses the declarations, is imported when the first class is used.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

from nep.i18n import _
from nep.messages.codecs import find_nan
from nep.messages.fields import FieldPathError
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.messages import shapes, typed
else:
    typed = lazy_module("nep.messages.typed")


class ParameterForm:
    """Conversion between instances of a class and plain values."""

    def __init__(self, declared: type, shape: shapes.ValueShape) -> None:
        self._shape = shape
        self._kind = declared
        members = list(declared) if issubclass(declared, Enum) else []
        self.choices: tuple[object, ...] = tuple(each.value for each in members)
        """Plain values of the Enum's members; empty for other classes."""
        kinds = {type(each).__name__ for each in self.choices}
        if len(kinds) > 1:
            kinds = {"mixed"}
        self.plain_kind = kinds.pop() if kinds else "dict"
        """Type name of the plain values, as in `NodeParameter.kind`."""

    def to_plain(self, value: object) -> object:
        """Convert an instance to its plain value, or validate and copy a plain value.

        Raises `ValueError` with the field path if the value doesn't match the class.
        """
        try:
            if not issubclass(self._kind, dict) and isinstance(value, self._kind):
                value = self._shape.write(value)
            plain_value = self._shape.write(self._shape.read(value))
        except FieldPathError as mismatch:
            raise ValueError(mismatch.message) from mismatch
        except RecursionError:
            raise ValueError(_("the value has too many levels")) from None
        nan_path = find_nan(plain_value)
        if nan_path is not None:
            raise ValueError(_("{where} must be a finite number").format(where=nan_path or _("the value")))
        return plain_value

    def create_instance(self, plain_value: object) -> object:
        """Create an instance from a validated plain value."""
        return self._shape.read(plain_value)


def create_form(declared: type) -> ParameterForm | None:
    """Return the form of a class, or None for a class that is not a dataclass, TypedDict or Enum.

    Raises `ValueError` when the type of a field can't be represented in JSON.
    """
    shape = typed.value_shape(declared)
    return None if shape is None else ParameterForm(declared, shape)
