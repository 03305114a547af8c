"""`Finding`: result of one of the doctor's checks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from nep.i18n import _, ngettext, number

Severity = Literal["error", "warning", "info", "ok"]


@dataclass(frozen=True)
class Finding:
    """Result of one check.

    Attributes:
        id: Subject and name of the finding, such as "master:none" or "ports:taken".
        severity: "error", "warning", "info" or "ok".
        sentence: Description of the result.
        fix: Next step for the user; "" if there is none.
        command: Terminal command for the next step, or "".
        instead: Name of a similar topic to use, or of a service to call, or "".
    """

    id: str
    severity: Severity
    sentence: str
    fix: str = ""
    command: str = ""
    instead: str = ""

    @property
    def error_message(self) -> str:
        """Finding in the form of an error message: lower case, hint after a semicolon, no full stop."""
        first = self.sentence.rstrip(".")
        step = self.fix.rstrip(".")
        message = f"{first}; {step[:1].lower()}{step[1:]}" if step else first
        return message[:1].lower() + message[1:]


def duration_text(seconds: float) -> str:
    """Format a duration in the largest suitable unit, such as "45 s" or "3 days"."""
    if seconds < 90:
        return f"{max(0, round(seconds))} s"
    if seconds < 5400:
        return f"{round(seconds / 60)} min"
    if seconds < 172_800:
        return f"{number(seconds / 3600, '.1f')} h"
    days = round(seconds / 86_400)
    return ngettext("{count} day", "{count} days", days).format(count=days)


def with_process(program: str, pid: int | None) -> str:
    """Append a process id to the name of a program; return the name alone if the id is None."""
    return program if pid is None else _("{program} (process {pid})").format(program=program, pid=pid)
