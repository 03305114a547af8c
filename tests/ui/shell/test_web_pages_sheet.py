"""The sheet "Web pages and tablets": a server that a client connects to, and what the sheet says of it."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.core.network.web_pages import WebPages
from app.ui.shell.dialogs.web_pages import WebPagesSheet
from app.ui.theme.theme import Theme
from nep.masters.master import Master
from tests.pseudo import untranslated
from tests.ui.clipping import clipped
from tests.ui.panels.test_words import said_by

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.fixture
def web(master: Master) -> Iterator[WebPages]:
    events: list = []
    made = WebPages(master.address, events.append, addresses=tuple)
    made.port = 0
    made.events = events  # type: ignore[attr-defined]
    yield made
    made.close()


@pytest.fixture
def sheet(qtbot, theme: Theme, web: WebPages) -> WebPagesSheet:
    window = QWidget()
    window.resize(1100, 700)
    qtbot.addWidget(window)
    window.show()
    theme.apply()
    theme.set_motion(True)
    made = WebPagesSheet(theme, window, web, lambda: ("Turtle",))
    made.open()
    return made


def switch_on(qtbot, sheet: WebPagesSheet, web: WebPages) -> None:
    sheet.switch.setFocus()
    QTest.keyClick(sheet.switch, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: bool(web.events))  # type: ignore[attr-defined]
    web.started(web.events.pop())  # type: ignore[attr-defined]
    sheet.refresh()


def test_client_of_the_server_that_the_sheet_started_is_listed_and_disconnected(
    qtbot, sheet: WebPagesSheet, web: WebPages
) -> None:
    switch_on(qtbot, sheet, web)
    assert web.state == "on"
    with connect(sheet.address.text()) as client:
        client.send(json.dumps({"op": "subscribe", "topic": "/odom", "type": "nep/Json"}))
        qtbot.waitUntil(lambda: bool(web.pages) and web.pages[0].subscribed == ("/odom",))
        sheet.refresh()
        item = sheet.list.topLevelItem(0)
        assert item is not None
        assert item.childCount() == 1
        sheet.list.setCurrentItem(item)
        sheet.list.setFocus()
        QTest.keyClick(sheet.list, Qt.Key.Key_Delete)
        qtbot.waitUntil(lambda: not web.pages)
    sheet.switch.click()
    assert (web.state, web.pages) == ("off", ())


def test_refused_origin_is_shown_and_allowed_by_its_button(
    qtbot, sheet: WebPagesSheet, web: WebPages
) -> None:
    switch_on(qtbot, sheet, web)
    with pytest.raises(InvalidStatus):
        connect(sheet.address.text(), origin="http://192.168.1.77:5173")
    sheet.refresh()
    assert sheet.allow.isVisible()
    sheet.allow.click()
    assert web.origins == ("http://192.168.1.77:5173",)


def test_taken_port_offers_the_next_one(qtbot, sheet: WebPagesSheet, web: WebPages) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        web.port = taken.getsockname()[1]
        switch_on(qtbot, sheet, web)
        assert (web.state, sheet.switch.isChecked()) == ("off", False)
        assert str(web.port) in sheet.state.text()
        assert str(web.port + 1) in sheet.other_port.text()


def test_wrong_origin_stays_as_typed_with_an_example(sheet: WebPagesSheet, web: WebPages) -> None:
    sheet.origins.setText("192.168.1.20")
    sheet.origins.editingFinished.emit()
    assert (web.origins, sheet.origins.text()) == ((), "192.168.1.20")
    assert sheet.origins.property("wrong") == "true"


@pytest.mark.parametrize("percent", [100, 200])
def test_its_words_are_translated_and_fit(
    qtbot, pseudo, theme: Theme, sheet: WebPagesSheet, percent: int
) -> None:
    theme.set_text_percent(percent)
    sheet.origins.setText("wrong")
    sheet.origins.editingFinished.emit()
    qtbot.wait(50)  # Qt lays out later
    data = ("http://192.168.1.20:8080", "ws://127.0.0.1:0", "wrong", "Turtle")
    assert [text for _where, text in said_by(sheet) if untranslated(text, *data)] == []
    assert clipped(sheet) == []
