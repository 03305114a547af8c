"""Round trips between Python and other languages, as a ratio to Python and Python in the same run.

    python bench/nep_clients.py [--trips 200] [--blocks 6] [--kinds json string bytes] [--sizes 1000 65536]

Python publishes and listens in this process; the other side decodes each message and publishes it again. All
go by TCP: Unix sockets and shared memory, which only Python has, are switched off (--local leaves them on).
Rows are interleaved in random order within each block. "Python again" is Python against itself: a size counts
only when that is within 5 %. The goal is 1.3 for `string` and `bytes` up to 1 MB and for `json` up to 64 kB.

nep-js has to be built before: `npm ci && npm run build` in clients/javascript.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from blocks import is_trusted

import nep
from nep.masters.master import Master

JAVASCRIPT = Path(__file__).parents[1] / "clients" / "javascript" / "dist" / "index.js"
PYTHON_ECHO = """
import sys, nep
topic, kind = sys.argv[1:]
node = nep.node("echo_" + topic)
publisher, subscriber = node.new_pub(topic + "_back", kind), node.new_sub(topic, kind)
print("ready", flush=True)
while True:
    publisher.publish(subscriber.listen(True)[1])
"""
JAVASCRIPT_ECHO = """
const nep = require(process.env.NEP_JS);
const [topic, kind] = process.argv.slice(1);
const node = new nep.Node("echo_" + topic);
const publisher = node.new_pub(topic + "_back", kind);
const subscriber = node.new_sub(topic, kind, (message) => publisher.publish(message));
Promise.all([publisher.ready, subscriber.ready]).then(() => console.log("ready"));
"""
ROWS = {
    "Python": (sys.executable, "-c", PYTHON_ECHO),
    "Python again": (sys.executable, "-c", PYTHON_ECHO),
    "JavaScript": ("node", "-e", JAVASCRIPT_ECHO),
}
WARM_UP = 20
SMALL_BYTES = 16_384


def payload_of(kind: str, size: int) -> object:
    """A payload of about so many bytes when it is encoded."""
    if kind == "json":
        return {"values": [round(0.5 * number, 1) for number in range(size // 8)]}
    return "x" * size if kind == "string" else bytes(size)


@contextmanager
def echo(row: str, topic: str, kind: str) -> Iterator[None]:
    """A program that publishes each message of a topic again, ready."""
    command = [*ROWS[row], topic, kind]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, env={**os.environ, "NEP_JS": str(JAVASCRIPT)}
    ) as process:
        try:
            assert process.stdout is not None
            if not process.stdout.readline():
                raise SystemExit(f"the program of the row '{row}' ended")
            yield
        finally:
            process.kill()


def round_trips(
    publisher: nep.Publisher, subscriber: nep.Subscriber, payload: object, count: int
) -> list[float]:
    """Milliseconds of so many round trips."""
    taken = []
    for _ in range(count):
        began = time.perf_counter()
        publisher.publish(payload)
        subscriber.listen(True)
        taken.append((time.perf_counter() - began) * 1e3)
    return taken


def measure(
    rows: Sequence[str], kind: str, sizes: Sequence[int], trips: int, blocks: int
) -> dict[tuple[str, int], list[float]]:
    """All round trips of each row and size."""
    taken: dict[tuple[str, int], list[float]] = {(row, size): [] for row in rows for size in sizes}
    with ExitStack() as stack:
        node = stack.enter_context(nep.node("pinger"))
        ends = {}
        for row in rows:
            topic = f"{kind}_{row.replace(' ', '_')}"
            stack.enter_context(echo(row, topic, kind))
            ends[row] = node.new_pub(topic, kind), node.new_sub(f"{topic}_back", kind)
            round_trips(*ends[row], payload_of(kind, sizes[0]), WARM_UP)
        for _ in range(blocks):
            for row, size in random.sample(list(taken), len(taken)):
                count = (
                    max(5, trips * sizes[0] // max(size, 20 * sizes[0])) if size > 20 * sizes[0] else trips
                )
                taken[row, size] += round_trips(*ends[row], payload_of(kind, size), count)
    return taken


def main() -> int:
    """Measure and print a table; 1 when a size does not count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trips", type=int, default=200)
    parser.add_argument("--blocks", type=int, default=6)
    parser.add_argument(
        "--kinds", nargs="+", choices=["json", "string", "bytes"], default=["json", "string", "bytes"]
    )
    parser.add_argument("--sizes", nargs="+", type=int, default=[1000, 65_536, 1_048_576])
    parser.add_argument("--local", action="store_true", help="let Python use Unix sockets and shared memory")
    given = parser.parse_args()
    if not given.local:
        os.environ |= {"NEP_LOCAL": "0", "NEP_SHARED_MEMORY": "0"}
    has_javascript = shutil.which("node") is not None and JAVASCRIPT.is_file()
    rows = [row for row in ROWS if row != "JavaScript" or has_javascript]
    if not has_javascript:
        print("JavaScript: not run, needs node and a built clients/javascript")
    trusted = True
    with Master("127.0.0.1:0", learn_s=0.0) as master:
        os.environ["NEP_MASTER"] = master.address
        print(f"{'':8}{'bytes':>9}" + "".join(f"{row + ', ms (p95)':>26}{'÷':>7}" for row in rows))
        for kind in given.kinds:
            taken = measure(rows, kind, given.sizes, given.trips, given.blocks)
            for size in given.sizes:
                own = statistics.median(taken["Python", size])
                line = f"{kind:8}{size:>9}"
                for row in rows:
                    median, p95 = (
                        statistics.median(taken[row, size]),
                        statistics.quantiles(taken[row, size], n=20)[-1],
                    )
                    line += f"{f'{median:.3f} ({p95:.2f})':>26}{median / own:>7.2f}"
                counts = is_trusted(statistics.median(taken["Python again", size]) / own)
                trusted = trusted and counts
                print(line + ("" if counts else "  does not count: the computer is busy"), flush=True)
    return 0 if trusted else 1


if __name__ == "__main__":
    sys.exit(main())
