"""Tests of typed settings: validated when they are read, observed when they change, stored as before."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import pytest

from app.core.storage.folders import default_pictures_folder
from app.core.storage.setting import FolderSetting, LanguageSetting, Setting
from app.core.storage.settings import Mode, Settings
from app.errors import SettingsError

STORED: dict[str, object] = {
    "begun": True,
    "chosen_layouts": {"developer": "Mine"},
    "first_steps": ["robot", "start"],
    "flight_recorder": {"on": True},
    "format": 1,
    "high_contrast": True,
    "language": "es",
    "layout": "developer",
    "layouts": {"developer": {"open": ["topics"]}},
    "less_motion": "on",
    "listen_at": ["192.168.1.20"],
    "networks": {"ros2": "7"},
    "of another version": [1, {"a": None}],
    "palette_last": ["command:text.larger"],
    "pictures_folder": "/somewhere/pictures",
    "recent": [{"path": "/a/Mine.nepb", "name": "Mine", "opened_s": 5.5}],
    "recording": {"mode": "all"},
    "recordings_folder": "/somewhere/recordings",
    "robots.known": [{"name": "NAO", "seen_s": 2.5}],
    "robots.may_move": ["NAO (nao)"],
    "robots_heard": False,
    "room": {"things": []},
    "runs_begin_at_start": False,
    "shortcuts": {"run.step": ["Ctrl+."]},
    "studio_versions": [{"version": "0.0.9", "since_s": 1.5}],
    "tabs": {"ended_well": True},
    "text_percent": 150,
    "theme": "dark",
    "toolbox_pinned": False,
    "virtual_robots": {"Pepper": "pepper"},
    "virtual_robots_come_back": False,
    "window": "AAAA",
}
"""Values as Studio 0.1 stores them."""


def write(folder: Path, values: dict[str, object]) -> Settings:
    folder.mkdir(exist_ok=True)
    (folder / "settings.json").write_text(json.dumps(values, indent=1, sort_keys=True), "utf-8")
    return Settings(folder)


def test_every_stored_value_is_read_and_written_back_unchanged(tmp_path: Path) -> None:
    values = {**STORED, "high_contrast": "on"}
    settings = write(tmp_path, values)
    before = settings.path.read_bytes()
    for setting in Settings.described():
        value = settings.value(setting)
        assert settings.is_stored(setting), setting.key
        assert value != setting.default, setting.key
        write(tmp_path, {**values, setting.key: None})
        Settings(tmp_path).set_value(setting, value)
        assert settings.path.read_bytes() == before, setting.key
    assert settings.invalid_count == 0


def test_keys_are_unique_and_all_known() -> None:
    keys = [setting.key for setting in Settings.described()]
    assert sorted(keys) == sorted(set(STORED) - {"format", "of another version"})


def test_values_that_older_versions_stored_are_converted_only_when_they_are_read(tmp_path: Path) -> None:
    settings = write(tmp_path, STORED)
    assert settings.contrast == "on"
    settings.text_percent = 125
    assert json.loads(settings.path.read_text()) == {**STORED, "text_percent": 125}


@pytest.mark.parametrize("setting", Settings.described(), ids=lambda setting: setting.key)
def test_invalid_value_gives_the_default_and_is_counted_and_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, setting: Setting[Any]
) -> None:
    other = "nonsense" if not isinstance(setting, FolderSetting | LanguageSetting) else 5
    invalid: object = 5 if isinstance(STORED[setting.key], str) else other
    settings = write(tmp_path, {**STORED, setting.key: invalid})
    with caplog.at_level(logging.WARNING):
        assert [settings.value(setting) for _ in range(3)] == [setting.default] * 3
    (record,) = caplog.records
    assert f"“{setting.key}”" in record.getMessage()
    assert str(invalid) not in record.getMessage().replace(str(tmp_path), "")
    assert (settings.invalid_count, settings.is_stored(setting)) == (1, False)
    for each in Settings.described():
        settings.value(each)
    assert settings.invalid_count == 1
    assert settings.stored_values()[setting.key] == invalid, "the file is not changed"


def test_number_is_limited_to_its_range(tmp_path: Path) -> None:
    assert [write(tmp_path, {"text_percent": each}).text_percent for each in (-5, 110, 900)] == [
        100,
        110,
        200,
    ]
    settings = Settings(tmp_path)
    settings.text_percent = 1000
    assert json.loads(settings.path.read_text())["text_percent"] == 200


def test_null_and_missing_values_are_the_default_without_a_warning(tmp_path: Path) -> None:
    settings = write(tmp_path, {"theme": None, "pictures_folder": ""})
    assert (settings.theme, settings.toolbox_pinned, settings.layout) == ("system", None, "start")
    assert settings.pictures_folder == default_pictures_folder()
    assert not settings.is_stored(Settings.pictures_folder)
    assert settings.invalid_count == 0


def test_callback_is_called_once_for_each_change_until_it_is_removed(tmp_path: Path) -> None:
    settings = Settings(tmp_path)
    noticed: list[Mode] = []
    remove = settings.on_change(Settings.theme, noticed.append)
    settings.theme = "dark"
    settings.theme = "dark"
    settings.text_percent = 150
    settings.theme = "light"
    assert noticed == ["dark", "light"]
    remove()
    settings.theme = "dark"
    assert noticed == ["dark", "light"]


def test_change_that_cannot_be_saved_is_noticed_nevertheless(tmp_path: Path) -> None:
    (tmp_path / "home").write_text("no folder")
    settings = Settings(tmp_path / "home")
    noticed: list[Mode] = []
    settings.on_change(Settings.theme, noticed.append)
    with pytest.raises(SettingsError):
        settings.theme = "dark"
    assert (settings.theme, noticed) == ("dark", ["dark"])


def test_change_of_another_instance_is_noticed_with_the_next_own_change(tmp_path: Path) -> None:
    settings = Settings(tmp_path)
    noticed: list[int] = []
    settings.on_change(Settings.text_percent, noticed.append)
    Settings(tmp_path).text_percent = 150
    assert noticed == []
    settings.layout = "developer"
    assert (settings.text_percent, noticed) == (150, [150])


def test_override_is_not_stored_and_ends_when_the_setting_is_set(tmp_path: Path) -> None:
    settings = write(tmp_path, {"theme": "light"})
    noticed: list[Mode] = []
    settings.on_change(Settings.theme, noticed.append)
    settings.override(Settings.theme, "dark")
    settings.text_percent = 125
    assert (settings.theme, Settings(tmp_path).theme) == ("dark", "light")
    settings.theme = "light"
    assert (settings.theme, noticed) == ("light", ["dark", "light"])
