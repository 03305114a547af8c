"""Run the benchmarks one after the other.

    python tools/bench.py                   all except the slow and special ones in SPECIAL_NAMES
    python tools/bench.py nep_rate -- ARGS  one benchmark; arguments after -- are passed on to it

Exits with 1 if a result is invalid because the computer was busy. See `bench/README.md`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

BENCH = Path(__file__).resolve().parent.parent / "bench"
NAMES = (
    "nep_import",
    "nep_roundtrip",
    "nep_rate",
    "nep_large",
    "nep_fan",
    "nep_logs",
    "nep_join",
    "nep_master",
    "stop",
    "studio_load",
    "studio_images",
    "studio_topics",
    "studio_plot",
    "studio_graph",
    "studio_idle",
    "studio_panels",
    "studio_start",
    "blocks_editor",
    "studio_tabs",
)
SPECIAL_NAMES = (
    "nep_clients",
    "nep_tail",
    "nep_ros",
    "paper",
    "soak",
    "ways",
    "film",
    "package_start",
    "recorder",
)
"""Benchmarks that run only if they are named on the command line.

They are slow, need ROS 1, Node.js or a package of Studio, or don't measure times.
"""


def main() -> int:
    """Run the requested benchmarks; return the exit code."""
    own_arguments, dashes, rest = " ".join(sys.argv[1:]).partition("--")
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", choices=[*NAMES, *SPECIAL_NAMES, []], help="default: all except the special ones"
    )
    names = parser.parse_args(own_arguments.split() if dashes else None).names or NAMES
    codes = []
    for name in names:
        print(f"\n=== {name}", flush=True)
        command = (sys.executable, str(BENCH / f"{name}.py"), *rest.split())
        codes.append(subprocess.run(command, check=False).returncode)
    return max(codes)


if __name__ == "__main__":
    sys.exit(main())
