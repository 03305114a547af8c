"""Tests of the sheet "Web pages and tablets": switches, settings, connected pages and rejections."""

from __future__ import annotations

import json
import queue
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest
from PySide6.QtCore import QPoint, QRectF, Qt, QUrl
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QWidget
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.core.network.web_pages import WebPages
from app.ui.shell.dialogs.web_pages import WebPagesSheet
from app.ui.shell.dialogs.web_pages.qr_code import QUIET_ZONE, encode_modules
from app.ui.theme.theme import Theme
from app.ui.widgets.keyboard import tab_stops
from nep.masters.master import Master
from nep.programs.web.context import PageTopic, Rejection
from nep.system.addresses import OwnAddress
from tests.core.network.fake_web_server import FakeWebServer, page
from tests.pseudo import untranslated
from tests.ui.clipping import clipped
from tests.ui.panels.test_words import said_by
from tests.ui.test_accessible import unsaid

pytest_plugins = ["tests.ui.shell_fixtures"]
WIFI = OwnAddress("192.168.1.20", "wlan0")
CAMERA = PageTopic("/camera", False, 15.0, 15.0, 190e3, 9_970, 30)
BUTTONS = PageTopic("/buttons", True, rate_hz=0.1, bytes_per_s=6.0)


class Desk:
    """Sheet over a window with fake servers; `said` lists toasts with their button functions."""

    def __init__(self, qtbot, theme: Theme, web: WebPages, events: queue.Queue) -> None:
        self.web, self.events = web, events
        self.said: list[tuple[str, Callable[[], object] | None]] = []
        self.opened: list[str] = []
        self.window = QWidget()
        self.window.resize(1100, 700)
        qtbot.addWidget(self.window)
        self.window.show()
        self.sheet = WebPagesSheet(theme, self.window, web, lambda: ("Turtle",), self._say, self._open)
        self.sheet.open()

    def _say(self, words: str, _button: str = "", run=None, *, until=None) -> None:
        self.said.append((words, run))

    def _open(self, url: QUrl) -> bool:
        self.opened.append(url.toString())
        return True

    def settle(self):
        self.web.on_started(self.events.get(timeout=30))
        self.sheet.refresh()
        return self.web._server

    def switch_on(self):
        self.sheet.switch.setFocus()
        QTest.keyClick(self.sheet.switch, Qt.Key.Key_Space)
        return self.settle()


@pytest.fixture
def events() -> queue.Queue:
    return queue.Queue()


@pytest.fixture
def web(master: Master, events: queue.Queue) -> Iterator[WebPages]:
    made = WebPages(master.address, events.put, start=FakeWebServer, addresses=lambda: (WIFI,))
    yield made
    made.close()


@pytest.fixture
def desk(qtbot, theme: Theme, web: WebPages, events: queue.Queue) -> Desk:
    theme.apply()
    theme.set_motion("on")
    return Desk(qtbot, theme, web, events)


@pytest.fixture
def sheet(desk: Desk) -> WebPagesSheet:
    return desk.sheet


def with_pages(desk: Desk) -> FakeWebServer:
    server = desk.switch_on()
    server.pages = (page(1, CAMERA, title="dashboard.html"), page(2, BUTTONS, title="buttons.html"))
    desk.sheet.refresh()
    return server


def test_client_of_a_real_server_is_listed_and_disconnected(
    qtbot, theme: Theme, master: Master, events: queue.Queue
) -> None:
    web = WebPages(master.address, events.put, addresses=tuple)
    web.port = 0
    desk = Desk(qtbot, theme, web, events)
    desk.switch_on()
    sheet = desk.sheet
    with pytest.raises(InvalidStatus):
        connect(sheet.access.address.text(), origin="http://192.168.1.77:5173")
    with connect(sheet.access.address.text()) as client:
        client.send(json.dumps({"op": "subscribe", "topic": "/odom", "type": "nep/Json"}))
        qtbot.waitUntil(lambda: bool(web.pages) and web.pages[0].subscribed_topics == ("/odom",))
        sheet.refresh()
        assert sheet.model.rowCount(sheet.model.index(0, 0)) == 1
        sheet.table.setFocus(Qt.FocusReason.TabFocusReason)
        QTest.keyClick(sheet.table, Qt.Key.Key_Delete)
        qtbot.waitUntil(lambda: not web.pages)
    sheet.refresh()
    sheet.notice.button.click()
    assert web.origins == ("http://192.168.1.77:5173",)
    with connect(sheet.access.address.text(), origin="http://192.168.1.77:5173"):
        pass
    sheet.switch.click()
    assert (web.state, web.pages) == ("off", ())
    web.close()


def test_topic_stats_are_updated_in_place_and_keep_selection_and_expansion(desk: Desk) -> None:
    server, model, table = with_pages(desk), desk.sheet.model, desk.sheet.table
    table.setExpanded(model.index(0, 0), False)
    table.setCurrentIndex(model.index(0, 0, model.index(1, 0)))
    server.change_topic(2, rate_hz=12.0)
    server.pages = (*server.pages, page(3, CAMERA))
    desk.sheet.refresh()
    assert [table.isExpanded(model.index(row, 0)) for row in range(3)] == [False, True, True]
    topic = model.topic(table.currentIndex())
    assert topic is not None
    assert (topic.topic, topic.rate_hz) == ("/buttons", 12.0)


def test_disconnected_page_stays_listed_and_cannot_be_disconnected_again(desk: Desk) -> None:
    server, sheet = with_pages(desk), desk.sheet
    server.leave(1)
    sheet.refresh()
    row = sheet.model.page_row(sheet.model.index(0, 0))
    assert row is not None
    assert row.listed_page.gone_s is not None
    sheet.table.setCurrentIndex(sheet.model.index(0, 0))
    QTest.keyClick(sheet.table, Qt.Key.Key_Delete)
    assert [each.id for each in server.pages] == [2]


def test_row_button_disconnects_its_page(desk: Desk) -> None:
    server, sheet = with_pages(desk), desk.sheet
    row = QRectF(sheet.table.visualRect(sheet.model.index(1, 0)))
    button = sheet.table.cell_rect("disconnect", row).center().toPoint()
    QTest.mouseClick(sheet.table.viewport(), Qt.MouseButton.LeftButton, pos=button)
    assert ([each.id for each in server.pages], server.kept_out) == ([1], {2})
    _words, undo = desk.said[-1]
    assert undo is not None
    undo()
    assert server.kept_out == set()


def test_refresh_of_many_pages_emits_signals_only_for_the_changed_page_and_topic(desk: Desk) -> None:
    server, sheet = desk.switch_on(), desk.sheet
    topics = [replace(CAMERA, topic=f"/topic{number}") for number in range(50)]
    server.pages = tuple(page(number, *topics) for number in range(100))
    sheet.refresh()
    assert sheet.model.rowCount() == 100
    told: list[int] = []
    sheet.model.dataChanged.connect(lambda *_args: told.append(1))
    server.change_topic(7, rate_hz=2.0)
    sheet.refresh()
    assert len(told) == 2  # only the rows of the page and its topic are repainted


def test_new_token_disconnects_pages_and_undo_restores_the_previous_token(desk: Desk) -> None:
    desk.web.listen_on(WIFI.host)
    with_pages(desk)
    before = desk.web.token
    desk.sheet.access.new_token.click()
    words, undo = desk.said[-1]
    assert "2" in words
    assert desk.web.token != before
    assert undo is not None
    undo()
    assert desk.web.token == before


def test_token_is_hidden_and_copied_in_full(desk: Desk) -> None:
    desk.web.listen_on(WIFI.host)
    access = desk.sheet.access
    desk.sheet.refresh()
    assert desk.web.token not in access.token.text()
    access.token.line.setFocus()
    QTest.keyClick(access.token.line, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    assert QGuiApplication.clipboard().text() == desk.web.token
    access.reveal.click()
    assert access.token.text() == desk.web.token


def test_qr_code_encodes_the_test_page_url_and_stays_light_in_the_dark_theme(
    desk: Desk, theme: Theme
) -> None:
    desk.web.listen_on(WIFI.host)
    desk.switch_on()
    code = desk.sheet.access.qr
    assert code.text == f"http://192.168.1.20:9090/?token={desk.web.token}"
    theme.set_mode("dark")
    image = code.grab().toImage()
    size = len(encode_modules(code.text))
    ratio = image.width() / code.width()
    side = int(image.width() / (size + 2 * QUIET_ZONE))
    quiet = (image.width() - side * size) / 2
    assert quiet >= QUIET_ZONE * side
    middle = round(image.height() / 2)
    for x in range(round(3 * ratio), int(quiet) - 1):
        assert image.pixelColor(x, middle).lightness() == 255
    assert image.pixelColor(int(quiet) + side // 2, int(quiet) + side // 2).lightness() == 0


def test_qr_code_is_empty_while_only_this_computer_can_connect(desk: Desk) -> None:
    desk.switch_on()
    assert desk.sheet.access.qr.text == ""
    assert desk.sheet.access.qr.accessibleName() != ""


def test_allowed_origins_are_tokens_and_invalid_text_is_kept_as_typed(desk: Desk) -> None:
    field = desk.sheet.permissions.origins
    field.edit.setFocus()
    QTest.keyClicks(field.edit, "http://lab.example 192.168.1.20")
    QTest.keyClick(field.edit, Qt.Key.Key_Return)
    assert desk.web.origins == ("http://lab.example",)
    assert (field.edit.text(), field.is_invalid) == ("192.168.1.20", True)
    field.edit.clear()
    QTest.keyClick(field.edit, Qt.Key.Key_Backspace)
    assert (desk.web.origins, list(field.tokens)) == ((), [])


def test_allowed_robots_are_selected_by_check_boxes_and_applied_immediately(desk: Desk) -> None:
    server, choice = desk.switch_on(), desk.sheet.permissions.robots
    desk.web.set_robots(["Rover"])  # allowed before, not connected now
    choice.choose.click()
    assert list(choice.boxes) == ["Rover", "Turtle"]
    QTest.keyClick(choice.boxes["Turtle"], Qt.Key.Key_Space)
    assert server.allow_moving == {"Rover", "Turtle"}
    assert "Turtle" in choice.text_label.text()


def test_tab_order_follows_the_reading_order(desk: Desk) -> None:
    with_pages(desk)
    desk.web.add_origin("http://lab.example")
    desk.sheet.permissions.robots.open_list()
    desk.sheet.refresh()
    sheet, access, permissions = desk.sheet, desk.sheet.access, desk.sheet.permissions
    (token,) = permissions.origins.tokens
    read = [
        access.address.line, access.token.copy, access.new_token, token, permissions.origins.edit,
        permissions.robots.choose, permissions.robots.boxes["Turtle"], sheet.table, sheet.copy_page,
    ]  # fmt: skip
    stops = list(tab_stops(sheet, sheet.switch))
    places = [stops.index(each) for each in read if each.isEnabled()]
    assert places == sorted(places)
    assert unsaid(desk.sheet) == []


def test_rejection_of_a_robot_command_links_to_the_selection_of_robots(desk: Desk) -> None:
    server, sheet = desk.switch_on(), desk.sheet
    server.rejections = (Rejection(1.0, "http://lab.example", "refused", kind="robot", robot="Turtle"),)
    sheet.refresh()
    sheet.notice.button.click()
    assert sheet.permissions.robots.boxes["Turtle"].isVisible()
    sheet.notice.close_button.click()
    assert not sheet.notice.isVisible()


def test_rosbridge_and_foxglove_tabs_have_separate_switches(desk: Desk) -> None:
    server, sheet = desk.switch_on(), desk.sheet
    sheet.tabs.set_value("foxglove")
    sheet.refresh()
    assert not sheet.switch.isChecked()
    sheet.switch.click()
    assert server.foxglove is not None
    sheet.copy_page.click()
    assert desk.web.full_url in QGuiApplication.clipboard().text()
    sheet.tabs.set_value("rosbridge")
    sheet.copy_page.click()
    assert "<html" in QGuiApplication.clipboard().text()
    assert desk.web.full_url in QGuiApplication.clipboard().text()


def test_port_in_use_offers_a_free_port(qtbot, theme: Theme, master: Master, events: queue.Queue) -> None:
    web = WebPages(master.address, events.put, addresses=tuple)
    desk = Desk(qtbot, theme, web, events)
    web.sentence, web.free_port, web._failed_protocols = (
        "Port 9090 is in use.",
        9091,
        frozenset({"rosbridge"}),
    )
    desk.sheet.refresh()
    assert "9091" in desk.sheet.other_port.text()
    web._start = FakeWebServer  # type: ignore[assignment]
    desk.sheet.other_port.click()
    desk.settle()
    assert (web.state, web.port, desk.sheet.switch.isChecked()) == ("on", 9091, True)
    web.close()


def test_test_page_opens_in_the_browser_of_this_computer(desk: Desk) -> None:
    assert not desk.sheet.test_page.isEnabled()
    desk.switch_on()
    desk.sheet.test_page.click()
    assert desk.opened == [desk.web.local_page_url]


@pytest.mark.parametrize(("size", "percent"), [((1024, 700), 150), ((1100, 700), 200), ((1600, 1000), 100)])
def test_texts_of_the_web_pages_sheet_are_translated_and_not_clipped(
    qtbot, pseudo, theme: Theme, desk: Desk, size: tuple[int, int], percent: int
) -> None:
    theme.set_text_percent(percent)
    desk.window.resize(*size)
    desk.web.listen_on(WIFI.host)
    server = with_pages(desk)
    server.rejections = (Rejection(1.0, "http://lab.example", "refused", "http://lab.example", "origin"),)
    desk.sheet.permissions.robots.open_list()
    desk.sheet.permissions.origins.edit.setText("wrong")
    desk.sheet.permissions.origins.edit.completed.emit()
    desk.sheet.refresh()
    place = desk.sheet.geometry()
    assert desk.window.rect().contains(place)
    data = (
        "http://192.168.1.20:8080", "http://lab.example", "ws://192.168.1.20:9090", "192.168.1.20:9090",
        "wrong", "Turtle", "rosbridge", "Foxglove", "192.168.1.20", desk.sheet.command.text(), "Chrome",
        "dashboard.html", "buttons.html", "/camera", "/buttons",
    )  # fmt: skip
    token = desk.sheet.access.token.text()
    assert [text for _where, text in said_by(desk.sheet) if untranslated(text, *data, token)] == []
    qtbot.waitUntil(lambda: clipped(desk.sheet) == [])  # Qt defers layouts


def test_sheet_is_placed_at_the_right_edge_below_the_stop_button(qtbot, theme: Theme, window) -> None:
    window.show()
    window.commands.run("layout.developer")
    window.commands.run("network.web")
    (sheet,) = window.findChildren(WebPagesSheet)
    stop = next(each for each in window.tool_bar.findChildren(QWidget) if type(each).__name__ == "StopButton")
    assert sheet.isVisible()
    assert sheet.geometry().right() >= window.width() - 10
    assert stop.mapTo(window, QPoint(0, stop.height())).y() < sheet.y()
    assert sheet.geometry().bottom() < window.status.mapTo(window, QPoint()).y()
    assert sheet.findChildren(QLabel)
    QTest.keyClick(sheet.switch, Qt.Key.Key_Escape)
    assert not sheet.isVisible()


def test_status_bar_shows_access_and_connected_pages_and_opens_the_sheet(window) -> None:
    window.show()
    window.commands.run("layout.developer")
    web = window.session.web_pages
    server = FakeWebServer()
    web._server, web.state, web.host = server, "on", WIFI.host
    server.pages = (page(1), page(2))
    web.refresh()
    window._update_status_bar()
    (item,) = [each for each in window.status.items() if WIFI.host in each.text]
    assert "2" in item.text
    QTest.mouseClick(item, Qt.MouseButton.LeftButton)
    (sheet,) = window.findChildren(WebPagesSheet)
    assert sheet.isVisible()
    assert sheet.count.text != ""
    server.pages = ()
    web.host = ""
    web.refresh()
    window._update_status_bar()
    assert [each for each in window.status.items() if WIFI.host in each.text] == []
