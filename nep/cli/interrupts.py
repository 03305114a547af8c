"""What Ctrl+C does to a command: before and after its work it ends at once, in between it is asked to end.

An interrupt in the middle of an import, or of the end of the interpreter, would be seen as a traceback.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from types import FrameType

from nep.cli import INTERRUPTED

__all__ = ["TERMINATED", "ask_first", "call_first", "end_at_once", "leave_when_told"]

TERMINATED = 143
"""The exit code of a program that SIGTERM ended."""

AGAIN_S = 0.02
GRACE_S = 3.0
"""So long may a command take to end that was asked to: nodes say goodbye within 2 s."""


def end_at_once() -> None:
    """From now on Ctrl+C ends the program without a word: there is nothing to tidy up."""
    _handle_with(_end)


def ask_first() -> None:
    """From now on Ctrl+C raises `KeyboardInterrupt`, so that nodes say goodbye.

    Once more, or when that takes too long, ends it at once: a terminal may take nothing any more.
    """
    _handle_with(_ask)


def call_first(action: Callable[[], object]) -> None:
    """From now on Ctrl+C, SIGTERM and SIGHUP call `action`, which lets the command come to its end.

    Once more ends it at once. For commands that must end well: a recording writes what it has. `action` only
    sets something.
    """

    def handle(_signal: int, _frame: FrameType | None) -> None:
        end_at_once()
        _end_requests_with(signal.SIG_DFL)
        action()

    _callers.add(handle)
    _handle_with(handle)
    _end_requests_with(handle)


_callers: set[signal._HANDLER] = set()


def leave_when_told(code: int = 0) -> None:
    """From now on SIGTERM and SIGHUP leave with `code`, through what closes nodes; once more ends at once.

    `docker stop`, systemd, `kill` and `timeout` send SIGTERM, a terminal that is closed sends SIGHUP.
    """

    def leave(_signal: int, _frame: FrameType | None) -> None:
        _end_requests_with(signal.SIG_DFL)
        sys.exit(code)

    _callers.add(leave)
    _end_requests_with(leave)


def _end_requests_with(handler: signal._HANDLER) -> None:
    """Handle SIGTERM and SIGHUP, unless whoever started this wants it to go on (`nohup`)."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) in {signal.SIG_DFL, *_callers}:
            with suppress(ValueError):  # only the main thread may
                signal.signal(number, handler)


def _end(_signal: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)


def _ask(_signal: int, frame: FrameType | None) -> None:
    if _is_in_finalizer(frame):  # what is raised there is printed as ignored, and is lost
        with suppress(RuntimeError):
            _thread.start_new_thread(_interrupt_again, ())
        return
    end_at_once()
    with suppress(
        RuntimeError
    ):  # no thread can be had; `Thread` has locks that whoever was interrupted may hold
        _thread.start_new_thread(_end_later, ())
    raise KeyboardInterrupt


def _is_in_finalizer(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_name == "__del__":
            return True
        frame = frame.f_back
    return False


def _interrupt_again() -> None:
    threading.Event().wait(AGAIN_S)
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)  # also where it waits
    else:
        _thread.interrupt_main()


def _end_later() -> None:
    threading.Event().wait(GRACE_S)
    os._exit(INTERRUPTED)


def _handle_with(handler: signal._HANDLER) -> None:
    """Unless whoever started this wants it to go on (`nohup`, `&` in a script) or handles it otherwise."""
    if signal.getsignal(signal.SIGINT) in {signal.default_int_handler, _end, _ask, *_callers}:
        with suppress(ValueError):  # only the main thread may, and only there does an interrupt come
            signal.signal(signal.SIGINT, handler)
