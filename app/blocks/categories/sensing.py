"""Category Time: the timer, and the current date and time."""

from __future__ import annotations

from functools import partial

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ChoiceField, ValueInput

_value = partial(Block, shape="value", style="values")

_DATE_PARTS = (
    ("year", "year"),
    ("month", "month"),
    ("day of the month", "day"),
    ("day of the week", "weekday"),
    ("weekday name", "day name"),
    ("hour", "hour"),
    ("minute", "minute"),
    ("second", "second"),
    ("date", "date"),
    ("time", "time"),
    ("date and time", "date and time"),
)

CATEGORY = Category(
    name="sensing",
    title="Time",
    style="values",
    icon="clock",
    order=37,
    parent="numbers",
    blocks=(
        _value(
            "sensing_timer",
            "timer",
            icon="timer",
            tooltip="Seconds since the run started or the timer was reset.",
            help="The timer stops while the behaviour is paused.",
            example="For example: when timer is above 60, say “The minute is over”.",
            python="timer()",
            check="Number",
            search_words="stopwatch, seconds, since, time, elapsed, chronometer, clock",
        ),
        Block(
            type="sensing_reset",
            text="reset timer",
            shape="statement",
            style="values",
            icon="timer-reset",
            tooltip="Resets the timer to 0; it starts counting again immediately.",
            example="For example: reset timer, wait for a touch, say timer.",
            python="reset_timer()",
            search_words="stopwatch, start, zero, seconds, restart, clear, chronometer",
        ),
        _value(
            "sensing_now",
            "%PART now",
            icon="calendar-clock",
            tooltip="The date and time of this computer.",
            help="The day of the week is 1 for Monday. “date” has the format 2026-11-23, “time” the "
            "format 14:30.",
            example="For example: if “hour now” is below 12, say “Good morning”.",
            python="now(%PART)",
            arguments=(ChoiceField("PART", _DATE_PARTS),),
            can_fail=False,
            search_words="current, today, clock, weekday, calendar, date, time, hour, day",
        ),
        _value(
            "sensing_seconds_since",
            "seconds since %MOMENT",
            icon="hourglass",
            tooltip="Seconds since a time or date; negative if it is in the future.",
            help="Write a time as 14:30, a date as 2026-11-23, or both separated by a space. To measure "
            "how long something takes, first set a variable to “date and time now”.",
            example="For example: if seconds since 14:30 is above 0, say “The lesson is over”.",
            python="seconds_since(%MOMENT)",
            arguments=(ValueInput("MOMENT", None, "14:30"),),
            check="Number",
            search_words="elapsed, difference, until, age, duration, days since",
        ),
    ),
)
