"""Tests of the sheet that selects other networks and shows their connection state."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget

from app.core.network.source import GraphReceived, MasterLost
from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.ui.shell.dialogs.other_networks import OtherNetworksSheet
from app.ui.theme.theme import Theme
from tests.core.networks.fake_networks import World, graph
from tests.pseudo import untranslated
from tests.ui.clipping import clipped
from tests.ui.panels.test_words import said_by

pytest_plugins = ["tests.ui.shell_fixtures"]
LONG = "no ROS master replied at '127.0.0.1:42787' (waited 2 s); start one with 'roscore', or with another"


@pytest.fixture
def world(tmp_path: Path) -> World:
    return World(Settings(tmp_path))


@pytest.fixture
def sheet(qtbot, theme: Theme, world: World) -> OtherNetworksSheet:
    window = QWidget()
    window.resize(1100, 700)
    qtbot.addWidget(window)
    window.show()
    theme.apply()
    theme.set_motion(True)
    made = OtherNetworksSheet(theme, window, world.networks)
    made.open()
    return made


def states(sheet: OtherNetworksSheet) -> list[str]:
    sheet.show_states()
    return [row.state.text() for row in sheet.rows]


def test_all_networks_are_disabled_by_default_and_explain_their_address(
    sheet: OtherNetworksSheet, world: World
) -> None:
    assert [row.switch.text() for row in sheet.rows] == ["ROS 1", "ROS 2", "Zenoh"]
    assert [row.switch.isChecked() for row in sheet.rows] == [False] * 3
    assert [row.address.placeholderText() for row in sheet.rows] == ["127.0.0.1:11311", "0", "local"]
    assert "another computer" in states(sheet)[0]
    assert sheet.initial_focus() is sheet.rows[0].switch
    assert world.made == []


def test_network_switch_applies_immediately_and_shows_the_connection_state(
    sheet: OtherNetworksSheet, world: World
) -> None:
    ros = sheet.rows[0]
    ros.switch.click()
    assert (world.made[0].address, ros.address.text()) == ("127.0.0.1:11311", "127.0.0.1:11311")
    assert states(sheet)[0] == "Searching…"
    world.tell(GraphReceived(graph("/a", "/b"), 0.0))
    assert states(sheet)[0] == "Connected: 2 topics, 1 node."
    world.tell(MasterLost("", LONG))
    assert states(sheet)[0] == f"N{LONG[1:]}."
    ros.switch.click()
    assert world.made[0].said == ["start", "end"]
    assert "another computer" in states(sheet)[0]


def test_invalid_address_is_reported_and_kept_as_typed(sheet: OtherNetworksSheet, world: World) -> None:
    row = sheet.rows[1]
    row.address.setText("999")
    row.switch.click()
    assert not row.switch.isChecked()
    assert (row.address.text(), row.address.property("wrong")) == ("999", "true")
    assert states(sheet)[1] == "'999' isn't a ROS 2 domain; use a number from 0 to 232."
    row.address.setText("9")
    row.switch.click()
    assert (row.switch.isChecked(), row.address.property("wrong")) == (True, "false")
    assert [fake.address for fake in world.made] == ["9"]
    row.address.setText("x")
    QTest.keyClick(row.address, Qt.Key.Key_Return)
    assert "'x' isn't a ROS 2 domain" in states(sheet)[1]
    assert sheet.isVisible()
    assert row.switch.isChecked(), "what was right goes on"
    row.address.setText(" 10 ")
    QTest.keyClick(row.address, Qt.Key.Key_Enter)
    assert ([fake.address for fake in world.made], row.address.text()) == (["9", "10"], "10")


def test_typed_address_is_applied_when_the_sheet_closes(sheet: OtherNetworksSheet, world: World) -> None:
    row = sheet.rows[2]
    row.switch.click()
    row.address.setText("local/lab")
    sheet.dismiss()
    assert [fake.address for fake in world.made] == ["local", "local/lab"]
    sheet.open()
    assert (row.switch.isChecked(), row.address.text()) == (True, "local/lab")
    sheet.dismiss()


def test_setting_that_cannot_be_saved_is_reported(
    sheet: OtherNetworksSheet, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_key: str, _value: object) -> None:
        raise SettingsError(Path("settings.json"), "no space left on device")

    monkeypatch.setattr(world.settings, "set_value", refuse)
    sheet.rows[2].switch.click()
    assert "no space left on device" in states(sheet)[2]
    assert sheet.rows[2].switch.isChecked(), "it is looked at until Studio ends"


@pytest.mark.parametrize("percent", [100, 200])
def test_texts_of_the_sheet_are_translated_and_not_clipped(
    qtbot, pseudo, theme: Theme, sheet: OtherNetworksSheet, world: World, percent: int
) -> None:
    theme.set_text_percent(percent)
    sheet.rows[0].switch.click()
    world.tell(MasterLost("", LONG))
    sheet.rows[1].address.setText("999")
    sheet.rows[1].switch.click()
    sheet.show_states()
    data = ("ROS 1", "ROS 2", "Zenoh", "ROS_AUTOMATIC_DISCOVERY_RANGE", f"N{LONG[1:]}.", "local")
    assert [text for _where, text in said_by(sheet) if untranslated(text, *data)] == []
    qtbot.waitUntil(lambda: clipped(sheet) == [])  # Qt defers layouts
    for row in sheet.rows:
        assert row.state.height() >= row.state.heightForWidth(row.state.width())
