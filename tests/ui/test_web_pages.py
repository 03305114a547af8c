"""Tests of a web page with roslib 1 in Chromium (Qt WebEngine) against `nep web`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QUrl
from PySide6.QtWebEngineCore import QWebEnginePage, QWebEngineProfile
from pytestqt.qtbot import QtBot

import nep
from nep.masters.master import Master
from nep.programs.web import WebServer, WebSettings
from nep.sensor import LaserScan
from tests.interop.conftest import Peers

pytestmark = [pytest.mark.web, pytest.mark.interop, pytest.mark.timeout(600)]
GUIDE = Path(__file__).parents[2] / "docs/web.md"
PAGE = """<!doctype html><title>waiting</title><script>%s</script><script>
const seen = {};
const report = (name, value) => { seen[name] = value; document.title = JSON.stringify(seen); };
const ros = new ROSLIB.Ros({ url: "%s" });
ros.on("error", () => report("error", true));
ros.on("close", () => report("closed", true));
ros.on("connection", () => {
  const talker = new ROSLIB.Topic({ ros, name: "/talker", messageType: "std_msgs/String" });
  talker.publish(new ROSLIB.Message({ data: "from the page" }));
  new ROSLIB.Topic({ ros, name: "/chatter", messageType: "std_msgs/String" })
    .subscribe((message) => report("chatter", message.data));
  new ROSLIB.Topic({ ros, name: "/scan", messageType: "sensor_msgs/LaserScan", compression: "cbor" })
    .subscribe((message) => report("scan", [message.ranges.constructor.name, message.ranges[1]]));
  new ROSLIB.Service({ ros, name: "/add", serviceType: "x/Add" })
    .callService(new ROSLIB.ServiceRequest({ a: 1, b: 2 }), (result) => report("sum", result.sum));
  ros.getTopics((result) => report("topics", result.topics.includes("/chatter")));
});
</script>"""


@pytest.fixture
def roslib() -> str:
    peers = Peers()
    return (peers.folder("roslib") / "node_modules/roslib1/build/roslib.min.js").read_text("utf-8")


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("python", master=master.address) as node:
        yield node


@pytest.fixture
def page(qtbot: QtBot) -> Iterator[QWebEnginePage]:
    profile = QWebEngineProfile()
    page = QWebEnginePage(profile)
    yield page
    with qtbot.waitSignal(page.destroyed):
        page.deleteLater()
    profile.deleteLater()


def test_page_of_this_computer_connects_and_page_of_a_disallowed_origin_is_rejected(
    qtbot: QtBot, page: QWebEnginePage, node: nep.Node, master: Master, roslib: str
) -> None:
    heard = node.new_sub("/talker", "string")
    node.new_server("/add", lambda given: {"sum": given["a"] + given["b"]}, threads=1)
    node.new_pub("/chatter", "string", latched=True).publish("from Python")
    node.new_pub("/scan", LaserScan, latched=True).publish(LaserScan(ranges=[1.0, 2.5]))
    with WebServer(WebSettings(port=0, master=master.address)) as server:
        html = PAGE % (roslib, server.url)
        page.setHtml(html, QUrl("http://evil.example/"))
        qtbot.waitUntil(lambda: "error" in page.title())
        assert (server.counts.opened, server.counts.turned_away) == (0, 1)
        page.setHtml(html, QUrl("http://localhost:8000/"))
        qtbot.waitUntil(
            lambda: all(f'"{name}"' in page.title() for name in ("chatter", "scan", "sum", "topics"))
        )
        assert json.loads(page.title()) == {
            "chatter": "from Python",
            "scan": ["Float32Array", 2.5],
            "sum": 3,
            "topics": True,
        }
        assert heard.listen(timeout_s=60) == (True, "from the page")
        (name,) = server.page_names
        assert name.startswith("web_localhost:8000_")
        page.setHtml("")
        qtbot.waitUntil(lambda: not server.page_names)


def test_example_page_of_the_guide_shows_messages_and_publishes_clicks(
    qtbot: QtBot, page: QWebEnginePage, node: nep.Node, master: Master, roslib: str
) -> None:
    found = re.search(r"```html\n(.*?)```", GUIDE.read_text("utf-8"), re.DOTALL)
    assert found is not None
    node.new_pub("/chatter", "string", latched=True).publish("hello")
    clicks = node.new_sub("/button")
    with WebServer(WebSettings(port=0, master=master.address)) as server:
        html = found[1].replace("ws://127.0.0.1:9090", server.url)
        html = html.replace('<script src="roslib.min.js"></script>', f"<script>{roslib}</script>")
        page.setHtml(html, QUrl("http://localhost:8000/"))
        texts: list[str] = []

        def is_shown() -> bool:
            page.toPlainText(texts.append)
            return "hello" in texts

        qtbot.waitUntil(is_shown)
        page.runJavaScript("document.body.click()")
        assert clicks.listen(timeout_s=60) == (True, {"pressed": True})
        page.setHtml("")
        qtbot.waitUntil(lambda: not server.page_names)
