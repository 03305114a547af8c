"""One finding of the doctor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from nep.i18n import _, ngettext, number

__all__ = ["Finding", "Severity", "ago", "with_process"]

Severity = Literal["error", "warning", "info", "ok"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at: how bad it is, a sentence, and what to do next ("" when nothing).

    `id` begins with what it is about ("master:none", "ports:taken"). `command` can be typed in a terminal.
    `instead` is the name that would do: of the topic that is meant, of the service to be called.
    """

    id: str
    severity: Severity
    sentence: str
    mend: str = ""
    command: str = ""
    instead: str = ""

    @property
    def as_error(self) -> str:
        """The finding as an error's sentence: lower case, no full stop, the next step after a semicolon."""
        first = self.sentence.rstrip(".")
        step = self.mend.rstrip(".")
        words = f"{first}; {step[:1].lower()}{step[1:]}" if step else first
        return words[:1].lower() + words[1:]


def ago(seconds: float) -> str:
    """How long something has been running."""
    if seconds < 90:
        return f"{max(0, round(seconds))} s"
    if seconds < 5400:
        return f"{round(seconds / 60)} min"
    if seconds < 172_800:
        return f"{number(seconds / 3600, '.1f')} h"
    days = round(seconds / 86_400)
    return ngettext("{count} day", "{count} days", days).format(count=days)


def with_process(words: str, pid: int | None) -> str:
    """Return what a program is called or where it is, with its process where that is known."""
    return words if pid is None else _("{program} (process {pid})").format(program=words, pid=pid)
