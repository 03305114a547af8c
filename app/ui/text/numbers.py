"""Formatting of numbers with units, and of keyboard shortcuts."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping

from nep.i18n import _, number, plazy

MAC_KEYS = {"Meta": "⌃", "Alt": "⌥", "Shift": "⇧", "Ctrl": "⌘"}
KEY_LABELS = {
    "Alt": plazy("key", "Alt"),
    "Backspace": plazy("key", "Backspace"),
    "Ctrl": plazy("key", "Ctrl"),
    "Del": plazy("key", "Del"),
    "Delete": plazy("key", "Delete"),
    "Down": plazy("key", "Down"),
    "End": plazy("key", "End"),
    "Enter": plazy("key", "Enter"),
    "Esc": plazy("key", "Esc"),
    "Home": plazy("key", "Home"),
    "Ins": plazy("key", "Ins"),
    "Left": plazy("key", "Left"),
    "Meta": plazy("key", "Meta"),
    "PgDown": plazy("key", "PgDown"),
    "PgUp": plazy("key", "PgUp"),
    "Return": plazy("key", "Return"),
    "Right": plazy("key", "Right"),
    "Shift": plazy("key", "Shift"),
    "Space": plazy("key", "Space"),
    "Tab": plazy("key", "Tab"),
    "Up": plazy("key", "Up"),
}
"""Labels of keys by Qt's names. Letters and function keys are the same in all languages."""
_KEY_NAME_PATTERN = re.compile(r"[A-Z][A-Za-z]+")
THIN_SPACE = "\u2009"  # thin space, as thousands separator


def rate_text(rate_hz: float | None) -> str:
    """Format a rate in Hz without a unit, such as "30.0", "0.4" or "1 204"; "" for None."""
    if rate_hz is None:
        return ""
    return number(rate_hz, ".1f") if rate_hz < 1000 else group_digits(round(rate_hz))


def bandwidth_text(bytes_per_s: float | None) -> str:
    """Format a bandwidth, such as "92 B/s", "1.6 kB/s" or "5.1 MB/s"; "" for None."""
    return "" if bytes_per_s is None else f"{size_text(bytes_per_s)}/s"


def size_text(size_bytes: float) -> str:
    """Format a size, such as "412 B", "1.6 kB", "46 kB" or "5.1 MB"."""
    if size_bytes < 1000:
        return f"{round(size_bytes)} B"
    value, unit = size_bytes / 1000, "kB"
    for larger_unit in ("MB", "GB", "TB"):
        if value < 999.5:
            break
        value, unit = value / 1000, larger_unit
    return f"{number(value, '.1f')} {unit}" if value < 9.95 else f"{round(value)} {unit}"


def age_text(age_s: float | None) -> str:
    """Format an age, such as "12 ms", "0.4 s", "6 s", "2 min" or "3 h"; "" for None."""
    if age_s is None:
        return ""
    if age_s < 0.0995:
        return f"{round(age_s * 1000)} ms"
    if age_s < 2.95:
        return f"{number(age_s, '.1f')} s"
    if age_s < 60:
        return f"{round(age_s)} s"
    return f"{round(age_s / 60)} min" if age_s < 3600 else f"{round(age_s / 3600)} h"


def latency_text(latency_s: float) -> str:
    """Format a latency, such as "0.6 ms", "41 ms" or "1.2 s"."""
    if latency_s < 0.00995:
        return f"{number(latency_s * 1000, '.1f')} ms"
    return f"{round(latency_s * 1000)} ms" if latency_s < 0.9995 else f"{number(latency_s, '.1f')} s"


def group_digits(count: int) -> str:
    """Format a count with thin spaces as thousands separators, such as "18 204"."""
    return f"{count:,}".replace(",", THIN_SPACE)


def seconds_text(value_s: float) -> str:
    """Format a duration, such as "0.4 s", "14 s" or "2 min"."""
    if value_s < 10:
        return f"{number(value_s, '.1f')} s"
    return f"{round(value_s)} s" if value_s < 120 else f"{round(value_s / 60)} min"


def shortcut_text(shortcut: str, platform: str = sys.platform) -> str:
    """Format shortcuts in the style of the platform, such as "Ctrl+Shift+S", or "⇧⌘S" on macOS.

    Args:
        shortcut: Shortcuts in Qt's portable format, separated by ", "; Ctrl stands for Cmd on macOS.
        platform: Value of `sys.platform`.
    """
    if platform != "darwin":
        return _translate_keys(shortcut, {})
    return ", ".join(_mac_key(each) for each in shortcut.split(", "))


def _mac_key(shortcut: str) -> str:
    # In the order of menus on a Mac.
    *modifiers, key = re.split(r"\+(?=.)", shortcut)
    return "".join(sign for name, sign in MAC_KEYS.items() if name in modifiers) + _translate_keys(
        key, MAC_KEYS
    )


def tip_with_key(tip: str, shortcut: str, platform: str = sys.platform) -> str:
    """Append a shortcut to a tooltip, such as "Save (Ctrl+S)", or "Save (⌘S)" on macOS.

    Args:
        tip: Text of the tooltip.
        shortcut: Shortcut in Qt's portable format, or "" for none.
        platform: Value of `sys.platform`.
    """
    return f"{tip} ({shortcut_text(shortcut, platform)})" if shortcut else tip


def _translate_keys(shortcut: str, signs: Mapping[str, str]) -> str:
    return _KEY_NAME_PATTERN.sub(lambda key: signs.get(key[0]) or _(KEY_LABELS.get(key[0], key[0])), shortcut)


def length_text(seconds: float) -> str:
    """Format a duration of a recording, such as "0:42", "12:04" or "1:32:10"."""
    total_s = int(seconds) if 0 <= seconds < 1e9 else 0
    minutes, remaining_s = divmod(total_s, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{remaining_s:02d}" if hours else f"{minutes}:{remaining_s:02d}"
