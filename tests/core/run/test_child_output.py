"""Tests of reading a program's output: protocol lines, read at a bounded rate into bounded memory."""

from __future__ import annotations

import itertools
import threading
import tracemalloc
from collections.abc import Callable, Iterable

import pytest

from app.core.run.child_output import (
    CHUNK_BYTES,
    MAX_BYTES_PER_S,
    MAX_LINE_LENGTH,
    MAX_LINES_PER_S,
    THROTTLE_PAUSE_S,
    OutputReader,
    RateLimiter,
)

LINE = b'{"is": "print", "text": "x"}\n'


class Pipe:
    """Fake pipe with the chunks of the test."""

    def __init__(self, chunks: Iterable[bytes]) -> None:
        self.chunks = iter(chunks)

    def read1(self, _size: int) -> bytes:
        return next(self.chunks, b"")


class CountedWaits(threading.Event):
    """Event that counts its waits and their seconds, and returns at once."""

    count, seconds = 0, 0.0

    def wait(self, timeout: float | None = None) -> bool:
        self.count += 1
        self.seconds += timeout or 0.0
        return False


def output(*chunks: bytes) -> OutputReader:
    return OutputReader(Pipe(chunks), CountedWaits())  # type: ignore[arg-type]


def test_protocol_lines_are_assembled_and_other_bytes_counted() -> None:
    read = output(b'{"is": "re', b'ady"}\nnoise\n\n{"is": 1}', b"\n", b"tail")
    assert list(read) == [b'{"is": "ready"}', b'{"is": 1}']
    assert read.unexpected_bytes == len("noise\n") + len("tail")


def test_oversized_line_is_discarded_to_its_end() -> None:
    long = b'{"is"' + b"x" * MAX_LINE_LENGTH
    assert list(output(long, b"x", b'{"is": 2}\n{"is": 3}\n')) == [b'{"is": 3}']
    assert list(output(long + b'\n{"is": 3}\n')) == [b'{"is": 3}']


@pytest.mark.parametrize(
    ("chunk", "lines_in_it", "count"),
    [
        pytest.param(b"y\n" * (CHUNK_BYTES // 2), 0, 200, id="short lines of no block"),
        pytest.param(b"x" * CHUNK_BYTES, 0, 200, id="no end of a line"),
        pytest.param(b'{"is"' + b"x" * (CHUNK_BYTES - 5), 0, 200, id="a line of the protocol without an end"),
        pytest.param(
            LINE * (CHUNK_BYTES // len(LINE)), CHUNK_BYTES // len(LINE), 100, id="lines of the protocol"
        ),
    ],
)
def test_output_flood_is_counted_exactly_in_constant_memory(
    chunk: bytes, lines_in_it: int, count: int
) -> None:
    read = output(*[chunk] * count)
    tracemalloc.start()
    try:
        lines = sum(1 for _ in read)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert lines == lines_in_it * count
    assert read.unexpected_bytes == (0 if lines_in_it else count * len(chunk))
    assert peak < 5 * MAX_LINE_LENGTH


def rested(chunks: Iterable[bytes], clock: Callable[[], float]) -> CountedWaits:
    rests = CountedWaits()
    for _ in OutputReader(Pipe(chunks), rests, clock):  # type: ignore[arg-type]
        pass
    return rests


def test_reader_pauses_after_exceeding_its_rate() -> None:
    assert rested([LINE] * MAX_LINES_PER_S, lambda: 5.0).count == 0
    tired = rested([LINE] * (MAX_LINES_PER_S + 3), lambda: 5.0)
    assert tired.count >= 3
    assert tired.seconds == pytest.approx(tired.count * THROTTLE_PAUSE_S)
    assert rested([b"y" * CHUNK_BYTES] * (MAX_BYTES_PER_S // CHUNK_BYTES), lambda: 5.0).count == 0
    assert rested([b"y" * CHUNK_BYTES] * (MAX_BYTES_PER_S // CHUNK_BYTES + 3), lambda: 5.0).count >= 2


def test_reader_below_its_rate_does_not_pause() -> None:
    steps = itertools.count()
    slow = (
        1.0 / MAX_LINES_PER_S
    )  # the clock advances with each reading: fewer lines than the limit per second
    assert rested([LINE] * (5 * MAX_LINES_PER_S), lambda: next(steps) * slow).count == 0


def test_rate_limit_reopens_after_a_second() -> None:
    now = [0.0]
    gate = RateLimiter(3, lambda: now[0])
    assert [gate.try_acquire() for _ in range(5)] == [True, True, True, False, False]
    assert gate.take_rejected_count() == 0  # reported only after the limiter reopens
    now[0] = 1.1
    assert gate.try_acquire()
    assert gate.take_rejected_count() == 2
    assert gate.take_rejected_count() == 0
