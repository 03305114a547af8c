"""Tests of the test page and starter page of `nep web` in Chromium (Qt WebEngine)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from PySide6.QtCore import QUrl
from PySide6.QtWebEngineCore import QWebEnginePage, QWebEngineProfile
from PySide6.QtWebEngineWidgets import QWebEngineView
from pytestqt.qtbot import QtBot

import nep
from nep.masters.master import Master
from nep.programs.web import Access, WebServer, WebSettings

pytestmark = [pytest.mark.web, pytest.mark.timeout(600)]
TOKEN = "a-token-of-some-letters"


class Browser(QWebEnginePage):
    """Page that records its console messages, such as violations of its content security policy."""

    def __init__(self, profile: QWebEngineProfile, qtbot: QtBot) -> None:
        super().__init__(profile)
        self.said: list[str] = []
        self._qtbot = qtbot

    def javaScriptConsoleMessage(self, _level: object, message: str, _line: int, _source: str) -> None:
        self.said.append(message)

    def evaluate(self, script: str) -> object:
        found: list[object] = []
        self.runJavaScript(script, found.append)
        self._qtbot.waitUntil(lambda: bool(found))
        return found[0]

    def wait(self, script: str) -> None:
        self._qtbot.waitUntil(lambda: self.evaluate(f"Boolean({script})") is True)


@pytest.fixture
def browser(qtbot: QtBot) -> Iterator[Browser]:
    profile = QWebEngineProfile()
    page = Browser(profile, qtbot)
    view = QWebEngineView()  # a hidden page subscribes to no topics
    view.setPage(page)
    view.show()
    yield page
    view.deleteLater()
    with qtbot.waitSignal(page.destroyed):
        page.deleteLater()
    profile.deleteLater()


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("python", master=master.address) as node:
        yield node


@pytest.fixture
def server(master: Master) -> Iterator[WebServer]:
    access = Access(token=TOKEN)
    with WebServer(WebSettings(port=0, master=master.address, access=access)) as running:
        yield running


def test_test_page_shows_topics_and_publishes(browser: Browser, server: WebServer, node: nep.Node) -> None:
    node.new_pub("/camera", "image", latched=True).publish(np.zeros((4, 6, 3), np.uint8))
    node.new_pub("/odom", latched=True).publish({"x": "<b>1</b>"})
    heard = node.new_sub("/text", "string")
    browser.load(QUrl(server.test_page_url))
    browser.wait("document.querySelectorAll('#topics li').length === 3")
    assert TOKEN not in str(browser.evaluate("location.href"))
    choose = "[...document.querySelectorAll('#topics button')].find((each) => each.innerText.includes('%s'))"
    browser.evaluate(f"{choose % '/odom'}.click()")
    browser.wait("document.getElementById('message').textContent.includes('<b>1</b>')")
    browser.evaluate(f"{choose % '/camera'}.click()")
    browser.wait("document.getElementById('picture').naturalWidth === 6")
    browser.evaluate("document.querySelector('#form button').click()")
    assert heard.listen(timeout_s=60)[0]
    assert server.pages[0].title == browser.title()
    browser.evaluate("window.isBeforeReload = true")
    browser.triggerAction(QWebEnginePage.WebAction.Reload)  # the reloaded address contains no token
    browser.wait("!window.isBeforeReload && document.querySelectorAll('#topics li').length >= 2")
    assert browser.said == []
    server.set_access(Access(token="another-token-of-letters"))
    browser.wait("document.getElementById('state').dataset.state === 'off'")
    browser.evaluate("document.getElementById('again').click()")
    browser.wait("document.getElementById('state').textContent === WORDS.refused")
    assert {each.kind for each in server.rejections} == {"token"}


def test_starter_page_shows_messages_and_publishes(
    browser: Browser, server: WebServer, node: nep.Node
) -> None:
    node.new_pub("/chatter", "string", latched=True).publish("hello")
    clicks = node.new_sub("/button")
    browser.load(QUrl(server.test_page_url.replace("/?", "/starter.html?")))
    browser.wait("document.getElementById('message')?.textContent === 'hello'")
    browser.evaluate("document.getElementById('button').click()")
    assert clicks.listen(timeout_s=60) == (True, {"pressed": True})
    assert [each.title for each in server.pages] == [browser.title()]
    assert browser.said == []
