"""Tests of a frozen program whose file is replaced or removed while it runs: its own modules are imported."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from nep.system.frozen_code import LOADER_MODULE, keep_archive_open

writers = pytest.importorskip("PyInstaller.archive.writers")
reader = pytest.importorskip("PyInstaller.loader.pyimod01_archive")


def frozen(path: Path, *names: str) -> Path:
    """Write an archive of modules as PyInstaller does; `made` in each holds the first name and its own."""
    code = {name: compile(f"made = '{names[0]} {name}'", name, "exec") for name in names}
    entries = [(name, str(path), "PYMODULE") for name in names]
    writers.ZlibArchiveWriter(str(path), entries, code_dict=code)
    return path


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Fake running program: its file and the reader of its modules."""
    file = frozen(tmp_path / "program", "old", "late")
    importers = SimpleNamespace(pyz_archive=reader.ZlibArchiveReader(str(file)))
    monkeypatch.setitem(sys.modules, LOADER_MODULE, importers)
    return SimpleNamespace(file=file, archive=importers.pyz_archive)


def made_by(archive, name: str) -> str:
    found: dict[str, str] = {}
    exec(archive.extract(name), found)
    return found["made"]


@pytest.fixture
def held(program: SimpleNamespace):
    """The program after `keep_archive_open`."""
    assert keep_archive_open()
    yield program
    os.close(int(program.archive._filename.rpartition("/")[2]))


only_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux alone can hold it")


@only_linux
def test_update_keeps_modules_of_the_running_program(held, tmp_path: Path) -> None:
    names = (*(f"only_in_the_new_{number}" for number in range(50)), "late")
    frozen(tmp_path / "next", *names).replace(held.file)
    assert made_by(held.archive, "late") == "old late"
    assert made_by(held.archive, "old") == "old old"


@only_linux
def test_running_program_can_import_its_modules_after_its_file_is_deleted(held) -> None:
    held.file.unlink()
    assert made_by(held.archive, "late") == "old late"


def test_import_from_a_deleted_program_exits_if_the_archive_is_not_kept_open(program) -> None:
    program.file.unlink()
    with pytest.raises(SystemExit):
        program.archive.extract("late")


def test_keep_archive_open_ignores_a_program_already_deleted(program) -> None:
    program.file.unlink()
    assert not keep_archive_open()
    assert program.archive._filename == str(program.file)


def test_keep_archive_open_has_no_effect_when_running_from_source(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, LOADER_MODULE, raising=False)
    assert not keep_archive_open()


@only_linux
def test_packaged_entry_programs_keep_the_archive_open_before_importing_main() -> None:
    entries = Path(__file__).resolve().parents[3] / "installers" / "entries"
    for entry in sorted(entries.glob("*_program.py")):
        lines = entry.read_text("utf-8").splitlines()
        begun = next(number for number, line in enumerate(lines) if "import main" in line)
        assert any(line.startswith("keep_archive_open()") for line in lines[:begun]), entry.name
