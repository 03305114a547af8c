"""Foxglove's WebSocket protocol: topics as channels, messages of those that are subscribed to."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

import nep
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
        assert received(connection, "serverInfo")["capabilities"] == []
        yield connection


def received(connection: ClientConnection, op: str) -> dict[str, object]:
    while True:
        data = connection.recv(30)
        if isinstance(data, str) and (fields := json.loads(data))["op"] == op:
            return fields


def channel_of(connection: ClientConnection, topic: str) -> dict[str, object]:
    while True:
        for each in received(connection, "advertise")["channels"]:
            if each["topic"] == topic:
                return each


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


def test_json_topic_reaches_its_subscribers_and_goes_with_its_publisher(
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


def test_client_that_publishes_is_refused(foxglove: WebServer) -> None:
    with opened(foxglove) as client:
        client.send(json.dumps({"op": "advertise", "channels": []}))
        assert received(client, "status")["level"] == 2
        client.send(b"\x01\xff[")
        assert received(client, "status")["level"] == 2


def test_page_of_another_origin_is_refused(foxglove: WebServer) -> None:
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
        channels: dict[str, dict[str, object]] = {}
        while not {f"/{each}" for each in publishers} <= channels.keys():
            channels |= {each["topic"]: each for each in received(client, "advertise")["channels"]}
        for id_, each in enumerate(publishers, 1):
            subscribe(client, id_, channels[f"/{each}"])
        eventually(lambda: all(each.subscribers for each in publishers.values()))
        for each in publishers.values():
            for data in (b"", b"\xff\xd8\xff", b"\xff\xfe{", b"\xc1", b"[" * 5000):
                each.publish_bytes(data)
        publishers["json"].publish({"x": 1})
        while message_of(client) != (2, b'{"x":1}'):
            pass
