"""Finding of the doctor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from nep.i18n import _, ngettext, number

__all__ = ["Finding", "Severity", "ago", "with_process"]

Severity = Literal["error", "warning", "info", "ok"]


@dataclass(frozen=True)
class Finding:
    """Result of one check: severity, sentence, and the next step ("" if none).

    `id` starts with its subject ("master:none", "ports:taken"). `command` can be run in a terminal. `instead`
    is a suggested name: of a similar topic, or of a service to call.
    """

    id: str
    severity: Severity
    sentence: str
    fix: str = ""
    command: str = ""
    instead: str = ""

    @property
    def as_error(self) -> str:
        """Finding formatted as an error: lower case, no full stop, the next step after a semicolon."""
        first = self.sentence.rstrip(".")
        step = self.fix.rstrip(".")
        words = f"{first}; {step[:1].lower()}{step[1:]}" if step else first
        return words[:1].lower() + words[1:]


def ago(seconds: float) -> str:
    """Format how long something has been running."""
    if seconds < 90:
        return f"{max(0, round(seconds))} s"
    if seconds < 5400:
        return f"{round(seconds / 60)} min"
    if seconds < 172_800:
        return f"{number(seconds / 3600, '.1f')} h"
    days = round(seconds / 86_400)
    return ngettext("{count} day", "{count} days", days).format(count=days)


def with_process(words: str, pid: int | None) -> str:
    """Append the process id to a description of a program, if known."""
    return words if pid is None else _("{program} (process {pid})").format(program=words, pid=pid)
