"""tools/check.py: the order of the checks, and that a failure is never lost."""

from __future__ import annotations

import sys

import pytest

from tools.check import Check, Outcome, checks, run, run_all, summary


def test_the_cheapest_mistakes_are_found_first_and_tests_are_last() -> None:
    names = [check.name for check in checks(fast=False)]
    assert names == ["ruff check", "ruff format", "mypy", "lint-imports", "tests read", "pytest"]
    assert [check.name for check in checks(fast=True)] == names[:-2]


def test_arguments_reach_pytest() -> None:
    assert checks(fast=False, pytest_arguments=["-k", "wire"])[-1].command[-2:] == ("-k", "wire")


@pytest.mark.parametrize("code", [0, 1, 3])
def test_an_exit_code_decides(code: int, capfd: pytest.CaptureFixture[str]) -> None:
    command = (sys.executable, "-c", f"import sys; print('said'); sys.exit({code})")
    outcome = run(Check("one", command))
    assert outcome.passed is (code == 0)
    assert capfd.readouterr().out.splitlines() == ["", "=== one", "said"]


def test_what_runs_beside_others_says_something_only_when_it_failed(
    capfd: pytest.CaptureFixture[str],
) -> None:
    def says(words: str, code: int) -> tuple[str, ...]:
        return (sys.executable, "-c", f"import sys; print('{words}'); sys.exit({code})")

    found = [
        Check("well", says("quiet", 0), is_beside=True),
        Check("not well", says("loud", 1), is_beside=True),
        Check("last", says("seen", 0)),
    ]
    assert [(each.name, each.passed) for each in run_all(found)] == [
        ("well", True),
        ("not well", False),
        ("last", True),
    ]
    said = capfd.readouterr().out.splitlines()
    assert "quiet" not in said
    assert said[-2:] == ["=== last", "seen"]
    assert said[:-2].count("loud") == 1


def test_what_the_tests_compile_is_written_also_where_the_computer_is_told_not_to(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    assert run(Check("one", (sys.executable, "-c", "import sys; print(sys.dont_write_bytecode)"))).passed
    assert capfd.readouterr().out.splitlines()[-1] == "False"


def test_the_summary_names_what_failed() -> None:
    lines = summary([Outcome("mypy", True, 1.25), Outcome("pytest", False, 60.0)]).splitlines()
    assert lines[0].split() == ["mypy", "ok", "1.2", "s"]
    assert lines[1].split() == ["pytest", "FAILED", "60.0", "s"]
