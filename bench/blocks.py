"""Helpers for benchmarks: interleaved blocks, medians, a child process and the check of a run's validity."""

from __future__ import annotations

import os
import random
import resource
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

__all__ = [
    "TRUSTED",
    "Child",
    "Sample",
    "cpu_s",
    "interleaved",
    "is_trusted",
    "medians",
    "other_process",
    "verdict",
]

TRUSTED = 0.05
"""Maximum relative difference between two measurements of plain pyzmq in a valid run."""


class Sample(NamedTuple):
    """Cost of one message: wall time and CPU time of both processes."""

    seconds: float
    cpu_s: float


class Child:
    """Child process with a line-based request and reply protocol."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def write(self, line: str) -> None:
        """Send a request line."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def read(self) -> str:
        """Return the reply line; exit if the child process has ended."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("the child process has ended")
        return line.strip()

    def kill(self) -> None:
        """Kill the process and wait for its end."""
        self._process.kill()
        self._process.wait()


@contextmanager
def other_process(program: str, arguments: Sequence[str], master: str) -> Iterator[Child]:
    """Context manager of a Python process that runs `program` and is killed on exit."""
    environment = {**os.environ, "NEP_MASTER": master, "PYTHONPATH": str(Path(__file__).parents[1])}
    process = subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )
    try:
        yield Child(process)
    finally:
        process.kill()
        process.communicate()


def cpu_s() -> float:
    """Return the user and system CPU time of all threads of this process, in seconds."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def interleaved(
    variants: Mapping[str, Callable[[], Sample]], blocks: int, *, limit: int = 1
) -> dict[str, Sample]:
    """Measure each variant once per block, in random order; return the medians in the given order.

    While "plain again" differs from "plain" by more than `TRUSTED`, the same number of blocks is added,
    up to `limit` times the number. The results of other variants do not affect this.
    """
    taken: dict[str, list[Sample]] = {name: [] for name in variants}
    for measure in variants.values():
        measure()  # warm-up: the first run allocates memory
    for _ in range(limit):
        for _ in range(blocks):
            for name in random.sample(list(variants), len(variants)):
                taken[name].append(variants[name]())
        found = medians(taken)
        if is_trusted(found["plain again"].seconds / found["plain"].seconds):
            break
    return medians(taken)


def is_trusted(again: float) -> bool:
    """Return whether the ratio of the two plain measurements is close enough to 1."""
    return abs(again - 1.0) <= TRUSTED


def medians(taken: Mapping[str, Sequence[Sample]]) -> dict[str, Sample]:
    """Return the median wall time and CPU time of each variant."""
    return {
        name: Sample(
            statistics.median(each.seconds for each in samples),
            statistics.median(each.cpu_s for each in samples),
        )
        for name, samples in taken.items()
    }


def verdict(again: float) -> int:
    """Print whether the run is valid, from the ratio of the plain measurements; return 0 if it is, else 1."""
    counts = is_trusted(again)
    said = "this run counts" if counts else "this run does NOT count, the computer is too busy"
    print(f"plain against itself: {again:.3f}; {said} (within {TRUSTED:.0%} counts)")
    return 0 if counts else 1
