"""What a program's process says: lines of its protocol, with bounds on how many and how long."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import IO

LONGEST_LINE = 1_000_000
CHUNK = 65_536
MARK = b'{"is"'
"""How each line of the protocol begins; everything else is counted, not read."""
LINES_PER_S = 1_000
BYTES_PER_S = 20_000_000
REST_S = 0.02
LONGEST_TEXT = 2_000


class Output:
    """The lines of a pipe, at a rate that leaves the window its time: the pipe's writer waits meanwhile."""

    def __init__(
        self, stream: IO[bytes], stopped: threading.Event, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`stopped` ends the resting between floods."""
        self._stream, self._stopped, self._clock = stream, stopped, clock
        self.strange_bytes = 0
        """How much of it was no line of the protocol."""
        self._second, self._lines, self._bytes = clock(), 0, 0

    def __iter__(self) -> Iterator[bytes]:
        """Lines that may be of the protocol, until the pipe's end."""
        held = b""
        while chunk := self._read():
            whole, end, held = (held + chunk).rpartition(b"\n")
            yield from self._protocol(whole + end)
            if len(held) > LONGEST_LINE:  # no end of line for a long time: it is none of ours
                self.strange_bytes += len(held) - 1
                held = b"-"  # stands for a byte of it: neither is its end ours
            self._rest(read=len(chunk))
        self.strange_bytes += len(held)

    def _protocol(self, whole: bytes) -> Iterator[bytes]:
        """The lines of the protocol in whole lines. The others are skipped in one piece, not looked at.

        A loop over a flood of short lines would keep the interpreter from the thread that stops the program.
        """
        at = 0
        while at < len(whole):
            if whole.startswith(MARK, at):
                end = whole.index(b"\n", at)
                if end - at <= LONGEST_LINE:
                    self._rest(lines=1)
                    yield whole[at:end]
                else:
                    self.strange_bytes += end + 1 - at
                at = end + 1
                continue
            found = whole.find(b"\n" + MARK, at)
            end = len(whole) if found < 0 else found + 1
            strange = whole[at:end]
            while b"\n\n" in strange:  # empty lines say nothing
                strange = strange.replace(b"\n\n", b"\n")
            self.strange_bytes += len(strange.lstrip(b"\n"))
            at = end

    def _read(self) -> bytes:
        try:
            return self._stream.read1(CHUNK)  # type: ignore[attr-defined, no-any-return]  # a buffered reader
        except (OSError, ValueError):
            return b""

    def _rest(self, *, lines: int = 0, read: int = 0) -> None:
        """After too much in this second, leave the processor to others for a while."""
        now = self._clock()
        if now - self._second >= 1.0:
            self._second, self._lines, self._bytes = now, 0, 0
        self._lines += lines
        self._bytes += read
        if self._lines > LINES_PER_S or self._bytes > BYTES_PER_S:
            self._stopped.wait(REST_S)


class Gate:
    """Lets so many of a kind through in a second, and counts the others."""

    def __init__(self, per_second: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._per_second, self._clock = per_second, clock
        self._second, self._passed = clock(), 0
        self.kept_back = 0

    def passes(self) -> bool:
        """Whether one more may pass now."""
        now = self._clock()
        if now - self._second >= 1.0:
            self._second, self._passed = now, 0
        if self._passed >= self._per_second:
            self.kept_back += 1
            return False
        self._passed += 1
        return True

    def take_kept_back(self) -> int:
        """How many did not pass since the last time this was asked, once some can pass again."""
        if self._clock() - self._second < 1.0 and self._passed >= self._per_second:
            return 0
        count, self.kept_back = self.kept_back, 0
        return count


def texts(said: object) -> tuple[str, ...]:
    """The words of a list; none when it is something else."""
    return tuple(str(each) for each in said) if isinstance(said, (list, tuple)) else ()


def text_of(said: Mapping[str, object], name: str) -> str:
    """A text that was said, of a length that can be shown."""
    return str(said.get(name, ""))[:LONGEST_TEXT]
