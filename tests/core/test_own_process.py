"""Studio open while its package is updated or removed: noticed, and said in a sentence."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from app.core.own_process import OwnProgram, fresh_environ, studio_command
from app.core.session import Session
from app.core.storage.settings import Settings


@pytest.fixture
def program(tmp_path: Path) -> Path:
    made = tmp_path / "nep-studio"
    made.write_bytes(b"old")
    return made


def test_nothing_became_of_it(program: Path) -> None:
    own = OwnProgram(program)
    program.read_bytes()
    assert own.fate() == ""


def test_an_update_takes_its_place_with_the_same_size_and_time(program: Path) -> None:
    own = OwnProgram(program)
    new = program.with_name("nep-studio.dpkg-new")
    new.write_bytes(b"new")
    shutil.copystat(program, new)
    new.replace(program)
    assert own.fate() == "replaced"


def test_it_is_gone_and_comes_back_as_another(program: Path) -> None:
    own = OwnProgram(program)
    program.rename(program.with_name("kept, so that its number is not given again"))
    assert own.fate() == "gone"
    program.write_bytes(b"new")
    assert own.fate() == "replaced"


def test_from_source_there_is_no_program_to_watch() -> None:
    assert OwnProgram().fate() == ""


def test_a_person_is_told_and_the_alert_goes_with_its_cause(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.frozen", True, raising=False)
    monkeypatch.setattr("sys.executable", str(program))
    session = Session(Settings(tmp_path / "home"), journal_folder=tmp_path / "j", start_processes=False)
    try:
        kept = program.rename(program.with_name("kept"))
        session._check(0.0)
        (alert,) = (each for each in session.alerts.active if each.id == "installation")
        assert (alert.severity, alert.count) == ("error", 0)
        assert "removed" in alert.title
        program.write_bytes(b"new")
        session._check(1.0)
        (alert,) = (each for each in session.alerts.active if each.id == "installation")
        assert "updated" in alert.title
        kept.replace(program)
        session._check(2.0)
        assert not [each for each in session.alerts.active if each.id == "installation"]
    finally:
        session.close()


def test_what_became_of_a_behaviour_is_still_told_after_the_look_at_studios_own_program(
    tmp_path: Path,
) -> None:
    session = Session(Settings(tmp_path / "home"), journal_folder=tmp_path / "j", start_processes=False)
    try:
        session.alerts.put("program", "error", "The behaviour ended unexpectedly.")
        session._check(0.0)
        assert [each.title for each in session.alerts.active if each.id == "program"] == [
            "The behaviour ended unexpectedly."
        ]
    finally:
        session.close()


def test_studio_starts_again_in_the_language_of_the_settings() -> None:
    environ = {"NEP_LANG": "en", "LANGUAGE": "es", "NEP_MASTER": "127.0.0.1:7781"}
    assert fresh_environ(environ) == {"NEP_MASTER": "127.0.0.1:7781"}
    assert studio_command("dark") == [sys.executable, "-m", "app", "--theme", "dark"]
