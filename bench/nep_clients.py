"""Round trips between Python and other languages, as a ratio to Python and Python in the same run.

    python bench/nep_clients.py [--trips 100] [--blocks 6] [--starts 8] [--kinds json] [--sizes 1000]

A Python program publishes and listens, the other program decodes each message and publishes it again;
both are ends of `paper.py` (`paper_ends.py`, `pong.cjs`, `Pong.cs`). `json` is a map with a list of
numbers. All rows use TCP: Unix sockets and shared memory, which only Python has, are switched off
(--local leaves them on). Rows are interleaved in random order within each block, and all programs are
restarted several times: two runs of one program differ by up to 40 % at 1 kB. "Python again" is the A/A
row, Python against itself: a size counts only if it is within 5 %. The goal is 1.3 for `string` and `bytes`
up to 1 MB, for `json` up to 64 kB.

JavaScript needs `npm ci && npm run build` in clients/javascript, C# needs Debian's mono-mcs, mono-runtime and
libnewtonsoft-json5.0-cil.
"""

from __future__ import annotations

import argparse
import os
import random
import statistics
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import paper_clients
from blocks import is_trusted
from paper_ends import NUMBERS
from paper_pairs import Pair, Places

ROWS = {
    "Python": "nep",
    "Python again": "nep",
    "JavaScript": paper_clients.JAVASCRIPT,
    "C#": paper_clients.CSHARP,
}
"""Row of `paper.py` for each row of the table."""
KINDS = {"json": NUMBERS, "string": "string", "bytes": "bytes"}
WARM_UP = 100
LARGE = 20  # times the smallest size: larger messages get fewer trips
Taken = dict[tuple[str, str, int], list[float]]
"""Milliseconds of the round trips of each row, kind and size."""


def trips(size: int, smallest: int, most: int) -> int:
    """Return the number of round trips of a size in each block."""
    return max(5, most * LARGE * smallest // size) if size > LARGE * smallest else most


def measure(rows: Sequence[str], kinds: Sequence[str], sizes: Sequence[int], most: int, blocks: int) -> Taken:
    """Return all round trips; ``most`` is the number of trips in each block for small sizes."""
    taken: Taken = {(row, kind, size): [] for row in rows for kind in kinds for size in sizes}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="nep-clients-")))
        places = Places(("127.0.0.1", "127.0.0.1"), (), folder)
        pairs = {}
        for row in rows:
            pairs[row] = Pair(ROWS[row], places)
            stack.callback(pairs[row].close)
            for kind in kinds:
                for size in sizes:
                    pairs[row].take(KINDS[kind], size, 0, trips(size, sizes[0], WARM_UP))
        for _ in range(blocks):
            for row, kind, size in random.sample(list(taken), len(taken)):
                seconds = pairs[row].take(KINDS[kind], size, trips(size, sizes[0], most), 1)
                taken[row, kind, size] += [each * 1e3 for each in seconds]
    return taken


def show(taken: Taken, rows: Sequence[str], kinds: Sequence[str], sizes: Sequence[int]) -> bool:
    """Print the table; return whether every size counts."""
    print(f"{'':8}{'bytes':>9}" + "".join(f"{row + ', ms (p95)':>26}{'÷':>7}" for row in rows))
    is_counted = True
    for kind in kinds:
        for size in sizes:
            medians = {row: statistics.median(taken[row, kind, size]) for row in rows}
            line = f"{kind:8}{size:>9}"
            for row in rows:
                p95 = statistics.quantiles(taken[row, kind, size], n=20)[-1]
                ratio = medians[row] / medians["Python"]
                line += f"{f'{medians[row]:.3f} ({p95:.2f})':>26}{ratio:>7.2f}"
            counts = is_trusted(medians["Python again"] / medians["Python"])
            is_counted = is_counted and counts
            print(line + ("" if counts else "  does not count: the computer is busy"))
    return is_counted


def main() -> int:
    """Measure and print a table. The exit code is 1 if a size does not count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trips", type=int, default=100)
    parser.add_argument("--blocks", type=int, default=6)
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--sizes", nargs="+", type=int, default=[1000, 65_536, 1_048_576])
    parser.add_argument("--local", action="store_true", help="let Python use Unix sockets and shared memory")
    given = parser.parse_args()
    if not given.local:
        os.environ |= {"NEP_LOCAL": "0", "NEP_SHARED_MEMORY": "0"}
    missing = {row: paper_clients.why_missing(of) for row, of in ROWS.items() if of in paper_clients.ROWS}
    for row, why in missing.items():
        if why:
            print(f"{row}: not run, {why}")
    rows = [row for row in ROWS if not missing.get(row)]
    sizes = sorted(given.sizes)
    taken: Taken = defaultdict(list)
    for _ in range(given.starts):
        for key, times in measure(rows, given.kinds, sizes, given.trips, given.blocks).items():
            taken[key] += times
    return 0 if show(taken, rows, given.kinds, sizes) else 1


if __name__ == "__main__":
    sys.exit(main())
