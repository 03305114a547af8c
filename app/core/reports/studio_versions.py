"""Which versions of Studio ran here, and since when: what went wrong after an update is looked for there."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping

from nep.version import __version__

KEY = "studio_versions"
"""The name of the setting: the versions, the newest last, each with the time of its first start (epoch s)."""
MOST = 10
PLAIN = re.compile(r"[0-9A-Za-z][0-9A-Za-z.+-]{0,39}")
"""What a version looks like; nothing else is taken out of a file."""
EARLIER = "earlier"
"""Stands for the versions that kept settings, but not yet this; they began at no known time (0)."""
_LATEST_S = 1e10
"""No time is later: a damaged file may have one that no calendar can show."""

Kept = list[dict[str, object]]


def plain_version(value: object) -> str:
    """What a file says of a version; "" for what is none."""
    return value if isinstance(value, str) and PLAIN.fullmatch(value) else ""


def known(values: Mapping[str, object]) -> list[tuple[str, float]]:
    """The versions in the settings and their first starts (epoch s), the newest last; no damaged one."""
    entries = values.get(KEY)
    found = []
    for entry in entries if isinstance(entries, list) else ():
        if not isinstance(entry, Mapping):
            continue
        version, since = plain_version(entry.get("version")), entry.get("since_s")
        if (
            isinstance(since, int | float)
            and not isinstance(since, bool)
            and 0 <= since <= _LATEST_S
            and version
        ):
            found.append((version, float(since)))
    return found[-MOST:]


def with_this_version(
    values: Mapping[str, object], now_s: float, *, is_first: bool, version: str = __version__
) -> Kept | None:
    """What to keep now that this version runs; None when it ran last, too.

    ``is_first``: no Studio ran here before.
    """
    before = known(values) or ([] if is_first else [(EARLIER, 0.0)])
    if before and before[-1][0] == version:
        return None
    return [{"version": each, "since_s": s} for each, s in [*before, (version, now_s)][-MOST:]]


def used_here(values: Mapping[str, object]) -> str:
    """The versions in one line, for developers: "0.0.9 since 2026-11-02, 0.1.0 since 2026-11-27"."""
    told = [
        f"{version} since {time.strftime('%Y-%m-%d', time.gmtime(since_s))}" if since_s else version
        for version, since_s in known(values)
    ]
    return ", ".join(told) or "unknown"
