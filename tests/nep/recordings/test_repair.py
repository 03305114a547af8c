"""Tests of the repair of truncated or damaged recordings: every intact message is recovered and counted."""

from __future__ import annotations

import random
from contextlib import suppress

import pytest

from nep.errors import RecordingError
from nep.recordings import repair as repair_module
from nep.recordings.reader import Recording
from nep.recordings.repair import repair, repaired_path
from tests.nep.recordings.mcap_doctor import McapDoctor
from tests.nep.recordings.messages import json_message, kept, odd_messages, picture, record

PARTS = [
    [json_message(seq, size=60) for seq in range(at * 8, at * 8 + 8)] + [picture(at + 1)] for at in range(10)
]
ALL = [each for part in PARTS for each in part]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("recordings") / "Tour guide.mcap"
    record(path, PARTS)
    return path


def read(path):
    with Recording(path) as recording:
        return [kept(each.message) for each in recording.read()]


def test_repair_of_a_truncated_recording_recovers_the_messages_of_complete_chunks(path, tmp_path):
    data, whole = path.read_bytes(), [kept(each) for each in ALL]
    with Recording(path) as recording:
        chunks = recording.file.chunks()
    rnd = random.Random(1474)
    for at in range(200):
        cut = rnd.randrange(len(data))
        damaged = tmp_path / f"{at}.mcap"
        damaged.write_bytes(data[:cut])
        there = [each for each in chunks if each.offset + each.length <= cut]
        least = sum(sum(each.counts.values()) for each in there)
        if not there:  # part of the first chunk may be readable
            with suppress(RecordingError):
                found = read(repair(damaged).path)
                assert found == whole[: len(found)]
            continue
        report = repair(damaged)
        found = read(report.path)
        assert found == whole[: len(found)], cut
        assert len(found) == report.recovered
        assert len(found) >= min(least - 2, len(ALL)), cut  # the recorder's own messages are not counted
        assert damaged.stat().st_size == cut  # unchanged


def test_repaired_file_is_complete_and_has_the_stats_of_the_original(path, tmp_path):
    damaged = tmp_path / "a.mcap"
    damaged.write_bytes(path.read_bytes()[:-300])
    progress = []
    report = repair(damaged, progress=lambda *told: progress.append(told))
    assert report.path == tmp_path / "a.repaired.mcap"
    assert (report.recovered, report.discarded) == (len(ALL), 0)
    assert McapDoctor(report.path).problems == []
    assert progress[-1] == (damaged.stat().st_size, damaged.stat().st_size)
    with Recording(report.path) as recording, Recording(path) as before:
        assert recording.is_complete
        assert recording.recorder_metadata["repaired"] == "1"
        assert recording.stats() == before.stats()


def test_repair_of_an_undamaged_recording_loses_no_message(path, tmp_path):
    report = repair(path, tmp_path / "copy.mcap")
    assert report.is_complete
    assert read(report.path) == [kept(each) for each in ALL]


@pytest.mark.parametrize("has_end", [True, False])
def test_repair_discards_only_the_damaged_chunk_and_counts_its_messages(path, tmp_path, has_end):
    with Recording(path) as recording:
        chunks = recording.file.chunks()
    data = bytearray(path.read_bytes())
    data[chunks[4].offset + chunks[4].length - 5] ^= 1
    if not has_end:
        del data[-200:]
    (tmp_path / "a.mcap").write_bytes(data)
    report = repair(tmp_path / "a.mcap")
    gone = {kept(each) for each in PARTS[4]}
    assert read(report.path) == [kept(each) for each in ALL if kept(each) not in gone]
    assert (report.discarded, report.corrupt_range_count) == (len(PARTS[4]), 1)
    assert report.discarded_bytes >= chunks[4].length


def test_repair_finds_chunks_after_a_damaged_length(path, tmp_path):
    with Recording(path) as recording:
        chunks = recording.file.chunks()
    data = bytearray(path.read_bytes())
    place = chunks[3].offset
    data[place : place + 600] = random.Random(3).randbytes(600)
    (tmp_path / "a.mcap").write_bytes(data)
    report = repair(tmp_path / "a.mcap")
    found = read(report.path)
    assert report.discarded is None  # the number can't be determined
    assert set(found) < {kept(each) for each in ALL}
    assert {kept(each) for part in (*PARTS[:3], *PARTS[5:]) for each in part} <= set(found)
    assert McapDoctor(report.path).problems == []


def test_repair_of_random_damage_raises_only_recording_errors_and_invents_no_message(path, tmp_path):
    data, sent = path.read_bytes(), {kept(each) for each in ALL}
    rnd = random.Random(5)
    for at in range(60):
        made = bytearray(data)
        for _each in range(rnd.randrange(1, 4)):
            place = rnd.randrange(8, len(made))
            made[place : place + rnd.choice([1, 8, 500])] = rnd.randbytes(rnd.choice([0, 1, 8, 500]))
        damaged = tmp_path / f"{at}.mcap"
        damaged.write_bytes(made)
        try:
            report = repair(damaged)
        except RecordingError:
            continue
        for _topic, payload, *_rest in read(report.path):
            assert payload in {each[1] for each in sent}


def test_repaired_file_gets_an_unused_name(path, tmp_path):
    damaged = tmp_path / "a.mcap"
    damaged.write_bytes(path.read_bytes()[:-300])
    assert [repair(damaged).path.name for _each in range(3)] == [
        "a.repaired.mcap",
        "a.repaired-2.mcap",
        "a.repaired-3.mcap",
    ]
    assert repaired_path(damaged).name == "a.repaired-4.mcap"
    with pytest.raises(RecordingError, match=r"a\.mcap': .*already exists"):
        repair(damaged, damaged)
    with pytest.raises(RecordingError, match=r"'.*none\.mcap'"):
        repair(tmp_path / "none.mcap")


@pytest.mark.parametrize("data", [b"", b"\x89MCAP0\r\n", b"nothing of the kind" * 100, bytes(100_000)])
def test_repair_of_a_file_without_messages_raises_and_leaves_no_file(tmp_path, data):
    (tmp_path / "a.mcap").write_bytes(data)
    with pytest.raises(RecordingError):
        repair(tmp_path / "a.mcap")
    assert [each.name for each in tmp_path.iterdir()] == ["a.mcap"]


def test_repair_raises_if_its_result_cannot_be_read_back(path, tmp_path, monkeypatch):
    damaged = tmp_path / "a.mcap"
    damaged.write_bytes(path.read_bytes()[:-300])
    finish = repair_module.FileWriter.finish

    def finish_badly(writer):
        finish(writer)
        data = bytearray(writer.path.read_bytes())
        data[len(data) // 2] ^= 1
        writer.path.write_bytes(data)

    monkeypatch.setattr(repair_module.FileWriter, "finish", finish_badly)
    with pytest.raises(RecordingError, match="read back"):
        repair(damaged)
    assert [each.name for each in tmp_path.iterdir()] == ["a.mcap"]


def test_recordings_of_other_programs_are_repaired(tmp_path):
    from mcap.writer import Writer

    damaged = tmp_path / "theirs.mcap"
    for use_chunking in (True, False):
        with damaged.open("wb") as file:
            writer = Writer(file, chunk_size=500, use_chunking=use_chunking)
            writer.start()
            for topic in ("/a", "/b"):
                channel = writer.register_channel(
                    topic, "json", writer.register_schema(topic, "jsonschema", b"{}")
                )
                for seq in range(50):
                    writer.add_message(channel, seq, b'{"x":%d}' % seq, seq, seq)
            writer.finish()
        damaged.write_bytes(damaged.read_bytes()[:-400])
        report = repair(damaged)
        with Recording(report.path) as recording:
            assert next(each.message_count for each in recording.topics.values()) == 50
            assert report.recovered == recording.message_count > 80
        assert not [each for each in McapDoctor(report.path).problems if "earlier" not in each]


def test_extreme_and_malformed_messages_survive_a_repair(tmp_path):
    record(tmp_path / "a.mcap", [odd_messages(), odd_messages()])
    (tmp_path / "b.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:-100])
    assert read(repair(tmp_path / "b.mcap").path) == read(tmp_path / "a.mcap")
