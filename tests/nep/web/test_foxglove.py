"""Tests of Foxglove's WebSocket protocol: topics as channels, and messages of subscribed channels."""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

import nep
from nep.geometry import Twist, Vector3
from nep.masters.master import Master
from nep.programs.web import WebServer, WebSettings
from nep.recordings.formats.channels import LiveChannels
from tests.nep.programs import eventually


@pytest.fixture
def foxglove(master: Master) -> Iterator[WebServer]:
    with WebServer(WebSettings(port=0, master=master.address, foxglove=LiveChannels())) as running:
        yield running


@contextmanager
def opened(server: WebServer, subprotocol: str = "foxglove.sdk.v1") -> Iterator[ClientConnection]:
    with connect(server.url, subprotocols=[subprotocol]) as connection:
        assert connection.subprotocol == subprotocol
        assert "clientPublish" in received(connection, "serverInfo")["capabilities"]
        yield connection


def received(connection: ClientConnection, op: str) -> dict[str, object]:
    while True:
        data = connection.recv(30)
        if isinstance(data, str) and (fields := json.loads(data))["op"] == op:
            return fields


def channels_of(connection: ClientConnection, topics: set[str]) -> dict[str, dict[str, object]]:
    """Wait until all of these topics are advertised; return the channels by topic."""
    channels: dict[str, dict[str, object]] = {}
    while not topics <= channels.keys():
        channels |= {each["topic"]: each for each in received(connection, "advertise")["channels"]}
    return channels


def channel_of(connection: ClientConnection, topic: str) -> dict[str, object]:
    return channels_of(connection, {topic})[topic]


def subscribe(connection: ClientConnection, id_: int, channel: dict[str, object]) -> None:
    wish = {"id": id_, "channelId": channel["id"]}
    connection.send(json.dumps({"op": "subscribe", "subscriptions": [wish]}))


def message_of(connection: ClientConnection) -> tuple[int, bytes]:
    while True:
        data = connection.recv(30)
        if isinstance(data, bytes):
            opcode, id_, log_ns = struct.unpack_from("<BIQ", data)
            assert (opcode, log_ns > 0) == (1, True)
            return id_, data[13:]


def test_json_topic_is_sent_to_subscribers_and_removed_with_its_publisher(
    foxglove: WebServer, node: nep.Node
) -> None:
    publisher = node.new_pub("/pose", "json", latched=True)
    publisher.publish({"x": 1})
    with opened(foxglove) as first, opened(foxglove, "foxglove.websocket.v1") as second:
        channels = [channel_of(each, "/pose") for each in (first, second)]
        assert [each["encoding"] for each in channels] == ["json", "json"]
        assert not node.graph().topics["/pose"].subscribers
        subscribe(first, 7, channels[0])
        subscribe(second, 8, channels[1])
        for connection, id_ in ((first, 7), (second, 8)):
            number, data = message_of(connection)
            assert (number, json.loads(data)) == (id_, {"x": 1})
        second.close()
        eventually(lambda: len(node.graph().topics["/pose"].subscribers) == 1)
        first.send(json.dumps({"op": "unsubscribe", "subscriptionIds": [7]}))
        eventually(lambda: not node.graph().topics["/pose"].subscribers)
        publisher.close()
        assert received(first, "unadvertise")["channelIds"] == [channels[0]["id"]]


def test_raw_image_is_advertised_again_with_its_schema(foxglove: WebServer, node: nep.Node) -> None:
    node.new_pub("/camera", "image", latched=True, image=nep.ImageFormat("raw")).publish(
        np.zeros((2, 3, 3), np.uint8)
    )
    with opened(foxglove) as client:
        channel = channel_of(client, "/camera")
        assert channel["schemaName"] == "foxglove.CompressedImage"
        subscribe(client, 1, channel)
        channel = channel_of(client, "/camera")
        assert (channel["schemaName"], channel["encoding"]) == ("foxglove.RawImage", "protobuf")
        subscribe(client, 2, channel)
        number, data = message_of(client)
        assert number == 2
        assert data.endswith(bytes(18))


def advertise(
    connection: ClientConnection, id_: int, topic: str, schema: str, encoding: str = "json"
) -> None:
    channel = {"id": id_, "topic": topic, "encoding": encoding, "schemaName": schema}
    connection.send(json.dumps({"op": "advertise", "channels": [channel]}))


def publish(connection: ClientConnection, id_: int, message: object) -> None:
    connection.send(struct.pack("<BI", 1, id_) + json.dumps(message).encode())


def test_client_publishes_string_msgpack_json_and_typed_messages(foxglove: WebServer, node: nep.Node) -> None:
    text, binary, twist = node.new_sub("/text", "string"), node.new_sub("/any"), node.new_sub("/cmd", Twist)
    node.new_pub("/text", "string")
    node.new_pub("/packed", "msgpack")
    packed = node.new_sub("/packed", "msgpack")
    with opened(foxglove) as client:
        channels = channels_of(client, {"/text", "/packed"})
        known = {topic: channel["schemaName"] for topic, channel in channels.items()}
        for id_, (topic, schema, message) in enumerate(
            (
                ("/text", known["/text"], {"data": "hello"}),
                ("/packed", known["/packed"], {"n": 1}),
                ("/any", "", [1, 2]),
                ("/cmd", "geometry_msgs/msg/Twist", {"linear": {"x": 2}}),
            )
        ):
            advertise(client, id_, topic, schema)
            publish(client, id_, message)
        assert text.listen(timeout_s=30) == (True, "hello")
        assert packed.listen(timeout_s=30) == (True, {"n": 1})
        assert binary.listen(timeout_s=30) == (True, [1, 2])
        assert twist.listen(timeout_s=30) == (True, Twist(linear=Vector3(x=2.0)))
        eventually(lambda: [each.sent_count for each in foxglove.pages[0].topics] == [1] * 4)
        client.send(json.dumps({"op": "unadvertise", "channelIds": [2]}))
        eventually(lambda: not node.graph().topics["/any"].publishers)


def test_client_moves_a_robot_only_after_it_is_allowed(foxglove: WebServer, node: nep.Node) -> None:
    description = {"title": "Rover", "rb:topics": {"command": "/orders"}}
    orders = node.new_sub("/orders")
    node.new_pub("/Rover/description", "robot/description", latched=True).publish(description)
    with opened(foxglove) as client:
        eventually(lambda: foxglove._guard.denial_reason("/orders") != "")
        advertise(client, 1, "/orders", "")
        assert "--allow-moving Rover" in str(received(client, "status")["message"])
        publish(client, 1, {"op": "invoke"})
        assert "Rover" in str(received(client, "status")["message"])
        assert [(each.kind, each.robot) for each in foxglove.rejections] == [("robot", "Rover")]
        foxglove.set_allow_moving(["Rover"])
        publish(client, 1, {"op": "stop"})
        assert orders.listen(timeout_s=30) == (True, {"op": "stop"})


def call(connection: ClientConnection, service: int, data: bytes, encoding: bytes = b"json") -> None:
    connection.send(struct.pack("<BIII", 2, service, 70 + service, len(encoding)) + encoding + data)


def test_client_calls_services(foxglove: WebServer, node: nep.Node) -> None:
    server = node.new_server("/add", lambda given: {"sum": given["a"] + given["b"]}, threads=1)
    with opened(foxglove) as client:
        (service,) = received(client, "advertiseServices")["services"]
        assert (service["name"], service["request"]["encoding"]) == ("/add", "json")
        call(client, service["id"], b'{"a": 1, "b": 2}')
        answer = client.recv(30)
        while isinstance(answer, str):
            answer = client.recv(30)
        assert struct.unpack_from("<BIII", answer) == (3, service["id"], 70 + service["id"], 4)
        assert answer[13:] == b'json{"sum":3}'
        for data, encoding, reason in (
            (b"{}", b"json", "KeyError"),
            (b"{}", b"cdr", "cdr"),
            (b"{", b"json", "JSON"),
        ):
            call(client, service["id"], data, encoding)
            failure = received(client, "serviceCallFailure")
            assert (failure["callId"], reason in str(failure["message"])) == (70 + service["id"], True)
        call(client, 4_000_000_000, b"{}")
        assert received(client, "serviceCallFailure")["serviceId"] == 4_000_000_000
        server.close()
        assert received(client, "unadvertiseServices")["serviceIds"] == [service["id"]]


def test_connection_graph_is_sent_as_incremental_updates(foxglove: WebServer, node: nep.Node) -> None:
    node.new_sub("/odom")
    publisher = node.new_pub("/odom")
    node.new_server("/add", lambda given: given, threads=1)
    with opened(foxglove) as client:
        client.send(json.dumps({"op": "subscribeConnectionGraph"}))
        update = received(client, "connectionGraphUpdate")
        assert update["publishedTopics"] == [{"name": "/odom", "publisherIds": ["python"]}]
        assert update["subscribedTopics"] == [{"name": "/odom", "subscriberIds": ["python"]}]
        assert update["advertisedServices"] == [{"name": "/add", "providerIds": ["python"]}]
        publisher.close()
        update = received(client, "connectionGraphUpdate")
        assert update["publishedTopics"] == [{"name": "/odom", "publisherIds": []}]
        assert update["subscribedTopics"] == []


def test_msgpack_is_sent_as_json(foxglove: WebServer, node: nep.Node) -> None:
    node.new_pub("/packed", "msgpack", latched=True).publish({"data": b"abc", "n": 2**60})
    with opened(foxglove) as client:
        channel = channel_of(client, "/packed")
        assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema")
        subscribe(client, 1, channel)
        assert json.loads(message_of(client)[1]) == {"data": "YWJj", "n": 2**60}


def test_invalid_messages_receive_an_error_status_and_the_client_stays_connected(foxglove: WebServer) -> None:
    channel = {"id": 1, "topic": "/a", "encoding": "json", "schemaName": "x/Y"}
    wrong = [
        b"", b"[1]", b"\x01", b"\x01\xff\xff\xff\xff[", b"\x02\x00\x00", b"\x07", b"\xff\xfe", b"[" * 9_000,
        *(json.dumps(each).encode() for each in (
            {}, {"op": 7}, {"op": "getParameters", "parameterNames": []}, {"op": "x" * 10_000},
            {"op": "subscribe", "subscriptions": [1]},
            {"op": "subscribe", "subscriptions": [{"id": -1, "channelId": []}]},
            {"op": "unadvertise", "channelIds": [None]},
            *({"op": "advertise", "channels": [{**channel, **each}]} for each in (
                {"id": -1}, {"id": True}, {"id": 2**32}, {"topic": "/nep/x"}, {"topic": 1}, {"topic": ""},
                {"encoding": "cdr"}, {"encoding": None}, {"schemaName": "\x1b"},
            )),
        )),
    ]  # fmt: skip
    with opened(foxglove) as client:
        for each in wrong:
            client.send(each)
            assert received(client, "status")["level"] == 2, each
        client.send(json.dumps({"op": "advertise", "channels": "x"}))
        assert foxglove.counts.rejected == len(wrong)


def test_images_for_a_client_that_stops_reading_are_dropped_without_affecting_others(
    foxglove: WebServer, node: nep.Node
) -> None:
    camera = node.new_pub("/camera", "image")
    image = np.random.default_rng(1).integers(0, 255, (240, 320, 3), np.uint8)
    options = {"subprotocols": ["foxglove.sdk.v1"], "max_queue": 1}
    with connect(foxglove.url, **options) as slow, opened(foxglove) as quick:
        for id_, each in enumerate((slow, quick)):
            subscribe(each, id_, channel_of(each, "/camera"))
        eventually(lambda: camera.subscribers == 2)
        size = 0
        for _number in range(300):
            camera.publish(image)
            size = len(message_of(quick)[1])
        eventually(lambda: foxglove.counts.dropped + foxglove.pages[0].topics[0].dropped_count > 200)
        pages = {each.topics[0].dropped_count > 0 for each in foxglove.pages}
        assert pages == {True, False}
        slow.send("nothing")
        taken = 0
        while True:
            data = slow.recv(30)
            if (
                isinstance(data, str)
                and json.loads(data)["op"] == "status"
                and json.loads(data)["level"] == 2
            ):
                break
            taken += isinstance(data, bytes)
        assert taken * size < 20_000_000  # socket buffers plus some images
        slow.socket.shutdown(socket.SHUT_RDWR)


def test_page_of_a_disallowed_origin_is_rejected(foxglove: WebServer) -> None:
    options = {"origin": "https://evil.example", "subprotocols": ["foxglove.sdk.v1"]}
    with pytest.raises(InvalidStatus) as refused, connect(foxglove.url, **options):
        pass
    assert refused.value.response.status_code == HTTPStatus.FORBIDDEN


def test_channels_of_many_topics_arrive_together(foxglove: WebServer, node: nep.Node) -> None:
    topics = {f"/many/{number}" for number in range(150)}
    for topic in topics:
        node.new_pub(topic, "json")
    with opened(foxglove) as client:
        missing, count = set(topics), 0
        while missing:
            count += 1
            missing -= {each["topic"] for each in received(client, "advertise")["channels"]}
        assert count < len(topics) / 10


def test_message_that_cannot_be_decoded_does_not_close_the_connection(
    foxglove: WebServer, node: nep.Node
) -> None:
    publishers = {each: node.new_pub(f"/{each}", each) for each in ("image", "json", "string", "msgpack")}
    with opened(foxglove) as client:
        channels = channels_of(client, {f"/{each}" for each in publishers})
        for id_, each in enumerate(publishers, 1):
            subscribe(client, id_, channels[f"/{each}"])
        eventually(lambda: all(each.subscribers for each in publishers.values()))
        for each in publishers.values():
            for data in (b"", b"\xff\xd8\xff", b"\xff\xfe{", b"\xc1", b"[" * 5000):
                each.publish_bytes(data)
        publishers["json"].publish({"x": 1})
        while message_of(client) != (2, b'{"x":1}'):
            pass
