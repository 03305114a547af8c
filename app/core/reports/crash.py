"""What a crash is: which part of Studio ended, how, and what it said. Whoever notices one logs it.

A record with the ``extra`` of `crash_extra` is for the log, as any other, and becomes a crash report where
Studio keeps them (`app.core.reports.crash_reports.CrashLog`).
"""

from __future__ import annotations

import signal
from dataclasses import dataclass
from typing import Literal

from nep.version import __version__

Part = Literal["studio", "behaviour", "robot", "master", "editor"]
PARTS: tuple[Part, ...] = ("studio", "behaviour", "robot", "master", "editor")

CRASH_SIGNALS = frozenset(
    getattr(signal, name)
    for name in ("SIGABRT", "SIGBUS", "SIGFPE", "SIGILL", "SIGKILL", "SIGSEGV", "SIGSYS", "SIGTRAP")
    if hasattr(signal, name)
)
"""By which processes end that nobody asked to end. The system ends by SIGKILL what takes all its memory."""
FIRST_BAD_STATUS = 0xC0000000
"""On Windows the exit code of a crash is its status, from here on."""
ASKED_STATUS = 0xC000013A
"""What Ctrl+C and the end of a session leave on Windows."""
STATUS_WORDS = {
    0xC0000005: "access violation",
    0xC000001D: "illegal instruction",
    0xC0000094: "division by zero",
    0xC00000FD: "stack overflow",
    0xC0000374: "damaged heap",
    0xC0000409: "abort",
}
TRACE_BEGINS = ("Fatal Python error:", "Windows fatal exception:")
"""How the lines of Python's faulthandler begin."""
MAYBE_CAUGHT = "Windows fatal exception: code "


@dataclass(frozen=True, slots=True)
class Crash:
    """One crash: the part that ended, how in a few English words, and what is known beside (a traceback).

    ``version`` is that of the Studio that crashed: after an update it is not the one that notices.
    """

    part: Part
    how: str
    text: str = ""
    version: str = __version__


def crash_extra(part: Part, how: str, text: str = "") -> dict[str, object]:
    """The ``extra`` of a log record that tells of a crash."""
    return {"crash": Crash(part, how, text)}


def is_crash(code: int) -> bool:
    """Whether a process with this exit code crashed; negative is the number of a signal."""
    if code < 0:
        return -code in CRASH_SIGNALS
    return code >= FIRST_BAD_STATUS and code != ASKED_STATUS


def end_words(code: int) -> str:
    """How a process ended, in English: "ended by signal 11 (SIGSEGV)"."""
    if code < 0:
        try:
            name = f" ({signal.Signals(-code).name})"
        except ValueError:
            name = ""
        return f"ended by signal {-code}{name}"
    if code >= FIRST_BAD_STATUS:
        words = STATUS_WORDS.get(code)
        return f"ended with the status 0x{code:08X}" + (f" ({words})" if words else "")
    return f"ended with the code {code}"


def split_trace(said: str) -> tuple[str, str]:
    """What a process said by itself, and what Python's faulthandler said of its crash behind that ("")."""
    lines = said.splitlines(keepends=True)
    for place, line in enumerate(lines):
        if line.startswith(TRACE_BEGINS):
            return "".join(lines[:place]), "".join(lines[place:])
    return said, ""


def fatal_line(trace: str) -> str:
    """The line of a trace that says how a process ended; "" when none does.

    On Windows faulthandler also writes of exceptions with a number that a library of the system raises and
    catches itself.
    """
    told = [line for line in trace.splitlines() if line.startswith(TRACE_BEGINS)]
    return next((line for line in reversed(told) if not line.startswith(MAYBE_CAUGHT)), "")
