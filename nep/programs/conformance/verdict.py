"""What a judge says when a client breaks a rule."""

from __future__ import annotations

from nep.errors import NepError
from nep.i18n import _

__all__ = ["BrokenRuleError", "broken", "expect", "shown"]

_MAX_SHOWN = 200


class BrokenRuleError(NepError):
    """The client broke a rule; the sentence says what was seen."""


def broken(sentence: str) -> BrokenRuleError:
    """Return the error for something that is said in a whole sentence."""
    return BrokenRuleError(sentence)


def expect(what: str, seen: object, wanted: object) -> None:
    """Raise `BrokenRuleError` unless what was seen is what is wanted. `what` is a name on the wire."""
    if seen != wanted or type(seen) is not type(wanted):
        raise BrokenRuleError(
            _("{what} is {seen}; {wanted} is expected").format(
                what=what, seen=shown(seen), wanted=shown(wanted)
            )
        )


def shown(value: object) -> str:
    """Return a value as a sentence may have it."""
    text = ascii(value)
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}…"
