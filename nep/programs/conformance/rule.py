"""Registry of the rules of the native wire: `rule` registers a check, `RULES` contains all rules."""

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
        judge: Raises `BrokenRuleError` if the adapter on the bench breaks the rule.
        features: Features that an adapter must announce for the rule to apply.
        is_last: True if the adapter has exited after the check.
    """

    id: str
    requirement: str
    section: str
    check: RuleCheck
    features: tuple[str, ...] = ()
    is_last: bool = False

    @property
    def location(self) -> str:
        """Page and section of the requirement in docs."""
        section = self.section.replace(" ", "-")
        return section if ".md#" in section else f"wire.md#{section}"


RULES: dict[str, Rule] = {}
"""Rules by id."""


def rule(
    id: str, requirement: str, section: str, *features: str, is_last: bool = False
) -> Callable[[RuleCheck], RuleCheck]:
    """Register the decorated function as the check of a rule; see `Rule`."""

    def register(judge: RuleCheck) -> RuleCheck:
        RULES[id] = Rule(id, requirement, section, judge, features, is_last)
        return judge

    return register
