"""tools/check.py: the order of the checks, and that a failure is never lost."""

from __future__ import annotations

import sys

import pytest

from tools.check import Check, Outcome, checks, run, summary


def test_the_cheapest_mistakes_are_found_first_and_tests_are_last() -> None:
    names = [check.name for check in checks(fast=False)]
    assert names == ["ruff check", "ruff format", "mypy", "lint-imports", "pytest"]
    assert [check.name for check in checks(fast=True)] == names[:-1]


def test_arguments_reach_pytest() -> None:
    assert checks(fast=False, pytest_arguments=["-k", "wire"])[-1].command[-2:] == ("-k", "wire")


@pytest.mark.parametrize("code", [0, 1, 3])
def test_an_exit_code_decides(code: int, capfd: pytest.CaptureFixture[str]) -> None:
    command = (sys.executable, "-c", f"import sys; print('said'); sys.exit({code})")
    outcome = run(Check("one", command))
    assert outcome.passed is (code == 0)
    assert capfd.readouterr().out.splitlines() == ["", "=== one", "said"]


def test_the_summary_names_what_failed() -> None:
    lines = summary([Outcome("mypy", True, 1.25), Outcome("pytest", False, 60.0)]).splitlines()
    assert lines[0].split() == ["mypy", "ok", "1.2", "s"]
    assert lines[1].split() == ["pytest", "FAILED", "60.0", "s"]
