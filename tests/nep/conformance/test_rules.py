"""Tests of the conformance rules: a correct client passes all; each broken client fails its rule."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import pytest

from nep.programs.conformance import RULES, Outcome, check, select_rules
from tests.nep.conformance.broken_clients import BROKEN
from tests.nep.conformance.client import SCALE, Client


def judged(rule: str) -> Outcome:
    """Return the outcome of a rule for the client that breaks it."""
    (outcome,) = check(BROKEN[rule], select_rules([rule]), SCALE)
    return outcome


@pytest.fixture(scope="module")
def outcomes() -> Mapping[str, Outcome]:
    """Outcomes of all broken clients, checked in parallel because most of the time is spent waiting."""
    with ThreadPoolExecutor(12) as pool:
        return dict(zip(BROKEN, pool.map(judged, BROKEN), strict=True))


def test_correct_client_passes_every_rule() -> None:
    rules = select_rules(())
    with ThreadPoolExecutor() as pool:  # the rules mostly wait
        found = pool.map(lambda first: list(check(Client, rules[first::8], SCALE)), range(8))
        outcomes = [each for some in found for each in some]
    assert [(each.rule.id, each.observation) for each in outcomes if each.status != "passed"] == []
    assert {each.rule.id for each in outcomes} == set(RULES)


@pytest.mark.parametrize("rule", list(RULES))
def test_client_with_one_error_fails_the_matching_rule(rule: str, outcomes: Mapping[str, Outcome]) -> None:
    assert outcomes[rule].status == "failed"
    assert outcomes[rule].observation


def test_rule_whose_feature_is_not_announced_is_skipped() -> None:
    class Plain(Client):
        def do_features(self) -> dict[str, object]:
            return {**super().do_features(), "features": []}

    (outcome,) = check(Plain, select_rules(["latched"]), SCALE)
    assert outcome.status == "skipped"
    assert "latched" in outcome.observation
