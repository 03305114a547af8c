"""Tests of the web server: nodes, topics and services of pages, and rejected operations."""

from __future__ import annotations

import json
import random
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from http import HTTPStatus

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import nep
from nep.errors import AddressInUseError, ServiceError
from nep.geometry import Twist, Vector3
from nep.masters.master import Master
from nep.programs.web import Access, WebServer, WebSettings
from nep.programs.web.limits import MAX_MESSAGE_BYTES
from tests import hostile
from tests.nep.programs import eventually
from tests.nep.web.conftest import Peer
from tests.nep.web.test_access import signed
from tests.nep.web.test_operations import EXAMPLES

Open = Callable[..., Peer]


def test_connected_page_is_a_node_until_the_page_disconnects(
    server: WebServer, node: nep.Node, open_page: Open
) -> None:
    page = open_page(origin="http://localhost:8000")
    port = page.connection.socket.getsockname()[1]
    name = f"web_localhost:8000_{port}"
    eventually(lambda: name in {each.name for each in node.graph().nodes.values()})
    page.connection.socket.shutdown(socket.SHUT_RDWR)  # simulates a crashed tab
    eventually(lambda: name not in {each.name for each in node.graph().nodes.values()})
    eventually(lambda: server.page_names == ())


def test_page_publishes_and_subscribes(node: nep.Node, page: Peer) -> None:
    typed = node.new_sub("/cmd", Twist)
    text = node.new_sub("/chatter", "string")
    page.send("advertise", topic="/chatter", type="std_msgs/String")
    page.send("publish", topic="/chatter", msg={"data": "hello"})
    page.send("publish", topic="/cmd", msg={"linear": {"x": 2}})  # its type is known
    assert text.listen(timeout_s=30) == (True, "hello")
    assert typed.listen(timeout_s=30) == (True, Twist(linear=Vector3(x=2.0)))
    pub = node.new_pub("/back", "string", latched=True)
    pub.publish("latched")
    page.send("subscribe", id="one", topic="/back", type="std_msgs/msg/String")
    assert page.receive("publish") == {"op": "publish", "topic": "/back", "msg": {"data": "latched"}}
    page.send("subscribe", id="two", topic="/back")
    assert page.receive("publish")["msg"] == {"data": "latched"}
    page.send("unsubscribe", id="one", topic="/back")
    page.send("unsubscribe", topic="/back")
    eventually(lambda: not node.graph().topics["/back"].subscribers)
    page.send("unadvertise", topic="/chatter")
    eventually(lambda: not node.graph().topics["/chatter"].publishers)


def test_latched_message_of_a_page_reaches_late_subscribers(node: nep.Node, page: Peer) -> None:
    page.send("advertise", topic="/map", type="nep/Json", latch=True)
    page.send("publish", topic="/map", msg={"cells": [1, 2]})
    eventually(lambda: "/map" in node.graph().topics)
    assert node.new_sub("/map").listen(timeout_s=30) == (True, {"cells": [1, 2]})


def test_page_calls_and_serves_services(node: nep.Node, page: Peer, open_page: Open) -> None:
    node.new_server("/add", lambda given: {"sum": given["a"] + given["b"]}, threads=1)
    assert page.call("/add", a=1, b=2)["values"] == {"sum": 3}
    failed = page.call("/add", a=1)
    assert (failed["result"], "KeyError" in str(failed["values"])) == (False, True)
    server = open_page()
    server.send("advertise_service", service="/double", type="x/Double")
    server.send("advertise_service", service="/fails", type="x/Double")
    eventually(lambda: {"/double", "/fails"} <= node.graph().services.keys())
    answers: list[object] = []
    clients = [node.new_client(name, timeout_s=30) for name in ("/double", "/double", "/fails")]
    futures = [each.call_async({"x": number}) for number, each in enumerate(clients)]
    calls = sorted((server.receive("call_service") for _each in futures), key=lambda each: each["args"]["x"])
    for call in reversed(calls):  # in any order: calls are independent
        is_right = call["service"] == "/double"
        values = {"y": 2 * call["args"]["x"]} if is_right else "no luck"
        server.send(
            "service_response", id=call["id"], service=call["service"], values=values, result=is_right
        )
    answers += [futures[0].result(30), futures[1].result(30)]
    assert answers == [{"y": 0}, {"y": 2}]
    with pytest.raises(ServiceError, match="no luck"):
        futures[2].result(30)
    waiting = clients[0].call_async({"x": 1})
    server.receive("call_service")
    server.connection.close()
    with pytest.raises(nep.NepError):
        waiting.result(30)


def test_rosapi_reports_the_graph_and_reads_and_sets_parameters(node: nep.Node, page: Peer) -> None:
    node.parameters.declare("speed", 1.5)
    node.new_server("/add", lambda given: given, threads=1)
    node.new_pub("/twist", Twist)
    node.new_sub("/twist", Twist)

    def asked(service: str, /, **args: object) -> dict[str, object]:
        answer = page.call(f"/rosapi/{service}", **args)
        assert answer["result"], answer
        return answer["values"]

    assert asked("topics") == {"topics": ["/twist"], "types": ["geometry_msgs/Twist"]}
    rates = asked("topic_rates")
    assert (rates["topics"], len(rates["rates"]), len(rates["bandwidths"])) == (["/twist"], 1, 1)
    assert asked("topics_for_type", type="geometry_msgs/msg/Twist") == {"topics": ["/twist"]}
    assert asked("topic_type", topic="/twist") == {"type": "geometry_msgs/Twist"}
    assert "MSG: geometry_msgs/Vector3" in asked("topics_and_raw_types")["typedefs_full_text"][0]
    assert asked("publishers", topic="/twist") == {"publishers": ["python"]}
    assert asked("subscribers", topic="/twist") == {"subscribers": ["python"]}
    assert len(asked("message_details", type="geometry_msgs/Twist")["typedefs"]) == 2
    assert "/add" in asked("services")["services"]
    assert asked("service_type", service="/rosapi/topics") == {"type": "rosapi/Topics"}
    assert asked("services_for_type", type="rosapi/GetTime") == {"services": ["/rosapi/get_time"]}
    assert asked("service_node", service="/add") == {"node": "python"}
    assert "python" in asked("nodes")["nodes"]
    assert "/twist" in asked("node_details", node="python")["publishing"]
    assert asked("get_param_names") == {"names": ["python:speed"]}
    asked("set_param", name="python:speed", value="2.5")
    assert asked("get_param", name="python:speed") == {"value": "2.5"}
    assert node.parameters.get("speed") == 2.5
    assert asked("has_param", name="python:nothing") == {"exists": False}
    assert asked("get_time")["time"]["secs"] > 1_700_000_000
    for service, args in (
        ("nothing", {}),
        ("message_details", {"type": "x/Y"}),
        ("get_param", {"name": "x"}),
    ):
        failed = page.call(f"/rosapi/{service}", **args)
        assert not failed["result"]
        assert failed["values"]


def test_page_cannot_move_a_robot_without_permission(server: WebServer, node: nep.Node, page: Peer) -> None:
    description = {"title": "Rover", "rb:topics": {"command": "/orders"}}
    page.send("advertise", topic="/orders", type="nep/Json")  # before the robot is announced
    orders = node.new_sub("/orders")
    page.send("publish", topic="/orders", msg=0)
    assert orders.listen(timeout_s=30.0) == (True, 0)
    node.new_pub("/Rover/description", "robot/description", latched=True).publish(description)
    eventually(lambda: server._guard.denial_reason("/orders") != "")
    assert "--allow-moving Rover" in page.refusal("publish", topic="/orders", msg={"op": "invoke"}, id="p")
    assert "--allow-moving" in page.refusal("advertise", topic="robot_action", type="nep/Json")
    node.parameters.declare("speed", 1.5)
    refused = page.call("/rosapi/set_param", name="python:speed", value="9.0")
    assert "--allow-moving Rover" in str(refused["values"])
    assert orders.received == 1
    assert server.counts.motions_rejected == 2


def test_page_moves_an_allowed_robot(master: Master, node: nep.Node) -> None:
    description = {"title": "Rover", "rb:topics": {"command": "/orders"}}
    orders = node.new_sub("/orders")
    node.new_pub("/Rover/description", "robot/description", latched=True).publish(description)
    settings = WebSettings(port=0, master=master.address, allow_moving=("Rover",))
    with WebServer(settings) as server, connect(server.url) as connection:
        Peer(connection).send("publish", topic="/orders", msg={"op": "invoke"})
        assert orders.listen(timeout_s=30) == (True, {"op": "invoke"})


# ---- rejected operations


def test_invalid_operations_receive_an_error_status_and_the_page_stays_connected(
    server: WebServer, node: nep.Node, page: Peer
) -> None:
    node.new_pub("/picture", "image")
    wrong = (
        ("nothing", {}),
        ("subscribe", {"topic": "/picture", "type": "std_msgs/String"}),
        ("advertise", {"topic": "/picture", "type": "std_msgs/String"}),
        ("publish", {"topic": "/unknown", "msg": {}}),
        ("publish", {"topic": "/picture", "msg": {"data": "AAAA"}}),
        ("service_response", {"service": "/s", "values": {}}),
        ("advertise_service", {"service": "/rosapi/topics", "type": ""}),
        ("png", {"data": "AAAA"}),
    )
    for number, (op, fields) in enumerate(wrong):
        page.send(op, **{"id": number, **fields})
        answer = page.receive("status")
        assert (answer["level"], answer["id"]) == ("error", number)
        assert answer["msg"]
    assert server.counts.rejected == len(wrong)
    page.send("unadvertise", topic="/nothing")  # a warning, below the level of the page
    page.send("set_level", level="none")
    page.send("nothing")
    page.send("set_level", level="info")
    page.send("advertise", topic="/a", type="nep/Json")
    assert page.receive("status")["level"] == "info"


def test_hostile_operations_close_neither_page_nor_server(
    server: WebServer, node: nep.Node, page: Peer
) -> None:
    node.new_server("/echo", lambda given: given, threads=1)  # the examples advertise /s themselves
    node.new_pub("/t", "string")
    drain = threading.Thread(target=lambda: deque(page.connection, maxlen=0))
    drain.start()
    chance = random.Random(4)
    for fields in EXAMPLES:
        for data in hostile.in_every_field(fields, share=9):
            page.connection.send(data)
        for _number in range(20):
            text = bytearray(json.dumps(fields).encode())
            text[chance.randrange(len(text))] = chance.randrange(256)
            page.connection.send(bytes(text))
    eventually(lambda: server.counts.rejected > 100)
    with connect(server.url) as other:
        assert Peer(other).call("/echo", x=1)["values"] == {"x": 1}
    page.connection.close()
    drain.join()


def test_message_beyond_the_limit_closes_only_its_page(server: WebServer, open_page: Open) -> None:
    large, other = open_page(), open_page()
    large.connection.send("x" * (MAX_MESSAGE_BYTES + 1))
    with pytest.raises(ConnectionClosed) as closed:
        large.connection.recv(30.0)
    assert closed.value.rcvd.code == 1009
    assert other.refusal("nothing")


def test_page_that_does_not_read_does_not_affect_other_pages(
    node: nep.Node, server: WebServer, open_page: Open
) -> None:
    slow, quick = open_page(max_queue=1), open_page()
    pub = node.new_pub("/big", "string")
    for each in (slow, quick):
        each.send("subscribe", topic="/big", queue_length=2)
    eventually(lambda: pub.subscribers == 2)
    for number in range(60):
        pub.publish(f"{number}" + "x" * 500_000)
        assert str(quick.receive("publish")["msg"]["data"]).startswith(f"{number}x")
    got = [str(slow.receive("publish")["msg"]["data"]).partition("x")[0]]
    while got[-1] != "59":
        got.append(slow.receive("publish")["msg"]["data"].partition("x")[0])
    assert len(got) < 60
    assert server.counts.dropped + len(got) == 60


def test_connection_of_a_disallowed_origin_is_rejected_before_a_page_is_created(server: WebServer) -> None:
    for origin in ("http://evil.example", "null"):
        with pytest.raises(InvalidStatus) as refused, connect(server.url, origin=origin):
            pass
        assert refused.value.response.status_code == HTTPStatus.FORBIDDEN
        assert b"--origin" in refused.value.response.body
    assert (server.counts.turned_away, server.counts.opened) == (2, 0)


def test_token_is_required_if_configured(master: Master) -> None:
    token = "a-token-of-some-letters"
    settings = WebSettings(port=0, master=master.address, access=Access(token=token))
    with WebServer(settings) as server:
        for path in ("/?token=wrong", "/?token="):
            with pytest.raises(InvalidStatus) as refused:
                connect(server.url + path).close()
            assert refused.value.response.status_code == HTTPStatus.UNAUTHORIZED
        for options in ({"additional_headers": {"Authorization": f"Bearer {token}"}}, {}):
            url = server.url if options else f"{server.url}/?token={token}"
            with connect(url, **options) as connection:
                assert Peer(connection).refusal("nothing")
        with connect(server.url) as locked:
            Peer(locked).send("subscribe", topic="/t")
            with pytest.raises(ConnectionClosed) as closed:
                locked.recv(30.0)
            assert closed.value.rcvd.code == 1008
        with connect(server.url) as unlocked:
            now = int(time.time())
            auth = signed(token, now, now + 60)
            Peer(unlocked).send(
                "auth", mac=auth.mac, client=auth.client, dest=auth.dest, rand=auth.rand, t=auth.time_s,
                level=auth.level, end=auth.end_s,
            )  # fmt: skip
            assert Peer(unlocked).refusal("nothing")


def test_server_sends_close_frames_and_releases_its_port(master: Master) -> None:
    server = WebServer(WebSettings(port=0, master=master.address)).start()
    with pytest.raises(AddressInUseError):
        WebServer(WebSettings(port=server.port, master=master.address)).start()
    with connect(server.url) as connection:
        server.close()
        with pytest.raises(ConnectionClosed) as closed:
            connection.recv(30.0)
        assert closed.value.rcvd.code == 1001
    with WebServer(WebSettings(port=server.port, master=master.address)):
        pass
    server.close()


def test_connected_pages_are_listed_with_their_topics_and_can_be_disconnected(
    server: WebServer, open_page: Open
) -> None:
    page = open_page(origin="http://localhost:8000")
    page.send("advertise", topic="/buttons", type="nep/Json")
    page.send("subscribe", topic="/odom", type="nep/Json")
    eventually(
        lambda: (
            [(each.published_topics, each.subscribed_topics) for each in server.pages]
            == [(("/buttons",), ("/odom",))]
        )
    )
    (listed,) = server.pages
    assert (listed.address, listed.origin) == ("127.0.0.1", "http://localhost:8000")
    server.disconnect(listed.id)
    eventually(lambda: server.pages == ())


def test_rejected_connection_is_listed_with_the_origin_to_allow(server: WebServer, open_page: Open) -> None:
    for _attempt in range(3):  # listed once
        with pytest.raises(InvalidStatus):
            open_page(origin="http://192.168.1.77:5173")
    assert [each.origin for each in server.rejections] == ["http://192.168.1.77:5173"]
