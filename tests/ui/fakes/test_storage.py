"""Tests that the storage in memory behaves like files, and the fake doctor like the real one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from app.blocks.model.program import Problem, Program
from app.core.network.doctor import Doctor
from app.core.projects.journal import Journal
from app.core.projects.open_project import OpenProject
from app.core.storage.settings import MAX_RECENT_FILES, Settings
from nep.programs.doctor import Finding
from tests.blocks.samples import block, started, text, workspace, write
from tests.ui.fakes import session, storage


@pytest.fixture(params=["on a disk", "in memory"])
def is_real(request: pytest.FixtureRequest) -> bool:
    return bool(request.param == "on a disk")


# -- settings ---------------------------------------------------------------------------------------------


@pytest.fixture
def settings(is_real: bool, tmp_path: Path) -> Settings:
    return Settings(tmp_path / "home") if is_real else storage.Settings()


def test_setting_is_saved_and_its_change_is_noticed(settings: Settings) -> None:
    noticed: list[str] = []
    settings.on_change(Settings.theme, noticed.append)
    assert settings.theme == "system"
    settings.theme = "dark"
    settings.theme = "dark"
    settings.tabs = {"tabs": ["a", {"b": None}]}
    assert (settings.theme, settings.tabs, noticed) == ("dark", {"tabs": ["a", {"b": None}]}, ["dark"])
    assert (settings.write_error, settings.damaged_path) == (None, None)


@pytest.mark.parametrize("value", [object(), {1, 2}, b"bytes"])
def test_value_that_json_cannot_encode_is_rejected_and_not_saved(settings: Settings, value: object) -> None:
    settings.tabs = {"tabs": 1}
    with pytest.raises(TypeError):
        settings.tabs = {"tabs": value}
    assert settings.tabs == {"tabs": 1}


def test_recent_files_are_newest_first(settings: Settings, tmp_path: Path) -> None:
    files = [tmp_path / f"{number}.nepb" for number in range(MAX_RECENT_FILES + 2)]
    for file in files:
        file.write_text("x", "utf-8")
        settings.add_recent(file)
    settings.add_recent(files[5], "Five")  # the name of a saved file is its file name
    files[-1].unlink()
    assert [each.name for each in settings.recent_files][:2] == ["5", files[-2].stem]
    assert len(settings.all_recent_files) == MAX_RECENT_FILES
    settings.set_recent([])
    assert settings.recent_files == []


# -- a behaviour and its journal --------------------------------------------------------------------------


class Kept:
    """Open project and the content of its journal."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self.document = OpenProject(lambda: Journal(folder)) if folder is not None else storage.OpenProject()

    @property
    def blocks(self) -> object:
        """Blocks in the journal, or None if it is empty."""
        if self._folder is not None:
            file = self._folder / self.document.journal_name
            return json.loads(file.read_text("utf-8"))["workspace"] if file.exists() else None
        journal = self.document._journal
        assert isinstance(journal, storage.Journal)
        return json.loads(journal.kept) if journal.kept is not None else None


@pytest.fixture
def kept(is_real: bool, tmp_path: Path) -> Kept:
    return Kept(tmp_path / "journal" if is_real else None)


FIRST = workspace(started(write(text("one"))))
SECOND = workspace(started(write(text("two"))))


def test_edit_is_in_the_journal_until_the_behaviour_is_saved(kept: Kept, tmp_path: Path) -> None:
    document = kept.document
    assert (kept.blocks, document.dirty, document.edits) == (None, False, 0)
    document.apply_edit(FIRST)
    document.apply_edit(FIRST)  # an edit without changes isn't counted
    assert (kept.blocks, document.dirty, document.edits) == (FIRST, True, 1)
    document.apply_edit(SECOND)
    assert (kept.blocks, document.edits) == (SECOND, 2)
    document.save(tmp_path / "mine.nepb")
    assert (kept.blocks, document.dirty, document.name) == (None, False, "mine")


def test_each_behaviour_has_its_own_journal(kept: Kept) -> None:
    document = kept.document
    document.apply_edit(FIRST)
    before = document.journal_name
    assert document.journal_name == before
    document.new("Other")
    assert document.journal_name != before
    assert kept.blocks is None
    document.close()
    document.close()  # already closed
    assert document.journal_error is None


def test_document_compiles_its_blocks_once_per_edit(kept: Kept) -> None:
    document = kept.document
    document.apply_edit(FIRST)
    program = document.program()
    assert type(program) is Program
    assert "one" in program.source
    assert document.newest_program() is document.program() is program
    document.apply_edit(workspace(started(block("control_wait", "w"))))
    assert [problem.block_id for problem in document.problems() if problem.severity == "error"] == ["w"]
    assert document.definitions() is document.definitions()
    document.set_topics(["/a"])
    assert document.newest_program() is not program


def test_fake_document_returns_the_given_compiler_results() -> None:
    document = storage.OpenProject()
    document.apply_edit(FIRST)
    told = (Problem("info", "b", None, "x", "x is slow."),)
    document.found, document.source, document.sensors, document.absent_blocks = (
        told,
        "pass",
        (("A", "b"),),
        ("c",),
    )
    program = document.program()
    document.found = ()
    assert document.problems() == told, "nothing was edited since"
    assert (program.source, program.sensors, program.absent) == ("pass", (("A", "b"),), ("c",))
    assert program.starts == 1


# -- connection doctor ------------------------------------------------------------------------------------


@pytest.fixture
def look(is_real: bool) -> Callable[[list[Finding]], Doctor]:
    """Return a function that runs a doctor with these findings; None makes its checks fail."""

    def found(findings: list[Finding] | None) -> Doctor:
        if is_real:
            made = Doctor(lambda _topic, _tell: tuple(findings))  # type: ignore[arg-type]
        else:
            made = session.Doctor()
            made.found = findings  # type: ignore[assignment]
        assert (made.is_running, made.finished_s, tuple(made.findings), made.revision) == (False, None, (), 0)
        made.start()
        made.close()
        return made

    return found


def test_doctor_stores_its_findings(look: Callable[[object], Doctor]) -> None:
    fine = Finding("master", "ok", "A master runs.")
    doctor = look([fine])
    assert (tuple(doctor.findings), doctor.is_running) == ((fine,), False)
    assert doctor.finished_s is not None
    seen = doctor.revision
    assert seen > 0
    doctor.start()
    doctor.close()
    assert doctor.revision > seen


def test_doctor_that_crashes_reports_the_error(look: Callable[[object], Doctor]) -> None:
    (finding,) = look(None).findings
    assert (finding.id, finding.severity) == ("doctor", "error")
    assert finding.sentence.startswith("The doctor couldn't finish (TypeError")
