"""Rules of the native wire that a client can be judged by: `rule` registers one, `RULES` has all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from nep.programs.conformance.bench import Bench

__all__ = ["RULES", "Rule", "rule"]

Judge = Callable[[Bench], None]


@dataclass(frozen=True)
class Rule:
    """One rule. `requirement` is English: give it to `_` when it is shown.

    `section` is a heading of docs/wire.md, or another page with one. `features` are those that an adapter
    must announce to be judged. `is_last`: the adapter has ended after it.
    """

    id: str
    requirement: str
    section: str
    judge: Judge
    features: tuple[str, ...] = ()
    is_last: bool = False

    @property
    def place(self) -> str:
        """The page and section that says what it requires."""
        section = self.section.replace(" ", "-")
        return section if ".md#" in section else f"wire.md#{section}"


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
