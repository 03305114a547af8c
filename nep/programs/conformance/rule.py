"""Rules of the native wire that a client can be judged by: `rule` registers one, `RULES` has all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nep.errors import NepError
from nep.i18n import _

if TYPE_CHECKING:
    from nep.programs.conformance.bench import Bench

__all__ = ["RULES", "BrokenRuleError", "Rule", "broken", "expect", "rule"]

Judge = Callable[["Bench"], None]
_MAX_SHOWN = 200


class BrokenRuleError(NepError):
    """The client broke a rule; the sentence says what was seen."""


@dataclass(frozen=True)
class Rule:
    """One rule. `requirement` is English: give it to `_` when it is shown.

    `section` is the place in docs/wire.md. `features` are those that an adapter must announce to be judged.
    `is_last`: the adapter has ended after it.
    """

    id: str
    requirement: str
    section: str
    judge: Judge
    features: tuple[str, ...] = ()
    is_last: bool = False


RULES: dict[str, Rule] = {}
"""By id, in the order in which a client is judged."""


def rule(
    id: str, requirement: str, section: str, *features: str, is_last: bool = False
) -> Callable[[Judge], Judge]:
    """Register the decorated function as the judge of a rule. It raises `BrokenRuleError`."""

    def register(judge: Judge) -> Judge:
        RULES[id] = Rule(id, requirement, section, judge, features, is_last)
        return judge

    return register


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
