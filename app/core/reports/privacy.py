"""What leaves this computer in a report, and what does not: the home folder's name, settings, secrets."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote

HARMLESS = frozenset({
    "begun", "first_steps", "format", "high_contrast", "language", "layout", "less_motion", "robots_heard",
    "shortcuts", "text_percent", "theme", "toolbox_pinned", "virtual_robots_come_back", "window",
})  # fmt: skip
"""The settings that go into a report. Of all others only the names do: what a later version keeps here, say
keys of networks and access codes, stays here until somebody has thought about it."""
LEFT_OUT = "(left out)"
_END = r"""(?=[\\/'":;,)\]}>\s]|\.(?=\s|$)|%2F|%5C|$)"""


def without_home(text: str, folder: Path | None = None) -> str:
    """The text with ``~`` for the home folder, however that is written: also in JSON, or in a URL."""
    home = str(folder if folder is not None else Path.home()).rstrip("/\\")
    if len(home) < 2:  # the home of nobody is the root: every path would be shortened
        return text
    slashes = home.replace("\\", "/")
    forms = {home, slashes, home.replace("\\", "\\\\"), quote(slashes), quote(slashes, safe="/:")}
    flags = re.IGNORECASE if os.name == "nt" else 0
    for form in sorted(forms, key=len, reverse=True):
        text = re.sub(re.escape(form) + _END, "~", text, flags=flags)
    return text


def shown_settings(values: Mapping[str, object]) -> dict[str, object]:
    """The settings as a report has them: harmless ones whole, of all others the names."""
    return {name: value if name in HARMLESS else LEFT_OUT for name, value in sorted(values.items())}
