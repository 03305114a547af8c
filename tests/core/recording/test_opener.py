"""Tests of reading recordings in another process; one that is too large or crashes it is reported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from app.core.alerts.alerts import Alerts
from app.core.recording.film_strip import read_preview
from app.core.recording.folder import RecordingInfo, read_info
from app.core.recording.opener import LocalOpener, process_opener
from app.core.recording.replay.opening import MAX_TOPICS, open_recording
from app.core.recording.replay.replay import FAILED, Replay
from app.core.session import Session
from app.core.storage.settings import Settings
from nep.errors import RecordingError, RecordingTooLargeError
from nep.recordings.apart.remote import ReaderProcess
from nep.recordings.reader import Recording
from tests.nep.programs import eventually
from tests.nep.recordings import hostile
from tests.nep.recordings.messages import json_message, record


class Failing(LocalOpener):
    """Opener that fails, or whose recordings fail when they are read."""

    def __init__(self, error: RecordingError, opened: int = 0) -> None:
        self._error, self._opened = error, opened
        self.is_closed = False

    def open(self, path: Path, **options: object) -> Recording:
        if not self._opened:
            raise self._error
        return Dying(path, self._error)

    def close(self) -> None:
        self.is_closed = True


class Dying(Recording):
    """Recording whose reader process dies after it was opened."""

    def __init__(self, path: Path, error: RecordingError) -> None:
        super().__init__(path)
        self._error = error

    def newest(self, *_given: object, **_named: object) -> dict[str, object]:  # type: ignore[override]
        raise self._error


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "a.mcap"
    record(path, [[json_message(seq, topic="/odom") for seq in range(5)]])
    return path


def test_file_too_expensive_to_read_is_listed_as_not_scanned(path: Path) -> None:
    plain = RecordingInfo(path, path.stat().st_size, 1.0)
    made = read_info(plain, Failing(RecordingTooLargeError(str(path), "reading the file takes too long")))
    assert (made.path, made.is_read, made.problem) == (path, True, "")
    assert "reading the file takes too long" in made.scan_problem
    made = read_info(plain, Failing(RecordingError(str(path), "the process has ended")))
    assert "the process has ended" in made.problem


@pytest.mark.parametrize("opened", [0, 1])
def test_dead_reader_process_is_an_alert_and_ends_the_replay(tmp_path: Path, path: Path, opened: int) -> None:
    alerts, opener = Alerts(), Failing(RecordingError(str(path), "the process has ended"), opened)
    replay = Replay(path, alerts, opener=opener)
    replay.start()
    eventually(lambda: replay.has_ended)
    replay.tick()
    (alert,) = (each for each in alerts.active if each.id == FAILED)
    assert "process has ended" in alert.detail
    replay.close()
    assert opener.is_closed


def test_recording_is_played_by_a_separate_process(tmp_path: Path, path: Path) -> None:
    replay = Replay(path, Alerts(), opener=process_opener())
    replay.start()
    watch = replay.watch("/odom")

    def seen(condition: Callable[[], bool]) -> Callable[[], bool]:
        def look() -> bool:
            replay.tick()
            return condition()

        return look

    eventually(seen(lambda: replay.player is not None and replay.opened_recording is not None), 60.0)
    replay.seek(replay.end_ns)
    eventually(seen(lambda: replay.topics["/odom"].newest is not None), 60.0)
    watch.close()
    replay.close()
    assert replay.has_ended


def test_studio_reads_recordings_in_separate_processes(tmp_path: Path) -> None:
    session = Session(Settings(tmp_path / "home"), journal_folder=tmp_path / "j", start_processes=True)
    try:
        opener = session.recordings.new_opener()
        assert isinstance(opener, ReaderProcess)
        opener.close()
    finally:
        session.close()


def test_recording_with_too_many_topics_is_rejected_with_explanation(tmp_path: Path) -> None:
    path = tmp_path / "many.mcap"
    path.write_bytes(hostile.many_channels(MAX_TOPICS + 1))
    with pytest.raises(RecordingError, match=str(MAX_TOPICS)):
        open_recording(path, lambda _share: None)
    assert read_preview(path, 4, 3, (24, 16), LocalOpener()) is None
