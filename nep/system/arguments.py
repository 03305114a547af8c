"""Arguments as callers give them: what is not allowed is refused at the call, in a sentence."""

from __future__ import annotations

import functools
import inspect
import math
import sys
from collections.abc import Callable, Sequence
from typing import TypeVar, cast

from nep.errors import WrongTypeError
from nep.i18n import _, listed
from nep.text import control_in, escaped, shortened

__all__ = [
    "at_least",
    "flag",
    "function",
    "is_coroutine_function",
    "limit",
    "one_of",
    "period",
    "plain_function",
    "seconds",
    "text",
    "within",
]

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., object])
_LETTERS = 200
"""Of a type; the master takes no more."""
_LONGEST_S = sys.float_info.max
"""Whole numbers go on behind it, and no clock can add them: longer is for ever."""


def text(name: str, value: object) -> str:
    """`value` itself when it is a text that can be a type's name. Raises `ValueError`."""
    if not isinstance(value, str):
        raise WrongTypeError(_("{name} is a '{kind}'; give a 'str'").format(name=name, kind=_kind(value)))
    if not value:
        raise ValueError(_("{name} is empty; give a name such as 'json'").format(name=name))
    if len(value) > _LETTERS or control_in(value):
        said = escaped(shortened(value, 40))
        raise ValueError(
            _("{name} is '{said}'; use {most} letters at most, and none that controls").format(
                name=name, said=said, most=_LETTERS
            )
        )
    return value


def flag(name: str, value: object) -> bool:
    """`value` itself when it is True or False. Raises `ValueError`."""
    if not isinstance(value, bool):
        raise WrongTypeError(
            _("{name} is {value}; give True or False").format(name=name, value=_shown(value))
        )
    return value


def one_of(name: str, value: T, allowed: Sequence[T]) -> T:
    """`value` itself when it is one of the allowed. Raises `ValueError`."""
    if value not in allowed:
        raise ValueError(
            _("{name} is {value}; use {choices}").format(
                name=name, value=_shown(value), choices=listed([repr(each) for each in allowed], "or")
            )
        )
    return value


def at_least(name: str, value: object, least: int) -> int:
    """`value` itself when it is a whole number and not below `least`. Raises `ValueError`."""
    if not isinstance(value, int) or isinstance(value, bool):
        raise WrongTypeError(
            _("{name} is {value}; give a whole number from {least} on").format(
                name=name, value=_shown(value), least=least
            )
        )
    if value < least:
        raise ValueError(
            _("{name} is {value}; give a whole number from {least} on").format(
                name=name, value=_shown(value), least=least
            )
        )
    return value


def within(name: str, value: object, least: int, most: int) -> int:
    """`value` itself when it is a whole number from `least` to `most`. Raises `ValueError`."""
    if not isinstance(value, int) or isinstance(value, bool):
        raise WrongTypeError(
            _("{name} is {value}; give a whole number from {least} to {most}").format(
                name=name, value=_shown(value), least=least, most=most
            )
        )
    if not least <= value <= most:
        raise ValueError(
            _("{name} is {value}; give a whole number from {least} to {most}").format(
                name=name, value=_shown(value), least=least, most=most
            )
        )
    return value


def seconds(name: str, value: object) -> float | None:
    """`value` itself when it is a time: 0 or more seconds, or None. Raises `ValueError`."""
    if value is None:
        return None
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise WrongTypeError(
            _("{name} is {value}; give seconds, 0 or more, or None").format(name=name, value=_shown(value))
        )
    if not value >= 0.0:  # also what is not a number
        raise ValueError(
            _("{name} is {value}; give seconds, 0 or more, or None").format(name=name, value=_shown(value))
        )
    return None if value > _LONGEST_S else value


def period(name: str, value: object) -> float:
    """`value` itself when it is seconds above 0, and finite. Raises `ValueError`."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise WrongTypeError(
            _("{name} is {value}; give seconds, more than 0").format(name=name, value=_shown(value))
        )
    if not 0.0 < value <= _LONGEST_S:  # also what is not a number
        raise ValueError(
            _("{name} is {value}; give seconds, more than 0").format(name=name, value=_shown(value))
        )
    return value


def limit(name: str, value: object) -> float:
    """`value` itself when it is a time that ends: 0 or more seconds. Raises `ValueError`."""
    if value is None:
        raise WrongTypeError(_("{name} is None; give seconds, 0 or more").format(name=name))
    return math.inf if seconds(name, value) is None else cast("float", value)


def function(name: str, value: F) -> F:
    """`value` itself when it can be called. Raises `ValueError`."""
    if not callable(value):
        raise WrongTypeError(_("{name} is a '{kind}'; give a function").format(name=name, kind=_kind(value)))
    return value


def plain_function(name: str, value: F) -> F:
    """The same, where nobody would await what a coroutine function gives. Raises `ValueError`."""
    if is_coroutine_function(function(name, value)):
        raise ValueError(
            _("{name} is a coroutine function, which nobody awaits here; give a plain function").format(
                name=name
            )
        )
    return value


def is_coroutine_function(call: object) -> bool:
    """Whether calling it makes a coroutine, as far as can be seen before."""
    while isinstance(call, functools.partial):
        call = call.func
    return inspect.iscoroutinefunction(call) or (
        callable(call) and inspect.iscoroutinefunction(call.__call__)
    )


def _shown(value: object) -> str:
    """The value as a sentence may have it: it may be of any size, as others may have sent it."""
    try:
        return escaped(shortened(repr(value), _LETTERS))
    except (RecursionError, ValueError):  # too deep; more digits than Python writes
        return type(value).__name__


def _kind(value: object) -> str:
    return type(value).__name__
