"""Tests of files in other formats: newer ones are kept and reported once, older ones are read."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.blocks.model.project import Project
from app.core.projects.backpack import Backpack
from app.core.projects.file_format import read_file, write_file
from app.core.projects.journal import newer_work_names, unsaved_work
from app.core.storage.settings import Settings
from app.core.storage.settings_file import FORMAT_VERSION
from app.errors import DocumentError
from app.ui.shell.docking.workbench import STATE_VERSION

NEWER = {
    "format": FORMAT_VERSION + 1,
    "theme": "dark",
    "language": "es",
    "recent": {"new": "shape"},
    "later": [1],
}
JOURNAL = {
    "pid": 2**22 + 7, "born_s": 1.0, "name": "Mine", "path": None, "edited_s": 5.0, "robots": {},
    "workspace": {"blocks": 1},
}  # fmt: skip


def write(path: Path, content: object) -> bytes:
    path.write_text(json.dumps(content))
    return path.read_bytes()


# ---- settings


def test_settings_of_a_newer_version_are_not_modified(tmp_path: Path) -> None:
    before = write(tmp_path / "settings.json", NEWER)
    settings = Settings(tmp_path)
    assert settings.theme == "dark", "what can be read of them is taken"
    assert settings.recent_files == []
    assert "newer NEP Studio (format 2)" in settings.notice
    assert settings.notice.count(".") == 2 + settings.notice.count(".json")
    settings.theme = "light"
    settings.add_recent(tmp_path / "a.nepb")
    assert (tmp_path / "settings.json").read_bytes() == before
    assert not settings.are_new


def test_changes_to_newer_settings_go_to_a_separate_file_with_one_notice(tmp_path: Path) -> None:
    write(tmp_path / "settings.json", NEWER)
    Settings(tmp_path).theme = "light"
    again = Settings(tmp_path)
    assert (again.theme, again.language) == ("light", "es")
    assert again.notice == ""
    kept = json.loads((tmp_path / "settings.format-1.json").read_text())
    assert kept["format"] == FORMAT_VERSION
    assert kept["later"] == [1]


def test_settings_that_a_newer_version_writes_at_runtime_are_not_overwritten(tmp_path: Path) -> None:
    settings = Settings(tmp_path)
    settings.theme = "light"
    newer = write(tmp_path / "settings.json", NEWER)
    settings.theme = "system"
    settings.language = "en"
    assert (tmp_path / "settings.json").read_bytes() == newer
    again = Settings(tmp_path)
    assert (again.theme, again.language) == ("system", "en")


@pytest.mark.parametrize("said", [None, "2", 1.5, True, [], 1])
def test_settings_of_an_older_version_are_read_and_migrated_in_place(tmp_path: Path, said: object) -> None:
    old: dict[str, object] = {"theme": "dark", "of another plug-in": 7}
    write(tmp_path / "settings.json", old if said is None else {**old, "format": said})
    settings = Settings(tmp_path)
    assert (settings.theme, settings.notice) == ("dark", "")
    settings.language = "es"
    kept = json.loads((tmp_path / "settings.json").read_text())
    assert kept == {**old, "language": "es", "format": FORMAT_VERSION}, "what it does not know is kept"
    assert [path.name for path in tmp_path.glob("settings*.json")] == ["settings.json"]


def test_own_settings_file_in_an_unreadable_newer_format_is_backed_up(tmp_path: Path) -> None:
    write(tmp_path / "settings.json", NEWER)
    whole = write(tmp_path / "settings.format-1.json", NEWER)
    settings = Settings(tmp_path)
    assert settings.damaged_path is not None
    assert settings.damaged_path.read_bytes() == whole
    settings.theme = "light"
    assert Settings(tmp_path).theme == "light"


def test_damaged_own_settings_file_next_to_a_newer_one_is_backed_up(tmp_path: Path) -> None:
    before = write(tmp_path / "settings.json", NEWER)
    (tmp_path / "settings.format-1.json").write_text("{")
    settings = Settings(tmp_path)
    assert settings.damaged_path is not None
    assert settings.damaged_path.read_text() == "{"
    assert (tmp_path / "settings.json").read_bytes() == before


def test_layout_state_version_changes_only_with_the_settings_format() -> None:
    assert (FORMAT_VERSION, STATE_VERSION) == (1, 1), (
        "a new STATE_VERSION requires a new FORMAT_VERSION of the settings"
    )


# ---- unsaved work


def test_unsaved_work_of_a_newer_version_is_listed_and_not_modified(tmp_path: Path) -> None:
    before = write(tmp_path / "a.json", {**JOURNAL, "format": 3, "workspace": "in another way"})
    write(tmp_path / "b.json", {**JOURNAL, "name": "Other", "format": 1})
    assert newer_work_names(tmp_path) == ["Mine"]
    assert [each.name for each in unsaved_work(tmp_path)] == ["Other"]
    assert (tmp_path / "a.json").read_bytes() == before


def test_unsaved_work_of_an_older_version_is_restored(tmp_path: Path) -> None:
    write(tmp_path / "a.json", JOURNAL)
    (found,) = unsaved_work(tmp_path)
    assert (found.name, found.project.always.workspace.blocks) == ("Mine", {"blocks": 1})
    assert newer_work_names(tmp_path) == []
    assert newer_work_names(tmp_path / "none") == []


@pytest.mark.parametrize("content", ["", "{", "[]", '{"format": 2}', '{"format": 2, "pid": []}'])
def test_invalid_journal_is_ignored(tmp_path: Path, content: str) -> None:
    (tmp_path / "a.json").write_text(content)
    assert newer_work_names(tmp_path) == []
    assert unsaved_work(tmp_path) == []


# ---- the backpack


def test_backpack_of_a_newer_version_is_not_modified(tmp_path: Path) -> None:
    before = write(tmp_path / "backpack.json", {"backpack": 2, "things": [{"id": "x"}]})
    backpack = Backpack(tmp_path)
    backpack.reload_if_changed()
    assert backpack.items == ()
    assert backpack.take_problem() == (
        "the backpack in “backpack.json” belongs to a newer NEP Studio and is unchanged; "
        "blocks you add here are saved separately"
    )
    backpack.add([{"type": "control_wait"}])
    assert (tmp_path / "backpack.json").read_bytes() == before
    again = Backpack(tmp_path)
    again.reload_if_changed()
    assert [item.block["type"] for item in again.items] == ["control_wait"]
    assert again.take_problem() == ""


def test_own_backpack_file_in_an_unreadable_newer_format_is_backed_up(tmp_path: Path) -> None:
    for name in ("backpack.json", "backpack.format-1.json"):
        write(tmp_path / name, {"backpack": 2})
    backpack = Backpack(tmp_path)
    backpack.reload_if_changed()
    assert "damaged" in backpack.take_problem()
    assert json.loads((tmp_path / "backpack.json").read_text()) == {"backpack": 2}
    assert json.loads((tmp_path / "backpack.format-1.damaged.json").read_text()) == {"backpack": 2}


# ---- behaviours


def test_behaviour_of_a_newer_version_is_rejected_with_a_message_and_not_modified(tmp_path: Path) -> None:
    path = tmp_path / "Mine.nepb"
    before = write(path, {"format": "nep-behaviour", "version": 3, "workspace": {"blocks": {}}})
    with pytest.raises(DocumentError) as raised:
        read_file(path)
    assert str(raised.value) == (
        "Mine.nepb was saved by a newer NEP Studio (version 3) and is unchanged; update NEP Studio"
    )
    assert path.read_bytes() == before


def test_unknown_fields_of_a_behaviour_file_are_preserved_on_save(tmp_path: Path) -> None:
    path = tmp_path / "Mine.nepb"
    write(
        path,
        {
            "format": "nep-behaviour",
            "version": 1,
            "workspace": {"later": {"inside": 1}},
            "robots": {},
            "later": [1],
        },
    )
    found = read_file(path)
    write_file(
        path, Project.of_blocks("Other", found.always.workspace.blocks, found.robots, found.unknown_fields)
    )
    assert json.loads(path.read_text())["later"] == [1]
    assert json.loads(path.read_text())["workspace"] == {"later": {"inside": 1}}
