"""Tests of the flight recorder: it keeps the last seconds within its limit of disk space."""

from __future__ import annotations

import os
import threading
from contextlib import suppress

import pytest

from nep.errors import RecordingError
from nep.recordings import ring as ring_module
from nep.recordings.reader import Recording
from nep.recordings.ring import FlightRecorder
from tests.nep.recordings.mcap_doctor import McapDoctor
from tests.nep.recordings.messages import STEP_NS, TestClock, json_message, kept, limits

NO_PROCESS = 2**31 - 2


def fill(ring: FlightRecorder, first: int, last: int, every: int = 10) -> None:
    """Post messages 10 ms apart, with a new chunk after each multiple of `every`."""
    for seq in range(first, last):
        ring.post([json_message(seq)])
        if seq % every == 0:
            assert ring._writer.flush()


def test_flight_recorder_keeps_the_last_seconds_plus_at_most_one_segment(tmp_path):
    with FlightRecorder(tmp_path / "ring", seconds=2.0, clock=TestClock(), limits=limits()) as ring:
        fill(ring, 1, 1001)
        status = ring.status
        assert 2.0 <= status.seconds <= 2.0 * 9 / 8 + 0.3
        made = ring.save(tmp_path / "a.mcap", 2.0, "it fell")
        assert 2.0 <= made.duration_s <= 2.2
        with Recording(tmp_path / "a.mcap") as recording:
            seqs = [each.message.seq for each in recording.read()]
            assert seqs == list(range(seqs[0], 1001))
            assert len(seqs) == made.message_count == recording.stats()["/odom"].received
            assert recording.recorder_metadata["note"] == "it fell"
            assert (recording.recorder_metadata["kept"], recording.is_complete) == ("1", True)
            assert [kept(each.message) for each in recording.read()] == [
                kept(json_message(seq)) for seq in seqs
            ]
        assert McapDoctor(tmp_path / "a.mcap").problems == []
        short = ring.save(tmp_path / "b.mcap", 0.5)
        assert 0.5 <= short.duration_s <= 0.7
        fill(ring, 1001, 1101)  # buffering continues
        ring.save(tmp_path / "c.mcap", 60.0)
        with Recording(tmp_path / "c.mcap") as recording:
            assert recording.newest(recording.end_ns)["/odom"].message.seq == 1100
    assert not list((tmp_path / "ring").iterdir())


def test_flight_recorder_is_limited_by_bytes_before_seconds(tmp_path):
    size = 60_000
    with FlightRecorder(tmp_path, seconds=1e6, size_bytes=size, clock=TestClock(), limits=limits()) as ring:
        for part in range(40):
            fill(ring, part * 50 + 1, part * 50 + 51)
            there = sum(each.stat().st_size for each in tmp_path.iterdir())
            assert there <= size * 9 / 8 + 2000
        assert ring.status.seconds < 20
        assert ring.save(tmp_path / "kept", 1e6).message_count > 100
        (tmp_path / "kept").unlink()


def test_segment_is_removed_only_after_its_copy_is_finished(tmp_path, monkeypatch):
    copying, go_on, made = threading.Event(), threading.Event(), []

    class SlowWriter(ring_module.FileWriter):
        def copy_chunk(self, *args):
            copying.set()
            assert go_on.wait(30)
            super().copy_chunk(*args)

    with FlightRecorder(tmp_path / "ring", seconds=1.0, clock=TestClock(), limits=limits()) as ring:
        fill(ring, 1, 101)
        with monkeypatch.context() as patched:
            patched.setattr(ring_module, "FileWriter", SlowWriter)
            thread = threading.Thread(target=lambda: made.append(ring.save(tmp_path / "a.mcap", 1.0)))
            thread.start()
            assert copying.wait(30)
        fill(ring, 101, 601)
        assert ring.status.seconds < 2
        go_on.set()
        thread.join(30)
        with Recording(tmp_path / "a.mcap") as recording:
            seqs = [each.message.seq for each in recording.read()]
            assert seqs == list(range(seqs[0], 101))
    assert made[0].message_count == len(seqs) >= 95
    assert not list((tmp_path / "ring").iterdir())


def test_saved_flight_recording_counts_only_losses_within_its_duration(tmp_path):
    clock = TestClock()
    with FlightRecorder(tmp_path / "ring", clock=clock, limits=limits(stats_interval_s=1e-9)) as ring:
        ring.post([json_message(1), json_message(5)])  # three are lost, before the saved time
        assert ring._writer.flush()
        ring.post([json_message(6)])
        assert ring._writer.flush()
        for _each in range(1000):
            clock()
        ring.post([json_message(7), json_message(9)])
        assert ring._writer.flush()
        ring.post([json_message(10)])
        assert ring._writer.flush()
        assert ring._writer.flush()
        ring.save(tmp_path / "all.mcap", 3600.0)
        ring.save(tmp_path / "last.mcap", 1.0)
    with Recording(tmp_path / "last.mcap") as recording:
        assert [each.message.seq for each in recording.read()] == [7, 9, 10]
        assert recording.stats()["/odom"].lost in {0, 1}  # only losses of this second, not the three


def test_segments_of_dead_processes_are_removed_and_segments_of_live_processes_kept(tmp_path):
    gone = tmp_path / f"ring-{NO_PROCESS}-a-1.mcap"
    others = [tmp_path / f"ring-{os.getppid()}-a-1.mcap", tmp_path / "mine.mcap", tmp_path / "ring-x-1.mcap"]
    for each in (gone, *others):
        each.write_bytes(b"x")
    with FlightRecorder(tmp_path, limits=limits()):
        assert not gone.exists()
    assert all(each.exists() for each in others)


def test_flight_recorder_raises_for_invalid_limits_existing_files_and_damaged_segments(tmp_path):
    with pytest.raises(ValueError, match="greater than 0"):
        FlightRecorder(tmp_path, seconds=0.0)
    with pytest.raises(ValueError, match="greater than 0"):
        FlightRecorder(tmp_path, seconds=float("nan"))
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(RecordingError):
        FlightRecorder(tmp_path / "file")
    with FlightRecorder(tmp_path / "ring", clock=TestClock(), limits=limits()) as ring:
        ring.post([json_message(1)])
        with pytest.raises(RecordingError, match=r"file': .*already exists"):
            ring.save(tmp_path / "file", 1.0)
        with pytest.raises(RecordingError):
            ring.save(tmp_path / "nowhere" / "a.mcap", 1.0)
        assert ring.save(tmp_path / "a.mcap", 1.0).message_count == 1
        for segment in (tmp_path / "ring").iterdir():
            with suppress(OSError):
                segment.write_bytes(b"damaged" * (segment.stat().st_size // 7 + 1))
        with pytest.raises(RecordingError, match="damaged"):
            ring.save(tmp_path / "b.mcap", 1e6)
        assert not (tmp_path / "b.mcap").exists()
        ring.post([json_message(2)])  # later messages are intact
        assert ring.save(tmp_path / "c.mcap", 1e6).message_count == 1
    with Recording(tmp_path / "c.mcap") as recording:
        assert [each.message.seq for each in recording.read()] == [2]
        assert recording.recorder_metadata["damaged"] == "1"


def test_saving_an_empty_or_closed_flight_recorder_raises(tmp_path):
    ring = FlightRecorder(tmp_path / "ring", clock=TestClock(), limits=limits())
    with pytest.raises(RecordingError, match="no messages received yet"):
        ring.save(tmp_path / "a.mcap", 1.0)
    ring.post([json_message(1)])
    for wrong in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="greater than 0"):
            ring.save(tmp_path / "a.mcap", wrong)
    ring.close()
    ring.close()
    ring.post([json_message(2)])
    assert ring.status.unkept == 1
    with pytest.raises(RecordingError):
        ring.save(tmp_path / "a.mcap", 1.0)
    assert [each.name for each in tmp_path.iterdir()] == ["ring"]


def test_full_disk_is_reported_and_leaves_no_flight_recorder_files(tmp_path):
    told = []
    ring = FlightRecorder(
        tmp_path / "ring",
        seconds=1.0,
        clock=TestClock(),
        limits=limits(min_free_bytes=2**62, stats_interval_s=0.001),
        on_problem=told.append,
    )
    with ring:
        ring.post([json_message(1)])
        while not ring.status.problem:
            ring._writer.flush()
    assert told == ["the disk is full"]
    assert not list((tmp_path / "ring").iterdir())


def test_test_clock_advances_one_step_per_call(tmp_path):
    clock = TestClock()
    assert clock() + STEP_NS == clock()
