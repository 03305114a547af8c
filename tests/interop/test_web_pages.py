"""Tests of unmodified roslib, roslibpy and Foxglove's client library with `nep web`."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import nep
from nep.geometry import Twist, Vector3
from nep.masters.master import Master
from nep.programs.web import WebServer, WebSettings
from nep.recordings.formats.channels import LiveChannels
from nep.sensor import LaserScan
from tests.interop.conftest import SCRIPTS, Peers, Program
from tests.nep.programs import eventually

pytestmark = [pytest.mark.interop]
CLIENTS = ("roslib", "roslibpy")


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("python", master=master.address) as node:
        yield node


@pytest.fixture
def server(master: Master) -> Iterator[WebServer]:
    settings = WebSettings(port=0, master=master.address, foxglove=LiveChannels())
    with WebServer(settings) as running:
        yield running


@pytest.fixture
def clients() -> Iterator[Peers]:
    """Clients of rosbridge, which don't use the fixed ports of the original NEP."""
    started = Peers()
    yield started
    started.close()


@pytest.fixture
def master() -> Iterator[Master]:
    with Master("127.0.0.1:0", learn_s=0.0) as running:
        yield running


def started(clients: Peers, client: str, server: WebServer) -> Program:
    if client == "roslib":
        return clients.run_javascript("roslib", "roslib_peer.mjs", [server.url]).wait_ready()
    return clients.run_native([str(SCRIPTS / "roslibpy_peer.py"), server.url]).wait_ready()


@pytest.mark.parametrize("client", CLIENTS)
def test_client_subscribes_publishes_calls_and_serves_like_its_examples(
    clients: Peers, server: WebServer, node: nep.Node, client: str
) -> None:
    heard = node.new_sub("/listener", "string")
    node.parameters.declare("speed", 1.5)
    node.new_server("/add_two_ints", lambda given: {"sum": given["a"] + given["b"]}, threads=1)
    node.new_pub("/chatter", "string", latched=True).publish("hello \u65e5\u672c")
    page = started(clients, client, server)
    page.tell(["listen", "/chatter", "std_msgs/String"])
    assert page.hears({"data": "hello \u65e5\u672c"})
    page.tell(["talk", "/listener", "std_msgs/String", {"data": "hi"}])
    assert heard.listen(timeout_s=60) == (True, "hi")
    page.tell(["call", "/add_two_ints", {"a": 1, "b": 2}])
    assert page.hears({"sum": 3})
    page.tell(["call", "/add_two_ints", {}])
    page.wait(lambda: "KeyError" in str(page.got[-1]), "the error of a service")
    page.tell(["serve", "/set_bool"])
    eventually(lambda: "/set_bool" in node.graph().services)
    answer = node.new_client("/set_bool", timeout_s=60).call({"data": True})
    assert answer == {"success": True, "message": "set"}
    names = ("getTopics", "getNodes", "getTopicType") if client == "roslib" else (
        "get_topics", "get_nodes", "get_topic_type",
    )  # fmt: skip
    page.tell(["ask", names[0]])
    page.wait(lambda: "/chatter" in str(page.got[-1]) and "topics" in page.got[-1], "the list of topics")
    page.tell(["ask", names[1]])
    page.wait(lambda: "python" in str(page.got[-1]), "the list of nodes")
    page.tell(["ask", names[2], "/chatter"])
    page.wait(lambda: "std_msgs/String" in str(page.got[-1]), "the type of a topic")
    page.tell(["getParam", "python:speed"])
    assert page.hears(1.5)
    assert server.counts.rejected == 0
    assert page.printed == ""


def test_roslib_decodes_cbor_and_png_messages_and_type_details(
    clients: Peers, server: WebServer, node: nep.Node
) -> None:
    scan = LaserScan(ranges=[1.0, 2.5], angle_min=-1.0)
    node.new_pub("/scan", LaserScan, latched=True).publish(scan)
    node.new_pub("/text", "string", latched=True).publish("\u65e5" * 300)
    node.new_pub("/picture", "image", latched=True).publish(np.zeros((4, 4, 3), np.uint8))
    page = started(clients, "roslib", server)
    page.tell(["kind", "/scan", "sensor_msgs/LaserScan", "ranges"])
    assert page.hears(["Float32Array", [1.0, 2.5]])
    page.tell(["kind", "/picture", "sensor_msgs/CompressedImage", "data"])
    page.wait(lambda: page.got[-1][0] == "Uint8Array", "a picture in CBOR")
    page.tell(["listen", "/text", "std_msgs/String", {"compression": "png"}])
    assert page.hears({"data": "\u65e5" * 300})
    page.tell(["ask", "getMessageDetails", "geometry_msgs/Twist"])
    page.wait(lambda: "geometry_msgs/Vector3" in str(page.got[-1]), "the fields of a type")
    page.tell(["setParam", "python:none", 1])
    page.wait(lambda: "failed" in str(page.got[-1]), "the refusal of a parameter")


def test_roslib_receives_a_close_frame_when_the_server_closes(
    clients: Peers, master: Master, node: nep.Node
) -> None:
    settings = WebSettings(port=0, master=master.address)
    with WebServer(settings) as first:
        page = started(clients, "roslib", first)
        page.tell(["listen", "/chatter", "std_msgs/String"])
        eventually(lambda: "/chatter" in node.graph().topics)
    assert page.process.wait(60) == 0  # by a close frame, not by a broken connection
    eventually(lambda: not node.graph().topics)


def test_foxglove_client_receives_publishes_and_calls_services(
    clients: Peers, server: WebServer, node: nep.Node
) -> None:
    heard = node.new_sub("/cmd", Twist)
    node.new_server("/add_two_ints", lambda given: {"sum": given["a"] + given["b"]}, threads=1)
    node.new_pub("/odom", latched=True).publish({"text": "日本"})
    node.new_pub("/picture", "image", latched=True).publish(np.zeros((4, 4, 3), np.uint8))
    page = clients.run_javascript("roslib", "foxglove_peer.mjs", [server.url]).wait_ready()
    assert page.hears({"topics": ["/odom", "/picture"]})
    assert page.hears({"services": ["/add_two_ints"]})
    page.tell(["listen", "/odom"])
    assert page.hears({"topic": "/odom", "isNow": True, "value": {"text": "日本"}})
    page.tell(["listen", "/picture"])
    page.wait(lambda: "/picture" in str(page.got[-1]) and page.got[-1]["value"] > 50, "an image")
    page.tell(["talk", "/cmd", "geometry_msgs/Twist", {"linear": {"x": 2.0}}])
    assert heard.listen(timeout_s=60) == (True, Twist(linear=Vector3(x=2.0)))
    page.tell(["call", "/add_two_ints", 7, {"a": 1, "b": 2}])
    assert page.hears({"callId": 7, "encoding": "json", "value": {"sum": 3}})
    page.tell(["call", "/add_two_ints", 8, {}])
    page.wait(lambda: any("KeyError" in str(each) for each in page.got), "the error of a service")
    page.tell(["graph"])
    page.wait(lambda: any("published" in each for each in page.got), "the graph")
    assert [each.client for each in server.pages] == ["Foxglove"]
    server.close()
    assert page.process.wait(60) == 0
    page.wait(lambda: {"closed": 1001} in page.got, "the close code")
    assert not [each for each in page.got if "error" in each]
