"""Tests of the film strip of a recording, and of selecting a part by times and topic patterns."""

from __future__ import annotations

from dataclasses import replace

import pytest
from mcap.writer import Writer

from app.core.recording.film_strip import read_preview, select_part
from app.core.recording.opener import LocalOpener
from nep.errors import BadTopicError
from nep.messages.message import Message
from nep.recordings.export import Part
from nep.recordings.reader import Recording
from tests.nep.recordings.messages import START_NS, STEP_NS, json_message, picture, record

COUNT = 40


@pytest.fixture
def look(tmp_path):
    """Film strip of a recording with ``/odom`` every 10 ms and every tenth message an image, one invalid."""
    messages = [picture(seq) if seq % 10 == 5 else json_message(seq) for seq in range(COUNT)]
    messages[35] = Message("/camera", b"\xff\xd8none", "image", "image", stamp_ns=5, seq=9, publisher=9)
    record(tmp_path / "a.mcap", [messages])
    made = read_preview(tmp_path / "a.mcap", 4, 10, (24, 16), LocalOpener())
    assert made is not None
    return made


def test_film_strip_has_different_thumbnails_and_counts_every_message(look):
    assert look.end_ns - look.start_ns >= (COUNT - 1) * STEP_NS
    assert len(look.pictures) == 4
    assert [each is not None for each in look.pictures[:3]] == [True] * 3
    first, second = (each.bgra.tobytes() for each in look.pictures[:2])
    assert first != second
    assert sum(look.counts) == COUNT
    assert [each.name for each in look.topics] == ["/camera", "/odom"]


def test_film_strip_without_images_has_counts_and_unreadable_or_empty_file_has_no_film_strip(tmp_path):
    record(tmp_path / "a.mcap", [[json_message(1)]])
    look = read_preview(tmp_path / "a.mcap", 4, 3, (24, 16), LocalOpener())
    assert look is not None
    assert (look.pictures, look.counts) == ((), (1, 0, 0))
    (tmp_path / "none.mcap").write_bytes(b"nothing of the kind")
    record(tmp_path / "empty.mcap", [])
    for name in ("none", "empty", "gone"):
        assert read_preview(tmp_path / f"{name}.mcap", 4, 3, (24, 16), LocalOpener()) is None


def test_part_includes_both_ends_and_matching_topics(look):
    begin, end = START_NS + 3 * STEP_NS, START_NS + 9 * STEP_NS
    assert select_part(look, look.start_ns, look.end_ns, (), ()) == Part()
    assert select_part(look, 0, 2**64, (), ("/camera",)) == Part(None, None, ["/odom"])
    assert select_part(look, begin, end, ("/*a*",), ()) == Part(begin, end + 1, ["/camera"])
    assert select_part(look, begin, end, ("/nowhere",), ()).topics == []
    with pytest.raises(BadTopicError):
        select_part(look, begin, end, ("two words",), ())


def test_topic_sizes_are_exact_and_part_size_is_proportional(look):
    with Recording(look.path) as recording:
        sizes: dict[str, list[int]] = {}
        for _log_ns, message in recording.read():
            sizes.setdefault(message.topic, []).append(message.size_bytes)
    both = {"/odom", "/camera"}
    for topic in look.topics:
        assert look.size_of(topic) == pytest.approx(sum(sizes[topic.name]))
    count, size = look.estimate_messages(look.start_ns, look.end_ns, both)
    assert (count, size) == (COUNT, pytest.approx(sum(map(sum, sizes.values()))))
    middle = (look.start_ns + look.end_ns) // 2
    halves = [look.estimate_messages(*ends, both) for ends in ((0, middle), (middle, 2**64))]
    assert [each[0] for each in halves] == [pytest.approx(COUNT / 2, abs=2)] * 2
    assert sum(each[1] for each in halves) == pytest.approx(size)
    assert look.estimate_messages(look.start_ns, look.end_ns, ()) == (0, 0)
    assert look.estimate_messages(middle, middle - 1, both)[0] == pytest.approx(0)
    assert look.estimate_messages(2**64, 2**65, both) == (0, 0)


def test_sizes_of_recording_without_statistics_are_sampled(tmp_path):
    path = tmp_path / "theirs.mcap"
    with path.open("wb") as file:  # by another program: without statistics
        writer = Writer(file)
        writer.start()
        channels = [writer.register_channel(topic, "json", 0) for topic in ("/few", "/many", "/none")]
        writer.add_message(channels[0], 5, b"{}", 5)
        for at_ns in range(1, 100):
            writer.add_message(channels[1], at_ns, b"1" * 50, at_ns)
        writer.finish()
    look = read_preview(path, 0, 10, (24, 16), LocalOpener())
    assert look is not None
    assert [(each.name, look.size_of(each)) for each in look.topics] == [
        ("/few", 2),
        ("/many", 99 * 50),
        ("/none", None),
    ]
    unknown = replace(look, message_bytes={"/few": 2.0})
    assert unknown.estimate_messages(0, 100, ("/few",)) == (1, 2)
    assert unknown.estimate_messages(0, 100, ("/few", "/many")) == (100, None)
