"""Helper functions for the checks of rules, and the error for a broken rule."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from nep.errors import NepError
from nep.i18n import _

_MAX_VALUE_LENGTH = 200


class BrokenRuleError(NepError):
    """Error for a client that breaks a rule; the message describes the observed behaviour."""


def broken_rule_error(message: str) -> BrokenRuleError:
    """Return a `BrokenRuleError` with this message."""
    return BrokenRuleError(message)


def expect(label: str, actual: object, expected: object) -> None:
    """Raise `BrokenRuleError` unless two values are equal and of the same type.

    Args:
        label: Name of the value, for the error message.
        actual: Actual value.
        expected: Expected value.
    """
    if actual != expected or type(actual) is not type(expected):
        raise BrokenRuleError(
            _("{what} is {seen}, expected {wanted}").format(
                what=label, seen=printable(actual), wanted=printable(expected)
            )
        )


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise `BrokenRuleError` if the `with` block takes longer than `seconds`."""
    started_s = time.monotonic()
    yield
    duration_s = time.monotonic() - started_s
    if duration_s > seconds:
        raise broken_rule_error(_("the operation took {seconds:.1f} s").format(seconds=duration_s))


def printable(value: object) -> str:
    """Return the `ascii` representation of a value, shortened for an error message."""
    text = ascii(value)
    return text if len(text) <= _MAX_VALUE_LENGTH else f"{text[:_MAX_VALUE_LENGTH]}…"
