"""`NodeParameter`: a value with a name, a type and limits. Performs no I/O."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import orjson

from nep.errors import ParameterError
from nep.i18n import _, format_list
from nep.patterns.parameters.form import ParameterForm, create_form
from nep.protocol.wire import check_topic
from nep.text import escaped, shortened

KINDS: Mapping[str, type] = {
    "bool": bool,
    "int": int,
    "float": float,
    "str": str,
    "list": list,
    "dict": dict,
}
_MAX_VALUE_BYTES = 2**20
_MAX_CHOICES = 1000
_MAX_DESCRIPTION_LENGTH = 1000
_MAX_SHOWN_LENGTH = 60
_MAX_INT = 2**63 - 1


@dataclass(frozen=True)
class NodeParameter:
    """Immutable state of a parameter.

    Attributes:
        name: Name of the parameter.
        value: Current value, as plain JSON value.
        kind: "bool", "int", "float", "str", "list" or "dict".
        default: Initial value, as plain JSON value.
        description: Text for people.
        minimum: Minimum of a number, inclusive, or None.
        maximum: Maximum of a number, inclusive, or None.
        choices: Allowed values; empty for any value.
        is_read_only: True if only the node itself may set the parameter.
        form: Conversion to a class, or None for plain values.
    """

    name: str
    value: object
    kind: str
    default: object
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[object, ...] = ()
    is_read_only: bool = False
    form: ParameterForm | None = field(default=None, compare=False, repr=False)

    @property
    def typed_value(self) -> object:
        """Value as a new instance of the parameter's class; the plain value if it has no class."""
        return self.value if self.form is None else self.form.create_instance(self.value)

    def with_value(self, value: object) -> NodeParameter:
        """Return a copy with another value. Raises `ParameterError` if the value is not allowed."""
        return replace(self, value=self._validate(value))

    def _validate(self, value: object) -> object:
        converted = self._convert(value if self.form is None else self._form_to_plain(self.form, value))
        if isinstance(converted, int | float) and not isinstance(converted, bool):
            if self.minimum is not None and converted < self.minimum:
                raise self._error(value, _("the minimum is {least}").format(least=self.minimum))
            if self.maximum is not None and converted > self.maximum:
                raise self._error(value, _("the maximum is {most}").format(most=self.maximum))
        if self.choices and converted not in self.choices:
            names = format_list([short_repr(each) for each in self.choices], "or")
            raise self._error(value, _("use {choices}").format(choices=names))
        return converted

    def _form_to_plain(self, form: ParameterForm, value: object) -> object:
        try:
            return form.to_plain(value)
        except ValueError as error:
            raise self._error(value, str(error)) from error

    def _convert(self, value: object) -> object:
        # ints are accepted as floats, and 2.0 as an int
        if isinstance(value, int | float) and not isinstance(value, bool) and self.kind in {"int", "float"}:
            return self._convert_number(value)
        if type(value) is not KINDS[self.kind]:
            raise self._error(value, _("the value must be of type '{kind}'").format(kind=self.kind))
        return self._json_copy(value)

    def _convert_number(self, value: float) -> float:
        if not _is_finite(value):
            raise self._error(value, _("the value must be a finite number"))
        if self.kind == "float":
            return float(value)
        if int(value) != value or abs(value) > _MAX_INT:
            raise self._error(value, _("the value must be a whole number"))
        return int(value)

    def _json_copy(self, value: object) -> object:
        # Round trip through JSON: validates the value, and protects it from changes in place.
        try:
            data = orjson.dumps(value)
        except (TypeError, ValueError) as error:
            raise self._error(value, str(error)) from error
        if len(data) > _MAX_VALUE_BYTES:
            raise self._error(
                value,
                _("the value is {size} bytes; at most {most} are allowed").format(
                    size=len(data), most=_MAX_VALUE_BYTES
                ),
            )
        return cast("object", orjson.loads(data))

    def _error(self, value: object, reason: str) -> ParameterError:
        return ParameterError(self.name, short_repr(value), reason)

    def as_map(self) -> dict[str, object]:
        """Return the parameter as a JSON-serializable dict, the form in which it is published."""
        return {
            "name": self.name,
            "value": self.value,
            "type": self.kind,
            "default": self.default,
            "description": self.description,
            "min": self.minimum,
            "max": self.maximum,
            "choices": list(self.choices),
            "read_only": self.is_read_only,
        }


def new_parameter(
    name: str,
    default: object,
    *,
    kind: type | str | None,
    description: str,
    minimum: float | None,
    maximum: float | None,
    choices: Sequence[object],
    is_read_only: bool,
) -> NodeParameter:
    """Create a parameter with its default value.

    Raises `ParameterError` or `ValueError` for invalid arguments.
    """
    form = _create_form(name, type(default) if kind is None else kind, default)
    kind_name = kind if isinstance(kind, str) else (type(default) if kind is None else kind).__name__
    if form is not None:
        kind_name, choices = form.plain_kind, choices or form.choices
    if kind_name not in KINDS:
        raise ParameterError(
            check_topic(name),
            short_repr(default),
            _("the type must be {kinds}").format(kinds=format_list([f"'{kind}'" for kind in KINDS], "or")),
        )
    for limit in (minimum, maximum):
        if limit is not None and (kind_name not in {"int", "float"} or not _is_finite(limit)):
            raise ParameterError(
                check_topic(name),
                short_repr(default),
                _("only numbers can have limits, and the limits must be finite"),
            )
    base = NodeParameter(check_topic(name), None, kind_name, None, _clean_description(description), form=form)
    if len(choices) > _MAX_CHOICES:
        raise ParameterError(name, short_repr(default), _("too many choices"))
    allowed = tuple(base.with_value(choice).value for choice in choices)
    parameter = replace(base, minimum=minimum, maximum=maximum, choices=allowed, is_read_only=is_read_only)
    value = parameter.with_value(default).value
    return replace(parameter, value=value, default=value)


def _create_form(name: str, kind: object, default: object) -> ParameterForm | None:
    if not isinstance(kind, type) or kind in KINDS.values():
        return None
    try:
        return create_form(kind)
    except ValueError as error:
        raise ParameterError(check_topic(name), short_repr(default), str(error)) from error


def _clean_description(description: object) -> str:
    text = str(description).encode("utf-8", "replace").decode()
    return shortened(text, _MAX_DESCRIPTION_LENGTH)


def _is_finite(value: object) -> bool:
    if isinstance(value, int) and not isinstance(value, bool):
        return abs(value) <= _MAX_INT
    return isinstance(value, float) and math.isfinite(value)


def short_repr(value: object) -> str:
    """Return the `repr` of a value, shortened and escaped for use in a message."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001 - `repr` of any class may raise; ints may have too many digits
        text = f"a '{type(value).__name__}'"
    return escaped(shortened(text, _MAX_SHOWN_LENGTH))
