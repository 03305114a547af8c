"""Test the library with each supported Python: `python3 dev.py versions`. Uses only the standard library.

    python3 dev.py versions                             each Python of this computer in turn
    python3 dev.py versions --only 3.10 --only 3.13     only these
    python3 dev.py versions --plain                     only nep without extras, no tests
    python3 dev.py versions --plain --install FILE      an existing wheel or source distribution
    python3 dev.py versions -- tests/nep/protocol -x    arguments after -- are passed on to pytest

Creates two environments for each Python in `build/versions`, with pinned packages and without Qt. In the
first, the built distribution is installed and a program publishes, receives and calls; in the second, the
library's tests run. Exits with 1 if anything failed.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tools.computer import ROOT, CommandError, Computer, timed, venv_python

SUPPORTED = ("3.10", "3.11", "3.12", "3.13")
FOLDER = ROOT / "build" / "versions"
TESTS = ("tests/nep", "tests/interop")
VERSION_SCRIPT = (
    "import sys; print('{}.{}'.format(*sys.version_info[:2]), sys.implementation.name, sys.executable)"
)
PYENV = ".pyenv/versions"
OLDEST_MACOS = "13_0"
"""Minimum macOS version of the package (installers/macos/information.py), in the format of wheel tags."""


@dataclass(frozen=True)
class Outcome:
    """Result of the tests with one Python version.

    Attributes:
        version: Python version.
        failed: Names of the failed steps in order; empty if all steps passed.
    """

    version: str
    failed: list[str] = field(default_factory=list)

    def table_row(self) -> str:
        """Format the result as one line of the table."""
        return f"  Python {self.version}  {'FAILED: ' + ', '.join(self.failed) if self.failed else 'ok'}"


def find_interpreters(computer: Computer, home: Path | None = None) -> dict[str, str]:
    """Find interpreters of the supported Python versions on this computer; return their paths by version.

    Searches the current interpreter, the PATH, the Windows launcher and pyenv, in this order.
    """
    interpreters: dict[str, str] = {}
    for version in SUPPORTED:
        for command in _candidates(computer, version, home or Path.home()):
            match = re.fullmatch(
                r"(\S+) cpython (.+)", computer.ask([*command, "-c", VERSION_SCRIPT]).strip()
            )
            if match and match[1] == version:
                interpreters[version] = match[2]
                break
    return interpreters


def _candidates(computer: Computer, version: str, home: Path) -> list[list[str]]:
    # Most likely first.
    commands = [[sys.executable]] if version == "{}.{}".format(*sys.version_info[:2]) else []
    if path := computer.which(f"python{version}"):
        commands.append([path])
    if launcher := computer.which("py"):
        commands.append([launcher, f"-{version}"])
    newest_first = sorted((home / PYENV).glob(f"{version}.*"), key=_patch_number, reverse=True)
    return [*commands, *([str(venv_python(each, computer.platform))] for each in newest_first)]


def _patch_number(folder: Path) -> int:
    # Last number of a folder such as 3.10.13; -1 for 3.13.0t and similar.
    last = folder.name.rpartition(".")[2]
    return int(last) if last.isdecimal() else -1


def _stamp(requirements: str) -> str:
    # Environments are recreated when this digest changes.
    made_of = [ROOT / "pyproject.toml", ROOT / "requirements" / f"{requirements}.txt"]
    return hashlib.sha256(b"".join(path.read_bytes() for path in made_of)).hexdigest()


def environment(
    computer: Computer, python: str, folder: Path, requirements: str, *, is_for_oldest: bool = False
) -> Path:
    """Create a virtual environment with pinned packages, unless it is up to date; return its interpreter.

    Args:
        computer: Computer to run on.
        python: Interpreter that creates the environment.
        folder: Folder of the environment.
        requirements: Name of the file in requirements/, without its extension.
        is_for_oldest: On a Mac, install wheels that run on `OLDEST_MACOS`. By default pip chooses
            wheels for the current macOS, which may not run on older ones (numpy's require macOS 14).
    """
    interpreter = venv_python(folder, computer.platform)
    stamp = folder / "nep-stamp"
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == _stamp(requirements):
        return interpreter
    pinned = ["--require-hashes", "-r", f"requirements/{requirements}.txt"]
    steps = [[python, "-m", "venv", "--clear", str(folder)], [*pip(interpreter), *pinned]]
    if is_for_oldest and computer.platform == "darwin":
        wheels, platform = str(folder / "wheels"), f"macosx_{OLDEST_MACOS}_{computer.machine}"
        options = ["--no-deps", "--only-binary=:all:", "--platform", platform, "--dest", wheels]
        steps[1:] = [
            [
                str(interpreter),
                "-m",
                "pip",
                "download",
                "--disable-pip-version-check",
                "--quiet",
                *options,
                *pinned,
            ],
            [*pip(interpreter), "--no-deps", "--no-index", "--find-links", wheels, *pinned],
        ]
    with timed(f"creating the environment {folder.name}"):
        for step in steps:
            if computer.do(step, computer.environ, None) != 0:
                raise CommandError(f"{folder} could not be created; the output of Python or pip is above")
    stamp.write_text(_stamp(requirements), encoding="utf-8")
    return interpreter


def pip(python: Path) -> list[str]:
    """Return the `pip install` command of an interpreter."""
    return [str(python), "-m", "pip", "install", "--disable-pip-version-check", "--quiet"]


def try_plain(computer: Computer, python: str, folder: Path, distribution: str = ".") -> list[str]:
    """Install the distribution without extras and test it from another folder; return the failed steps."""
    interpreter = environment(computer, python, folder, "library")
    install = [*pip(interpreter), "--no-deps", "--no-build-isolation", "--force-reinstall", distribution]
    # -I: test the installed package, not the local sources.
    use = [str(interpreter), "-I", str(ROOT / "tools" / "library_alone.py")]
    for step_name, step in (
        ("install", install),
        ("pip check", [str(interpreter), "-m", "pip", "check"]),
        ("use", use),
    ):
        if computer.do(step, computer.environ, None) != 0:
            return [f"plain: {step_name}"]
    return []


def try_tests(computer: Computer, python: str, folder: Path, arguments: Sequence[str]) -> list[str]:
    """Run the library's tests in an environment with their requirements; return the failed steps."""
    interpreter = environment(computer, python, folder, "test")
    install = [*pip(interpreter), "--no-deps", "--no-build-isolation", "-e", "."]
    pytest = [str(interpreter), "-m", "pytest", "-q", *arguments]
    if not any((ROOT / each.partition("::")[0]).exists() for each in arguments):
        pytest += TESTS
    for step_name, step in (("install", install), ("tests", pytest)):
        if computer.do(step, computer.environ, None) != 0:
            return [step_name]
    return []


def versions(
    computer: Computer, arguments: Sequence[str], folder: Path = FOLDER, home: Path | None = None
) -> int:
    """Run the requested tests; return 0 if they passed with all Python versions found, else 1."""
    parser = argparse.ArgumentParser(
        prog="dev.py versions", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", action="append", choices=SUPPORTED, help="test this version; repeatable")
    parser.add_argument("--plain", action="store_true", help="only the library without extras, no tests")
    parser.add_argument(
        "--install", metavar="FILE", help="test this wheel or source distribution instead of this folder"
    )
    parser.add_argument("pytest_arguments", nargs="*", help="arguments for pytest, after --")
    options = parser.parse_args(arguments)
    selected = [each for each in SUPPORTED if each in (options.only or SUPPORTED)]
    if options.install and not Path(options.install).is_file():
        raise CommandError(
            f"there is no file {options.install}; python -m build creates dist/*.whl and dist/*.tar.gz"
        )
    distribution = str(Path(options.install).resolve()) if options.install else "."
    interpreters = {
        version: python
        for version, python in find_interpreters(computer, home).items()
        if version in selected
    }
    absent = [version for version in selected if version not in interpreters]
    if absent:
        print(f"· not found on this computer: Python {', '.join(absent)}", flush=True)
    if not interpreters:
        raise CommandError("none of these Python versions was found; install one, for example with pyenv")
    outcomes = []
    for version, python in interpreters.items():
        print(f"\n=== Python {version} ({python})", flush=True)
        failed = try_plain(computer, python, folder / f"{version}-plain", distribution)
        if not options.plain:
            failed += try_tests(computer, python, folder / version, options.pytest_arguments)
        outcomes.append(Outcome(version, failed))
    print("\n" + "\n".join(each.table_row() for each in outcomes), file=sys.stderr, flush=True)
    return 1 if any(each.failed for each in outcomes) else 0
