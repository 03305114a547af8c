"""Validators for arguments. Each returns the value, or raises `ValueError` that names the argument."""

from __future__ import annotations

import functools
import inspect
import math
import sys
from collections.abc import Callable, Sequence
from typing import TypeVar, cast

from nep.errors import WrongTypeError
from nep.i18n import _, format_list
from nep.text import escaped, first_control, shortened

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., object])
_MAX_LENGTH = 200
"""Maximum length in characters of a message type's name; the master has the same limit."""
_MAX_SECONDS = sys.float_info.max
"""Maximum time limit in seconds. Larger values are treated as no limit, because they may overflow a float."""


def check_type_name(name: str, value: object) -> str:
    """Validate the name of a message type and return it. Raises `ValueError`."""
    if not isinstance(value, str):
        raise WrongTypeError(
            _("{name} must be a 'str', not '{kind}'").format(name=name, kind=_type_name(value))
        )
    if not value:
        raise ValueError(_("{name} is empty; use a name such as 'json'").format(name=name))
    if len(value) > _MAX_LENGTH or first_control(value):
        display_value = escaped(shortened(value, 40))
        raise ValueError(
            _("{name} is '{said}'; use at most {most} characters, without control characters").format(
                name=name, said=display_value, most=_MAX_LENGTH
            )
        )
    return value


def check_bool(name: str, value: object) -> bool:
    """Validate a bool and return it. Raises `ValueError`."""
    if not isinstance(value, bool):
        raise WrongTypeError(
            _("{name} must be True or False, not {value}").format(name=name, value=_bounded_repr(value))
        )
    return value


def check_choice(name: str, value: T, allowed: Sequence[T]) -> T:
    """Validate that a value is one of `allowed` and return it. Raises `ValueError`."""
    if value not in allowed:
        raise ValueError(
            _("{name} is {value}; use {choices}").format(
                name=name,
                value=_bounded_repr(value),
                choices=format_list([repr(each) for each in allowed], "or"),
            )
        )
    return value


def check_at_least(name: str, value: object, minimum: int) -> int:
    """Validate an int of at least `minimum` and return it. Raises `ValueError`."""
    if not isinstance(value, int) or isinstance(value, bool):
        raise WrongTypeError(
            _("{name} must be a whole number of at least {least}, not {value}").format(
                name=name, value=_bounded_repr(value), least=minimum
            )
        )
    if value < minimum:
        raise ValueError(
            _("{name} must be a whole number of at least {least}, not {value}").format(
                name=name, value=_bounded_repr(value), least=minimum
            )
        )
    return value


def check_range(name: str, value: object, minimum: int, maximum: int) -> int:
    """Validate an int from `minimum` to `maximum` and return it. Raises `ValueError`."""
    if not isinstance(value, int) or isinstance(value, bool):
        raise WrongTypeError(
            _("{name} must be a whole number from {least} to {most}, not {value}").format(
                name=name, value=_bounded_repr(value), least=minimum, most=maximum
            )
        )
    if not minimum <= value <= maximum:
        raise ValueError(
            _("{name} must be a whole number from {least} to {most}, not {value}").format(
                name=name, value=_bounded_repr(value), least=minimum, most=maximum
            )
        )
    return value


def check_optional_time_limit(name: str, value: object) -> float | None:
    """Validate a non-negative time limit in seconds, or None, and return it; None for infinity.

    Raises `ValueError`.
    """
    if value is None:
        return None
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise WrongTypeError(
            _("{name} must be a number of seconds (0 or greater) or None, not {value}").format(
                name=name, value=_bounded_repr(value)
            )
        )
    if not value >= 0.0:  # also NaN
        raise ValueError(
            _("{name} must be a number of seconds (0 or greater) or None, not {value}").format(
                name=name, value=_bounded_repr(value)
            )
        )
    return None if value > _MAX_SECONDS else value


def check_period(name: str, value: object) -> float:
    """Validate a positive, finite period in seconds and return it. Raises `ValueError`."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise WrongTypeError(
            _("{name} must be a number of seconds greater than 0, not {value}").format(
                name=name, value=_bounded_repr(value)
            )
        )
    if not 0.0 < value <= _MAX_SECONDS:  # also NaN
        raise ValueError(
            _("{name} must be a number of seconds greater than 0, not {value}").format(
                name=name, value=_bounded_repr(value)
            )
        )
    return value


def check_time_limit(name: str, value: object) -> float:
    """Validate a non-negative time limit in seconds, which may be infinite, and return it as a number.

    Raises `ValueError`, also for None.
    """
    if value is None:
        raise WrongTypeError(
            _("{name} must be a number of seconds (0 or greater), not None").format(name=name)
        )
    return math.inf if check_optional_time_limit(name, value) is None else cast("float", value)


def check_function(name: str, value: F) -> F:
    """Check that a value is callable and return it. Raises `ValueError` otherwise."""
    if not callable(value):
        raise WrongTypeError(
            _("{name} must be a function, not '{kind}'").format(name=name, kind=_type_name(value))
        )
    return value


def check_plain_function(name: str, value: F) -> F:
    """Check that a value is callable and not a coroutine function, and return it.

    Raises `ValueError` otherwise.
    """
    if is_coroutine_function(check_function(name, value)):
        raise ValueError(
            _("{name} is a coroutine function, which isn't awaited here; use a regular function").format(
                name=name
            )
        )
    return value


def is_coroutine_function(call: object) -> bool:
    """Return True if calling the object returns a coroutine.

    Also detects `functools.partial` and `__call__`.
    """
    while isinstance(call, functools.partial):
        call = call.func
    return inspect.iscoroutinefunction(call) or (
        callable(call) and inspect.iscoroutinefunction(call.__call__)
    )


def _bounded_repr(value: object) -> str:
    # Bounded `repr` of an untrusted value.
    try:
        return escaped(shortened(repr(value), _MAX_LENGTH))
    except (RecursionError, ValueError):  # too deep, or too many digits
        return type(value).__name__


def _type_name(value: object) -> str:
    return type(value).__name__
