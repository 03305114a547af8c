"""Checks of an adapter against rules. The adapter is restarted after each broken rule."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from nep.errors import NepError
from nep.i18n import _
from nep.programs.conformance.adapter import AdapterError
from nep.programs.conformance.bench import AdapterStarter, Bench
from nep.programs.conformance.rule import RULES, Rule

_MODULES = (
    "registration",
    "handshake",
    "messages",
    "receiving",
    "connections",
    "losses",
    "closing",
    "lease",
    "limits",
    "services",
)
"""Modules of rules in the order in which they are checked; later rules depend on earlier ones."""
Status = Literal["passed", "failed", "skipped"]


@dataclass(frozen=True)
class Outcome:
    """Result of checking one rule.

    Attributes:
        rule: Rule that was checked.
        status: "passed", "failed" or "skipped".
        observation: Description of the failure, or reason for skipping; "" if passed.
    """

    rule: Rule
    status: Status
    observation: str = ""

    def to_plain(self) -> dict[str, object]:
        """Return the result as a JSON-serializable dict, for ``--json``."""
        return {
            "id": self.rule.id,
            "status": self.status,
            "requirement": _(self.rule.requirement),
            "seen": self.observation,
            "section": f"docs/{self.rule.location}",
        }


def select_rules(ids: Iterable[str]) -> list[Rule]:
    """Return the rules with the given ids, in the order in which they are checked.

    Returns all rules if `ids` is empty. Raises `KeyError` for an unknown id.
    """
    requested_ids = list(ids)
    for rule_id in requested_ids:
        if rule_id not in RULES:
            raise KeyError(rule_id)
    selected = [each for each in RULES.values() if not requested_ids or each.id in requested_ids]
    return sorted(selected, key=lambda each: _MODULES.index(each.check.__module__.rpartition(".")[2]))


def check(start: AdapterStarter, rules: Iterable[Rule], scale: float = 1.0) -> Iterator[Outcome]:
    """Check an adapter against rules, and yield each outcome.

    Args:
        start: Starts an adapter, given the address of the master.
        rules: Rules in the order in which they are checked.
        scale: Factor for all times of the wire; the adapter must use the same factor.

    Raises:
        AdapterError: The adapter can't be started, or does not support `features` and `node`.
    """
    bench: Bench | None = None
    try:
        for rule in rules:
            bench = bench or Bench(start, scale)
            outcome = _check_rule(rule, bench)
            yield outcome
            if outcome.status == "failed" or rule.is_last or not _try_clear(bench):
                bench.close()
                bench = None
    finally:
        if bench is not None:
            bench.close()


def _check_rule(rule: Rule, bench: Bench) -> Outcome:
    announced_features = bench.features.get("features", ())
    missing_features = [each for each in rule.features if each not in announced_features]
    if missing_features:
        return Outcome(
            rule, "skipped", _("the adapter doesn't announce '{feature}'").format(feature=missing_features[0])
        )
    try:
        rule.check(bench)
    except NepError as error:
        return Outcome(rule, "failed", str(error))
    except (KeyError, IndexError, TypeError, ValueError) as error:  # missing or invalid field
        reason = f"{type(error).__name__}: {error}"
        return Outcome(rule, "failed", _("invalid reply: {reason}").format(reason=reason))
    return Outcome(rule, "passed")


def _try_clear(bench: Bench) -> bool:
    try:
        bench.clear()
    except AdapterError:
        return False
    return True
