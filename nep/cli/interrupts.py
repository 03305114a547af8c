"""Signal handling of commands: Ctrl+C, SIGTERM and SIGHUP.

Before and after the command's work, Ctrl+C exits at once, because an interrupt during an import or the
interpreter's shutdown would print a traceback. In between, Ctrl+C raises `KeyboardInterrupt`.
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

from nep.cli import INTERRUPTED_EXIT_CODE

TERMINATED_EXIT_CODE = 143
"""Exit code of a program that was stopped by SIGTERM."""

RETRY_DELAY_S = 0.02
GRACE_PERIOD_S = 3.0
"""Time limit in seconds for stopping a command after Ctrl+C; nodes leave the master within 2 s."""


def exit_on_interrupt() -> None:
    """Make Ctrl+C exit immediately and without a message; for phases that need no cleanup."""
    _set_interrupt_handler(_exit_immediately)


def raise_on_interrupt() -> None:
    """Make Ctrl+C raise `KeyboardInterrupt`, so that nodes leave the master.

    After a second Ctrl+C, or `GRACE_PERIOD_S` after the first, the process exits at once, because the
    terminal may be blocked.
    """
    _set_interrupt_handler(_raise_interrupt)


def call_on_signal(action: Callable[[], object]) -> None:
    """Make Ctrl+C, SIGTERM and SIGHUP call `action`, which asks the command to finish.

    Use this for commands that must finish cleanly, such as a recording. A second signal exits
    immediately.

    Args:
        action: Function that is called in a signal handler, so it should only set a flag.
    """

    def handle(_signal: int, _frame: FrameType | None) -> None:
        exit_on_interrupt()
        _set_termination_handler(signal.SIG_DFL)
        action()

    _installed_handlers.add(handle)
    _set_interrupt_handler(handle)
    _set_termination_handler(handle)


_installed_handlers: set[signal._HANDLER] = set()


def exit_on_termination(code: int = 0) -> None:
    """Make SIGTERM and SIGHUP exit with `code` after cleanup; a second signal exits at once.

    `docker stop`, systemd, `kill` and `timeout` send SIGTERM; a closing terminal sends SIGHUP.
    """

    def exit_cleanly(_signal: int, _frame: FrameType | None) -> None:
        _set_termination_handler(signal.SIG_DFL)
        sys.exit(code)

    _installed_handlers.add(exit_cleanly)
    _set_termination_handler(exit_cleanly)


def _set_termination_handler(handler: signal._HANDLER) -> None:
    # Keeps handlers that the parent has set to ignore (`nohup`).
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) in {signal.SIG_DFL, *_installed_handlers}:
            with suppress(ValueError):  # only the main thread may
                signal.signal(number, handler)


def _exit_immediately(_signal: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED_EXIT_CODE)


def _raise_interrupt(_signal: int, frame: FrameType | None) -> None:
    if _is_in_finalizer(frame):  # exceptions in __del__ are printed and ignored
        with suppress(RuntimeError):
            _thread.start_new_thread(_retry_interrupt, ())
        return
    exit_on_interrupt()
    with suppress(RuntimeError):  # no more threads; not Thread, whose locks the interrupted code may hold
        _thread.start_new_thread(_exit_after_grace, ())
    raise KeyboardInterrupt


def _is_in_finalizer(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_name == "__del__":
            return True
        frame = frame.f_back
    return False


def _retry_interrupt() -> None:
    threading.Event().wait(RETRY_DELAY_S)
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(
            threading.main_thread().ident or 0, signal.SIGINT
        )  # interrupts blocking calls, too
    else:
        _thread.interrupt_main()


def _exit_after_grace() -> None:
    threading.Event().wait(GRACE_PERIOD_S)
    os._exit(INTERRUPTED_EXIT_CODE)


def _set_interrupt_handler(handler: signal._HANDLER) -> None:
    # Keeps a handler that the parent set (`nohup`, `&` in a script) or that somebody installed.
    if signal.getsignal(signal.SIGINT) in {
        signal.default_int_handler,
        _exit_immediately,
        _raise_interrupt,
        *_installed_handlers,
    }:
        with suppress(ValueError):  # signals are handled in the main thread only
            signal.signal(signal.SIGINT, handler)
