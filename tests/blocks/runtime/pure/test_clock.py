from __future__ import annotations

from datetime import datetime, timedelta

import pytest

from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.pure import clock
from app.blocks.runtime.scheduler import Scheduler
from app.clock import VirtualClock
from tests.blocks.fakes import play
from tests.blocks.samples import block, started, text, workspace, write

MOMENT = datetime.fromisoformat("2026-11-23 07:05:09")


def test_date_parts_are_extracted():
    told = {part: clock.date_part(MOMENT, part) for _words, part in PARTS}
    assert told == {
        "year": 2026, "month": 11, "day": 23, "weekday": 1, "day name": "Monday", "hour": 7, "minute": 5,
        "second": 9, "date": "2026-11-23", "time": "07:05", "date and time": "2026-11-23 07:05:09",
    }  # fmt: skip


def options():
    from app.blocks.categories.sensing import CATEGORY

    (block_of_now,) = [each for each in CATEGORY.blocks if each.type == "sensing_now"]
    return block_of_now.argument("PART").options


PARTS = options()


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("14:30", "2026-11-23 14:30:00"),
        ("7:30", "2026-11-23 07:30:00"),
        ("7:30:05", "2026-11-23 07:30:05"),
        (" 2026-11-22 ", "2026-11-22 00:00:00"),
        ("2026-11-22 14:30:05", "2026-11-22 14:30:05"),
    ],
)
def test_common_date_formats_are_parsed(written, expected):
    assert str(clock.parse_moment(written, MOMENT)) == expected


@pytest.mark.parametrize(
    "wrong", ["", "soon", "25:00", "2026-13-01", "-1", "0", "18446744073709551615", "nan", "👍"]
)
def test_invalid_date_is_rejected_with_explanation(wrong):
    with pytest.raises(BehaviourError, match="needs a time such as 14:30"):
        clock.parse_moment(wrong, MOMENT)


def test_seconds_since_is_positive_for_past_and_negative_for_future():
    moment = str(clock.now("date and time"))
    assert 0 <= clock.seconds_since(moment) < 60
    later = datetime.fromisoformat(moment) + timedelta(days=1)
    assert clock.seconds_since(f"{later:%Y-%m-%d %H:%M:%S}") < 0


def test_timer_counts_and_resets():
    run = play(
        workspace(
            started(
                block("control_wait", SECONDS=block("values_number", NUMBER=0.2)),
                write(block("sensing_timer")),
                block("sensing_reset"),
                write(block("sensing_timer")),
                write(block("sensing_seconds_since", "since", MOMENT=text("soon"))),
            )
        )
    )
    before, after = map(float, run.lines)
    assert before >= 0.2 > after >= 0
    assert run.runtime.error is not None
    assert run.runtime.error.block == "since"


def test_script_clock_stops_while_paused():
    clock = VirtualClock(advances_alone=False)
    scheduler = Scheduler(clock)
    began = scheduler.running_time_s()
    clock.advance(2)
    scheduler.pause()
    scheduler.pause()
    clock.advance(100)
    assert scheduler.running_time_s() - began == 2
    scheduler.resume()
    clock.advance(1)
    assert scheduler.running_time_s() - began == 3
