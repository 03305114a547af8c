"""Tests of an open Studio whose package is updated or removed: detected and shown as an alert."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from app.core.reports.own_process import OwnProgram, fresh_environ, studio_command
from app.core.session import Session
from app.core.storage.settings import Settings


@pytest.fixture
def program(tmp_path: Path) -> Path:
    made = tmp_path / "nep-studio"
    made.write_bytes(b"old")
    return made


def test_unmodified_program_file_is_not_reported_as_changed(program: Path) -> None:
    own = OwnProgram(program)
    program.read_bytes()
    assert own.executable_state() == ""


def test_update_with_same_size_and_time_is_detected_as_replaced(program: Path) -> None:
    own = OwnProgram(program)
    new = program.with_name("nep-studio.dpkg-new")
    new.write_bytes(b"new")
    shutil.copystat(program, new)
    new.replace(program)
    assert own.executable_state() == "replaced"


def test_removed_program_is_detected_and_a_new_one_counts_as_replaced(program: Path) -> None:
    own = OwnProgram(program)
    program.rename(program.with_name("kept, so that its number is not given again"))
    assert own.executable_state() == "gone"
    program.write_bytes(b"new")
    assert own.executable_state() == "replaced"


def test_run_from_source_has_no_executable_to_monitor() -> None:
    assert OwnProgram().executable_state() == ""


def test_alert_about_a_changed_program_is_shown_and_resolved_with_its_cause(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.frozen", True, raising=False)
    monkeypatch.setattr("sys.executable", str(program))
    session = Session(Settings(tmp_path / "home"), journal_folder=tmp_path / "j", start_processes=False)
    try:
        kept = program.rename(program.with_name("kept"))
        session.check()
        (alert,) = (each for each in session.alerts.active if each.id == "installation")
        assert (alert.severity, alert.count) == ("error", 0)
        assert "removed" in alert.title
        program.write_bytes(b"new")
        session.check()
        (alert,) = (each for each in session.alerts.active if each.id == "installation")
        assert "updated" in alert.title
        kept.replace(program)
        session.check()
        assert not [each for each in session.alerts.active if each.id == "installation"]
    finally:
        session.close()


def test_check_of_the_program_file_keeps_the_alert_about_a_stopped_behaviour(
    tmp_path: Path,
) -> None:
    session = Session(Settings(tmp_path / "home"), journal_folder=tmp_path / "j", start_processes=False)
    try:
        session.alerts.raise_alert("program", "error", "The behaviour stopped unexpectedly.")
        session.check()
        assert [each.title for each in session.alerts.active if each.id == "program"] == [
            "The behaviour stopped unexpectedly."
        ]
    finally:
        session.close()


def test_restart_uses_the_language_of_the_settings() -> None:
    environ = {"NEP_LANG": "en", "LANGUAGE": "es", "NEP_MASTER": "127.0.0.1:7781"}
    assert fresh_environ(environ) == {"NEP_MASTER": "127.0.0.1:7781"}
    assert studio_command("dark") == [sys.executable, "-m", "app", "--theme", "dark"]
