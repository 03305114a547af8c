"""Crashes: the part of Studio that ended, how, and its output. The code that detects a crash logs it.

A log record with the ``extra`` of `crash_extra` is also stored as a crash report
(`app.core.reports.crash_reports.CrashLog`).
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
"""Signals of an unexpected end. SIGKILL is what the system sends when memory runs out."""
FIRST_BAD_STATUS = 0xC0000000
"""Lowest exit code of a crash on Windows, where it is a status."""
ASKED_STATUS = 0xC000013A
"""Exit code after Ctrl+C and at the end of a session on Windows."""
STATUS_WORDS = {
    0xC0000005: "access violation",
    0xC000001D: "illegal instruction",
    0xC0000094: "division by zero",
    0xC00000FD: "stack overflow",
    0xC0000374: "damaged heap",
    0xC0000409: "abort",
}
TRACE_BEGINS = ("Fatal Python error:", "Windows fatal exception:")
"""First words of a trace of Python's faulthandler."""
MAYBE_CAUGHT = "Windows fatal exception: code "


@dataclass(frozen=True, slots=True)
class Crash:
    """Crash: the part that ended, how (in English), and details such as a traceback.

    ``version`` is that of the crashed Studio, which after an update is not the running one.
    """

    part: Part
    how: str
    text: str = ""
    version: str = __version__


def crash_extra(part: Part, how: str, text: str = "") -> dict[str, object]:
    """Return the ``extra`` of a log record about a crash."""
    return {"crash": Crash(part, how, text)}


def is_crash(code: int) -> bool:
    """Return whether an exit code means a crash; negative ones are numbers of signals."""
    if code < 0:
        return -code in CRASH_SIGNALS
    return code >= FIRST_BAD_STATUS and code != ASKED_STATUS


def end_words(code: int) -> str:
    """Describe the end of a process in English: "ended by signal 11 (SIGSEGV)"."""
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
    """Split a process's output into its own part and the trace of Python's faulthandler, or ""."""
    lines = said.splitlines(keepends=True)
    for place, line in enumerate(lines):
        if line.startswith(TRACE_BEGINS):
            return "".join(lines[:place]), "".join(lines[place:])
    return said, ""


def fatal_line(trace: str) -> str:
    """Return the line of a trace that names the cause, or "".

    On Windows faulthandler also writes exceptions that a system library raises and catches itself.
    """
    headers = [line for line in trace.splitlines() if line.startswith(TRACE_BEGINS)]
    return next((line for line in reversed(headers) if not line.startswith(MAYBE_CAUGHT)), "")
