"""Test of a setting that is added in one file: shown in the sheet, stored, read with its type, noticed."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel

from app.core.session import Session
from app.core.storage import settings as settings_module
from app.ui.shell.dialogs.settings import SettingsSheet
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from app.ui.widgets import Switch
from app.ui.widgets.inputs.fields import NumberEdit
from tests.ui.shell_parts import PANELS, free_address

pytest_plugins = ["tests.ui.shell_fixtures"]

SOURCE = """
from app.core.storage import settings
from app.core.storage.setting import FlagSetting, NumberSetting, SheetRow
from nep.i18n import lazy


class Settings(settings.Settings):
    volume = NumberSetting(
        "volume", 60, 0, 100, "%",
        row=SheetRow(lazy("Volume"), explanation=lazy("Applies to all robots.")), is_public=True,
    )
    greets = FlagSetting("greets", True, row=SheetRow(lazy("Greeting"), lazy("Greet at startup")))
"""
"""Settings with two more: the lines that would be added to `app.core.storage.settings.Settings`."""
USER = """
from typing import assert_type
from settings_of_the_test import Settings

settings = Settings()
assert_type(settings.volume, int)
assert_type(settings.theme, str)
settings.volume = "loud"
settings.on_change(Settings.volume, str.upper)
"""


@pytest.fixture
def added(tmp_path: Path) -> Iterator[ModuleType]:
    """Yield the module of the settings from one more file."""
    path = tmp_path / "settings_of_the_test.py"
    path.write_text(SOURCE, "utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[path.stem]


def test_setting_added_in_one_file_is_shown_stored_typed_and_noticed(
    qtbot, added: ModuleType, theme: Theme, home: Path
) -> None:
    description = cast("Any", added.Settings)
    settings = description(home)
    session = Session(
        settings, address=free_address(), journal_folder=home / "journal", start_processes=False
    )
    window = MainWindow(session, theme, PANELS, [])
    qtbot.addWidget(window)
    window.show()
    window.commands.run("settings.open")
    sheet = window.findChild(SettingsSheet)
    assert sheet is not None
    assert {"Volume", "Greeting"} <= {label.text() for label in sheet.findChildren(QLabel)}
    noticed: list[tuple[str, object]] = []
    settings.on_change(description.volume, lambda value: noticed.append(("volume", value)))
    settings.on_change(description.greets, lambda value: noticed.append(("greets", value)))

    switch = sheet.rows[description.greets].control
    assert isinstance(switch, Switch)
    assert (switch.text(), switch.isChecked()) == ("Greet at startup", True)
    QTest.mouseClick(switch, Qt.MouseButton.LeftButton)
    field = sheet.rows[description.volume].control
    assert isinstance(field, NumberEdit)
    assert (field.text(), field.accessibleName(), field.toolTip()) == (
        "60",
        "Volume",
        "Applies to all robots.",
    )
    field.selectAll()
    QTest.keyClicks(field, "35")
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert (settings.volume, settings.greets) == (35, False)
    assert noticed == [("greets", False), ("volume", 35)]
    settings.volume = 40
    assert field.text() == "40"
    window.close()

    stored = json.loads((home / "settings.json").read_text("utf-8"))
    assert (stored["volume"], stored["greets"]) == (40, False)
    again = description(home)
    assert (again.volume, again.greets) == (40, False)
    assert "volume" in {each.key for each in description.described() if each.is_public}


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_type_of_an_added_setting_is_checked(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    (tmp_path / "settings_of_the_test.py").write_text(SOURCE, "utf-8")
    (tmp_path / "user.py").write_text(USER, "utf-8")
    root = Path(settings_module.__file__).parents[3]
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--no-error-summary",
         f"--cache-dir={tmp_path / 'cache'}", "user.py"],
        cwd=tmp_path, env={"MYPYPATH": str(root), "PATH": ""}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    lines = checked.stdout.splitlines()
    assert [line.split(":")[1] for line in lines] == ["7", "8", "9"], checked.stdout + checked.stderr
    assert "Literal['light', 'dark', 'system']" in lines[0]
