"""Crash records: which part of Studio crashed, the cause, and its output.

The code that detects a crash logs it. A log record with the ``extra`` of `crash_extra` is also stored
as a crash report (`app.core.reports.crash_reports.CrashLog`).
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
"""Signals that indicate a crash. The system sends SIGKILL when it runs out of memory."""
MIN_CRASH_STATUS = 0xC0000000
"""Lowest exit code on Windows that indicates a crash; such exit codes are NTSTATUS values."""
CTRL_C_STATUS = 0xC000013A
"""Exit code on Windows after Ctrl+C or when the user logs out. Not a crash."""
STATUS_TEXTS = {
    0xC0000005: "access violation",
    0xC000001D: "illegal instruction",
    0xC0000094: "division by zero",
    0xC00000FD: "stack overflow",
    0xC0000374: "damaged heap",
    0xC0000409: "abort",
}
TRACE_PREFIXES = ("Fatal Python error:", "Windows fatal exception:")
"""First words of a stack trace written by Python's faulthandler."""
CAUGHT_EXCEPTION_PREFIX = "Windows fatal exception: code "


@dataclass(frozen=True, slots=True)
class Crash:
    """Crash of a part of Studio.

    Attributes:
        part: Part that crashed.
        cause: Cause, in English.
        text: Details such as a traceback.
        version: Version of Studio that crashed, which may be older than the running version.
    """

    part: Part
    cause: str
    text: str = ""
    version: str = __version__


def crash_extra(part: Part, cause: str, text: str = "") -> dict[str, object]:
    """Return the ``extra`` argument for a log record about a crash.

    Args:
        part: Part that crashed.
        cause: Cause, in English.
        text: Details such as a traceback.
    """
    return {"crash": Crash(part, cause, text)}


def is_crash(code: int) -> bool:
    """Return True if an exit code indicates a crash. Negative codes are signal numbers."""
    if code < 0:
        return -code in CRASH_SIGNALS
    return code >= MIN_CRASH_STATUS and code != CTRL_C_STATUS


def exit_text(code: int) -> str:
    """Describe an exit code in English, such as "ended by signal 11 (SIGSEGV)"."""
    if code < 0:
        try:
            name = f" ({signal.Signals(-code).name})"
        except ValueError:
            name = ""
        return f"ended by signal {-code}{name}"
    if code >= MIN_CRASH_STATUS:
        text = STATUS_TEXTS.get(code)
        return f"ended with the status 0x{code:08X}" + (f" ({text})" if text else "")
    return f"ended with the code {code}"


def split_trace(output: str) -> tuple[str, str]:
    """Split the output of a process into normal output and faulthandler's stack trace ("" if none)."""
    lines = output.splitlines(keepends=True)
    for index, line in enumerate(lines):
        if line.startswith(TRACE_PREFIXES):
            return "".join(lines[:index]), "".join(lines[index:])
    return output, ""


def fatal_line(trace: str) -> str:
    """Return the line of a stack trace that states the cause of the crash, or "".

    On Windows, faulthandler also writes exceptions that a system library raises and handles itself.
    """
    headers = [line for line in trace.splitlines() if line.startswith(TRACE_PREFIXES)]
    return next((line for line in reversed(headers) if not line.startswith(CAUGHT_EXCEPTION_PREFIX)), "")
