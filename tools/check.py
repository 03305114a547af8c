"""Run all checks of the project, cheapest first.

    python tools/check.py           ruff, format, mypy, lint-imports, test collection, pytest
    python tools/check.py --fast    the same without test collection and pytest
    python tools/check.py -- ARGS   arguments after -- are passed on to pytest; without test collection

All checks run, even after a failure; the exit code is 1 if any check failed. Test collection writes pytest's
compiled files, which otherwise every worker would compile. It takes as long as mypy, which uses a single
core, so it runs in parallel.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import sysconfig
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
MAX_WORKERS = 6


class Check(NamedTuple):
    """Command that checks the project.

    Attributes:
        name: Name in the output.
        command: Command and arguments.
        in_background: True to run the check in parallel with the others and show its output only if it
            fails.
    """

    name: str
    command: tuple[str, ...]
    in_background: bool = False


class Outcome(NamedTuple):
    """Result of a check.

    Attributes:
        name: Name of the check.
        passed: True if the exit code was 0.
        elapsed_s: Duration in seconds.
    """

    name: str
    passed: bool
    elapsed_s: float


def checks(*, fast: bool, pytest_arguments: Sequence[str] = ()) -> tuple[Check, ...]:
    """Return all checks, cheapest first.

    Args:
        fast: True to omit test collection and pytest.
        pytest_arguments: Further arguments of pytest; if there are any, test collection is omitted.
    """
    python = sys.executable
    lint_imports = str(Path(sysconfig.get_path("scripts")) / "lint-imports")
    all_checks = (
        Check("ruff check", (python, "-m", "ruff", "check", ".")),
        Check("ruff format", (python, "-m", "ruff", "format", "--check", ".")),
        Check("mypy", (python, "-m", "mypy")),
        Check("lint-imports", (lint_imports, "--no-logo", "--cache-dir", "build/import-linter")),
        Check("collect tests", (python, "-m", "pytest", "--collect-only", "-qq", "-n0"), in_background=True),
        Check("pytest", (python, "-m", "pytest", *parallel_options(), *pytest_arguments)),
    )
    if fast:
        return all_checks[:-2]
    return (
        (*all_checks[:-2], all_checks[-1]) if pytest_arguments else all_checks
    )  # selected tests are collected quickly


def parallel_options() -> tuple[str, ...]:
    """Return the options for parallel tests with pytest-xdist: two workers more than cores, at most six.

    Many tests wait for processes and windows: on two cores, one extra worker leaves a fifth of the time
    idle. With two extra workers, some tests would wait too long for a robot or a page, so the last
    worker opens no windows (tests/scheduler.py).
    """
    workers = min(MAX_WORKERS, (os.cpu_count() or 1) + 2)
    return ("-n", str(workers), "--dist", "loadfile")


def run(check: Check) -> Outcome:
    """Run a check and return its result."""
    if not check.in_background:
        print(f"\n=== {check.name}", flush=True)
    # Many containers set it, but later runs need the compiled files, which git ignores.
    environ = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    begin = time.monotonic()
    out, errors = (subprocess.PIPE, subprocess.STDOUT) if check.in_background else (None, None)
    completed = subprocess.run(
        check.command,
        cwd=ROOT,
        check=False,
        env=environ,
        stdout=out,
        stderr=errors,
        text=True,
        errors="replace",
    )
    if check.in_background and completed.returncode != 0:
        print(f"\n=== {check.name}\n{completed.stdout}", flush=True)
    return Outcome(check.name, completed.returncode == 0, time.monotonic() - begin)


def run_all(all_checks: Sequence[Check]) -> list[Outcome]:
    """Run the checks in order and return their outcomes.

    Checks with `in_background` run in the background from the start; later checks wait for them.
    """
    with ThreadPoolExecutor() as pool:
        background = {check: pool.submit(run, check) for check in all_checks if check.in_background}
        return [background[check].result() if check.in_background else run(check) for check in all_checks]


def summary(outcomes: Sequence[Outcome]) -> str:
    """Format the outcomes as a table."""
    width = max(len(outcome.name) for outcome in outcomes)
    return "\n".join(
        f"  {outcome.name:<{width}}  {'ok    ' if outcome.passed else 'FAILED'}  {outcome.elapsed_s:6.1f} s"
        for outcome in outcomes
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the checks; return 0 if all passed, 1 if not, 130 after Ctrl+C."""
    parser = argparse.ArgumentParser(description="Run all checks of the project.")
    parser.add_argument("--fast", action="store_true", help="skip the tests")
    parser.add_argument("pytest_arguments", nargs="*", help="arguments for pytest, after --")
    options = parser.parse_args(arguments)
    try:
        outcomes = run_all(checks(fast=options.fast, pytest_arguments=options.pytest_arguments))
    except KeyboardInterrupt:
        print("\nstopped", flush=True)
        return 130
    # To stderr, so that pytest's summary remains the last line of stdout.
    print("\n" + summary(outcomes), file=sys.stderr, flush=True)
    return 0 if all(outcome.passed for outcome in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
