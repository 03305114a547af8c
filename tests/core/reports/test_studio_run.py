"""Tests of detecting how Studio ended: a clean exit leaves no files, a crash is reported once."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from app.core.reports.crash_reports import CrashReports
from app.core.reports.studio_run import NO_TRACE_CAUSE, StudioRun

ROOT = Path(__file__).resolve().parents[3]
BEGIN = (
    "import os, signal, sys\n"
    "from pathlib import Path\n"
    "from app.core.reports.studio_run import StudioRun\n"
    "run = StudioRun(Path(sys.argv[1]), Path(sys.argv[2]))\n"
    "run.start()\n"
    "print('begun', flush=True)\n"
)


class Place:
    def __init__(self, folder: Path) -> None:
        self.runs, self.log = folder / "runs", folder / "log"

    def run(self) -> StudioRun:
        return StudioRun(self.runs, self.log)

    def files(self) -> list[str]:
        return sorted(path.name for folder in (self.runs, self.log) for path in folder.glob("*"))

    def process(self, code: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-c", BEGIN + code, str(self.runs), str(self.log)],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ends(self, code: str) -> int:
        with self.process(code) as process:
            return process.wait(60)


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path)


def test_clean_exit_leaves_no_files(place: Place) -> None:
    run = place.run()
    run.start()
    assert run.is_recorded
    assert len(place.files()) == 3  # mark, lock, trace
    run.finish()
    assert place.files() == []
    assert place.run().pop_crashes() == []


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize(
    ("number", "how"), [("SIGSEGV", "Segmentation fault"), ("SIGABRT", "Aborted"), ("SIGBUS", "Bus error")]
)
def test_native_crash_is_reported_once_with_its_location(place: Place, number: str, how: str) -> None:
    code = f"def deep_inside(): os.kill(os.getpid(), signal.{number})\ndeep_inside()\n"
    assert place.ends(code) == -getattr(signal, number)
    place.log.joinpath("studio.log").write_text("the last line\n")
    (crash,) = place.run().pop_crashes()
    assert crash.part == "studio"
    assert how in crash.cause
    assert "deep_inside" in crash.text
    assert "the last line" in crash.text
    assert place.run().pop_crashes() == []
    assert place.files() == ["studio.log"]


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_kill_by_the_system_is_reported_as_exit_without_message(place: Place) -> None:
    assert place.ends("os.kill(os.getpid(), signal.SIGKILL)") == -signal.SIGKILL
    (crash,) = place.run().pop_crashes()
    assert crash.cause == NO_TRACE_CAUSE
    assert place.run().pop_crashes() == []


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_expected_exit_is_reported_only_if_it_crashed(place: Place) -> None:
    assert place.ends("run.expect_exit(); os.kill(os.getpid(), signal.SIGKILL)") == -signal.SIGKILL
    assert place.run().pop_crashes() == []
    assert place.ends("run.expect_exit(); os.kill(os.getpid(), signal.SIGSEGV)") == -signal.SIGSEGV
    assert len(place.run().pop_crashes()) == 1


def test_running_studio_is_not_reported_as_crash_until_it_is_killed(place: Place) -> None:
    own = place.run()
    own.start()
    with place.process("sys.stdin.read()") as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "begun\n"
        assert place.run().pop_crashes() == []
        assert own.pop_crashes() == []
        other.kill()
        other.wait(60)
        (crash,) = own.pop_crashes()
        assert crash.cause == NO_TRACE_CAUSE
    assert own.is_recorded
    own.finish()
    assert place.files() == []


def entry(place: Place, **other: object) -> Path:
    """Write the mark file of a run whose process no longer exists."""
    place.runs.mkdir(exist_ok=True)
    said = {"pid": 2**22 + 7, "began_s": 4_000_000_000.0, "version": "0.0.9", "asked": False, **other}
    mark = place.runs / "mark.json"
    mark.write_text(json.dumps(said))
    return mark


@pytest.mark.parametrize(("kept", "version"), [("0.0.9", "0.0.9"), (None, ""), ("9\n9", ""), (["9"], "")])
def test_crash_before_an_update_has_its_version(place: Place, kept: object, version: str) -> None:
    entry(place, version=kept)
    (crash,) = place.run().pop_crashes()
    assert crash.version == version
    assert f"Version {version or 'unknown'}, started " in crash.text


def test_exit_by_computer_restart_is_not_a_crash(place: Place) -> None:
    entry(place)
    assert len(place.run().pop_crashes()) == 1
    entry(place, began_s=1000.0)
    assert place.run().pop_crashes() == []
    assert place.files() == []


def test_reused_pid_is_recognized_by_process_start_time(place: Place) -> None:
    """On a disk without file locks, a process is identified by its PID and start time."""
    entry(place, pid=os.getpid(), began_s=4_000_000_000.0)
    assert place.run().pop_crashes() == [], "as old as the mark says: it lives"
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as younger:
        import psutil

        entry(place, pid=younger.pid, began_s=max(psutil.boot_time(), younger_begin(younger.pid) - 100))
        found = place.run().pop_crashes()
        younger.communicate(b"\n", 60)
    assert len(found) == 1


def younger_begin(pid: int) -> float:
    import psutil

    return psutil.Process(pid).create_time()


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"pid": "x", "began_s": 1}', '{"pid": 1e400}'])
def test_damaged_run_marker_file_is_deleted(place: Place, text: str) -> None:
    place.runs.mkdir()
    (place.runs / "mark.json").write_text(text)
    assert place.run().pop_crashes() == []
    assert place.files() == []


def test_uncaught_exception_is_reported_immediately_and_only_once(place: Place) -> None:
    with pytest.raises(ZeroDivisionError), place.run():
        raise ZeroDivisionError("by nothing")
    (report,) = CrashReports(place.log / "crashes").all()
    told = report.path.read_text("utf-8")
    assert "how: ZeroDivisionError: by nothing" in told
    assert "test_studio_run.py" in told
    assert place.run().pop_crashes() == []


def test_system_exit_is_not_a_crash(place: Place) -> None:
    with pytest.raises(SystemExit), place.run():
        raise SystemExit(0)
    assert CrashReports(place.log / "crashes").all() == []
    assert place.run().pop_crashes() == []


def test_unwritable_run_folder_is_logged_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "file").write_text("no folder")
    run = StudioRun(tmp_path / "file" / "runs", tmp_path / "file" / "log")
    run.start()
    run.expect_exit()
    assert not run.is_recorded
    assert run.pop_crashes() == []
    run.finish()
    assert len(caplog.records) == 1
    assert getattr(caplog.records[0], "in_console", False), "the window does not complain"
