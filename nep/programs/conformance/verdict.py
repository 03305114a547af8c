"""Checks for rules, and the error raised if a client breaks a rule."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from nep.errors import NepError
from nep.i18n import _

_MAX_VALUE_LENGTH = 200


class BrokenRuleError(NepError):
    """Error for a client that broke a rule; the message describes the observed behaviour."""


def broken_rule(sentence: str) -> BrokenRuleError:
    """Create the error with this message."""
    return BrokenRuleError(sentence)


def expect(what: str, seen: object, wanted: object) -> None:
    """Raise `BrokenRuleError` unless `seen` equals `wanted` in type and value; `what` names the field."""
    if seen != wanted or type(seen) is not type(wanted):
        raise BrokenRuleError(
            _("{what} is {seen}, expected {wanted}").format(
                what=what, seen=printable(seen), wanted=printable(wanted)
            )
        )


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise `BrokenRuleError` if the block takes longer than `seconds`."""
    began = time.monotonic()
    yield
    took_s = time.monotonic() - began
    if took_s > seconds:
        raise broken_rule(_("it took {seconds:.1f} s").format(seconds=took_s))


def printable(value: object) -> str:
    """Return the `ascii` of a value, shortened for a message."""
    text = ascii(value)
    return text if len(text) <= _MAX_VALUE_LENGTH else f"{text[:_MAX_VALUE_LENGTH]}…"
