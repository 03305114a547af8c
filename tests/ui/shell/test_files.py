"""Tests of opening and saving behaviours without losing work or asking for confirmation."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.blocks.model.project import Project
from app.core.projects.file_format import write_file
from app.core.projects.open_project import OpenProject
from app.core.projects.versions import free_path
from app.core.run.view import RunState
from app.intents import AddTimeLimit, OpenBehaviour
from app.ui.intents import CloseBehaviour, CloseOtherTabs, MoveTab
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow
from tests.ui.shell_parts import Answers

pytest_plugins = ["tests.ui.shell_fixtures"]
BLOCKS = {"blocks": {"languageVersion": 0, "blocks": [{"type": "events_started", "id": "a"}]}}


@pytest.fixture
def document(window: MainWindow) -> OpenProject:
    return window.session.document


def saved(path: Path) -> Path:
    """Write a behaviour file and return its path."""
    write_file(path, Project.of_blocks(path.stem, BLOCKS))
    return path


def test_saving_a_new_behaviour_opens_the_file_dialog(
    commands: Commands, document: OpenProject, answers: Answers, tmp_path
) -> None:
    document.apply_edit(BLOCKS)
    answers.path = tmp_path / "Story.nepb"
    commands.run("file.save")
    assert answers.asked[0].endswith("New behaviour.nepb")
    assert answers.path.is_file()
    assert (document.name, document.dirty) == ("Story", False)
    commands.run("file.save")
    assert len(answers.asked) == 1


def test_saving_flushes_the_behaviour_editor(
    commands: Commands, window: MainWindow, document, answers, tmp_path
) -> None:
    answers.path = tmp_path / "a.nepb"
    bench = window.show_layout("behaviour")
    commands.run("file.save")
    assert bench.docks["behaviour"].panel.flushed == 1


def changed(id: str) -> dict[str, object]:
    return {"blocks": {"languageVersion": 0, "blocks": [{"type": "events_started", "id": id}]}}


def names(window: MainWindow) -> list[str]:
    return [document.name for document in window.session.documents]


def test_another_file_opens_in_a_new_tab_next_to_unsaved_work(commands, window, tmp_path: Path) -> None:
    path = saved(tmp_path / "Other.nepb")
    window.session.document.apply_edit(BLOCKS)
    commands.files.open(path)
    assert names(window) == ["New behaviour", "Other"]
    assert window.session.document.name == "Other"
    assert next(iter(window.session.documents)).dirty
    assert window.current_layout == "behaviour"


def test_unsaved_behaviour_without_a_file_is_kept_when_its_tab_is_closed(
    commands, window, home: Path
) -> None:
    window.session.document.apply_edit(BLOCKS)
    commands.run("tab.close")
    kept = list((home / "kept").glob("New behaviour*.nepb"))
    assert len(kept) == 1
    assert [file.path for file in window.session.settings.recent_files] == [kept[0].resolve()]
    assert window.toast.text == "Closed New behaviour. You'll find it under Recent."
    assert names(window) == ["New behaviour"]
    assert window.session.document.is_blank


def test_changed_file_is_saved_when_its_tab_is_closed_and_can_be_reopened(commands, window, tmp_path) -> None:
    path = saved(tmp_path / "Mine.nepb")
    commands.files.open(path)
    window.session.document.apply_edit(changed("z"))
    commands.run("tab.close")
    assert window.toast.text == "Saved Mine"
    assert names(window) == ["New behaviour"]
    commands.run("tab.reopen")
    assert names(window) == ["Mine"]
    assert window.session.document.workspace == changed("z")
    commands.run("tab.reopen")
    assert window.toast.text == "No closed tabs"


def press_toast(window: MainWindow) -> None:
    window.toast.button.click()


def test_saving_on_tab_close_can_be_undone(commands, window, tmp_path: Path) -> None:
    path = saved(tmp_path / "Mine.nepb")
    before = path.read_bytes()
    commands.files.open(path)
    window.session.document.apply_edit(changed("z"))
    commands.run("tab.close")
    assert path.read_bytes() != before
    assert window.toast.button.accessibleName() == "Undo"
    press_toast(window)
    assert path.read_bytes() == before
    assert names(window) == ["Mine"]
    assert window.session.document.dirty
    assert window.session.document.workspace == changed("z")


def test_previous_content_of_an_overwritten_file_is_backed_up(commands, window, home: Path, tmp_path) -> None:
    path = saved(tmp_path / "Mine.nepb")
    before = path.read_bytes()
    commands.files.open(path)
    window.session.document.apply_edit(changed("z"))
    commands.run("tab.close")
    copies = list((home / "earlier").glob("Mine, before *.nepb"))
    assert [copy.read_bytes() for copy in copies] == [before]


def test_several_tabs_are_closed_and_restored_together(commands, window, tmp_path: Path) -> None:
    paths = [saved(tmp_path / f"{name}.nepb") for name in "ABC"]
    before = [path.read_bytes() for path in paths]
    for path in paths:
        commands.files.open(path)
        window.session.document.apply_edit(changed(path.stem))
    commands.request(CloseOtherTabs(window.session.document.key))
    assert window.toast.text == "Saved 2 behaviours"
    press_toast(window)
    assert [path.read_bytes() for path in paths] == before
    assert {document.name: document.dirty for document in window.session.documents} == dict.fromkeys(
        "ABC", True
    )


def test_tab_reopened_before_undo_is_unsaved_work(commands, window, tmp_path: Path) -> None:
    path = saved(tmp_path / "Mine.nepb")
    before = path.read_bytes()
    commands.files.open(path)
    window.session.document.apply_edit(changed("z"))
    commands.run("tab.close")
    commands.run("tab.reopen")
    press_toast(window)
    assert path.read_bytes() == before
    assert (names(window), window.session.document.dirty) == (["Mine"], True)
    assert window.session.document.workspace == changed("z")


def test_undo_does_not_overwrite_changes_of_another_program(commands, window, tmp_path: Path) -> None:
    path = saved(tmp_path / "Mine.nepb")
    before = path.read_bytes()
    commands.files.open(path)
    window.session.document.apply_edit(changed("z"))
    commands.run("tab.close")
    path.write_bytes(before + b"\n")
    press_toast(window)
    assert path.read_bytes() == before + b"\n"
    assert names(window) == ["Mine (previous version)"]
    assert window.session.document.path is None  # a copy: saving overwrites neither version
    assert window.session.document.workspace == BLOCKS


def test_tab_stays_open_when_the_overwritten_content_cannot_be_backed_up(
    commands, window, home: Path, tmp_path
) -> None:
    path = saved(tmp_path / "Mine.nepb")
    before = path.read_bytes()
    commands.files.open(path)
    window.session.document.apply_edit(changed("z"))
    (home / "earlier").write_text("in the way", "utf-8")
    commands.run("tab.close")
    assert path.read_bytes() == before
    assert (names(window), window.session.document.dirty) == (["Mine"], True)
    assert window.session.alerts.active[0].title.startswith("Mine.nepb wasn't saved")


def test_saving_over_changes_of_another_program_backs_up_the_changes(
    commands, window, home: Path, tmp_path
) -> None:
    path = saved(tmp_path / "Mine.nepb")
    commands.files.open(path)
    window.session.document.apply_edit(changed("z"))
    foreign = path.read_bytes().replace(b'"a"', b'"theirs"')
    path.write_bytes(foreign)
    commands.run("file.save")
    assert (
        window.toast.text
        == "Saved Mine. Another program had changed the file; its version is under Earlier versions."
    )
    assert [copy.read_bytes() for copy in (home / "earlier").iterdir()] == [foreign]
    press_toast(window)
    document = window.session.document
    assert document.workspace["blocks"]["blocks"][0]["id"] == "theirs"
    assert (document.name, document.path) == ("Mine (previous version)", None)


def test_second_save_is_not_detected_as_an_external_change(commands, window, home: Path, tmp_path) -> None:
    path = saved(tmp_path / "Mine.nepb")
    said = [path.read_bytes()]
    commands.files.open(path)
    for id in "xy":
        window.session.document.apply_edit(changed(id))
        commands.run("file.save")
        assert window.toast.text == "Saved Mine"
        said.append(path.read_bytes())
        commands.run("file.save")
    assert sorted(copy.read_bytes() for copy in (home / "earlier").iterdir()) == sorted(said[:-1])


def test_saving_succeeds_when_earlier_versions_cannot_be_stored(
    commands, window, home: Path, tmp_path
) -> None:
    path = saved(tmp_path / "Mine.nepb")
    commands.files.open(path)
    window.session.document.apply_edit(changed("z"))
    (home / "earlier").write_text("in the way", "utf-8")
    commands.run("file.save")
    assert window.toast.text == "Saved Mine"
    assert b'"z"' in path.read_bytes()
    assert any("can't be kept" in record.text for record in window.session.console.records)


def test_save_as_backs_up_the_overwritten_file(commands, window, answers, home: Path, tmp_path) -> None:
    answers.path = saved(tmp_path / "Theirs.nepb")
    before = answers.path.read_bytes()
    window.session.document.apply_edit(changed("z"))
    commands.run("file.save_as")
    assert window.toast.text == "Saved Theirs. The previous file is under Earlier versions."
    assert b'"z"' in answers.path.read_bytes()
    assert [copy.read_bytes() for copy in (home / "earlier").iterdir()] == [before]
    press_toast(window)
    assert (names(window), window.session.document.path) == (["Theirs", "Theirs (previous version)"], None)
    assert window.session.document.workspace == BLOCKS


def test_file_that_cannot_be_backed_up_is_not_overwritten(
    commands, window, answers, home: Path, tmp_path
) -> None:
    answers.path = saved(tmp_path / "Theirs.nepb")
    before = answers.path.read_bytes()
    window.session.document.apply_edit(changed("z"))
    assert window.session.document.is_on_disk, "it makes the folder"
    (home / "earlier").write_text("in the way", "utf-8")
    commands.run("file.save_as")
    assert answers.path.read_bytes() == before
    assert window.session.document.dirty
    assert window.session.alerts.active[0].button == "Save somewhere else"


def test_save_as_to_a_new_file_creates_no_backup(commands, window, answers, home: Path, tmp_path) -> None:
    answers.path = tmp_path / "New.nepb"
    window.session.document.apply_edit(changed("z"))
    commands.run("file.save_as")
    assert window.toast.text == "Saved New"
    assert not (home / "earlier").exists()


def test_tab_that_cannot_be_saved_stays_open(commands, window, tmp_path: Path) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()
    commands.files.open(saved(folder / "Mine.nepb"))
    window.session.document.apply_edit(changed("z"))
    (folder / "Mine.nepb").unlink()
    folder.rmdir()
    folder.write_text("in the way", "utf-8")
    commands.run("tab.close")
    assert names(window) == ["Mine"]
    alert = window.session.alerts.active[0]
    assert alert.title.startswith("Can't write Mine.nepb (")
    assert alert.button == "Save somewhere else"


def test_closing_the_tab_of_a_running_program_stops_the_program(commands, window, monkeypatch) -> None:
    runs, stopped = window.session.runs, []
    window.session.document.apply_edit(BLOCKS)
    runs.document, runs._run = window.session.document, RunState("running")
    monkeypatch.setattr(runs, "stop", lambda: stopped.append(True))
    commands.run("tab.close")
    assert stopped == [True]


def test_tabs_are_selected_moved_and_closed_by_commands(commands, window, tmp_path: Path) -> None:
    for name in "ABC":
        commands.files.open(saved(tmp_path / f"{name}.nepb"))
    commands.run("tab.next")
    assert window.session.document.name == "A"
    commands.run("tab.previous")
    assert window.session.document.name == "C"
    key = window.session.document.key
    commands.request(MoveTab(key, 0))
    assert names(window) == ["C", "A", "B"]
    commands.request(CloseOtherTabs(key))
    assert names(window) == ["C"]
    commands.request(CloseBehaviour("nobody"))
    assert names(window) == ["C"]


def test_unedited_new_behaviour_leaves_no_file(commands: Commands, home: Path) -> None:
    commands.run("file.new")
    commands.run("tab.close")
    assert not (home / "kept").exists()


def test_save_as_renames_the_tab_and_keeps_the_old_file(
    commands, window, document, answers, tmp_path
) -> None:
    old = saved(tmp_path / "Old.nepb")
    before = old.read_bytes()
    commands.files.open(old)
    window.session.document.apply_edit(changed("z"))
    answers.path = tmp_path / "New.nepb"
    commands.run("file.save_as")
    assert names(window) == ["New"]
    assert old.read_bytes() == before
    assert b'"z"' in answers.path.read_bytes()
    assert [file.name for file in window.session.settings.recent_files] == ["New", "Old"]
    assert answers.asked[-1] == f"save {tmp_path / 'Old.nepb'}"


def test_behaviour_files_are_opened_and_unsupported_files_raise_a_single_alert(
    commands, window, tmp_path: Path
) -> None:
    picture = tmp_path / "photo.png"
    picture.write_bytes(b"x")
    paths = [saved(tmp_path / "A.nepb"), picture, saved(tmp_path / "B.nepb"), tmp_path]
    commands.files.open_all(paths)
    assert names(window) == ["A", "B"]
    alert = window.session.alerts.active[0]
    assert alert.title == "photo.png and 1 more aren't behaviours."
    assert ".nepb" in alert.detail


def test_file_that_is_not_a_behaviour_raises_an_alert(commands, window, document, tmp_path: Path) -> None:
    path = tmp_path / "bad.nepb"
    path.write_text("not json", "utf-8")
    document.apply_edit(BLOCKS)
    commands.files.open(path)
    alert = window.session.alerts.active[0]
    assert alert.title == "bad.nepb is damaged or not a behaviour."
    assert alert.detail == "Open an earlier copy."
    assert alert.intent == OpenBehaviour()
    assert document.workspace == BLOCKS


def test_failed_save_raises_an_alert_until_the_behaviour_is_saved_elsewhere(
    commands: Commands, window, document, answers, tmp_path
) -> None:
    document.apply_edit(BLOCKS)
    (tmp_path / "file").write_text("in the way", "utf-8")
    answers.path = tmp_path / "file" / "x.nepb"
    commands.run("file.save")
    assert window.session.alerts.active[0].button == "Save somewhere else"
    assert document.dirty
    answers.path = tmp_path / "x.nepb"
    commands.run("file.save_as")
    assert list(window.session.alerts.active) == []


def test_fix_changes_the_blocks_and_the_fix_counter(commands: Commands, document: OpenProject) -> None:
    wait = {"type": "control_wait_until", "id": "w"}
    document.apply_edit({"blocks": {"languageVersion": 0, "blocks": [wait]}})
    before = document.fixes
    assert commands.request(AddTimeLimit("w"))
    assert document.workspace["blocks"]["blocks"][0]["type"] == "control_wait_until_at_most"
    assert document.fixes > before
    assert document.dirty


def test_backup_files_do_not_overwrite_each_other(tmp_path: Path) -> None:
    first = free_path(tmp_path, "a/b: c", 0)
    first.touch()
    second = free_path(tmp_path, "a/b: c", 0)
    assert first.parent == tmp_path
    assert first != second
