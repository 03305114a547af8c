"""Formatting of times and durations."""

from __future__ import annotations

import time


def local_midnight_ns(at_ns: int) -> int:
    """Return a time (ns since 1970) at which a local day starts, from which ruler marks are counted.

    Args:
        at_ns: Time that determines the UTC offset.
    """
    return -(time.localtime(at_ns // 1_000_000_000).tm_gmtoff or 0) * 1_000_000_000


def duration_text(ns: int, *, digits: int = 3) -> str:
    """Format a duration, such as "7:26.412", "0:00" or "1:02:03".

    Args:
        ns: Duration in ns.
        digits: Number of decimals of the seconds.
    """
    sign, ns = ("-", -ns) if ns < 0 else ("", ns)
    unit = 10 ** (9 - digits)
    total_s, fraction = divmod(ns // unit, 10**digits)
    minutes, seconds = divmod(total_s, 60)
    hours, minutes = divmod(minutes, 60)
    text = f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"
    return f"{sign}{text}.{fraction:0{digits}d}" if digits else f"{sign}{text}"


def clock_text(at_ns: int, *, digits: int = 3) -> str:
    """Format a local time of day, such as "15:09:37.412".

    Args:
        at_ns: Time in ns since 1970.
        digits: Number of decimals of the seconds.
    """
    seconds, fraction = divmod(at_ns, 1_000_000_000)
    local_time = time.localtime(seconds)
    text = f"{local_time.tm_hour}:{local_time.tm_min:02d}:{local_time.tm_sec:02d}"
    return f"{text}.{fraction // 10 ** (9 - digits):0{digits}d}" if digits else text


def date_text(at_ns: int) -> str:
    """Format a local date, such as "2026-11-17"."""
    return time.strftime("%Y-%m-%d", time.localtime(at_ns // 1_000_000_000))
