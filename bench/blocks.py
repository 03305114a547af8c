"""What the benchmarks share: interleaved blocks, medians, a child to talk to, and when a run counts."""

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
"""A run counts when plain pyzmq differs from itself by no more than this."""


class Sample(NamedTuple):
    """What one message took: by the clock, and of all processors in both processes."""

    seconds: float
    cpu_s: float


class Child:
    """The other process: one line asks, one line answers."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def write(self, line: str) -> None:
        """Ask."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def read(self) -> str:
        """The answer. Ends the program when the child is gone."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("the child process has ended")
        return line.strip()

    def kill(self) -> None:
        """Kill it, and wait until it is gone."""
        self._process.kill()
        self._process.wait()


@contextmanager
def other_process(program: str, arguments: Sequence[str], master: str) -> Iterator[Child]:
    """A Python process that runs `program`; killed at the end."""
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
    """Processor time of this process so far, all threads, user and system, in seconds."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def interleaved(
    variants: Mapping[str, Callable[[], Sample]], blocks: int, *, limit: int = 1
) -> dict[str, Sample]:
    """Each variant once a block, in random order; the medians, in the order given.

    While "plain again" is not within `TRUSTED` of "plain", as many blocks again are added, until there are
    `limit` times as many. What the other variants gave is not looked at for that.
    """
    taken: dict[str, list[Sample]] = {name: [] for name in variants}
    for measure in variants.values():
        measure()  # the first time pays for memory
    for _ in range(limit):
        for _ in range(blocks):
            for name in random.sample(list(variants), len(variants)):
                taken[name].append(variants[name]())
        found = medians(taken)
        if is_trusted(found["plain again"].seconds / found["plain"].seconds):
            break
    return medians(taken)


def is_trusted(again: float) -> bool:
    """Whether plain against itself is close enough to 1."""
    return abs(again - 1.0) <= TRUSTED


def medians(taken: Mapping[str, Sequence[Sample]]) -> dict[str, Sample]:
    """The median of each column."""
    return {
        name: Sample(
            statistics.median(each.seconds for each in samples),
            statistics.median(each.cpu_s for each in samples),
        )
        for name, samples in taken.items()
    }


def verdict(again: float) -> int:
    """Print whether the run counts, by the ratio of plain against itself; 0 when it does, else 1."""
    counts = is_trusted(again)
    said = "this run counts" if counts else "this run does NOT count, the computer is too busy"
    print(f"plain against itself: {again:.3f}; {said} (within {TRUSTED:.0%} counts)")
    return 0 if counts else 1
