"""Benchmark of the time to import nep and its names, in new Python processes.

    python bench/nep_import.py [--blocks 40]

Each value is the time of a process minus that of an empty one; all are interleaved in random order:

    plain       python -c pass; "plain again" repeats it and shows the repeatability
    json, zmq   `import json` and `import zmq`, for comparison
    nep         `import nep`, which imports its names lazily, on first use
    a name      `import nep; nep.node`: everything that a program with a node needs, including pyzmq
    others      the external modules that nep imports; "all there" is these and nep, the difference is
                the cost of nep's own modules

The names are measured because a lazy `import nep` alone shows little.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from blocks import Sample, interleaved, verdict

ROOT = Path(__file__).resolve().parents[1]
GOAL_S = 0.060
OTHERS = "import zmq, asyncio, ssl, logging, dataclasses, orjson, msgpack, secrets, subprocess"
PROGRAMS = {
    "plain": "pass",
    "plain again": "pass",
    "json": "import json",
    "zmq": "import zmq",
    "others": OTHERS,
    "nep": "import nep",
    "a name": "import nep; nep.node",
    "all there": f"{OTHERS}\nimport nep; nep.node",
}
LIMIT = 4


def start(program: str) -> Callable[[], Sample]:
    """Return a function that measures a new Python process which runs ``program``."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", program]

    def measure() -> Sample:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        started = time.perf_counter()
        subprocess.run(command, check=True, env=environment)
        taken = time.perf_counter() - started
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return Sample(taken, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)

    return measure


def main() -> int:
    """Measure and print a table; return 1 if `import nep` misses its goal or the run is not valid."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--blocks", type=int, default=40, help="processes of each kind")
    arguments = parser.parse_args()
    if arguments.blocks < 1:
        parser.error("--blocks must be 1 or more")
    found = interleaved(
        {name: start(program) for name, program in PROGRAMS.items()}, arguments.blocks, limit=LIMIT
    )
    plain = found["plain"]
    print(
        f"medians of at least {arguments.blocks} processes of Python {sys.version.split()[0]}; milliseconds"
    )
    print(f"{'':>12} {'whole':>8} {'beyond':>8} {'its processor time':>20}")
    for name, sample in found.items():
        beyond, work = sample.seconds - plain.seconds, sample.cpu_s - plain.cpu_s
        print(f"{name:>12} {sample.seconds * 1e3:>8.1f} {beyond * 1e3:>8.1f} {work * 1e3:>20.1f}", flush=True)
    own = found["all there"].seconds - found["others"].seconds
    print(f"nep's own modules, when what they import is there already: {own * 1e3:.1f} ms")
    beyond = found["nep"].seconds - plain.seconds
    print(f"import nep: {beyond * 1e3:.1f} ms, the goal is {GOAL_S * 1e3:.0f} ms")
    return max(verdict(found["plain again"].seconds / plain.seconds), int(beyond > GOAL_S))


if __name__ == "__main__":
    sys.exit(main())
