"""Tests of the list of recordings: the contents of each file, read without blocking the window."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

import pytest

from app.core.recording import folder as folder_module
from app.core.recording.folder import FolderScan, RecordingFolder, new_path
from app.core.storage.folders import default_recordings_folder
from nep.recordings.repair import repair
from tests.nep.programs import eventually
from tests.nep.recordings.messages import json_message, record


def look(folder: RecordingFolder, being_written: Path | None = None) -> FolderScan:
    found: list[FolderScan] = []

    def is_found() -> bool:
        made = folder.pop_result()
        if made is not None:
            found.append(made)
        return made is not None

    folder.start_scan(being_written)
    eventually(is_found)
    return found[0]


@pytest.fixture
def folder(tmp_path):
    made = RecordingFolder(tmp_path)
    yield made
    made.close()


def test_each_mcap_file_is_listed_with_its_contents_and_read_only_once(folder, tmp_path, monkeypatch):
    assert look(folder) == FolderScan()
    record(tmp_path / "a.mcap", [[json_message(seq, topic="/odom") for seq in range(5)]])
    (tmp_path / "cut.MCAP").write_bytes((tmp_path / "a.mcap").read_bytes()[:-100])
    repair(tmp_path / "cut.MCAP", tmp_path / "fixed.mcap")
    (tmp_path / "none.mcap").write_bytes(b"nothing of the kind")
    (tmp_path / "notes.txt").write_bytes(b"")
    (tmp_path / "folder.mcap").mkdir()
    found = {each.path.name: each for each in look(folder).files}
    assert sorted(found) == ["a.mcap", "cut.MCAP", "fixed.mcap", "none.mcap"]
    whole = found["a.mcap"]
    assert (whole.message_count, whole.topics, whole.is_complete, whole.problem) == (5, ("/odom",), True, "")
    assert whole.size_bytes == whole.path.stat().st_size
    assert not found["cut.MCAP"].is_complete
    assert found["cut.MCAP"].message_count == 5
    assert found["fixed.mcap"].is_repaired
    assert "not an MCAP file" in found["none.mcap"].problem
    monkeypatch.setattr(folder_module, "read_info", pytest.fail)
    assert {each.path.name: each for each in look(folder).files} == found  # no file is opened again


def test_active_recording_is_not_opened_and_files_are_read_incrementally(folder, tmp_path, monkeypatch):
    for name in "abc":
        record(tmp_path / f"{name}.mcap", [[json_message(1)]])
    monkeypatch.setattr(folder_module, "MAX_READS_PER_SCAN", 1)
    counts = []
    for _each in range(3):
        found = look(folder, tmp_path / "b.mcap")
        counts.append((sum(each.is_read for each in found.files), found.is_complete))
    assert counts == [(1, False), (2, True), (2, True)]
    monkeypatch.setattr(folder_module, "MAX_FILES", 2)
    found = look(folder)
    assert (len(found.files), found.omitted_count) == (2, 1)


def test_missing_recordings_folder_is_reported(tmp_path):
    folder = RecordingFolder(tmp_path / "nowhere")
    assert "no such file" in look(folder).problem
    folder.close()


def test_new_recording_names_are_unique(tmp_path, monkeypatch):
    now = datetime(2026, 11, 26, 22, 1, 5, tzinfo=timezone.utc)
    first = new_path(tmp_path, now)
    assert first.name == "recording-2026-11-26-22-01-05.mcap"
    first.touch()
    assert new_path(tmp_path, now).name == "recording-2026-11-26-22-01-05-2.mcap"
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    assert default_recordings_folder() == tmp_path / "Recordings"
