"""Formatting of dates and times."""

from __future__ import annotations

import datetime as dt

from nep.i18n import _, day_text


def relative_day_text(moment: dt.datetime, now: dt.datetime) -> str:
    """Format a date relative to now, such as "Today, 8:12", "Yesterday" or "17 November 2025"."""
    days = (now.date() - moment.date()).days
    if days == 0:
        return _("Today, {clock}").format(clock=clock_text(moment))
    if days == 1:
        return _("Yesterday")
    return day_text(moment.day, moment.month, moment.year if moment.year != now.year else None)


def date_time_text(moment: dt.datetime, now: dt.datetime) -> str:
    """Format a date and time relative to now, such as "Today, 8:12" or "17 November, 8:12"."""
    day = relative_day_text(moment, now)
    if moment.date() == now.date():
        return day
    return _("{day}, {clock}").format(day=day, clock=clock_text(moment))


def last_seen_text(moment: dt.datetime, now: dt.datetime) -> str:
    """Format the time at which something was last seen, such as "seen today, 8:12"."""
    clock = clock_text(moment)
    days = (now.date() - moment.date()).days
    if days == 0:
        return _("seen today, {clock}").format(clock=clock)
    if days == 1:
        return _("seen yesterday, {clock}").format(clock=clock)
    return _("seen {day}, {clock}").format(day=relative_day_text(moment, now), clock=clock)


def clock_text(moment: dt.datetime) -> str:
    """Format a time of day, such as "8:12"."""
    return f"{moment.hour}:{moment.minute:02d}"
