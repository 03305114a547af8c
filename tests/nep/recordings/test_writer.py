"""Tests of the writer with slow, full and failing disks: every message that is not written is counted."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from nep.errors import RecordingError
from nep.messages.clocks import OWN_CLOCK, ClockDifference, PublisherClock
from nep.messages.message import Message, message_kind, received_message
from nep.recordings.formats.mcap_file import FileWriter
from nep.recordings.formats.message_counts import MAX_LOST
from nep.recordings.reader import Recording
from nep.recordings.repair import repair
from nep.recordings.writer import RecordingWriter
from tests.nep.programs import eventually as until
from tests.nep.recordings.mcap_doctor import McapDoctor
from tests.nep.recordings.messages import START_NS, TestClock, json_message, kept, limits, odd_messages
from tests.small_disk import SmallDisk


class HeldDestination:
    """Destination whose flush blocks until `go_on` is set."""

    is_full = False

    def next_file(self) -> None:
        raise AssertionError

    def __init__(self, path: Path) -> None:
        self.file = FileWriter(path)
        self.is_held, self.go_on = threading.Event(), threading.Event()

    def on_flushed(self) -> None:
        self.is_held.set()
        assert self.go_on.wait(30)

    def look(self) -> None:
        pass

    def finish(self) -> None:
        self.file.finish()

    def abort(self) -> None:
        self.file.close()


class FullDisk:
    """File that accepts `budget` bytes, the last write possibly in part, and then raises "no space left"."""

    def __init__(self, file, budget: int) -> None:
        self._file, self._budget = file, budget

    def write(self, data) -> int:
        if self._budget <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        part = memoryview(data)[: self._budget]
        self._budget -= len(part)
        return self._file.write(part)

    def __getattr__(self, name: str):
        return getattr(self._file, name)


def read(path: Path) -> list[Message]:
    with Recording(path) as recording:
        return [each.message for each in recording.read()]


def test_messages_beyond_the_queue_limit_are_counted_in_status_and_recording(tmp_path):
    path = tmp_path / "a.mcap"
    with RecordingWriter(path, clock=TestClock(), limits=limits(queue_messages=10)) as writer:
        writer.post([json_message(seq) for seq in range(1, 26)])
    status = writer.status
    assert (status.message_count, status.unkept, status.problem) == (10, 15, "")
    with Recording(path) as recording:
        figures = recording.stats()["/odom"]
    assert (figures.received, figures.unkept, figures.lost) == (25, 15, 0)
    assert [each.seq for each in read(path)] == list(range(1, 11))


def test_slow_disk_does_not_block_post(tmp_path):
    destination = HeldDestination(tmp_path / "a.mcap")
    writer = RecordingWriter(
        destination, clock=TestClock(), limits=limits(queue_bytes=1000, flush_interval_s=0.001)
    )
    writer.post([json_message(1)])
    assert destination.is_held.wait(30)
    for seq in range(2, 102):
        writer.post([json_message(seq)])
    assert writer.status.queued_bytes <= 1000
    destination.go_on.set()
    status = writer.close()
    assert status.message_count + status.unkept == 101
    assert status.unkept > 80
    with Recording(tmp_path / "a.mcap") as recording:
        assert recording.message_count == status.message_count
        assert recording.stats()["/odom"].unkept == status.unkept
        assert recording.stats()["/odom"].lost == 0


def test_lost_late_and_undecodable_messages_are_counted_per_topic(tmp_path):
    path = tmp_path / "a.mcap"
    seqs = [3, 4, 7, 6, 9]  # 5 and 8 are missing, 6 is late
    messages = [json_message(seq) for seq in seqs] + [
        json_message(1, publisher=8),
        json_message(2, publisher=8),
    ]
    broken = Message("/camera", b"\xff\xd8\xff", "image", "image", seq=1, stamp_ns=1, publisher=9)
    with RecordingWriter(path, clock=TestClock(), limits=limits()) as writer:
        writer.post([*messages, broken, Message("/original", b"{}", "json", "json")])
    with Recording(path) as recording:
        figures = recording.stats()
    assert (figures["/odom"].received, figures["/odom"].lost, figures["/odom"].late) == (7, 2, 1)
    assert (figures["/camera"].undecodable, figures["/camera"].lost) == (1, 0)
    assert figures["/original"].lost is None
    assert figures == writer.status.topics


def test_recorded_stats_contain_the_time_of_a_loss(tmp_path):
    path = tmp_path / "a.mcap"
    with RecordingWriter(path, clock=TestClock(), limits=limits(stats_interval_s=0.001)) as writer:
        for seqs in ((1, 2), (5,), (6,)):
            writer.post([json_message(seq) for seq in seqs])
            until(lambda last=seqs[-1]: writer.status.topics.get("/odom") and last_seen(writer, last))
    with Recording(path) as recording:
        times = [(at, each["/odom"].lost) for at, each in recording.stats_over_time() if "/odom" in each]
        seen = {each.message.seq: each.log_ns for each in recording.read()}
    lost_at = next(at for at, lost in times if lost == 2)
    assert seen[5] <= lost_at <= seen[6]


def last_seen(writer: RecordingWriter, seq: int) -> bool:
    received = writer.status.topics["/odom"].received
    return received == {2: 2, 5: 3, 6: 4}[seq]


def test_receive_times_follow_time_stamps_of_known_clocks_and_never_decrease(tmp_path):
    path, now = tmp_path / "a.mcap", [START_NS]
    kinds = {
        "own": message_kind("/own", "json", "json", clock=OWN_CLOCK),
        "other": message_kind("/other", "json", "json", clock=PublisherClock(ClockDifference(1000, 10))),
        "unknown": message_kind("/unknown", "json", "json"),
    }
    with RecordingWriter(path, clock=lambda: now[0], limits=limits()) as writer:
        now[0] += 100_000
        batch = [
            ("own", 50_000),
            ("other", 59_000),
            ("own", 10),
            ("unknown", 5),
            ("own", 70_000),
            ("own", 10**9),
        ]
        writer.post([received_message(kinds[name], b"{}", START_NS + at, 1, 1) for name, at in batch])
    with Recording(path) as recording:
        times = [each.log_ns - START_NS for each in recording.read()]
    assert times == [50_000, 60_000, 60_000, 100_000, 100_000, 100_000]


@pytest.mark.parametrize("budget", [0, 1, 40, 500, 1000, 2100, 3003, 5000, 8191])
def test_full_disk_leaves_complete_records_and_counts_the_remaining_messages(tmp_path, budget):
    path = tmp_path / "a.mcap"
    messages = [json_message(seq) for seq in range(1, 101)]
    told = []
    writer = RecordingWriter(path, clock=TestClock(), limits=limits(), on_problem=told.append)
    file = writer._destination.file
    file._file = FullDisk(file._file, budget)
    for message in messages:
        writer.post([message])
        writer.flush()
    status = writer.close()
    assert told == [status.problem]
    assert "disk is full" in status.problem
    assert status.message_count + status.unkept == len(messages)
    with Recording(path) as recording:
        assert not recording.is_complete
        assert recording.size_bytes == path.stat().st_size  # no partial record remains
        found = [each.message for each in recording.read()]
    assert [kept(each) for each in found] == [kept(each) for each in messages[: status.message_count]]


def test_writer_reports_a_full_disk_and_counts_unwritten_messages(tmp_path):
    disk = SmallDisk(tmp_path)
    found = disk.run(
        "import json, sys\n"
        "from pathlib import Path\n"
        "from nep.messages.message import Message\n"
        "from nep.recordings.reader import Recording\n"
        "from nep.recordings.writer import RecordingWriter, WriterLimits\n"
        "import os\n"
        "path = Path(sys.argv[1]) / 'a.mcap'\n"
        "writer = RecordingWriter(path, limits=WriterLimits(min_free_bytes=0))\n"
        "count = 0\n"
        "while not writer.problem:\n"
        "    count += 1\n"
        "    writer.post([Message('/t', os.urandom(5000), 'bytes', 'bytes', seq=count)])\n"
        "    writer.flush()\n"
        "status = writer.close()\n"
        "with Recording(path) as recording:\n"
        "    seqs = [each.message.seq for each in recording.read()]\n"
        "print(json.dumps({'a': [count, status.message_count, status.unkept, status.problem, len(seqs),\n"
        "    seqs == list(range(1, len(seqs) + 1))]}))\n"
    )["a"]
    count, written, unkept, problem, there, is_in_order = found
    assert "disk is full" in problem
    assert written == there >= 40
    assert written + unkept == count
    assert is_in_order


def test_writer_stops_with_a_complete_file_before_the_disk_is_full(tmp_path, monkeypatch):
    path, free = tmp_path / "a.mcap", [1000]
    monkeypatch.setattr(
        "nep.recordings.formats.destination.shutil.disk_usage", lambda _folder: SimpleNamespace(free=free[0])
    )
    writer = RecordingWriter(
        path, clock=TestClock(), limits=limits(min_free_bytes=1000, stats_interval_s=0.001)
    )
    writer.post([json_message(1)])
    assert writer.flush()
    free[0] = 999
    until(lambda: writer.problem)
    assert "disk is full" in writer.close().problem
    assert McapDoctor(path).problems == []
    with Recording(path) as recording:
        assert (recording.is_complete, recording.message_count) == (True, 1)
        assert "disk is full" in recording.recorder_metadata["end"]


@pytest.mark.skipif(os.name == "nt", reason="Windows removes no file that is open")
def test_deleted_recording_file_is_reported(tmp_path):
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, clock=TestClock(), limits=limits(stats_interval_s=0.001))
    writer.post([json_message(1)])
    assert writer.flush()
    path.unlink()
    until(lambda: writer.problem)
    assert "moved or deleted" in writer.close().problem
    writer.post([json_message(2)])  # only counted as not saved
    assert writer.status.unkept == 1


def test_internal_error_stops_the_writer_and_keeps_earlier_messages(tmp_path, monkeypatch):
    path, told = tmp_path / "a.mcap", []
    writer = RecordingWriter(path, clock=TestClock(), limits=limits(), on_problem=told.append)
    writer.post([json_message(1), json_message(2)])
    assert writer.flush()
    monkeypatch.setattr("nep.recordings.writer.encoding_of", lambda *_args, **_more: 1 // 0)
    writer.post([json_message(3), json_message(4)])
    until(lambda: writer.problem)
    status = writer.close()
    assert not writer.flush()
    assert "ZeroDivisionError('integer " in status.problem
    assert told == [status.problem]
    assert status.message_count == 2
    assert [each.seq for each in read(path)] == [1, 2]


def test_extreme_sequence_numbers_do_not_stop_the_recording(tmp_path):
    path = tmp_path / "a.mcap"
    messages = [json_message(seq, publisher=who) for who in range(3) for seq in (0, 2**64 - 1)]
    with RecordingWriter(path, clock=TestClock(), limits=limits()) as writer:
        writer.post(messages)
    assert (writer.status.problem, writer.status.message_count) == ("", 6)
    with Recording(path) as recording:
        assert recording.stats()["/odom"].lost == MAX_LOST


def test_no_file_is_left_if_the_disk_is_full_from_the_start(tmp_path, monkeypatch):
    monkeypatch.setattr("nep.recordings.formats.mcap_file.MAGIC", FailingBytes())
    with pytest.raises(RecordingError, match="disk is full"):
        RecordingWriter(tmp_path / "a.mcap")
    assert not list(tmp_path.iterdir())


class FailingBytes:
    """Data that cannot be written: its use raises "no space left on device"."""

    def __add__(self, _other: bytes) -> bytes:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_existing_file_or_missing_folder_raises_recording_error(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(b"mine")
    with pytest.raises(RecordingError, match=r"a\.mcap': .*already exists"):
        RecordingWriter(path)
    assert path.read_bytes() == b"mine"
    with pytest.raises(RecordingError, match="can't use the recording"):
        RecordingWriter(tmp_path / "nowhere" / "a.mcap")


def test_publishers_beyond_the_limit_share_a_channel_without_loss(tmp_path, monkeypatch):
    monkeypatch.setattr("nep.recordings.writer.MAX_PUBLISHER_CHANNELS", 3)
    path = tmp_path / "a.mcap"
    messages = [json_message(seq, publisher=seq) for seq in range(1, 50)] + odd_messages()
    with RecordingWriter(path, clock=TestClock(), limits=limits()) as writer:
        writer.post(messages)
    assert [kept(each) for each in read(path)] == [kept(each) for each in messages]
    assert McapDoctor(path).problems == []


def test_messages_of_channels_beyond_the_limit_are_counted(tmp_path, monkeypatch):
    monkeypatch.setattr("nep.recordings.formats.mcap_file.MAX_CHANNELS", 5)
    monkeypatch.setattr("nep.recordings.writer.MAX_PUBLISHER_CHANNELS", 2)
    path = tmp_path / "a.mcap"
    with RecordingWriter(path, clock=TestClock(), limits=limits()) as writer:
        writer.post([json_message(1, topic=f"/t{number}") for number in range(20)])
    assert writer.status.message_count + writer.status.unkept == 20
    assert writer.status.unkept >= 15


_CHILD = """
import sys
from nep.recordings.writer import RecordingWriter
from tests.nep.recordings.messages import json_message, limits
writer = RecordingWriter(sys.argv[1], limits=limits())
seq = 0
for line in sys.stdin:
    for _each in range(100):
        seq += 1
        writer.post([json_message(seq)])
    while writer.status.message_count < seq - 100 * (line == "more\\n"):
        writer._thread.join(0.01)
    print(seq, flush=True)
"""


def test_killed_writer_process_loses_only_unflushed_messages(tmp_path):
    path = tmp_path / "a.mcap"
    child = subprocess.Popen(
        [sys.executable, "-c", _CHILD, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with child:
        for line in ("wait", "wait", "more"):
            child.stdin.write(f"{line}\n")
            child.stdin.flush()
            assert child.stdout.readline()
        child.kill()
    assert [each.seq for each in read(path)][:200] == list(range(1, 201))
    report = repair(path)
    assert report.recovered >= 200
    assert McapDoctor(report.path).problems == []
