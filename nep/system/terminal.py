"""Terminal: writes to a terminal, pipe or file from a thread of its own, so that nobody else waits for it.

A terminal takes nothing while somebody marks text in it (Windows) or has pressed Ctrl+S, and a pipe while
nobody reads it. A program that serves others must not stand still as long: what does not fit is dropped,
counted, and told when there is room again.
"""

from __future__ import annotations

import io
import logging
import os
import threading
from collections import deque
from typing import TYPE_CHECKING, TextIO

from nep.i18n import ngettext
from nep.system.forks import watch
from nep.text import escaped

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["LineFormatter", "Terminal", "log_to"]

MAX_CHARACTERS = 256 * 1024
"""So much text waits for the terminal."""
CLOSE_S = 0.5
_AGAIN_S = 0.05


class Terminal(io.TextIOBase):
    """A text stream in front of `stream`, which may be None (a program without a window). A context manager.

    `write` never waits and never raises, in any thread. The thread begins with the first text.
    """

    def __init__(self, stream: TextIO | None, max_characters: int = MAX_CHARACTERS) -> None:
        super().__init__()
        self._stream = stream
        self._max_characters = max_characters
        self._waiting: deque[str] = deque()
        self._size = 0
        self._lines_dropped = 0
        self._is_over = stream is None
        self._is_closing = False
        self._is_writing = False
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        watch(self)

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """The stream's."""
        return getattr(self._stream, "encoding", None) or "utf-8"

    def writable(self) -> bool:
        """See `io.TextIOBase`."""
        return True

    def isatty(self) -> bool:
        """Whether a person reads it."""
        return self._stream is not None and self._stream.isatty()

    def write(self, text: str) -> int:
        """Hand `text` over; dropped when too much waits, or when the stream takes nothing any more."""
        with self._changed:
            if self._is_over or self._is_closing or not text:
                return len(text)
            if self._waiting and self._size + len(text) > self._max_characters:
                self._lines_dropped += max(1, text.count("\n"))
                return len(text)
            self._waiting.append(text)
            self._size += len(text)
            if self._thread is None:
                self._begin()
            self._changed.notify_all()
        return len(text)

    def flush(self) -> None:
        """Nothing: whoever flushes must not wait either."""

    def drain(self, timeout_s: float = CLOSE_S) -> bool:
        """Wait until all is written, for what must be read before the program ends; whether it is."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._waiting and not self._is_writing, timeout_s)

    def close(self, timeout_s: float = CLOSE_S) -> None:
        """Give what waits `timeout_s` to be written, then leave it. May be called twice."""
        with self._changed:
            self._is_closing = True
            self._changed.notify_all()
            thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def forked(self) -> None:
        """In a child: the thread is not there; what waits is its parent's to write. `nep.system.forks`."""
        self._changed = threading.Condition()
        self._thread = None
        self._waiting.clear()
        self._size = self._lines_dropped = 0
        self._is_writing = False

    def _begin(self) -> None:
        thread = threading.Thread(target=self._run, name="nep-terminal", daemon=True)
        try:
            thread.start()
        except RuntimeError:  # the interpreter is ending (from 3.12 on), or no thread can be had now
            return
        self._thread = thread

    # ---- in the thread

    def _run(self) -> None:
        while (text := self._next()) is not None:
            try:
                self._put(text)
            except (OSError, ValueError):  # nobody reads it any more, or it was closed: nowhere to say so
                with self._changed:
                    self._is_over = True
                    self._is_writing = False
                    self._waiting.clear()
                    self._changed.notify_all()
                return

    def _next(self) -> str | None:
        """What is to be written now; None at the end. Waits."""
        with self._changed:
            self._is_writing = False
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._waiting or self._lines_dropped or self._is_closing)
            if not self._waiting and not self._lines_dropped:
                return None
            text = "".join(self._waiting)
            self._waiting.clear()
            self._size = 0
            self._is_writing = True
            dropped, self._lines_dropped = self._lines_dropped, 0
        if dropped:
            text += ngettext(
                "… {count} line left out: nobody read this for a while",
                "… {count} lines left out: nobody read this for a while",
                dropped,
            ).format(count=dropped)
            text += "\n"
        return text

    def _put(self, text: str) -> None:
        """Write all of it; takes as long as the stream does.

        Past the stream's own buffer: the interpreter wants its lock when it ends, and would abort while this
        thread holds it.
        """
        stream = self._stream
        buffer = getattr(stream, "buffer", None)
        raw = getattr(buffer, "raw", buffer)  # there is none between with `python -u`
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
            if written is None:  # somebody made it non-blocking, and it is full
                never.wait(_AGAIN_S)
            else:
                data = data[written:]


class LineFormatter(logging.Formatter):
    """Formats a record so that nothing in it moves the cursor or clears the screen."""

    def format(self, record: logging.LogRecord) -> str:
        """See `logging.Formatter`."""
        return escaped(super().format(record), lines=True)


def log_to(terminal: Terminal, level: int) -> logging.Handler:
    """Let this program log to `terminal` from `level` on, unless it has said already where it logs to.

    The handler, for who takes it away again.
    """
    handler = logging.StreamHandler(terminal)
    handler.setFormatter(LineFormatter("%(name)s: %(message)s"))
    logging.basicConfig(level=level, handlers=[handler])
    return handler
