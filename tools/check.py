"""Every check of the project, in the order that finds mistakes cheapest first.

    python tools/check.py            ruff, format, mypy, lint-imports, pytest
    python tools/check.py --fast     the same without pytest
    python tools/check.py -- ARGS    what comes after -- goes to pytest

Everything runs, also after a failure; the exit code is 1 if anything failed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import sysconfig
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
MOST_WORKERS = 6


class Check(NamedTuple):
    """One check: what it is called, and the command that decides it."""

    name: str
    command: tuple[str, ...]


class Outcome(NamedTuple):
    """How one check ended."""

    name: str
    passed: bool
    elapsed_s: float


def checks(*, fast: bool, pytest_arguments: Sequence[str] = ()) -> tuple[Check, ...]:
    """All checks, cheapest first; `fast` leaves the tests out."""
    python = sys.executable
    lint_imports = str(Path(sysconfig.get_path("scripts")) / "lint-imports")
    found = (
        Check("ruff check", (python, "-m", "ruff", "check", ".")),
        Check("ruff format", (python, "-m", "ruff", "format", "--check", ".")),
        Check("mypy", (python, "-m", "mypy")),
        Check("lint-imports", (lint_imports, "--no-logo", "--cache-dir", "build/import-linter")),
        Check("pytest", (python, "-m", "pytest", *side_by_side(), *pytest_arguments)),
    )
    return found[:-1] if fast else found


def side_by_side() -> tuple[str, ...]:
    """Options of pytest-xdist: one process more than processors, six at most; tests/conftest.py groups tests.

    Most tests wait for processes and windows: with one each processor, a third of the time is idle. With two
    more everything took a third longer.
    """
    workers = min(MOST_WORKERS, (os.cpu_count() or 1) + 1)
    return ("-n", str(workers), "--dist", "loadfile")


def run(check: Check) -> Outcome:
    """Run one check with its output on ours, and tell how it ended."""
    print(f"\n=== {check.name}", flush=True)
    begin = time.monotonic()
    code = subprocess.run(check.command, cwd=ROOT, check=False).returncode
    return Outcome(check.name, code == 0, time.monotonic() - begin)


def summary(outcomes: Sequence[Outcome]) -> str:
    """A short table of all outcomes."""
    width = max(len(outcome.name) for outcome in outcomes)
    return "\n".join(
        f"  {outcome.name:<{width}}  {'ok    ' if outcome.passed else 'FAILED'}  {outcome.elapsed_s:6.1f} s"
        for outcome in outcomes
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the checks; 0 if all passed, 1 if not, 130 after Ctrl+C."""
    parser = argparse.ArgumentParser(description="Run every check of the project.")
    parser.add_argument("--fast", action="store_true", help="leave the tests out")
    parser.add_argument("pytest_arguments", nargs="*", help="arguments for pytest, after --")
    options = parser.parse_args(arguments)
    try:
        outcomes = [
            run(check) for check in checks(fast=options.fast, pytest_arguments=options.pytest_arguments)
        ]
    except KeyboardInterrupt:
        print("\nstopped", flush=True)
        return 130
    # On stderr, so that pytest's own closing line stays the last one of the output.
    print("\n" + summary(outcomes), file=sys.stderr, flush=True)
    return 0 if all(outcome.passed for outcome in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
