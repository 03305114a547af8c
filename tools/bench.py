"""The benchmarks, one after the other.

    python tools/bench.py                       all of them but those of ASKED, such as nep_tail and film
    python tools/bench.py nep_rate -- ARGS      one; what comes after -- goes to it

Exit code 1 when a run does not count because the computer was busy. See `bench/README.md`.
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
ASKED = ("nep_clients", "nep_tail", "nep_ros", "paper", "soak", "ways", "film", "package_start", "recorder")
"""Run only by name: they take long, need ROS 1, Node.js or a package, or measure no time."""


def main() -> int:
    """Run what was asked for."""
    own, dashes, rest = " ".join(sys.argv[1:]).partition("--")
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", choices=[*NAMES, *ASKED, []], help="all when none is given")
    names = parser.parse_args(own.split() if dashes else None).names or NAMES
    codes = []
    for name in names:
        print(f"\n=== {name}", flush=True)
        command = (sys.executable, str(BENCH / f"{name}.py"), *rest.split())
        codes.append(subprocess.run(command, check=False).returncode)
    return max(codes)


if __name__ == "__main__":
    sys.exit(main())
