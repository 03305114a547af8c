"""Tests of recordings in several files: each is complete and bounded in size, and no message is lost."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer

import nep
from nep.errors import RecordingError
from nep.messages.message import message_kind, received_message
from nep.recordings.reader import Recording
from nep.recordings.split import SplitFiles, part_path
from nep.recordings.writer import RecordingWriter
from tests.nep.programs import eventually
from tests.nep.recordings.mcap_doctor import McapDoctor
from tests.nep.recordings.messages import TestClock, json_message, limits
from tests.nep.recordings.test_commands import run

PART = 100_000
STATE = received_message(message_kind("/arm/state", "json", "json", is_latched=True), b'{"on":true}', 1, 1, 3)


def split(path: Path, sequences: range) -> SplitFiles:
    files = SplitFiles(path, PART, limits())
    with RecordingWriter(files, clock=TestClock(), limits=limits(), note="long") as writer:
        writer.post([STATE])
        for seq in sequences:
            writer.post([json_message(seq, size=2_000)])
            if seq % 20 == 0:
                assert writer.flush()
        writer.close()
        assert writer.status.message_count == len(sequences) + 1
        assert writer.status.size_bytes == sum(each.stat().st_size for each in files.paths)
    return files


def test_split_files_are_complete_and_together_hold_every_message_once(tmp_path: Path) -> None:
    files = split(tmp_path / "tour.mcap", range(1, 401))
    assert len(files.paths) > 3
    numbers = range(1, len(files.paths) + 1)
    assert files.paths == [part_path(tmp_path / "tour.mcap", number) for number in numbers]
    sequences: list[int | None] = []
    for number, path in enumerate(files.paths, 1):
        assert McapDoctor(path).problems == []
        assert path.stat().st_size < 2 * PART
        with Recording(path) as recording:
            found = [each.message.seq for each in recording.read(topics=["/odom"])]
            sequences += found
            figures = recording.stats()["/odom"]
            assert (figures.received, figures.lost, figures.late) == (len(found), 0, 0)
            assert (recording.recorder_metadata["part"], recording.recorder_metadata["note"]) == (
                str(number),
                "long",
            )
            states = [each.message.payload for each in recording.read(topics=["/arm/state"])]
            assert states == [{"on": True}]
    assert sequences == list(range(1, 401))


def test_recording_below_the_split_size_is_one_file(tmp_path: Path) -> None:
    files = split(tmp_path / "tour.mcap", range(1, 5))
    assert [each.name for each in tmp_path.iterdir()] == ["tour-001.mcap"]
    with Recording(files.paths[0]) as recording:
        assert "part" not in recording.recorder_metadata


def test_split_does_not_overwrite_a_file_and_keeps_the_previous_part_complete(tmp_path: Path) -> None:
    (tmp_path / "tour-002.mcap").write_bytes(b"mine")
    writer = RecordingWriter(
        SplitFiles(tmp_path / "tour.mcap", PART, limits()), clock=TestClock(), limits=limits()
    )
    for seq in range(1, 401):
        writer.post([json_message(seq, size=2_000)])
        if seq % 20 == 0:
            writer.flush()
    status = writer.close()
    assert "already exists" in status.problem
    assert (tmp_path / "tour-002.mcap").read_bytes() == b"mine"
    with Recording(tmp_path / "tour-001.mcap") as recording:
        assert recording.is_complete
        assert recording.message_count == status.message_count
    with pytest.raises(RecordingError):
        SplitFiles(tmp_path / "tour.mcap", PART)


def test_record_command_splits_and_stops_by_size(
    master: nep.Master, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    words = ("--max-size", "100kB", "--master", master.address, "--json")
    with nep.node("robot", master=master.address) as robot:
        publisher = robot.new_pub("/noise", "bytes", latched=True)
        publisher.publish(json_message(1, size=300_000).raw)
        run("record", "/noise", "-o", tmp_path / "one.mcap", *words)  # stops at the maximum size
        told = json.loads(capfdbinary.readouterr().out)
        assert told["size_bytes"] > 100_000
        run("record", "/noise", "-o", tmp_path / "many.mcap", "--split", "--duration", 1.0, *words)
        told = json.loads(capfdbinary.readouterr().out)
        assert Path(told["paths"][0]).name == "many-001.mcap"
    for wrong in (("--split",), ("--max-size", "12"), ("--max-size", "much"), ("--max-size", "-1GB")):
        with pytest.raises(typer.BadParameter):
            run("record", "-o", tmp_path / "b.mcap", *wrong)
    eventually(lambda: not (tmp_path / "b.mcap").exists())
