"""Functions of the category "Numbers and logic".

Angles are in degrees. Functions raise BehaviourError for values that aren't finite numbers (`values.number`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from decimal import ROUND_HALF_DOWN, ROUND_HALF_UP, Decimal
from fractions import Fraction

from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.values import number, text
from nep.i18n import _, lazy

__all__ = [
    "absolute", "arc_cosine", "arc_sine", "arc_tangent", "cosine", "counting", "e_to_the", "is_divisible",
    "is_even", "is_negative", "is_odd", "is_positive", "is_whole", "larger", "limited", "logarithm",
    "mapped", "natural_logarithm", "rounded_to", "sign", "sine", "smaller", "square_root", "tangent",
    "ten_to_the",
]  # fmt: skip

_MAX_ITERATIONS = 10**9
_MAX_DECIMAL_PLACES = 15
_MAX_EXACT_INTEGER = 2**53


def square_root(value: object) -> int | float:
    """Return the square root of a number. Raises BehaviourError for negative numbers."""
    return _apply(math.sqrt, value, lazy("“square root”"))


def absolute(value: object) -> int | float:
    """Return the absolute value of a number."""
    return abs(number(value, lazy("“absolute value”")))


def sign(value: object) -> int:
    """Return the sign of a number: 1, 0 or -1."""
    operand = number(value, lazy("“sign”"))
    return (operand > 0) - (operand < 0)


def sine(degrees: object) -> int | float:
    """Return the sine of an angle in degrees."""
    return _rounded_result(math.sin(_to_radians(degrees, lazy("“sin”"))))


def cosine(degrees: object) -> int | float:
    """Return the cosine of an angle in degrees."""
    return _rounded_result(math.cos(_to_radians(degrees, lazy("“cos”"))))


def tangent(degrees: object) -> int | float:
    """Return the tangent of an angle in degrees. Raises BehaviourError at odd multiples of 90 degrees."""
    label = lazy("“tan”")
    if abs(number(degrees, label)) % 180 == 90:
        raise _no_result_error(label, degrees)
    return _rounded_result(math.tan(_to_radians(degrees, label)))


def arc_sine(value: object) -> int | float:
    """Return the angle in degrees whose sine is `value`. Raises BehaviourError outside of -1 to 1."""
    return _rounded_result(math.degrees(_apply(math.asin, value, lazy("“asin”"))))


def arc_cosine(value: object) -> int | float:
    """Return the angle in degrees whose cosine is `value`. Raises BehaviourError outside of -1 to 1."""
    return _rounded_result(math.degrees(_apply(math.acos, value, lazy("“acos”"))))


def arc_tangent(value: object) -> int | float:
    """Return the angle in degrees whose tangent is `value`."""
    return _rounded_result(math.degrees(math.atan(number(value, lazy("“atan”")))))


def natural_logarithm(value: object) -> int | float:
    """Return the logarithm of a number to the base e. Raises BehaviourError if it is not positive."""
    return _apply(math.log, value, lazy("“ln”"))


def logarithm(value: object) -> int | float:
    """Return the logarithm of a number to the base 10. Raises BehaviourError if it is not positive."""
    return _apply(math.log10, value, lazy("“log”"))


def e_to_the(power: object) -> float:
    """Return e to the power of a number."""
    return math.exp(number(power, lazy("“e to the power”")))


def ten_to_the(power: object) -> int | float:
    """Return 10 to the power of a number."""
    return _rounded_result(math.pow(10, number(power, lazy("“10 to the power”"))), decimal_places=None)


def rounded_to(value: object, decimal_places: object) -> int | float:
    """Round to a number of decimal places, halves up; negative places round to tens, hundreds and so on."""
    operand = number(value, lazy("“round”"))
    requested_digits = number(decimal_places, lazy("“decimal places”"))
    digits = max(-_MAX_DECIMAL_PLACES, min(_MAX_DECIMAL_PLACES, round(requested_digits)))
    if abs(operand) >= _MAX_EXACT_INTEGER:  # floats of this size have no fraction
        return operand
    rounding_mode = ROUND_HALF_UP if operand > 0 else ROUND_HALF_DOWN
    exact = Decimal(repr(operand)).scaleb(digits).to_integral_value(rounding_mode).scaleb(-digits)
    return int(exact) if exact == int(exact) else float(exact)


def smaller(one: object, other: object) -> int | float:
    """Return the smaller of two numbers."""
    return min(number(one, lazy("“smaller”")), number(other, lazy("“smaller”")))


def larger(one: object, other: object) -> int | float:
    """Return the larger of two numbers."""
    return max(number(one, lazy("“larger”")), number(other, lazy("“larger”")))


def limited(value: object, low: object, high: object) -> int | float:
    """Limit a number to a range; the limits may be given in any order."""
    operand, first, last = (number(each, lazy("“limit”")) for each in (value, low, high))
    return max(min(first, last), min(max(first, last), operand))


def mapped(value: object, low: object, high: object, new_low: object, new_high: object) -> int | float:
    """Scale a number linearly from one range to another.

    Raises:
        BehaviourError: The first range is empty.
    """
    label = lazy("“map”")
    operand, first, last, to_first, to_last = (
        number(each, label) for each in (value, low, high, new_low, new_high)
    )
    if first == last:
        raise BehaviourError(
            _("The first range of {name} needs two different numbers.").format(name=_(label))
        )
    return to_first + (operand - first) * (to_last - to_first) / (last - first)


def is_even(value: object) -> bool:
    """Return True if the value is an even integer."""
    return is_whole(value) and int(number(value, lazy("“even”"))) % 2 == 0


def is_odd(value: object) -> bool:
    """Return True if the value is an odd integer."""
    return is_whole(value) and int(number(value, lazy("“odd”"))) % 2 == 1


def is_whole(value: object) -> bool:
    """Return True if the number has no fractional part."""
    operand = number(value, lazy("“is”"))
    return isinstance(operand, int) or operand.is_integer()


def is_positive(value: object) -> bool:
    """Return True if the number is greater than 0."""
    return number(value, lazy("“positive”")) > 0


def is_negative(value: object) -> bool:
    """Return True if the number is less than 0."""
    return number(value, lazy("“negative”")) < 0


def is_divisible(value: object, by: object) -> bool:
    """Return True if a number is divisible by another one, in decimal arithmetic: 0.3 is divisible by 0.1."""
    dividend, divisor = (number(each, lazy("“is divisible by”")) for each in (value, by))
    return Fraction(str(dividend)) % Fraction(str(divisor)) == 0


def counting(first: object, last: object, step: object) -> Iterator[int | float]:
    """Return an iterator over the numbers from `first` to `last`, ascending or descending.

    The sign of `step` is ignored.

    Raises:
        BehaviourError: The step is 0.
    """
    label = lazy("“count”")
    begin, end, step_size = (number(each, label) for each in (first, last, step))
    if step_size == 0:
        raise BehaviourError(_("{name} needs a step other than 0.").format(name=_(label)))
    step_size = abs(step_size) if end >= begin else -abs(step_size)
    # Tolerance for rounding errors: 0 to 0.3 by 0.1 has four numbers.
    step_count = min(math.floor((end - begin) / step_size + 1e-9), _MAX_ITERATIONS)
    is_integer = isinstance(begin, int) and isinstance(step_size, int)
    return (
        begin + index * step_size
        if is_integer
        else _rounded_result(begin + index * step_size, decimal_places=12)
        for index in range(step_count + 1)
    )


def _to_radians(degrees: object, label: str) -> float:
    return math.radians(math.fmod(number(degrees, label), 360))


def _apply(function: Callable[[float], float], value: object, label: str) -> int | float:
    operand = number(value, label)
    try:
        return _rounded_result(function(operand), decimal_places=None)
    except ValueError:
        raise _no_result_error(label, operand) from None


def _no_result_error(label: str, value: object) -> BehaviourError:
    return BehaviourError(_("{name} has no result for {number}.").format(name=_(label), number=text(value)))


def _rounded_result(value: float, decimal_places: int | None = 10) -> int | float:
    rounded = value if decimal_places is None else round(value, decimal_places)
    return int(rounded) if rounded.is_integer() and abs(rounded) < _MAX_EXACT_INTEGER else rounded
