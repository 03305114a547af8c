"""Conversion of ordinary command-line values without pydantic, whose import takes a third of a short command.

typer 0.29 converts all values, also defaults, with pydantic. Other values and other versions of typer are
left to typer.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

_SURROGATE = re.compile("[\ud800-\udfff]")
_NUMBERS = {int: re.compile(r"-?[0-9]{1,9}"), float: re.compile(r"-?[0-9]{1,9}(\.[0-9]{1,9})?")}
_NOT_CONVERTED = object()


def skip_needless_imports(parameter: Any) -> None:  # noqa: ANN401 - typer's types are not public
    """Let typer convert the values of a parameter only if `_converted` doesn't."""
    convert = getattr(parameter, "get_runtime_param", None)
    if convert is not None and hasattr(parameter, "type_descriptor") and not isinstance(convert, _Conversion):
        parameter.get_runtime_param = _Conversion(convert)


class _Conversion:
    # Replaces the method `get_runtime_param` of a parameter, which builds the converter with pydantic.

    def __init__(self, convert: Callable[[], Any]) -> None:
        self._convert = convert

    def __call__(self) -> _Conversion:
        return self

    def coerce(self, value: object, param: Any, ctx: Any) -> object:  # noqa: ANN401 - see above
        converted = _converted(value, param)
        return (
            self._convert().coerce(value, param=param, ctx=ctx) if converted is _NOT_CONVERTED else converted
        )


def _converted(value: object, parameter: Any) -> object:  # noqa: ANN401 - see above
    wanted, info = parameter.type_descriptor.annotation, parameter.type_descriptor.parameter_info
    is_list = parameter.multiple or parameter.nargs != 1
    if value is None:
        return () if is_list else None
    if info.parser is not None:
        return _NOT_CONVERTED
    if wanted == list[str] and isinstance(value, (list, tuple)):
        return list(value) if all(_is_text(each) for each in value) else _NOT_CONVERTED
    if is_list:
        return _NOT_CONVERTED
    if wanted is str and _is_text(value):
        return value
    if type(value) is wanted and value is parameter.default:
        return value
    if wanted in _NUMBERS and isinstance(value, str) and _NUMBERS[wanted].fullmatch(value):
        number = wanted(value)
        is_valid = (info.min is None or number >= info.min) and (info.max is None or number <= info.max)
        return number if is_valid else _NOT_CONVERTED
    return _NOT_CONVERTED


def _is_text(value: object) -> bool:
    return isinstance(value, str) and not _SURROGATE.search(value)  # pydantic rejects lone surrogates
