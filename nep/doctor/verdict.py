"""One finding of the doctor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding", "Severity", "ago", "counted"]

Severity = Literal["error", "warning", "info", "ok"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at: how bad it is, a sentence, and what to do next ("" when nothing).

    `id` begins with what it is about ("master:none", "port:7000"). `command` can be typed in a terminal.
    """

    id: str
    severity: Severity
    sentence: str
    mend: str = ""
    command: str = ""

    @property
    def as_error(self) -> str:
        """The finding as an error's sentence: lower case, no full stop, the next step after a semicolon."""
        first = self.sentence.rstrip(".")
        step = self.mend.rstrip(".")
        words = f"{first}; {step[:1].lower()}{step[1:]}" if step else first
        return words[:1].lower() + words[1:]


def counted(count: int, one: str) -> str:
    """How many there are, as in "1 node", "2 nodes"."""
    return f"{count} {one}" if count == 1 else f"{count} {one}s"


def ago(seconds: float) -> str:
    """How long something has been running."""
    if seconds < 90:
        return f"{max(0, round(seconds))} s"
    if seconds < 5400:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h" if seconds < 172_800 else f"{round(seconds / 86_400)} days"
