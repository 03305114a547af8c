"""Tests of the folders of settings, state and logs on each platform."""

from __future__ import annotations

from pathlib import Path

import platformdirs
import pytest
from platformdirs import windows
from platformdirs.macos import MacOS
from platformdirs.unix import Unix
from platformdirs.windows import Windows

from app.core.faults import log_folder
from app.core.storage.folders import data_home, home, state_home

VARIABLES = ("XDG_CONFIG_HOME", "XDG_STATE_HOME", "XDG_DATA_HOME", "NEP_STUDIO_HOME")


@pytest.fixture(autouse=True)
def _of_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "/home/ana")
    monkeypatch.setenv("USERPROFILE", "/home/ana")  # the home directory on Windows
    # Called only on Windows.
    monkeypatch.setattr(windows, "get_win_folder", lambda _name: "C:\\Users\\ana\\AppData\\Local")


def on(monkeypatch: pytest.MonkeyPatch, system: type[platformdirs.api.PlatformDirsABC]) -> None:
    monkeypatch.setattr(platformdirs, "PlatformDirs", system)


@pytest.mark.parametrize(
    ("system", "log", "state"),
    [
        (Unix, "/home/ana/.local/state/nep-studio/log", "/home/ana/.local/state/nep-studio"),
        (MacOS, "/home/ana/Library/Logs/nep-studio", "/home/ana/Library/Application Support/nep-studio"),
        (
            Windows,
            "C:\\Users\\ana\\AppData\\Local/nep-studio/Logs",
            "C:\\Users\\ana\\AppData\\Local/nep-studio",
        ),
    ],
)
def test_log_and_state_folders_follow_platform_conventions(
    monkeypatch: pytest.MonkeyPatch, system: type[platformdirs.api.PlatformDirsABC], log: str, state: str
) -> None:
    on(monkeypatch, system)
    assert str(log_folder()).replace("\\", "/") == log.replace("\\", "/")
    assert str(state_home()).replace("\\", "/") == state.replace("\\", "/")
    assert home().name == data_home().name == "nep-studio"


def test_environment_variable_puts_settings_state_and_logs_into_one_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    assert (log_folder(), state_home(), home()) == (tmp_path / "log", tmp_path, tmp_path)
