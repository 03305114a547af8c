"""Tests of settings that persist across restarts and after damage of their file."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.core.storage.folders import home
from app.core.storage.settings import MAX_RECENT_FILES, Settings
from app.core.storage.settings_file import read_setting
from app.errors import SettingsError


def test_setting_persists_after_a_restart(tmp_path: Path) -> None:
    Settings(tmp_path).theme = "dark"
    assert Settings(tmp_path).theme == "dark"


def test_settings_are_new_until_a_value_is_saved(tmp_path: Path) -> None:
    assert Settings(tmp_path).are_new
    assert Settings(tmp_path).are_new
    Settings(tmp_path).theme = "dark"
    assert not Settings(tmp_path).are_new


def test_damaged_settings_are_not_new(tmp_path: Path) -> None:
    (tmp_path / "settings.json").write_bytes(b"{")
    assert not Settings(tmp_path).are_new


@pytest.mark.parametrize("damage", [b"", b"{", b"[1]", b"\xff\xfe", b'{"theme": "da'])
def test_damaged_settings_file_is_backed_up(tmp_path: Path, damage: bytes) -> None:
    (tmp_path / "settings.json").write_bytes(damage)
    settings = Settings(tmp_path)
    assert settings.theme == "system"
    assert settings.damaged_path is not None
    assert settings.damaged_path.read_bytes() == damage
    assert "settings.damaged.json" in settings.notice
    settings.theme = "dark"
    assert Settings(tmp_path).theme == "dark"


@pytest.mark.parametrize(
    ("kept", "language"),
    [
        (b'{"language": "ja"}', "ja"),
        (b'{"language": 5}', ""),
        (b"{}", ""),
        (b"[1]", ""),
        (b"{", ""),
        (b"\xff", ""),
        (b"[" * 100_000, ""),
        (None, ""),
    ],
)
def test_language_is_read_without_modifying_any_file(
    tmp_path: Path, kept: bytes | None, language: str
) -> None:
    if kept is not None:
        (tmp_path / "settings.json").write_bytes(kept)
    assert read_setting(Settings.language, tmp_path) == language
    assert [each.read_bytes() for each in tmp_path.iterdir()] == ([] if kept is None else [kept])


def test_language_from_the_separate_file_overrides_newer_settings(tmp_path: Path) -> None:
    (tmp_path / "settings.json").write_text('{"format": 99, "language": "ja"}', "utf-8")
    assert read_setting(Settings.language, tmp_path) == "ja"
    Settings(tmp_path).language = "fr"
    assert read_setting(Settings.language, tmp_path) == "fr"
    (tmp_path / "settings.json").write_text('{"language": "es"}', "utf-8")
    assert read_setting(Settings.language, tmp_path) == "es"


def test_recent_files_are_newest_first_without_duplicates_or_missing_files(tmp_path: Path) -> None:
    settings = Settings(tmp_path / "home")
    files = [tmp_path / f"{number}.nepb" for number in range(MAX_RECENT_FILES + 3)]
    for file in files:
        file.write_text("x")
        settings.add_recent(file)
    settings.add_recent(files[5], "Five")
    files[-1].unlink()
    recent = Settings(tmp_path / "home").recent_files
    assert recent[0].path == files[5].resolve()
    assert recent[0].name == "5", "the file's own name"
    assert files[-1].resolve() not in [item.path for item in recent]
    assert len({item.path for item in recent}) == len(recent) <= MAX_RECENT_FILES


def test_unwritable_settings_folder_raises_settings_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(SettingsError, match="can't save settings"):
        Settings(tmp_path / "file").theme = "dark"


def test_settings_folder_is_configurable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    assert home() == tmp_path


def test_unsaved_changes_are_tracked_until_the_file_is_writable(tmp_path: Path) -> None:
    settings = Settings(tmp_path)
    settings.theme = "light"
    assert settings.write_error is None
    settings.path.unlink()
    settings.path.mkdir()  # stands for a disk that can't be written
    with pytest.raises(SettingsError):
        settings.theme = "dark"
    with pytest.raises(SettingsError):
        settings.text_percent = 125
    assert settings.write_error is not None
    assert (settings.theme, settings.text_percent) == ("dark", 125)
    settings.path.rmdir()
    Settings(tmp_path).layout = "developer"  # another Studio, once the disk can be written again
    settings.text_percent = 125
    assert settings.write_error is None
    again = Settings(tmp_path)
    assert (again.theme, again.text_percent, again.layout) == (
        "dark", 125, "developer",
    )  # fmt: skip


def test_recent_file_with_non_utf_8_name_is_saved_with_the_other_settings(
    tmp_path: Path,
) -> None:
    """Disks of other systems contain such names; Python decodes them to lone surrogates."""
    name = "Begr\udcfc\udcdfung.nepb"
    settings = Settings(tmp_path / "home")
    settings.add_recent(tmp_path / name)
    settings.theme = "dark"
    again = Settings(tmp_path / "home")
    assert [file.path.name for file in again.all_recent_files] == [name]
    assert again.theme == "dark"
    assert again.damaged_path is None


@pytest.mark.parametrize("value", [{"a": object()}, {"a": {1, 2}}, {("a", "b"): 1}])
def test_value_that_json_cannot_represent_is_rejected_and_other_settings_are_saved(
    tmp_path: Path, value: dict[str, object]
) -> None:
    settings = Settings(tmp_path)
    with pytest.raises(TypeError):
        settings.layouts = value
    settings.theme = "dark"
    assert Settings(tmp_path).theme == "dark"
