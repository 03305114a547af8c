"""Tests of bookmarks, which are saved next to the recording and never change it."""

from __future__ import annotations

import json

import pytest

from nep.errors import RecordingError
from nep.recordings.bookmarks import Bookmark, Bookmarks
from nep.recordings.reader import Recording
from nep.recordings.writer import RecordingWriter
from tests.nep.recordings.messages import STEP_NS, TestClock, json_message, limits


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "Tour guide.mcap"
    with RecordingWriter(path, clock=TestClock(), limits=limits()) as writer:
        for seq in range(10):
            writer.post([json_message(seq)])
            if seq == 4:
                writer.write_entry("notes", {"text": "it fell"})
                writer.write_entry("notes", {"text": 7})
                writer.write_entry("notes", ["other"])
    return path


def test_bookmarks_and_notes_are_listed_in_time_order_and_saved_next_to_the_recording(path):
    before = path.read_bytes()
    with Recording(path) as recording:
        marks = Bookmarks(recording)
        (note,) = marks.all
        assert (note.name, note.is_note) == ("it fell", True)
        late = marks.add(recording.end_ns - STEP_NS, "the end")
        early = marks.add(0, "begin")
        assert early.at_ns == recording.start_ns
        assert marks.add(2**64).at_ns == recording.end_ns
        assert [each.name for each in marks.all] == ["begin", "it fell", "the end", ""]
        assert marks.after(early.at_ns) == note
        assert marks.before(late.at_ns) == note
        assert marks.before(early.at_ns) is None
        assert marks.after(recording.end_ns) is None
        renamed = marks.rename(late, "ñ" * 300)
        assert renamed.name == "ñ" * 200
        marks.remove(early)
        for wrong in (note, early, Bookmark(1, "never")):
            with pytest.raises(ValueError, match="changed"):
                marks.remove(wrong)
            with pytest.raises(ValueError, match="changed"):
                marks.rename(wrong, "x")
        told = marks.all
    with Recording(path) as recording:
        assert Bookmarks(recording).all == told
    assert path.read_bytes() == before
    assert sorted(each.name for each in path.parent.iterdir()) == [
        "Tour guide.mcap",
        "Tour guide.mcap.bookmarks.json",
    ]


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"bookmarks": 5}', '{"bookmarks": [{"at_ns": -1, "name": ""}]}', "\x00" * 100]
)
def test_damaged_bookmark_file_is_ignored_and_backed_up_on_the_next_change(path, text):
    beside = path.with_name(f"{path.name}.bookmarks.json")
    beside.write_text(text)
    with Recording(path) as recording:
        marks = Bookmarks(recording)
        assert len(marks.all) == 1
        assert beside.read_text() == text
        marks.add(recording.start_ns, "new")
        assert len(Bookmarks(recording).all) == 2
    assert beside.with_name(f"{beside.name}.damaged").read_text() == text


def test_bookmark_that_cannot_be_saved_raises_and_changes_no_bookmark(path, monkeypatch):
    with Recording(path) as recording:
        marks = Bookmarks(recording)
        with pytest.raises(RecordingError, match=r"name .*characters"):
            marks.add(recording.start_ns, "\ud800")
        marks.path.mkdir()  # a folder can't be replaced by the file
        with pytest.raises(RecordingError, match="can't use the recording"):
            marks.add(recording.start_ns, "new")
        assert len(marks.all) == 1
        marks.path.rmdir()
        monkeypatch.setattr("nep.recordings.bookmarks.MAX_BOOKMARKS", 1)
        marks.add(recording.start_ns, "new")
        with pytest.raises(RecordingError, match="1 bookmarks, the maximum"):
            marks.add(recording.start_ns, "too many")
        assert [each["name"] for each in json.loads(marks.path.read_text())["bookmarks"]] == ["new"]
    assert sorted(each.name for each in path.parent.iterdir()) == [path.name, marks.path.name]
