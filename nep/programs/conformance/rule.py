"""Registry of the rules of the native wire.

The decorator `rule` registers a check; `RULES` contains all rules.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from nep.programs.conformance.bench import Bench

RuleCheck = Callable[[Bench], None]


@dataclass(frozen=True)
class Rule:
    """Rule of the native wire.

    Attributes:
        id: Unique id.
        requirement: English sentence; translate it with `_` for display.
        section: Anchor of a heading in docs/wire.md, or ``PAGE.md#anchor``.
        check: Check; raises `BrokenRuleError` if the adapter on the bench breaks the rule.
        features: Features that an adapter must announce for the rule to apply.
        is_last: True if the check makes the adapter exit, so that it must be restarted.
    """

    id: str
    requirement: str
    section: str
    check: RuleCheck
    features: tuple[str, ...] = ()
    is_last: bool = False

    @property
    def location(self) -> str:
        """Page and anchor of the requirement, such as "wire.md#messages"."""
        section = self.section.replace(" ", "-")
        return section if ".md#" in section else f"wire.md#{section}"


RULES: dict[str, Rule] = {}
"""Rules by id."""


def rule(
    id: str, requirement: str, section: str, *features: str, is_last: bool = False
) -> Callable[[RuleCheck], RuleCheck]:
    """Return a decorator that registers a function as the check of a rule.

    The arguments are the attributes of `Rule`.
    """

    def register(check: RuleCheck) -> RuleCheck:
        RULES[id] = Rule(id, requirement, section, check, features, is_last)
        return check

    return register
