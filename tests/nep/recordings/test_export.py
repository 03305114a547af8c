"""Tests of exports of a recording as tables, images and videos."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import textwrap
from contextlib import suppress

import cv2
import numpy as np
import pytest

from nep.errors import RecordingError, RecordingsUnavailableError
from nep.messages import image_codec
from nep.messages.message import Message
from nep.recordings.export import Part, export, flatten
from nep.recordings.reader import Recording
from nep.recordings.writer import RecordingWriter
from tests.nep.recordings.mcap_doctor import McapDoctor
from tests.nep.recordings.messages import STEP_NS, TestClock, json_message, kept, limits, picture, record

VALUES = [
    {"pose": {"x": 0.1, "y": None}, "j": [1, 2], "name": 'a,\n"b"', "ok": True, "big": 2**63},
    {"pose": {"x": 2}, "j": [3, 4, 5], "name": "ñ", "ok": False, "big": 1, "new": {"deep": [[1], {"a": 2}]}},
    {"pose": {"x": 1e300}, "j": [], "name": 7, "ok": None, "long": list(range(101))},
]


def message(seq, value, codec="json", topic="/arm/state"):
    data = value if isinstance(value, bytes) else json.dumps(value).encode()
    return Message(topic, data, codec, codec, stamp_ns=seq * 10**9, seq=seq, publisher=2**64 - 1)


@pytest.fixture
def recording(tmp_path):
    messages = [message(seq, value) for seq, value in enumerate(VALUES, 1)]
    messages += [
        message(4, b"{broken"),
        message(1, b"\xff", "bytes", "/raw"),
        message(1, b"t", "string", "/t"),
    ]
    messages += [picture(seq) for seq in range(1, 6)]
    record(tmp_path / "a.mcap", [messages])
    with Recording(tmp_path / "a.mcap") as opened:
        yield opened


def test_csv_export_has_every_field_of_every_decodable_message(recording, tmp_path):
    progress = []
    made = export(recording, "csv", tmp_path / "out", progress=lambda *told: progress.append(told))
    assert [(each.topic, each.path.name, each.count, each.undecodable_count) for each in made] == [
        ("/arm/state", "arm_state.csv", 3, 1),
        ("/t", "t.csv", 1, 0),
    ]
    assert progress[-1] == (5, 5)
    with made[0].path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["pose.x"] for row in rows] == ["0.1", "2", "1e+300"]
    assert [row["name"] for row in rows] == ['a,\n"b"', "ñ", "7"]
    assert [row["ok"] for row in rows] == ["true", "false", ""]
    assert [row["j[2]"] for row in rows] == ["", "5", ""]
    assert rows[1]["new.deep[1].a"] == "2"
    assert json.loads(rows[2]["long"]) == list(range(101))
    assert (rows[0]["seq"], rows[0]["stamp_s"], rows[0]["publisher"]) == ("1", "1.0", str(2**64 - 1))
    assert rows[0]["stamp_ns"] == str(10**9)
    assert [int(row["time_ns"]) for row in rows] == [
        each.log_ns for each in recording.read(topics=("/arm/state",)) if each.message.seq != 4
    ]
    assert not list((tmp_path / "out").glob("*.part"))


def test_parquet_export_preserves_value_types(recording, tmp_path):
    pq = pytest.importorskip("pyarrow.parquet")
    made = export(recording, "parquet", tmp_path, Part(topics=("/arm/state",)))
    table = pq.read_table(made[0].path)
    kinds = {field.name: str(field.type) for field in table.schema}
    assert (kinds["pose.x"], kinds["ok"], kinds["j[0]"], kinds["name"], kinds["seq"]) == (
        "double", "bool", "int64", "string", "uint64",
    )  # fmt: skip
    rows = table.to_pylist()
    assert [row["pose.x"] for row in rows] == [0.1, 2.0, 1e300]
    assert [row["name"] for row in rows] == ['a,\n"b"', "ñ", "7"]
    assert [row["big"] for row in rows] == [None, 1, None]  # 2^63 doesn't fit into int64


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_export_renames_conflicting_fields_and_escapes_invalid_characters(tmp_path, kind):
    values = [{"seq": "seven", "time_s": 1, "publisher": None, "big": 2**70, "x": float("nan")}]
    values += [{"seq": 2**70, "text": "\ud800", "big": 0.5, "x": 2**2000, "deep": {"\ud800": [{}] * 200}}]
    record(tmp_path / "a.mcap", [[message(seq, value) for seq, value in enumerate(values, 1)]])
    with Recording(tmp_path / "a.mcap") as recording:
        (made,) = export(recording, kind, tmp_path / "out")
    assert (made.count, made.undecodable_count) == (2, 0)
    if kind == "csv":
        with made.path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    else:
        pq = pytest.importorskip("pyarrow.parquet")
        rows = pq.read_table(made.path).to_pylist()
    assert [str(row["seq"]) for row in rows] == ["1", "2"]
    assert [str(row["payload.seq"]) for row in rows] == ["seven", str(2**70)]
    assert rows[1]["text"] == "\\ud800"


def test_exported_images_are_the_original_files(recording, tmp_path):
    made = export(recording, "pictures", tmp_path / "out")
    files = sorted(made[0].path.iterdir())
    assert [each.name for each in files] == [f"{number:06d}.jpg" for number in range(1, 6)]
    assert [each.read_bytes() for each in files] == [bytes(picture(seq).data) for seq in range(1, 6)]


def test_raw_images_are_exported_as_lossless_png(tmp_path):
    frame = np.arange(60, dtype=np.uint16).reshape(6, 10) * 1000
    raw = image_codec.raw_image(frame)
    sent = Message("/depth", bytes(raw.data), "image", "image", seq=1, extension=dict(raw.extension))
    record(tmp_path / "a.mcap", [[sent]])
    with Recording(tmp_path / "a.mcap") as recording:
        made = export(recording, "pictures", tmp_path / "out")
    assert (cv2.imread(str(made[0].path / "000001.png"), cv2.IMREAD_UNCHANGED) == frame).all()


def test_exported_video_has_the_duration_of_the_recording(tmp_path):
    record(tmp_path / "a.mcap", [[picture(seq) for seq in range(1, 101)]])
    with Recording(tmp_path / "a.mcap") as recording:
        times = [each.log_ns for each in recording.read()]
        made = export(recording, "mp4", tmp_path / "out", fps=20.0)
    film = cv2.VideoCapture(str(made[0].path))
    count = 0
    while film.read()[0]:
        count += 1
    film.release()
    assert count == int((times[-1] - times[0]) / 1e9 * 20) + 1
    assert (made[0].count, sorted(each.name for each in (tmp_path / "out").iterdir())) == (
        100,
        ["camera.mp4"],
    )


def test_video_is_exported_without_ffmpeg(tmp_path):
    """Runs as a process because OpenCV reads its environment only once."""
    record(tmp_path / "a.mcap", [[picture(seq) for seq in range(1, 31)]])
    program = f"""
        from pathlib import Path
        from nep.recordings.export import export
        from nep.recordings.reader import Recording
        with Recording({str(tmp_path / "a.mcap")!r}) as recording:
            (made,) = export(recording, "mp4", Path({str(tmp_path / "out")!r}), fps=20.0)
        print(made.path.name, made.count)
    """
    environment = {**os.environ, "OPENCV_VIDEOIO_PRIORITY_FFMPEG": "0"}
    command = [sys.executable, "-c", textwrap.dedent(program)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    made = next((tmp_path / "out").iterdir())
    assert done.stdout.split() == [made.name, "30"]
    if made.suffix == ".avi":  # other systems may have another MP4 encoder of OpenCV
        film = cv2.VideoCapture(str(made), cv2.CAP_OPENCV_MJPEG)
        assert (film.get(cv2.CAP_PROP_FPS), film.read()[0]) == (20.0, True)
        film.release()
    assert [each.name for each in (tmp_path / "out").iterdir()] == [made.name]


def test_video_encoder_probe_keeps_existing_files(tmp_path):
    record(tmp_path / "a.mcap", [[picture(seq) for seq in range(1, 4)]])
    out = tmp_path / "out"
    out.mkdir()
    for name in ("trial.mp4", "trial.avi"):
        (out / name).write_bytes(b"mine")
    with Recording(tmp_path / "a.mcap") as recording:
        (made,) = export(recording, "mp4", out)
    assert {each.name for each in out.iterdir()} == {"trial.mp4", "trial.avi", made.path.name}
    assert {(out / name).read_bytes() for name in ("trial.mp4", "trial.avi")} == {b"mine"}


def test_missing_video_encoder_is_reported(tmp_path, monkeypatch):
    record(tmp_path / "a.mcap", [[picture(1)]])
    monkeypatch.setattr("nep.recordings.film.CONTAINERS", ())
    with (
        Recording(tmp_path / "a.mcap") as recording,
        pytest.raises(RecordingError, match="OpenCV can't write videos on this computer"),
    ):
        export(recording, "mp4", tmp_path / "out")
    assert not list((tmp_path / "out").iterdir())


def test_failed_video_export_raises_and_leaves_no_file(tmp_path, monkeypatch):
    record(tmp_path / "a.mcap", [[picture(seq) for seq in range(1, 4)]])
    with Recording(tmp_path / "a.mcap") as recording:
        with monkeypatch.context() as patched:
            patched.setattr("nep.recordings.film.MAX_DURATION_S", 0.015)
            with pytest.raises(RecordingError, match="more than a day"):
                export(recording, "mp4", tmp_path / "out")
        monkeypatch.setattr("nep.recordings.film.VideoFile.close", truncate)
        with pytest.raises(RecordingError, match="the disk may be full"):
            export(recording, "mp4", tmp_path / "out")
    assert not list((tmp_path / "out").iterdir())


def truncate(film):
    """Truncate the video as a full disk does; OpenCV reports no error."""
    film._writer.release()
    with suppress(FileNotFoundError):
        os.truncate(film._video_path, 100)


def test_export_of_a_time_range_contains_only_its_messages(recording, tmp_path):
    start = recording.start_ns
    made = export(recording, "csv", tmp_path, Part(start + STEP_NS, start + 2 * STEP_NS, ("/arm/state",)))
    assert made[0].count == 1


def test_export_overwrites_no_file_and_leaves_no_partial_file(recording, tmp_path, monkeypatch):
    export(recording, "csv", tmp_path / "out")
    before = (tmp_path / "out" / "t.csv").read_bytes()
    with pytest.raises(RecordingError, match=r"\.csv': .*already exists"):
        export(recording, "csv", tmp_path / "out")
    assert (tmp_path / "out" / "t.csv").read_bytes() == before
    monkeypatch.setattr("nep.recordings.export.MAX_COLUMNS", 3)
    with pytest.raises(RecordingError, match="more than 3 different fields"):
        export(recording, "csv", tmp_path / "more")
    assert not list((tmp_path / "more").iterdir())


def test_export_file_names_are_unique_and_valid_on_every_system(tmp_path):
    topics = ["/a/b", "/a_b", "/A/B", "a:b", "/日本", "/..", "/" + "x" * 190]
    record(tmp_path / "a.mcap", [[json_message(1, topic=each) for each in topics]])
    with Recording(tmp_path / "a.mcap") as recording:
        names = [each.path.name.lower() for each in export(recording, "csv", tmp_path / "out")]
    assert len(set(names)) == len(topics)
    assert all(len(each) < 120 and not set('/\\:*?"<>|') & set(each) for each in names)


def test_export_raises_for_unknown_formats_missing_values_images_or_packages(
    recording, tmp_path, monkeypatch
):
    record(tmp_path / "b.mcap", [[json_message(1)]])
    with (
        Recording(tmp_path / "b.mcap") as plain,
        pytest.raises(RecordingError, match="no topic has images"),
    ):
        export(plain, "mp4", tmp_path)
    with pytest.raises(ValueError, match="'xls'"):
        export(recording, "xls", tmp_path)
    with pytest.raises(RecordingError, match="no topic has values"):
        export(recording, "csv", tmp_path, Part(topics=("/camera",)))
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(RecordingsUnavailableError, match="pip install"):
        export(recording, "parquet", tmp_path / "out")


def test_scalars_and_empty_collections_are_flattened_to_a_column():
    assert flatten(5) == {"value": 5}
    assert flatten({}) == {"value": "{}"}
    assert flatten({"a": {}, "b": [], "c": b"\0"}) == {"a": "{}", "b": "[]", "c": "\"b'\\\\x00'\""}


def test_mcap_export_of_a_range_preserves_bytes_times_notes_and_run(tmp_path):
    path = tmp_path / "a.mcap"
    run = {"id": "1", "name": "Greeting", "until_ns": None}
    with RecordingWriter(
        path, note="first", clock=TestClock(), limits=limits(stats_interval_s=1e6)
    ) as writer:
        for seq in range(40):
            writer.post([picture(seq) if seq % 4 == 0 else json_message(seq, f"/{'ab'[seq % 2]}")])
            assert writer.flush()
            if seq % 5 == 0:
                writer.write_entry("runs", run)
            if seq in {2, 21}:
                writer.write_entry("notes", {"text": f"note {seq}"})
    with Recording(path) as whole:
        times = [each.log_ns for each in whole.read()]
        part = Part(times[10], times[30], ["/a", "/camera"])
        wanted = [
            (each.log_ns, kept(each.message)) for each in whole.read(part.start_ns, part.end_ns, part.topics)
        ]
        notes = list(whole.entries("notes"))[1:]
        told: list[tuple[int, int]] = []
        (made,) = export(whole, "mcap", tmp_path / "out", part, progress=lambda *each: told.append(each))
        assert (made.path, made.count, told[-1]) == (
            tmp_path / "out" / "a.mcap",
            len(wanted),
            (len(wanted),) * 2,
        )
        with pytest.raises(RecordingError, match=r"a\.mcap': .*already exists"):
            export(whole, "mcap", tmp_path / "out", part)
        with pytest.raises(RecordingError, match=r"a\.mcap': .*topics"):
            export(whole, "mcap", tmp_path / "none", Part(topics=["/nowhere"]))
        with pytest.raises(RecordingError, match=r"a\.mcap': .*part"):
            export(whole, "mcap", tmp_path / "none", Part(start_ns=times[-1] + 1))
    with Recording(made.path) as recording:
        assert recording.is_complete
        assert [(each.log_ns, kept(each.message)) for each in recording.read()] == wanted
        assert recording.recorder_metadata["note"] == "first"
        assert list(recording.entries("notes")) == notes
        assert [value for _at, value in recording.entries("runs")] == [run]  # stored once, not every second
    assert McapDoctor(made.path).problems == []
    assert sorted(each.name for each in (tmp_path / "out").iterdir()) == ["a.mcap"]
