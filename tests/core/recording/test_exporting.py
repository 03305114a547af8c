"""Tests of exports in the background: files, progress and cancellation."""

from __future__ import annotations

import threading

from app.core.recording import exporting as exporting_module
from app.core.recording.exporting import RecordingExport
from app.core.recording.folder import read_picture
from app.core.recording.opener import LocalOpener
from nep.recordings.export import Part, export
from tests.nep.programs import eventually
from tests.nep.recordings.messages import START_NS, STEP_NS, json_message, record


def test_export_reports_its_files(tmp_path):
    record(tmp_path / "a.mcap", [[json_message(seq, topic="/odom") for seq in range(250)]])
    job = RecordingExport(tmp_path / "a.mcap", "csv", tmp_path / "out")
    eventually(lambda: job.is_finished)
    assert (job.result_text(), job.progress) == ("Exported 1 file", 1.0)
    (made,) = job.files
    assert made.count == 250
    assert len(made.path.read_text("utf-8").splitlines()) == 251


def test_export_of_a_part_contains_only_its_topics_and_times(tmp_path):
    messages = [json_message(seq, topic=f"/{'ab'[seq % 2]}") for seq in range(400)]
    record(tmp_path / "a.mcap", [messages])
    part = Part(START_NS + 100 * STEP_NS, START_NS + 300 * STEP_NS, ["/a"])
    job = RecordingExport(tmp_path / "a.mcap", "csv", tmp_path / "out", part)
    eventually(lambda: job.is_finished)
    assert ([(each.topic, each.count) for each in job.files], job.progress) == ([("/a", 100)], 1.0)


def test_failed_export_is_reported(tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"nothing of the kind")
    job = RecordingExport(tmp_path / "a.mcap", "csv", tmp_path / "out")
    eventually(lambda: job.is_finished)
    assert job.result_text().startswith("Not exported: ")
    assert not job.files


def test_canceled_export_leaves_no_partial_file(tmp_path, monkeypatch):
    record(tmp_path / "a.mcap", [[json_message(seq, topic="/odom") for seq in range(500)]])
    has_begun, go_on = threading.Event(), threading.Event()

    def slow(recording, kind, folder, part, *, progress):
        def tell(done: int, total: int) -> None:
            has_begun.set()
            go_on.wait()
            progress(done, total)

        return export(recording, kind, folder, part, progress=tell)

    monkeypatch.setattr(exporting_module, "export", slow)
    job = RecordingExport(tmp_path / "a.mcap", "csv", tmp_path / "out")
    has_begun.wait()
    assert job.result_text() == ""
    job.cancel()
    go_on.set()
    eventually(lambda: job.is_finished)
    assert job.result_text() == "The export was cancelled"
    assert list((tmp_path / "out").iterdir()) == []


def test_recording_without_images_and_unreadable_file_have_no_thumbnail(tmp_path):
    record(tmp_path / "a.mcap", [[json_message(1, topic="/odom")]])
    assert read_picture(tmp_path / "a.mcap", (128, 96), LocalOpener()) is None
    assert read_picture(tmp_path / "gone.mcap", (128, 96), LocalOpener()) is None
    (tmp_path / "none.mcap").write_bytes(b"nothing of the kind")
    assert read_picture(tmp_path / "none.mcap", (128, 96), LocalOpener()) is None
