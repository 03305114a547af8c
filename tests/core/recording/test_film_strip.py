"""A recording at a glance, and what part of it two times and some patterns mean."""

from __future__ import annotations

import pytest

from app.core.recording.film_strip import film_strip, part_of
from nep.errors import BadTopicError
from nep.messages.message import Message
from nep.recordings.export import Part
from tests.nep.recordings.messages import START_NS, STEP_NS, json_message, picture, record

COUNT = 40


@pytest.fixture
def look(tmp_path):
    """/odom every 10 ms, and every tenth time a picture, the last of which is none."""
    messages = [picture(seq) if seq % 10 == 5 else json_message(seq) for seq in range(COUNT)]
    messages[35] = Message("/camera", b"\xff\xd8none", "image", "image", stamp_ns=5, seq=9, publisher=9)
    record(tmp_path / "a.mcap", [messages])
    made = film_strip(tmp_path / "a.mcap", 4, 10, (24, 16))
    assert made is not None
    return made


def test_pictures_stand_in_the_middles_of_equal_parts(look):
    assert look.end_ns - look.start_ns >= (COUNT - 1) * STEP_NS
    assert len(look.pictures) == 4
    assert [each is not None for each in look.pictures[:3]] == [True] * 3
    first, second = (each.bgra.tobytes() for each in look.pictures[:2])
    assert first != second
    assert sum(look.counts) == COUNT
    assert [each.name for each in look.topics] == ["/camera", "/odom"]


def test_without_pictures_there_are_counts_and_what_is_none_is_not_there(tmp_path):
    record(tmp_path / "a.mcap", [[json_message(1)]])
    look = film_strip(tmp_path / "a.mcap", 4, 3, (24, 16))
    assert look is not None
    assert (look.pictures, look.counts) == ((), (1, 0, 0))
    (tmp_path / "none.mcap").write_bytes(b"nothing of the kind")
    record(tmp_path / "empty.mcap", [])
    for name in ("none", "empty", "gone"):
        assert film_strip(tmp_path / f"{name}.mcap", 4, 3, (24, 16)) is None


def test_a_part_has_both_its_ends_and_the_topics_that_fit(look):
    begin, end = START_NS + 3 * STEP_NS, START_NS + 9 * STEP_NS
    assert part_of(look, look.start_ns, look.end_ns, (), ()) == Part()
    assert part_of(look, 0, 2**64, (), ("/camera",)) == Part(None, None, ["/odom"])
    assert part_of(look, begin, end, ("/*a*",), ()) == Part(begin, end + 1, ["/camera"])
    assert part_of(look, begin, end, ("/nowhere",), ()).topics == []
    with pytest.raises(BadTopicError):
        part_of(look, begin, end, ("two words",), ())
