"""Functions of the category "Time": local date and time of this computer."""

from __future__ import annotations

from datetime import datetime

from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.values import text
from nep.i18n import _, lazy

__all__ = ["now", "seconds_since"]

_DAYS = (
    lazy("Monday"),
    lazy("Tuesday"),
    lazy("Wednesday"),
    lazy("Thursday"),
    lazy("Friday"),
    lazy("Saturday"),
    lazy("Sunday"),
)


def now(part: str) -> object:
    """Return one part of the current date and time.

    Args:
        part: "year", "month", "day", "hour", "minute", "second", "weekday" (1 for Monday), "day name",
            "date", "time" or "date and time".
    """
    return date_part(_now(), part)


def date_part(moment: datetime, part: str) -> object:
    """Return one part of a date and time; see `now`."""
    if part in ("year", "month", "day", "hour", "minute", "second"):
        return getattr(moment, part)
    if part == "weekday":
        return moment.isoweekday()
    if part == "day name":
        return _(_DAYS[moment.weekday()])
    return moment.strftime(_FORMATS[part])


def seconds_since(moment: object) -> float:
    """Return the seconds since a time of today, a date, or a date with time; negative for the future.

    Raises:
        BehaviourError: The text is not a date or time.
    """
    return round((_now() - parse_moment(text(moment), _now())).total_seconds(), 3)


def parse_moment(moment_text: str, today: datetime) -> datetime:
    """Parse a text such as “14:30”, “2026-11-23” or “2026-11-23 14:30:05”.

    Args:
        moment_text: Text.
        today: Date that is used if the text contains only a time.

    Raises:
        BehaviourError: The text is not a date or time.
    """
    normalized = moment_text.strip()
    if ":" in normalized and "-" not in normalized:
        width = 5 if normalized.count(":") == 1 else 8
        normalized = f"{today:%Y-%m-%d} {normalized.zfill(width)}"
    try:
        return datetime.fromisoformat(normalized).replace(tzinfo=None)
    except ValueError:
        message = _("“seconds since” needs a time such as 14:30 or a date such as 2026-11-23, not “{text}”.")
        raise BehaviourError(message.format(text=moment_text[:60])) from None


_FORMATS = {"date": "%Y-%m-%d", "time": "%H:%M", "date and time": "%Y-%m-%d %H:%M:%S"}


def _now() -> datetime:
    return datetime.now().astimezone().replace(tzinfo=None)
