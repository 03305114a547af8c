"""Benchmark of the paper's two scenarios: round trips between two programs with nep and other libraries.

    python3 dev.py bench paper                  both: 4 minutes, most of an hour for 200 trips per size
    python3 dev.py bench paper -- --write       also write docs/figures.md with its plots; results of a
                                                scenario that is not measured are kept
    python3 dev.py bench paper -- --scenarios local --rows nep --kinds string json --seconds 60
    python3 dev.py bench paper -- --from docs/figures.json --write      write again without measuring

    L-local     two programs on one computer
    R-remote    two programs in two networks, linked with the delay and rate of Wi-Fi (`link.py`)

Each message is encoded, sent, received and decoded, and returned the same way. Both ends are separate
processes that do nothing else (`paper_ends.py`). Kinds are the paper's `string` and `json` (a map
with one string), and `bytes`. All rows, kinds and sizes are interleaved in random order in each
block. L-local runs as many blocks as fit into its time, R-remote runs ten with twenty trips of each
size. "plain again" is a second series of plain pyzmq: a size counts only if both differ by at most
5 %.

Rows that can't run report the reason; the others are measured. rosbridge is in no package registry:
pass the folder of its sources (--rosbridge-sources, see `rosbridge.py`), or the address of a running
server (--rosbridge ws://127.0.0.1:9090, L-local only; its ROS master is $ROS_MASTER_URI). The
original NEP needs Python 2.7 (--python2, see `paper_original.py`), rosnodejs needs its folder
(--rosnodejs).
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
import platform
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from datetime import datetime, timezone
from importlib import metadata
from pathlib import Path
from typing import Any

import paper_clients
from link import HOSTS, LinkError, Wifi, joined, why_no_networks
from paper_ends import KINDS
from paper_figures import AGAIN, PLAIN, ROWS, does_count, goals, report, write
from paper_pairs import NotRunError, Pair, Places, around, end, guard

from nep.backends.ros.library import SEARCH_FOLDERS

ROOT = Path(__file__).parents[1]
SIZES = {
    "local": tuple(1024 * n for n in (1, 4, 16, 64, 256, 1024, 4096, 8192)),
    "remote": tuple(1024 * n for n in (1, 4, 16, 64, 256, 1024)),
}
TRIPS = {"local": ((256 * 1024, 20), (1024 * 1024, 10)), "remote": ()}
"""Trips per block for sizes up to the given number of bytes."""
LARGE_TRIPS = {"local": 5, "remote": 20}
REMOTE_BLOCKS = 10
"""Blocks of R-remote: 200 trips of each size, as in the paper, however long they take."""
WARM_TRIPS = {"local": 1, "remote": 0}
"""Trips before each measurement that are not counted, because they include waking both ends."""
PACKAGES = ("pyzmq", "pynng", "eclipse-zenoh", "iceoryx2", "orjson", "roslibpy")
Cell = tuple[str, str, int]
"""Row, kind and size."""


def trips(scenario: str, size: int) -> int:
    """Return the number of trips per block."""
    return next((count for most, count in TRIPS[scenario] if size <= most), LARGE_TRIPS[scenario])


def sizes_of(scenario: str, arguments: argparse.Namespace) -> list[int]:
    """Return the requested sizes of the scenario; all of its sizes if none was requested."""
    return [size for size in SIZES[scenario] if size in arguments.sizes or not arguments.sizes]


def start_pairs(
    rows: Sequence[str], places: Places, stack: ExitStack
) -> tuple[dict[str, Pair], dict[str, str]]:
    """Return the pairs of all rows that can run, and the reason for each row that can't."""
    pairs, not_run = {}, {}
    for row in rows:
        try:
            pairs[row] = Pair(row, places)
            stack.callback(pairs[row].close)
        except NotRunError as error:
            not_run[row] = str(error)
        print(f"· {row}: {not_run.get(row, 'ready')}", file=sys.stderr, flush=True)
    return pairs, not_run


def measure(arguments: argparse.Namespace, scenario: str, places: Places) -> dict[str, Any]:
    """Measure as many blocks of a scenario as fit into its time."""
    ends_at = time.monotonic() + arguments.seconds if scenario == "local" else math.inf
    most_blocks = arguments.blocks or (-1 if scenario == "local" else REMOTE_BLOCKS)
    taken: dict[Cell, list[float]] = {}
    sizes = sizes_of(scenario, arguments)
    with ExitStack() as stack:
        pairs, not_run = start_pairs(arguments.rows, places, stack)
        names = (*pairs, *([AGAIN] if PLAIN in pairs else []))
        cells = list(itertools.product(names, arguments.kinds, sizes))
        blocks = 0
        while pairs and blocks != most_blocks:
            for name, kind, size in random.sample(cells, len(cells)):
                row = PLAIN if name == AGAIN else name
                if blocks and time.monotonic() > ends_at:
                    break  # the first block is always complete
                if row not in pairs or kind not in pairs[row].kinds:
                    continue
                try:
                    came = pairs[row].take(kind, size, trips(scenario, size), WARM_TRIPS[scenario])
                except NotRunError as error:
                    not_run[row] = f"no further than `{kind}` of {size} in block {blocks + 1}, {error}"
                    del pairs[row]
                else:
                    taken.setdefault((name, kind, size), []).extend(came)
            blocks += 1
            if time.monotonic() > ends_at:
                break
    return {
        "blocks": blocks,
        "not_run": not_run,
        "cells": [cell_of(cell, seconds) for cell, seconds in taken.items()],
    }


def cell_of(cell: Cell, seconds: Sequence[float]) -> dict[str, Any]:
    """Return the statistics of a cell for the result file."""
    row, kind, size = cell
    return {
        "row": row,
        "kind": kind,
        "size": size,
        "trips": len(seconds),
        "median_ms": statistics.median(seconds) * 1e3,
        "p95_ms": statistics.quantiles(seconds, n=20, method="inclusive")[-1] * 1e3,
    }


def measure_local(arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure L-local over loopback."""
    here = ("127.0.0.1", "127.0.0.1")
    with around(
        here, (), arguments.rosbridge, arguments.rosbridge_sources, arguments.python2, arguments.rosnodejs
    ) as places:
        return {"name": "local", "link": "loopback", **measure(arguments, "local", places)}


def measure_remote(_arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure R-remote by running this program again in its own network namespace. Raises `NotRunError`."""
    why = why_no_networks()
    if why:
        raise NotRunError(why)
    with tempfile.TemporaryDirectory(prefix="nep-paper-") as folder:
        result = Path(folder, "remote.json")
        command = [*guard(), sys.executable, __file__, *sys.argv[1:], "--inside", str(result)]
        process = subprocess.Popen(["unshare", "-rn", *command])
        try:
            process.wait()
        finally:
            process.terminate()
            end(process)
        if process.returncode or not result.exists():
            raise NotRunError("the program in a network of its own failed; its words are above")
        found: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
    if "not run" in found:
        raise NotRunError(found["not run"])
    return found


def inside(arguments: argparse.Namespace) -> None:
    """Measure R-remote inside its network namespace and write the result to the file of `--inside`."""
    wifi = Wifi(arguments.delay_ms, arguments.jitter_ms, arguments.rate_mbit)
    found: dict[str, Any]
    try:
        with ExitStack() as stack:
            link = stack.enter_context(joined(wifi))
            places = stack.enter_context(
                around(
                    HOSTS,
                    link.elsewhere,
                    "",
                    arguments.rosbridge_sources,
                    arguments.python2,
                    arguments.rosnodejs,
                )
            )
            found = measure(arguments, "remote", places)
        delay = f"{wifi.delay_ms:g} ± {wifi.jitter_ms:g} ms each way"
        said = f"{delay}, {wifi.rate_mbit:g} Mbit/s, by {link.made_by}"
        found = {"name": "remote", "link": said, "link_told": link.told, **found}
    except LinkError as error:
        found = {"not run": str(error)}
    Path(arguments.inside).write_text(json.dumps(found), encoding="utf-8")


def computer() -> dict[str, Any]:
    """Return the hardware and system of this computer, without names that identify it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": models[0] if models else platform.machine(),
        "processors": os.cpu_count(),
        "system": f"{platform.system()} {platform.release().partition('-')[0]}",
        "load_before": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
    }


def versions() -> dict[str, str]:
    """Return the versions of Python, nep and the compared libraries."""
    found = {"Python": platform.python_version()}
    for name in ("nep-studio", *PACKAGES):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    asked = subprocess.run(
        ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    if not asked.returncode:
        found["nep-studio"] += f" ({asked.stdout.strip()})"
    rospy = next(iter(metadata.distributions(name="rospy", path=list(SEARCH_FOLDERS))), None)
    return found | ({"rospy": rospy.version} if rospy else {}) | paper_clients.versions()


def run(arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure the requested scenarios."""
    found: dict[str, Any] = {"scenarios": [], "not_run": {}}
    for scenario, measured in (("local", measure_local), ("remote", measure_remote)):
        if scenario not in arguments.scenarios:
            continue
        try:
            if not sizes_of(scenario, arguments):
                raise NotRunError("it has none of the sizes that were asked for")
            about = {
                "taken": datetime.now(timezone.utc).strftime("%Y-%m-%d"),
                "computer": computer(),
                "versions": versions(),
            }
            found["scenarios"].append(measured(arguments) | about)
        except NotRunError as error:
            found["not_run"][scenario] = str(error)
    return found


def asked() -> argparse.Namespace:
    """Parse the command line."""
    wifi = Wifi()
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenarios", nargs="+", choices=SIZES, default=list(SIZES))
    parser.add_argument(
        "--rows", nargs="+", choices=ROWS, default=list(ROWS), help=f"{PLAIN} is always there"
    )
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--sizes", nargs="+", type=int, default=[], help="of those that there are; else all")
    parser.add_argument("--seconds", type=float, default=240.0, help="for L-local; its first block is whole")
    parser.add_argument(
        "--blocks", type=int, default=0, help="at most; else as many as there is time for, ten in R-remote"
    )
    parser.add_argument("--rosbridge", default="", help="the address of a running server")
    parser.add_argument("--rosbridge-sources", default="", help="a folder with rosbridge_suite, branch ros1")
    parser.add_argument("--rosnodejs", default="", help="its folder, as `npm install rosnodejs` makes it")
    parser.add_argument("--python2", default="python2.7", help="a Python 2.7 that has nep 0.5.3.5")
    parser.add_argument("--delay-ms", type=float, default=wifi.delay_ms, help="of the link, in one direction")
    parser.add_argument("--jitter-ms", type=float, default=wifi.jitter_ms)
    parser.add_argument("--rate-mbit", type=float, default=wifi.rate_mbit)
    parser.add_argument("--write", action="store_true", help="make docs/figures.md and its pictures of it")
    parser.add_argument("--from", dest="source", type=Path, help="measure nothing; take what was kept there")
    parser.add_argument("--keep", type=Path, default=ROOT / "build" / "paper.json", help="where it is kept")
    parser.add_argument("--inside", default="", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if not (arguments.rate_mbit > 0 and arguments.delay_ms >= 0 and arguments.jitter_ms >= 0):
        parser.error("a link has a rate above 0, and neither delay nor jitter below 0")
    if not (arguments.seconds >= 0 and arguments.blocks >= 0):
        parser.error("neither the time nor the number of blocks is below 0")
    if arguments.source and not arguments.source.is_file():
        parser.error(f"there is no file '{arguments.source}'")
    unknown = set(arguments.sizes).difference(*SIZES.values())
    if unknown:
        parser.error(
            f"not among the sizes: {sorted(unknown)}; there are {sorted(set().union(*SIZES.values()))}"
        )
    arguments.rows = list(dict.fromkeys([PLAIN, *arguments.rows]))
    return arguments


def main() -> int:
    """Measure, save and print the result; return 1 if a run does not count or a goal is missed."""
    arguments = asked()
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(143))  # to end all child processes
    if arguments.inside:
        inside(arguments)
        return 0
    if arguments.source:
        found = json.loads(arguments.source.read_text(encoding="utf-8"))
    else:
        found = run(arguments)
        arguments.keep.parent.mkdir(parents=True, exist_ok=True)
        arguments.keep.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(report(found))
    counts = does_count(found)
    said = "counts" if counts else "does NOT count, the computer is too busy"
    print(f"\nthis run {said} (A/A within 5 % in the mean of each table counts)")
    if arguments.write:
        print("written:", *(path.relative_to(ROOT) for path in write(found, ROOT / "docs")))
    return 0 if counts and all(goal.is_reached for goal in goals(found)) else 1


if __name__ == "__main__":
    sys.exit(main())
