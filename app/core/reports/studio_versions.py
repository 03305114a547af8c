"""History of the Studio versions used on this computer, for diagnosing problems after an update."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence

from nep.version import __version__

MAX_VERSIONS = 10
VERSION_PATTERN = re.compile(r"[0-9A-Za-z][0-9A-Za-z.+-]{0,39}")
"""Pattern of a valid version; anything else in a file is ignored."""
UNKNOWN_VERSION = "earlier"
"""Placeholder for versions used before this setting existed; their start time is 0."""
_MAX_TIME_S = 1e10
"""Latest valid time in seconds since 1970.

A damaged file may contain a time that the calendar doesn't support.
"""

VersionEntries = Sequence[Mapping[str, object]]
"""Versions and the times of their first start, newest last, as stored in the settings."""


def parse_version(value: object) -> str:
    """Return a version read from a file, or "" if it is invalid."""
    return value if isinstance(value, str) and VERSION_PATTERN.fullmatch(value) else ""


def known_versions(entries: VersionEntries) -> list[tuple[str, float]]:
    """Return the valid versions and the times of their first start in seconds since 1970, newest last."""
    versions = []
    for entry in entries:
        version, since_s = parse_version(entry.get("version")), entry.get("since_s")
        if (
            isinstance(since_s, int | float)
            and not isinstance(since_s, bool)
            and 0 <= since_s <= _MAX_TIME_S
            and version
        ):
            versions.append((version, float(since_s)))
    return versions[-MAX_VERSIONS:]


def add_this_version(
    entries: VersionEntries, now_s: float, *, is_first: bool, version: str = __version__
) -> VersionEntries | None:
    """Return the updated setting that includes this version; None if this version is already the newest.

    Args:
        entries: Current setting.
        now_s: Current time in seconds since 1970.
        is_first: True if Studio was never started on this computer before.
        version: Version to add.
    """
    earlier_versions = known_versions(entries) or ([] if is_first else [(UNKNOWN_VERSION, 0.0)])
    if earlier_versions and earlier_versions[-1][0] == version:
        return None
    return [
        {"version": each, "since_s": since_s}
        for each, since_s in [*earlier_versions, (version, now_s)][-MAX_VERSIONS:]
    ]


def format_versions(entries: VersionEntries) -> str:
    """Format the versions for developers, such as "0.0.9 since 2026-11-02, 0.1.0 since 2026-11-27"."""
    versions = [
        f"{version} since {time.strftime('%Y-%m-%d', time.gmtime(since_s))}" if since_s else version
        for version, since_s in known_versions(entries)
    ]
    return ", ".join(versions) or "unknown"
