"""Tests of the sheet that allows remote connections, and of its state in the status bar."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QApplication, QWidget

from app.core.alerts.alerts import Alerts
from app.core.network.remote_access import RemoteAccess, access_status
from app.core.storage.settings import Settings
from app.ui.shell.dialogs.network_access import NetworkAccessSheet
from app.ui.theme.theme import Theme
from nep.protocol.graph_view import GraphView
from nep.system.addresses import OwnAddress


@pytest.fixture
def make(qtbot, tmp_path):
    """Factory of a network access sheet with its switch and the recorded listen requests."""
    made = []

    def make(address="127.0.0.1:7780", here=(("192.168.1.20", "wlan0"), ("10.8.0.2", "tun0"))):
        asked = []
        own = tuple(OwnAddress(*each) for each in here)
        reach = RemoteAccess(
            address,
            Settings(tmp_path),
            Alerts(),
            lambda _event: None,
            request_listen=lambda hosts, _address: asked.append(tuple(hosts)),
            local_addresses=lambda: own,
        )
        window = QWidget()
        window.resize(1100, 700)
        qtbot.addWidget(window)
        window.show()
        sheet = NetworkAccessSheet(Theme("light"), window, reach)
        made.append((reach, window))
        return sheet, reach, asked

    yield make
    for reach, _window in made:
        reach.close()


def test_network_access_sheet_warns_shows_the_address_and_allows_connections(make):
    sheet, reach, asked = make()
    sheet.open()
    assert sheet.heading.text() == "Let other computers connect?"
    assert "no password" in sheet.warning.text()
    assert sheet.initial_focus() is sheet.cancel_button, "the careful answer has the keyboard"
    assert sheet.setting_label.text() == "NEP_MASTER=192.168.1.20:7780"
    sheet.choice.set_value("10.8.0.2")
    assert sheet.setting_label.text() == "NEP_MASTER=10.8.0.2:7780"
    sheet.copy.click()
    assert QApplication.clipboard().text() == "NEP_MASTER=10.8.0.2:7780"
    sheet.allow_button.click()
    reach.close()
    assert asked == [("10.8.0.2",)]
    assert not sheet.isVisible()


def test_not_now_closes_the_sheet_without_allowing_access(make):
    sheet, _reach, asked = make()
    sheet.open()
    sheet.cancel_button.click()
    assert not asked
    assert not sheet.isVisible()


def test_access_is_revoked_in_the_same_sheet(make):
    sheet, reach, asked = make()
    reach.update_graph(GraphView(epoch=1, revision=1, listens=("192.168.1.20",)))
    assert access_status(reach) == ("wifi", "Other computers connect at 192.168.1.20", "warn")
    sheet.open()
    assert sheet.heading.text() == "Other computers can connect at 192.168.1.20"
    assert not sheet.allow_button.isVisible()
    sheet.revoke_button.click()
    reach.close()
    assert asked == [()]


def test_network_access_sheet_reports_a_missing_network_connection(make):
    sheet, reach, _asked = make(here=())
    sheet.open()
    assert sheet.heading.text() == "This computer isn't connected to a network"
    assert not sheet.allow_button.isVisible()
    assert access_status(reach)[1] == "This computer only"


def test_access_to_a_remote_master_cannot_be_changed_on_this_computer(make):
    sheet, reach, _asked = make(address="192.168.1.9:7780")
    sheet.open()
    assert "192.168.1.9" in sheet.heading.text()
    assert not sheet.allow_button.isVisible()
    assert not sheet.revoke_button.isVisible()
    assert access_status(reach) == ("network", "Master on 192.168.1.9", None)
