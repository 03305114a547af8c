"""Tests that lost messages are found without reading the whole recording."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import pytest

from app.core.recording.replay.density import losses_of
from nep.recordings import file_reader
from nep.recordings.reader import Recording
from nep.recordings.writer import RecordingWriter
from tests.nep.recordings.messages import TestClock, json_message, limits

PIECES, EACH = 128, 60  # statistics follow each piece


def numbers(gaps: dict[int, int]) -> Iterator[int]:
    """Yield sequence numbers; `gaps` maps the index of a message to the number of messages lost before it."""
    number = 0
    for place in itertools.count():
        number += 1 + gaps.get(place, 0)
        yield number


def recording(path, gaps: dict[int, int]) -> None:
    made = numbers(gaps)
    with RecordingWriter(path, clock=TestClock(), limits=limits(stats_interval_s=0.0)) as writer:
        for _piece in range(PIECES):
            for _each in range(EACH):
                writer.post([json_message(next(made), "/a")])
            assert writer.flush()


@pytest.fixture
def read_bytes(monkeypatch) -> list[int]:
    """Lengths in bytes of the chunks that are read."""
    lengths: list[int] = []
    read = file_reader.read_chunk

    def counted(file, chunk):
        lengths.append(chunk.length)
        return read(file, chunk)

    monkeypatch.setattr(file_reader, "read_chunk", counted)
    return lengths


def test_recording_without_losses_is_not_read(tmp_path, read_bytes) -> None:
    recording(tmp_path / "a.mcap", {})
    with Recording(tmp_path / "a.mcap") as made:
        assert len(made.stats_chunks()) > PIECES // 2
        assert losses_of(made) == {}
    assert read_bytes == []


def test_few_losses_are_found_by_reading_a_small_part_of_the_file(tmp_path, read_bytes) -> None:
    path = tmp_path / "a.mcap"
    recording(path, {1: 2, 3000: 3, 3003: 1, 7_600: 7})
    with Recording(path) as made:
        found = losses_of(made)
    assert sum(mark.count for mark in found["/a"]) == 13
    assert len(found["/a"]) in {3, 4}
    few = sum(read_bytes)
    assert 0 < few < path.stat().st_size // 4
    with Recording(path) as made:
        made.is_complete = False  # forces a full read
        assert losses_of(made) == found
    assert sum(read_bytes) - few > 3 * few


@pytest.mark.parametrize("is_complete", [True, False])
def test_late_messages_are_not_lost(tmp_path, is_complete) -> None:
    path = tmp_path / "a.mcap"
    order = [*range(200), 205, *range(206, 400), 200, 201, *range(400, 600), 603, *range(604, 800)]
    with RecordingWriter(path, clock=TestClock(), limits=limits(stats_interval_s=0.0)) as writer:
        for number in order:  # 200 to 204 count as lost until 200 and 201 arrive; 600 to 602 stay lost
            writer.post([json_message(number, "/a")])
            assert writer.flush()
    with Recording(path) as made:
        assert made.stats()["/a"].lost == 6
        made.is_complete = is_complete
        marks = losses_of(made)["/a"]
    assert [mark.count for mark in marks] == [3, 3]
    assert marks[0].at_ns < marks[1].at_ns
