"""Fuzz all parsers with atheris: `python3 dev.py fuzz`. Uses only the standard library.

    python3 dev.py fuzz                         all targets, 15 minutes in total
    python3 dev.py fuzz -- --minutes 60         all targets, one hour in total
    python3 dev.py fuzz -- json_codec keys      only these targets; --list prints all
    python3 dev.py fuzz -- --again FILE         reproduce a finding

Creates an environment in `build/fuzz` with pinned packages, without Qt. The corpus in `build/fuzz/corpus` is
reused by later runs. Each finding is a file in `build/fuzz/findings` next to its traceback. Exits with 1 if
there are findings; then fix the library and add the bytes to `tests/fuzz/cases.py`. See docs/fuzzing.md.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from tools.computer import ROOT, CommandError, Computer
from tools.versions import environment

FOLDER = ROOT / "build" / "fuzz"
HARNESS = "tests/fuzz/harness.py"
DEFAULT_MINUTES = 15.0
MIN_TARGET_S = 1
"""Minimum time for a target in seconds."""


def seconds_each(weights: Mapping[str, int], minutes: float) -> dict[str, int]:
    """Distribute a total time among the targets; return the seconds per target.

    Args:
        weights: Weight of each target; targets with a weight above 1 get twice the time of the others.
        minutes: Total time. Each target gets at least `MIN_TARGET_S` seconds.
    """
    shares = {name: 2 if weight > 1 else 1 for name, weight in weights.items()}
    unit_s = minutes * 60 / max(1, sum(shares.values()))
    return {name: max(MIN_TARGET_S, round(unit_s * share)) for name, share in shares.items()}


def findings_in(folder: Path) -> list[Path]:
    """Return the input files in a folder that made a parser fail.

    The traceback of each is in a .txt file next to it.
    """
    return sorted(path for path in folder.glob("*") if path.suffix != ".txt") if folder.is_dir() else []


def fuzz(computer: Computer, arguments: Sequence[str], folder: Path = FOLDER) -> int:
    """Fuzz the requested targets; return 1 if there are findings, else 0.

    With ``--list`` or ``--again``, targets are listed or one input is run instead. If the harness
    fails, its exit code is returned. Raises CommandError on other systems than Linux and for unknown
    targets.

    Args:
        computer: Computer to run on.
        arguments: Command-line arguments.
        folder: Folder of the environment, the corpus and the findings.
    """
    parser = argparse.ArgumentParser(
        prog="dev.py fuzz", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="TARGET", help="default: all targets")
    parser.add_argument("--minutes", type=float, default=DEFAULT_MINUTES, help="total time for all targets")
    parser.add_argument("--list", action="store_true", help="list the targets")
    parser.add_argument("--again", type=Path, metavar="FILE", help="run the target on this file")
    options = parser.parse_args([each for each in arguments if each != "--"])
    if not 0 < options.minutes <= 24 * 60:
        parser.error("--minutes must be greater than 0 and at most 1440")
    if computer.platform != "linux":
        raise CommandError("atheris is available for Linux only; the tests in tests/fuzz run on all systems")
    python = environment(computer, sys.executable, folder / "environment", "fuzz")
    command = [str(python), str(ROOT / HARNESS)]
    if options.again is not None:
        return computer.do([*command, "--again", str(options.again.resolve())], computer.environ, None)
    weights = _targets(computer, command)
    if options.list:
        print("\n".join(weights), flush=True)
        return 0
    if unknown := [name for name in options.names if name not in weights]:
        raise CommandError(f"there is no target '{unknown[0]}'; --list prints all targets")
    selected = {name: weights[name] for name in options.names or weights}
    findings_folder = folder / "findings"
    shutil.rmtree(findings_folder, ignore_errors=True)
    findings_folder.mkdir(parents=True)
    plan = [f"{name}={seconds}" for name, seconds in seconds_each(selected, options.minutes).items()]
    code = computer.do([*command, str(folder), *plan], computer.environ, None)
    return max(code, _report_findings(folder / "findings"))


def _targets(computer: Computer, command: Sequence[str]) -> dict[str, int]:
    # Weights by target: its relative duration.
    try:
        weights: dict[str, int] = json.loads(computer.ask([*command, "--list"]))
    except ValueError:
        raise CommandError(f"the targets cannot be imported; see '{' '.join(command)} --list'") from None
    return weights


def _report_findings(folder: Path) -> int:
    # Prints the findings; returns 1 if there are any.
    findings = findings_in(folder)
    for path in findings:
        report_path = path.with_suffix(".txt")
        print(f"\n=== {path}", flush=True)
        print(
            report_path.read_text(encoding="utf-8")
            if report_path.is_file()
            else "the input takes too long or too much memory"
        )
    print(f"· {len(findings)} findings in {folder}", flush=True)
    return 1 if findings else 0
