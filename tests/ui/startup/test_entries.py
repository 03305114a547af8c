"""Tests of the entry points of ``python -m app``: window, headless run, child processes of a frozen build."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.__main__ import main, run_child_module, run_parser, window_parser

ROOT = Path(__file__).parents[3]


def python(*arguments: str, words: str = "") -> subprocess.CompletedProcess[str]:
    environ = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, *arguments],
        input=words,
        capture_output=True,
        text=True,
        timeout=140,
        env=environ,
        check=False,
    )


def test_window_parser_accepts_files_theme_and_demo() -> None:
    options = window_parser().parse_intermixed_args(["story.nepb", "--theme", "dark", "--demo", "tour.nepb"])
    assert options.files == [Path("story.nepb"), Path("tour.nepb")]
    assert (options.theme, options.demo, options.self_drive, options.new_window) == (
        "dark",
        True,
        None,
        False,
    )


def test_run_parser_accepts_file_master_and_robot_wait() -> None:
    options = run_parser().parse_args(["a.nepb", "--robot-wait", "3", "--master", "127.0.0.1:5"])
    assert (options.file, options.robot_wait, options.master) == (Path("a.nepb"), 3.0, "127.0.0.1:5")


def test_headless_run_does_not_import_qt(tmp_path: Path) -> None:
    code = f"import sys; from app.__main__ import main; c = main(['run', {str(tmp_path / 'none.nepb')!r}]); "
    code += "assert c == 2, c; assert not [m for m in sys.modules if m.startswith('PySide6')]"
    done = python("-c", code)
    assert done.returncode == 0, done.stderr


def test_child_process_entry_reports_ready() -> None:
    done = python("-m", "app", "--child")
    assert '{"is": "ready"}' in done.stdout.replace('{"is":"ready"}', '{"is": "ready"}')


def test_only_known_child_processes_are_started(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_child_module("os", []) == 2
    assert main(["--module", "antigravity"]) == 2
    assert "no process 'os'" in capsys.readouterr().err


def test_module_entry_runs_the_recorder_process() -> None:
    done = python("-m", "app", "--module", "nep.recordings.child", "--help")
    assert done.returncode == 0, done.stderr
    assert "--master" in done.stdout


def test_module_entry_passes_options_to_the_module() -> None:
    done = python("-m", "app", "--module", "nep", "--help")
    assert done.returncode == 0
    assert "topic" in done.stdout
