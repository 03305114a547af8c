"""Privacy of reports: removal of the home folder, of private settings and of secrets."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote

from app.core.storage.settings import Settings

PUBLIC_SETTINGS = frozenset({"format", *(each.key for each in Settings.described() if each.is_public)})
"""Keys of settings whose values are included in a report.

For all other settings, only the key is included. Future settings, such as network keys and access
codes, thus stay private unless their description says otherwise.
"""
OMITTED_TEXT = "(left out)"
_PATH_END = r"""(?=[\\/'":;,)\]}>\s]|\.(?=\s|$)|%2F|%5C|$)"""


def without_home(text: str, folder: Path | None = None) -> str:
    """Replace all spellings of the home folder with ``~``, including those in JSON and in URLs.

    Args:
        text: Text of the report.
        folder: Home folder; default: the home folder of the user.
    """
    home = str(folder if folder is not None else Path.home()).rstrip("/\\")
    if len(home) < 2:  # a home folder "/" would shorten every path
        return text
    slashes = home.replace("\\", "/")
    forms = {home, slashes, home.replace("\\", "\\\\"), quote(slashes), quote(slashes, safe="/:")}
    flags = re.IGNORECASE if os.name == "nt" else 0
    for form in sorted(forms, key=len, reverse=True):
        text = re.sub(re.escape(form) + _PATH_END, "~", text, flags=flags)
    return text


def reportable_settings(values: Mapping[str, object]) -> dict[str, object]:
    """Return the settings for a report: values of `PUBLIC_SETTINGS`, placeholders for all others."""
    return {
        name: value if name in PUBLIC_SETTINGS else OMITTED_TEXT for name, value in sorted(values.items())
    }
