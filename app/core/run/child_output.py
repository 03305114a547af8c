"""Output of a program's process: lines of the protocol, limited in number and length."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import IO

MAX_LINE_LENGTH = 1_000_000
CHUNK_BYTES = 65_536
PROTOCOL_PREFIX = b'{"is"'
"""First bytes of each line of the protocol. Other output is counted but not parsed."""
MAX_LINES_PER_S = 1_000
MAX_BYTES_PER_S = 20_000_000
THROTTLE_PAUSE_S = 0.02
MAX_TEXT_LENGTH = 2_000


class OutputReader:
    """Iterator over the lines of a pipe that may belong to the protocol. Other output is only counted.

    The rate is limited, so that the window remains responsive. A process that writes faster blocks.
    """

    def __init__(
        self, stream: IO[bytes], stopped: threading.Event, clock: Callable[[], float] = time.monotonic
    ) -> None:
        # `stopped` ends the pauses between floods.
        self._stream, self._stopped, self._clock = stream, stopped, clock
        self.unexpected_bytes = 0
        """Number of bytes that don't belong to the protocol."""
        self._second, self._lines, self._bytes = clock(), 0, 0

    def __iter__(self) -> Iterator[bytes]:
        # Possible protocol lines until the pipe's end.
        remainder = b""
        while chunk := self._read():
            complete, end, remainder = (remainder + chunk).rpartition(b"\n")
            yield from self._protocol_lines(complete + end)
            if len(remainder) > MAX_LINE_LENGTH:  # a line that is too long isn't a protocol line
                self.unexpected_bytes += len(remainder) - 1
                remainder = b"-"  # placeholder, so that the rest of the line isn't parsed either
            self._throttle(read=len(chunk))
        self.unexpected_bytes += len(remainder)

    def _protocol_lines(self, data: bytes) -> Iterator[bytes]:
        # Other lines are skipped in one piece: a loop over a flood of short lines would keep the interpreter
        # from the thread that stops the program.
        offset = 0
        while offset < len(data):
            if data.startswith(PROTOCOL_PREFIX, offset):
                end = data.index(b"\n", offset)
                if end - offset <= MAX_LINE_LENGTH:
                    self._throttle(lines=1)
                    yield data[offset:end]
                else:
                    self.unexpected_bytes += end + 1 - offset
                offset = end + 1
                continue
            next_offset = data.find(b"\n" + PROTOCOL_PREFIX, offset)
            end = len(data) if next_offset < 0 else next_offset + 1
            strange = data[offset:end]
            while b"\n\n" in strange:  # skip empty lines
                strange = strange.replace(b"\n\n", b"\n")
            self.unexpected_bytes += len(strange.lstrip(b"\n"))
            offset = end

    def _read(self) -> bytes:
        try:
            return self._stream.read1(CHUNK_BYTES)  # type: ignore[attr-defined, no-any-return]  # a buffered reader
        except (OSError, ValueError):
            return b""

    def _throttle(self, *, lines: int = 0, read: int = 0) -> None:
        # Pauses when this second's limit is exceeded.
        now = self._clock()
        if now - self._second >= 1.0:
            self._second, self._lines, self._bytes = now, 0, 0
        self._lines += lines
        self._bytes += read
        if self._lines > MAX_LINES_PER_S or self._bytes > MAX_BYTES_PER_S:
            self._stopped.wait(THROTTLE_PAUSE_S)


class RateLimiter:
    """Rate limiter that counts rejected items."""

    def __init__(self, per_second: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._per_second, self._clock = per_second, clock
        self._second, self._passed = clock(), 0
        self.rejected_count = 0

    def try_acquire(self) -> bool:
        """Return True if another item may pass now; otherwise count the item as rejected."""
        now = self._clock()
        if now - self._second >= 1.0:
            self._second, self._passed = now, 0
        if self._passed >= self._per_second:
            self.rejected_count += 1
            return False
        self._passed += 1
        return True

    def take_rejected_count(self) -> int:
        """Return and clear the number of rejected items; 0 while items are still being rejected."""
        if self._clock() - self._second < 1.0 and self._passed >= self._per_second:
            return 0
        count, self.rejected_count = self.rejected_count, 0
        return count


def parse_texts(value: object) -> tuple[str, ...]:
    """Return the items of a list as strings; empty if the value is not a list."""
    return tuple(str(each) for each in value) if isinstance(value, (list, tuple)) else ()


def text_of(fields: Mapping[str, object], name: str) -> str:
    """Return a field as a string, shortened for display; "" if the field is missing."""
    return str(fields.get(name, ""))[:MAX_TEXT_LENGTH]
