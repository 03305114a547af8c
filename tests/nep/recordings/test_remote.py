"""Tests of reading recordings in another process: same messages, or an error when the process dies."""

from __future__ import annotations

import io
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from nep.errors import ClosedError, RecordingError, RecordingTooLargeError
from nep.recordings.apart.frames import read_frame, write_frame
from nep.recordings.apart.reader_process import RecordingService
from nep.recordings.apart.remote import ReaderProcess
from nep.recordings.reader import Recording
from tests.nep.recordings import hostile
from tests.nep.recordings.messages import kept, odd_messages, record

COMMAND = [sys.executable, "-m", "nep.recordings.apart.reader_process"]
DIES = [sys.executable, "-c", "import sys; sys.stdin.buffer.read(4)"]
NEVER_ANSWERS = [sys.executable, "-c", "import time; time.sleep(600)"]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("remote") / "a.mcap"
    record(path, [odd_messages()] * 12)
    return path


@pytest.fixture(scope="module")
def reader(path: Path) -> Iterator[ReaderProcess]:
    with ReaderProcess(COMMAND) as reader:
        reader.open(path).close()  # starts its thread before the leak check of the first test
        yield reader


def test_remote_reader_returns_the_same_as_a_local_reader(path: Path, reader: ReaderProcess) -> None:
    with Recording(path) as here, reader.open(path) as there:
        assert there.info == here.info
        assert there.topics == here.topics
        assert [(at, kept(each)) for at, each in there.read()] == [
            (at, kept(each)) for at, each in here.read()
        ]
        middle = (here.start_ns + here.end_ns) // 2
        newest = {topic: kept(each.message) for topic, each in here.newest(middle).items()}
        assert {topic: kept(each.message) for topic, each in there.newest(middle).items()} == newest
        assert there.newest(-1) == there.newest(2**70, ()) == {}
        assert there.newest_times(middle) == here.newest_times(middle)
        span = (here.start_ns, here.end_ns + 1, 30)
        assert there.densities(*span) == here.densities(*span)
        assert there.stats() == here.stats()
        assert list(there.stats_over_time(here.stats_chunks())) == list(here.stats_over_time())
        assert there.after(middle, "/list") is not None
    with pytest.raises(ClosedError):
        next(there.read())


def test_several_remote_readers_of_one_file_are_independent(path: Path, reader: ReaderProcess) -> None:
    with reader.open(path) as one, reader.open(path) as two:
        pairs = list(zip(one.read(), two.read(), strict=True))
    assert pairs
    assert all(kept(a.message) == kept(b.message) for a, b in pairs)


def test_unreadable_file_raises_and_other_files_stay_readable(
    tmp_path: Path, path: Path, reader: ReaderProcess
) -> None:
    (tmp_path / "none.mcap").write_bytes(b"none")
    with pytest.raises(RecordingError, match=r"none\.mcap': .*MCAP file"):
        reader.open(tmp_path / "none.mcap")
    with pytest.raises(RecordingError):
        reader.open(tmp_path / "gone.mcap")
    with pytest.raises(RecordingTooLargeError):
        reader.open(path, budget=(10, None))
    (tmp_path / "bomb.mcap").write_bytes(hostile.files()["zstd frame larger than its chunk states"]())
    with reader.open(tmp_path / "bomb.mcap") as bomb:
        assert list(bomb.read()) == []
        assert len(bomb.corruption) == 1
    with reader.open(path) as whole:
        assert next(whole.read())


def test_open_with_a_crashing_or_missing_reader_process_raises_recording_error(path: Path) -> None:
    with ReaderProcess(DIES) as reader:
        for _again in range(2):
            with pytest.raises(RecordingError, match=r"a\.mcap': .*process"):
                reader.open(path)
    with ReaderProcess(["/no/such/program"]) as reader, pytest.raises(RecordingError, match="/such/program"):
        reader.open(path)


def test_open_with_an_unresponsive_reader_process_raises_after_the_timeout(path: Path) -> None:
    reader = ReaderProcess(NEVER_ANSWERS, timeout_s=0.05)
    with reader, pytest.raises(RecordingTooLargeError, match="too long"):
        reader.open(path)


def test_closing_the_reader_process_ends_pending_calls(path: Path) -> None:
    reader = ReaderProcess(NEVER_ANSWERS)
    raised: list[BaseException] = []

    def wait() -> None:
        try:
            reader.open(path)
        except NepErrors as error:
            raised.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    while reader._pipe is None:
        thread.join(0.01)
    reader.close()
    thread.join(60.0)
    assert not thread.is_alive()
    assert isinstance(raised[0], ClosedError)
    with pytest.raises(ClosedError):
        reader.open(path)


NepErrors = (ClosedError, RecordingError)


def test_malformed_reader_requests_receive_an_error_reply() -> None:
    service = RecordingService(lambda _content: None)
    for request in (
        {},
        {"op": "open"},
        {"op": "raw", "file": 7},
        {"op": "next", "cursor": []},
        {"op": ["x"]},
    ):
        assert "error" in service.reply(request)


def test_truncated_or_invalid_frame_is_read_as_end_of_stream() -> None:
    stream = io.BytesIO()
    write_frame(stream, {"a": b"\0" * 10})
    whole = stream.getvalue()
    assert read_frame(io.BytesIO(whole)) == {"a": b"\0" * 10}
    for cut in range(len(whole)):
        assert read_frame(io.BytesIO(whole[:cut])) is None
    assert read_frame(io.BytesIO(b"\xff\xff\xff\xff")) is None
    assert read_frame(io.BytesIO(b"\x01\0\0\0\xc1")) is None
