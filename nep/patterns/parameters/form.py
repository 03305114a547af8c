"""ParameterForm: parameters that are instances of a dataclass, TypedDict or Enum. Others see plain values.

What a class declares is looked at in `nep.messages.typed`, which is imported when the first one is given.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

from nep.i18n import _
from nep.messages.codecs import nan_in
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.messages import shapes, typed
else:
    shapes, typed = lazy_module("nep.messages.shapes"), lazy_module("nep.messages.typed")

__all__ = ["ParameterForm", "form_of"]


class ParameterForm:
    """How values of a class, of this shape, become plain ones and come back."""

    def __init__(self, declared: type, shape: shapes.ValueShape) -> None:
        self._shape = shape
        self._kind = declared
        members = list(declared) if issubclass(declared, Enum) else []
        self.choices: tuple[object, ...] = tuple(each.value for each in members)
        """The plain values there are; none: any that fit."""
        kinds = {type(each).__name__ for each in self.choices}
        if len(kinds) > 1:
            kinds = {"mixed"}
        self.plain_kind = kinds.pop() if kinds else "dict"
        """What plain values are, in the word of a parameter's type."""

    def plain(self, value: object) -> object:
        """An instance, or a plain value that fits, as a plain one. Raises `ValueError` that says where."""
        try:
            if not issubclass(self._kind, dict) and isinstance(value, self._kind):
                value = self._shape.write(value)
            plain = self._shape.write(self._shape.read(value))
        except shapes.Misfit as misfit:
            raise ValueError(misfit.sentence) from misfit
        except RecursionError:
            raise ValueError(_("it has too many levels")) from None
        where = nan_in(plain)
        if where is not None:
            raise ValueError(_("{where} is no finite number; give one").format(where=where or _("it")))
        return plain

    def instance(self, plain: object) -> object:
        """A plain value that fitted, as a new instance."""
        return self._shape.read(plain)


def form_of(declared: type) -> ParameterForm | None:
    """The form of a class; None for one that is no dataclass, TypedDict or Enum.

    Raises `ValueError` when a field is of a type that has no form in JSON.
    """
    shape = typed.value_shape(declared)
    return None if shape is None else ParameterForm(declared, shape)
