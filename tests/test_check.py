"""Tests of tools/check.py: the order of the checks and the report of failures."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.scheduler import may_take
from tools.check import ROOT, Check, Outcome, checks, run, run_all, summary


def test_checks_run_in_order_with_tests_last() -> None:
    names = [check.name for check in checks(fast=False)]
    assert names == ["ruff check", "ruff format", "mypy", "lint-imports", "collect tests", "pytest"]
    assert [check.name for check in checks(fast=True)] == names[:-2]


def test_arguments_reach_pytest() -> None:
    assert checks(fast=False, pytest_arguments=["-k", "wire"])[-1].command[-2:] == ("-k", "wire")


@pytest.mark.parametrize("code", [0, 1, 3])
def test_check_passes_if_its_exit_code_is_zero(code: int, capfd: pytest.CaptureFixture[str]) -> None:
    command = (sys.executable, "-c", f"import sys; print('said'); sys.exit({code})")
    outcome = run(Check("one", command))
    assert outcome.passed is (code == 0)
    assert capfd.readouterr().out.splitlines() == ["", "=== one", "said"]


def test_parallel_check_prints_its_output_only_on_failure(
    capfd: pytest.CaptureFixture[str],
) -> None:
    def says(words: str, code: int) -> tuple[str, ...]:
        return (sys.executable, "-c", f"import sys; print('{words}'); sys.exit({code})")

    found = [
        Check("well", says("quiet", 0), in_background=True),
        Check("not well", says("loud", 1), in_background=True),
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


def test_bytecode_of_tests_is_written_despite_the_environment_setting(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    assert run(Check("one", (sys.executable, "-c", "import sys; print(sys.dont_write_bytecode)"))).passed
    assert capfd.readouterr().out.splitlines()[-1] == "False"


def test_summary_names_failed_checks() -> None:
    lines = summary([Outcome("mypy", True, 1.25), Outcome("pytest", False, 60.0)]).splitlines()
    assert lines[0].split() == ["mypy", "ok", "1.2", "s"]
    assert lines[1].split() == ["pytest", "FAILED", "60.0", "s"]


def test_last_surplus_test_worker_receives_no_window_tests() -> None:
    window, waiting = "tests/e2e/test_stop.py", "tests/nep/services/test_calls.py"
    assert not may_take("gw3", 4, 2, window)
    assert may_take("gw3", 4, 2, waiting)
    assert all(may_take("gw2", workers, 2, each) for each in (window, waiting) for workers in (3, 4))
    assert may_take("gw5", 6, 8, window)


def test_crashed_test_worker_fails_one_test_and_the_other_tests_complete(
    tmp_path: Path,
) -> None:
    """Both workers have finished some files before the crash; the new worker gets files of one test."""
    harmless = "".join(f"def test_{number}() -> None: ...\n" for number in range(3))
    for number in range(6):
        (tmp_path / f"test_first_{number}.py").write_text(harmless, encoding="utf-8")
    crash = "import os\n\ndef test_crash() -> None:\n    os._exit(1)\n\ndef test_after() -> None: ...\n"
    (tmp_path / "test_second_crash.py").write_text(crash, encoding="utf-8")
    for number in range(4):
        text = "def test_alone() -> None: ...\n"
        (tmp_path / f"test_third_{number}.py").write_text(text, encoding="utf-8")
    hook = "from tests.conftest import pytest_xdist_make_scheduler\n"
    (tmp_path / "conftest.py").write_text(hook, encoding="utf-8")
    command = (sys.executable, "-m", "pytest", "-q", "-n2", "--dist", "loadfile", "-p", "no:cacheprovider")
    done = subprocess.run(
        command,
        check=False,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert "crashed while running 'test_second_crash.py::test_crash'" in done.stdout
    assert "1 failed, 23 passed" in done.stdout.splitlines()[-1]
