"""Benchmark of the response times of Studio in the films of a user's first hour and path.

    python3 dev.py bench film -- --runs 5 --film hour_mouse

Each film (an end-to-end test with real mouse or keyboard input) is played several times. The slowest
response of a step in a run is used: from the input until its effect is painted in the window, or as
reported by the editor page (Event Timing, in steps of 8 ms). The table shows median and minimum over
the runs; a step is too slow if its median is above 200 ms. The minimum is the cost without disturbance.
"work" is the time that the GUI thread was busy (minimum of the runs), the only comparable value on a
busy computer.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
GOAL_MS = 200.0
QUIET = 1.5  # 1-minute load average; above it, other programs kept the computer busy
TIME_S = 900.0


@dataclass(frozen=True)
class Answer:
    """Slowest response of a step, as saved by a film."""

    where: str
    what: str
    took_ms: float
    work_ms: float


Reactions = Mapping[str, Mapping[str, Any]]


def films() -> dict[str, Path]:
    """Return the films by name, such as "hour_mouse" and "path_keys"."""
    folder = ROOT / "tests" / "e2e"
    found = sorted((*folder.glob("test_hour_*.py"), *folder.glob("test_path_*.py")))
    return {path.stem.removeprefix("test_"): path for path in found}


def play(film: Path, folder: Path) -> dict[str, Reactions]:
    """Play a film and return the response times of its steps by title, also if the film failed."""
    command = [sys.executable, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider", str(film)]
    environment = {**os.environ, "NEP_FILM": str(folder)}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=TIME_S, check=False
    )
    if done.returncode:
        print(f"  {film.stem} failed: {done.stdout.strip().splitlines()[-1]}", flush=True)
    told = sorted(folder.glob("*/reactions.json"))
    return {path.parent.name: json.loads(path.read_text("utf-8")) for path in told}


def table(taken: Mapping[str, Sequence[Answer]]) -> int:
    """Print the steps, slowest first, and return how many are too slow."""
    rows = sorted(
        ((statistics.median(each.took_ms for each in answers), step) for step, answers in taken.items()),
        reverse=True,
    )
    for median, step in rows:
        least, work = (min(each) for each in zip(*((a.took_ms, a.work_ms) for a in taken[step]), strict=True))
        what = " ".join(sorted({f"{each.where} {each.what}" for each in taken[step]})[:1])
        mark = "SLOW" if median > GOAL_MS else ""
        print(f"  {median:6.0f} ms  least {least:6.0f}  work {work:5.0f}  {mark:4}  {what:26} {step}")
    return sum(median > GOAL_MS for median, _ in rows)


def main() -> int:
    """Print a table for each film; return 1 if a run is not valid or a step is too slow."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    known = films()
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--film", choices=sorted(known), action="append", help="all when none is given")
    asked = parser.parse_args()
    slow, busy = 0, 0
    for name in asked.film or known:
        taken: dict[str, dict[str, list[Answer]]] = defaultdict(lambda: defaultdict(list))
        loads = []
        for _ in range(asked.runs):
            loads.append(os.getloadavg()[0])
            with tempfile.TemporaryDirectory() as folder:
                for title, steps in play(known[name], Path(folder)).items():
                    for step, each in steps.items():
                        taken[title][step].append(Answer(**each))
        busy += max(loads[:1]) > QUIET
        for title, steps_of in taken.items():
            print(f"{title}, {asked.runs} runs:", flush=True)
            slow += table(steps_of)
    print(f"{slow} steps above {GOAL_MS:g} ms; "
          f"the run {'does not count: the computer was busy' if busy else 'counts'}")  # fmt: skip
    return 1 if slow or busy else 0


if __name__ == "__main__":
    sys.exit(main())
