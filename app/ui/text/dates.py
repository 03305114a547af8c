"""Days and times as people say them."""

from __future__ import annotations

import datetime as dt


def day_words(then: dt.datetime, now: dt.datetime) -> str:
    """Say "Today, 8:12", "Yesterday", "17 November", "17 November 2025"."""
    days = (now.date() - then.date()).days
    if days == 0:
        return f"Today, {then.hour}:{then.minute:02d}"
    if days == 1:
        return "Yesterday"
    words = f"{then.day} {then:%B}"
    return words if then.year == now.year else f"{words} {then.year}"


def when_words(then: dt.datetime, now: dt.datetime) -> str:
    """Say "Today, 8:12", "Yesterday, 8:12", "17 November, 8:12"."""
    day = day_words(then, now)
    return day if then.date() == now.date() else f"{day}, {then.hour}:{then.minute:02d}"
