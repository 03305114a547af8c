"""Category Time: the timer, and the current date and time."""

from __future__ import annotations

from functools import partial

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ChoiceField, ValueInput

_value = partial(Block, shape="value", style="values")

_PARTS = (
    ("year", "year"),
    ("month", "month"),
    ("day of the month", "day"),
    ("day of the week", "weekday"),
    ("name of the day", "day name"),
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
    within="numbers",
    blocks=(
        _value(
            "sensing_timer",
            "timer",
            icon="timer",
            tooltip="How many seconds have gone by since Run, or since the timer was reset.",
            help="It stands still while the behaviour is paused.",
            python="timer()",
            check="Number",
            words="stopwatch, seconds, since, time, elapsed, chronometer, clock",
        ),
        Block(
            type="sensing_reset",
            text="reset timer",
            shape="statement",
            style="values",
            icon="timer-reset",
            tooltip="Sets the timer to 0; it begins to count again at once.",
            python="reset_timer()",
            words="stopwatch, start, zero, seconds, restart, clear, chronometer",
        ),
        _value(
            "sensing_now",
            "%PART now",
            icon="calendar-clock",
            tooltip="The date and time of this computer.",
            help="Day 1 of the week is Monday. “date” looks like 2026-11-23, “time” like 14:30.",
            python="now(%PART)",
            arguments=(ChoiceField("PART", _PARTS),),
            fails=False,
            words="current, today, clock, weekday, calendar, date, time, hour, day",
        ),
        _value(
            "sensing_seconds_since",
            "seconds since %MOMENT",
            icon="hourglass",
            tooltip="How many seconds have gone by since a time or date; below 0 when it is still to come.",
            help="The time is written like 14:30, the date like 2026-11-23, or both with a space between. To "
            "measure how long something takes, set a variable to “date and time now” first.",
            python="seconds_since(%MOMENT)",
            arguments=(ValueInput("MOMENT", None, "14:30"),),
            check="Number",
            words="elapsed, difference, until, age, duration, days since",
        ),
    ),
)
