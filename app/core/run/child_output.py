"""Output of a program's process: lines of the protocol, limited in number and length."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import IO

MAX_LINE_LENGTH = 1_000_000
CHUNK_BYTES = 65_536
PROTOCOL_PREFIX = b'{"is"'
"""First bytes of each line of the protocol. Other output is counted but not parsed."""
MAX_LINES_PER_S = 1_000
MAX_BYTES_PER_S = 20_000_000
THROTTLE_PAUSE_S = 0.02


class OutputReader:
    """Iterator over the lines of a pipe that may belong to the protocol. Other output is only counted.

    The rate is limited, so that the window remains responsive. A process that writes faster blocks.
    """

    def __init__(
        self, stream: IO[bytes], stop_event: threading.Event, clock: Callable[[], float] = time.monotonic
    ) -> None:
        # `stop_event` ends the pauses between floods.
        self._stream, self._stop_event, self._clock = stream, stop_event, clock
        self.unexpected_bytes = 0
        """Number of bytes that don't belong to the protocol."""
        self._period_start_s, self._line_count, self._byte_count = clock(), 0, 0

    def __iter__(self) -> Iterator[bytes]:
        # Possible protocol lines until the pipe's end.
        remainder = b""
        while chunk := self._read():
            complete, end, remainder = (remainder + chunk).rpartition(b"\n")
            yield from self._protocol_lines(complete + end)
            if len(remainder) > MAX_LINE_LENGTH:  # a line that is too long isn't a protocol line
                self.unexpected_bytes += len(remainder) - 1
                remainder = b"-"  # placeholder, so that the rest of the line isn't parsed either
            self._throttle(byte_count=len(chunk))
        self.unexpected_bytes += len(remainder)

    def _protocol_lines(self, data: bytes) -> Iterator[bytes]:
        # Other lines are skipped in one piece: a loop over a flood of short lines would keep the interpreter
        # from the thread that stops the program.
        offset = 0
        while offset < len(data):
            if data.startswith(PROTOCOL_PREFIX, offset):
                end = data.index(b"\n", offset)
                if end - offset <= MAX_LINE_LENGTH:
                    self._throttle(line_count=1)
                    yield data[offset:end]
                else:
                    self.unexpected_bytes += end + 1 - offset
                offset = end + 1
                continue
            next_offset = data.find(b"\n" + PROTOCOL_PREFIX, offset)
            end = len(data) if next_offset < 0 else next_offset + 1
            unexpected = data[offset:end]
            while b"\n\n" in unexpected:  # skip empty lines
                unexpected = unexpected.replace(b"\n\n", b"\n")
            self.unexpected_bytes += len(unexpected.lstrip(b"\n"))
            offset = end

    def _read(self) -> bytes:
        try:
            return self._stream.read1(CHUNK_BYTES)  # type: ignore[attr-defined, no-any-return]  # a buffered reader
        except (OSError, ValueError):
            return b""

    def _throttle(self, *, line_count: int = 0, byte_count: int = 0) -> None:
        # Pauses when this second's limit is exceeded.
        now = self._clock()
        if now - self._period_start_s >= 1.0:
            self._period_start_s, self._line_count, self._byte_count = now, 0, 0
        self._line_count += line_count
        self._byte_count += byte_count
        if self._line_count > MAX_LINES_PER_S or self._byte_count > MAX_BYTES_PER_S:
            self._stop_event.wait(THROTTLE_PAUSE_S)


class RateLimiter:
    """Rate limiter that counts rejected items."""

    def __init__(self, per_second: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._per_second, self._clock = per_second, clock
        self._period_start_s, self._passed_count = clock(), 0
        self.rejected_count = 0

    def try_acquire(self) -> bool:
        """Return True if another item may pass now; otherwise count the item as rejected."""
        now = self._clock()
        if now - self._period_start_s >= 1.0:
            self._period_start_s, self._passed_count = now, 0
        if self._passed_count >= self._per_second:
            self.rejected_count += 1
            return False
        self._passed_count += 1
        return True

    def take_rejected_count(self) -> int:
        """Return and clear the number of rejected items; 0 while items are still being rejected."""
        if self._clock() - self._period_start_s < 1.0 and self._passed_count >= self._per_second:
            return 0
        count, self.rejected_count = self.rejected_count, 0
        return count
