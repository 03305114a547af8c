"""Non-blocking terminal output through a writer thread.

A terminal blocks while text is selected (Windows) or after Ctrl+S, and a pipe while its reader is busy.
Excess text is dropped; the number of dropped lines is written when the queue has room again.
"""

from __future__ import annotations

import io
import logging
import os
import threading
from collections import deque
from typing import TYPE_CHECKING, TextIO

from nep.i18n import ngettext
from nep.system.forks import call_in_child
from nep.text import escaped

if TYPE_CHECKING:
    from typing_extensions import Self


MAX_CHARACTERS = 256 * 1024
"""Maximum size of queued text in characters."""
CLOSE_TIMEOUT_S = 0.5
_RETRY_DELAY_S = 0.05


class Terminal(io.TextIOBase):
    """Text stream with a queue and a writer thread. Usable as a context manager.

    `write` never blocks or raises, in any thread. The writer thread starts with the first text.

    Args:
        stream: Stream to write to, or None (a program without a console).
        max_characters: Maximum size of the queued text.
    """

    def __init__(self, stream: TextIO | None, max_characters: int = MAX_CHARACTERS) -> None:
        super().__init__()
        self._stream = stream
        self._max_characters = max_characters
        self._queue: deque[str] = deque()
        self._queued_characters = 0
        self._dropped_lines = 0
        self._has_failed = stream is None
        self._is_closing = False
        self._is_writing = False
        self._condition = threading.Condition()
        self._thread: threading.Thread | None = None
        call_in_child(self._reset_in_child)

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Encoding of the stream."""
        return getattr(self._stream, "encoding", None) or "utf-8"

    def writable(self) -> bool:
        """Return True; the stream is write-only."""
        return True

    def isatty(self) -> bool:
        """Return True if the stream is an interactive terminal."""
        return self._stream is not None and self._stream.isatty()

    def write(self, text: str) -> int:
        """Queue text; drop it if the queue is full, the stream has failed or `close` was called."""
        with self._condition:
            if self._has_failed or self._is_closing or not text:
                return len(text)
            if self._queue and self._queued_characters + len(text) > self._max_characters:
                self._dropped_lines += max(1, text.count("\n"))
                return len(text)
            self._queue.append(text)
            self._queued_characters += len(text)
            if self._thread is None:
                self._start_thread_locked()
            self._condition.notify_all()
        return len(text)

    def flush(self) -> None:
        """Do nothing: flushing must not block."""

    def drain(self, timeout_s: float = CLOSE_TIMEOUT_S) -> bool:
        """Wait until all queued text is written; return False after the time limit."""
        with self._condition:
            return self._condition.wait_for(lambda: not self._queue and not self._is_writing, timeout_s)

    def close(self, timeout_s: float = CLOSE_TIMEOUT_S) -> None:
        """Write the queued text for at most `timeout_s` seconds, then stop the thread. Idempotent."""
        with self._condition:
            self._is_closing = True
            self._condition.notify_all()
            thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def _reset_in_child(self) -> None:
        # The queued text belongs to the parent.
        self._condition = threading.Condition()
        self._thread = None
        self._queue.clear()
        self._queued_characters = self._dropped_lines = 0
        self._is_writing = False
        call_in_child(self._reset_in_child)

    def _start_thread_locked(self) -> None:
        thread = threading.Thread(target=self._run, name="nep-terminal", daemon=True)
        try:
            thread.start()
        except RuntimeError:  # the interpreter is shutting down (Python 3.12+), or no thread can be started
            return
        self._thread = thread

    # ---- thread

    def _run(self) -> None:
        while (text := self._next_text()) is not None:
            try:
                self._write_all(text)
            except (OSError, ValueError):  # the reader is gone, or the stream is closed
                with self._condition:
                    self._has_failed = True
                    self._is_writing = False
                    self._queue.clear()
                    self._condition.notify_all()
                return

    def _next_text(self) -> str | None:
        # Blocks until there is text; None at the end.
        with self._condition:
            self._is_writing = False
            self._condition.notify_all()
            self._condition.wait_for(lambda: self._queue or self._dropped_lines or self._is_closing)
            if not self._queue and not self._dropped_lines:
                return None
            text = "".join(self._queue)
            self._queue.clear()
            self._queued_characters = 0
            self._is_writing = True
            dropped, self._dropped_lines = self._dropped_lines, 0
        if dropped:
            text += ngettext(
                "… {count} line dropped because the output wasn't read",
                "… {count} lines dropped because the output wasn't read",
                dropped,
            ).format(count=dropped)
            text += "\n"
        return text

    def _write_all(self, text: str) -> None:
        # Bypasses the stream's buffer: at exit the interpreter needs its lock, and would abort while this
        # thread holds it.
        stream = self._stream
        buffer = getattr(stream, "buffer", None)
        raw = getattr(buffer, "raw", buffer)  # `python -u` has no buffer
        if raw is None:
            if stream is not None:
                stream.write(text)
                stream.flush()
            return
        errors = getattr(stream, "errors", None) or "strict"
        errors = "backslashreplace" if errors == "strict" else errors
        data = memoryview(text.replace("\n", os.linesep).encode(self.encoding, errors))
        never = threading.Event()
        while data:
            written = raw.write(data)
            if written is None:  # a non-blocking stream that is full
                never.wait(_RETRY_DELAY_S)
            else:
                data = data[written:]


class LineFormatter(logging.Formatter):
    """Formatter that escapes control characters."""

    def format(self, record: logging.LogRecord) -> str:
        """Format a record and escape its control characters."""
        return escaped(super().format(record), lines=True)


def log_to(terminal: Terminal, level: int) -> logging.Handler:
    """Configure logging to `terminal` from `level` on, unless a root handler exists. Return the handler."""
    handler = logging.StreamHandler(terminal)
    handler.setFormatter(LineFormatter("%(name)s: %(message)s"))
    logging.basicConfig(level=level, handlers=[handler])
    return handler
