"""What Ctrl+C does to a command: before and after its work it ends at once, in between it is asked to end.

An interrupt in the middle of an import, or of the end of the interpreter, would be seen as a traceback.
"""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from types import FrameType

from nep.cli import INTERRUPTED

__all__ = ["ask_first", "end_at_once"]


def end_at_once() -> None:
    """From now on Ctrl+C ends the program without a word: there is nothing to tidy up."""
    _handle_with(_end)


def ask_first() -> None:
    """From now on Ctrl+C raises `KeyboardInterrupt`, so that nodes say goodbye; once more ends it at once."""
    _handle_with(_ask)


def _end(_signal: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)


def _ask(_signal: int, _frame: FrameType | None) -> None:
    end_at_once()
    raise KeyboardInterrupt


def _handle_with(handler: signal._HANDLER) -> None:
    """Unless whoever started this wants it to go on (`nohup`, `&` in a script) or handles it otherwise."""
    if signal.getsignal(signal.SIGINT) in {signal.default_int_handler, _end, _ask}:
        with suppress(ValueError):  # only the main thread may, and only there does an interrupt come
            signal.signal(signal.SIGINT, handler)
