"""Tests of the self-test's report and of its watchdog, which ends a process that hangs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from app.__main__ import main
from app.core.self_test.environment import UnwritableFolderError, prepare
from app.core.self_test.report import Report
from app.core.self_test.test import is_windows_program

ROOT = Path(__file__).parents[3]
HANGS = """
import os, subprocess, sys, threading
from pathlib import Path
from app.core.self_test import SelfTest, prepare, timeouts

timeouts.STEP_TIMEOUTS_S["window"], timeouts.GRACE_S = 0.2, 0.2
test = SelfTest(prepare(Path(sys.argv[1]), os.environ, is_root=False), {})
child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
print(child.pid, flush=True)

def show():
    test.start_step("window", "the window")
    threading.Event().wait()

test.run(show)
"""
WELL = """
import logging, os, sys
from pathlib import Path
from app.core.self_test import SelfTest, prepare

test = SelfTest(prepare(Path(sys.argv[1]), os.environ, is_root=False), {})
log = test.environment.home / "studio.log"
handler = logging.FileHandler(log, encoding="utf-8")
logging.getLogger().addHandler(handler)

def show():
    logging.warning("seen")
    assert log.stat().st_size
    return 0

assert test.run(show) == 0
assert handler.stream is None
"""


def told(folder: Path) -> dict:
    return json.loads((folder / "report.json").read_text("utf-8"))


def test_self_test_report_is_readable_during_and_after_its_steps(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    report = Report(path, {"web": True})
    report.start_step("window", "the window", 5.0)
    half = told(tmp_path)
    assert not half["ok"]
    assert half["why"] == "Studio exited during the self-test; its last step was “window”."
    assert half["steps"][0]["ms"] is None
    report.record_success("it was painted")
    report.record_time("first_paint")
    assert report.finish()
    whole = told(tmp_path)
    assert (whole["ok"], whole["why"], whole["web"], whole["frozen"]) == (True, "", True, False)
    step = whole["steps"][0]
    assert (step["name"], step["ok"], step["bound_s"], step["said"]) == (
        "window",
        True,
        5.0,
        "it was painted",
    )
    assert 0 < step["began_ms"] <= step["ms"] <= whole["first_paint_ms"] <= whole["total_ms"]


def test_first_failure_is_the_reported_reason(tmp_path: Path) -> None:
    report = Report(tmp_path / "report.json", {})
    report.start_step("robot", "the virtual robot", 5.0)
    report.fail("The robot doesn't exist.")
    report.fail("The window did not close.")
    assert not report.finish()
    whole = told(tmp_path)
    assert (whole["ok"], whole["why"]) == (False, "The robot doesn't exist.")
    assert (whole["steps"][0]["ok"], whole["steps"][0]["said"]) == (False, "The robot doesn't exist.")


def test_unwritable_self_test_report_is_a_failure(tmp_path: Path) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()
    report = Report(folder / "report.json", {})
    report.start_step("window", "the window", 5.0)
    (folder / "report.json").unlink()
    folder.rmdir()
    folder.write_text("a file is there now", "utf-8")
    assert not report.finish()
    assert report.failure.startswith("The report can't be written (")


def test_self_test_has_its_own_home_and_master(tmp_path: Path) -> None:
    folder = tmp_path / "自己 テスト"
    folder.mkdir()
    (folder / "window.png").write_bytes(b"of an earlier test")
    (folder / "mine.txt").write_text("a person's", "utf-8")
    environ = {"NEP_STUDIO_HOME": "/a/home", "NEP_MASTER": "127.0.0.1:7780"}
    first = prepare(folder, environ, is_root=True)
    second = prepare(folder, dict(environ), is_root=False)
    assert environ["NEP_STUDIO_HOME"] == str(first.home)
    assert environ["NEP_MASTER"] == first.master
    assert len({first.master, second.master, "127.0.0.1:7780"}) == 3
    assert first.home.parent == second.home.parent == folder
    assert first.home != second.home
    assert not (folder / "window.png").exists()
    assert (folder / "mine.txt").is_file()
    assert told(folder) == {}


def test_unwritable_folder_is_reported_without_opening_a_window(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Without SIGALRM, pytest-timeout uses a thread, which the end of a process must not wait for.
    monkeypatch.setattr("app.__main__.join_threads", lambda within_s: ())
    (tmp_path / "file").write_text("", "utf-8")
    before = dict(os.environ)
    assert main(["--selftest", str(tmp_path / "file" / "below")]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"nep-studio: can't write to the folder '{tmp_path / 'file' / 'below'}' (")
    assert said.endswith("; choose another folder\n")
    assert os.environ == before
    with pytest.raises(UnwritableFolderError):
        prepare(tmp_path / "file", {}, is_root=False)


def test_hanging_process_is_ended_with_its_children(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", HANGS, str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=False,
    )
    assert done.returncode == 1, done.stderr
    whole = told(tmp_path)
    assert not whole["ok"]
    assert whole["why"] == "Studio didn't respond in time and was stopped. It was waiting for: the window"
    assert not whole["steps"][0]["ok"]
    assert "in show" in (tmp_path / "crash.txt").read_text("utf-8")  # the function in which Studio hung
    assert not psutil.pid_exists(int(done.stdout))


def test_home_and_open_log_are_deleted_after_success(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-c", WELL, str(tmp_path)],
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=True,
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.json"]


@dataclass
class ItsProgram:
    """Fake process whose executable may be readable, or only its command line."""

    program: str
    words: tuple[str, ...] = ()

    def exe(self) -> str:
        if not self.program:
            raise OSError("WinError 0")
        return self.program

    def cmdline(self) -> list[str]:
        if not self.words:
            raise psutil.NoSuchProcess(1)
        return list(self.words)


def test_windows_system_processes_are_excluded_from_the_self_test() -> None:
    for program in (r"C:\Windows\explorer.exe", r"c:\windows\System32\conhost.exe"):
        assert is_windows_program(ItsProgram(program), r"C:\Windows")
        assert is_windows_program(ItsProgram("", (program, "/desktop")), r"C:\Windows")
    studio = r"C:\Users\山田 太郎\AppData\Local\Programs\NEP Studio\nep-studio.exe"
    for program in (studio, r"C:\Windows of mine\a.exe"):
        assert not is_windows_program(ItsProgram(program), r"C:\Windows")
        assert not is_windows_program(ItsProgram("", (program, r"C:\Windows\a.exe")), r"C:\Windows")
    assert not is_windows_program(ItsProgram(""), r"C:\Windows")  # the process has ended
    assert not is_windows_program(ItsProgram("/usr/bin/python3"), "")
