from __future__ import annotations

import re

import pytest

import nep
from nep.messages.message import Message
from nep.programs.gateway.attachment import NativeNetwork
from nep.programs.gateway.graph_registrar import GraphRegistrar
from nep.programs.gateway.inbox import NativeInbox
from tests import hostile
from tests.nep.bad_pictures import BOMBS

LONG_S = 30


class Scene:
    def __init__(self, master):
        self.alerts = ()
        self.made = 0
        self.inbox = NativeInbox()
        self.native = NativeNetwork(self._node, GraphRegistrar(master.submit, master.epoch), self._report)
        self.native.start(self.inbox)
        self.address = master.address

    def _node(self):
        self.made += 1
        return nep.Node("gateway", master=self.address, generation="gateway", wait_s=60.0)

    def _report(self, alerts):
        self.alerts = alerts

    def close(self):
        self.native.close()
        self.inbox.close()


@pytest.fixture
def scene(master, patient):
    made = Scene(master)
    yield made
    made.close()


def test_node_is_created_only_on_first_use(scene):
    assert scene.made == 0
    scene.native.subscribe("t", "json")
    scene.native.subscribe("u", "json")
    assert scene.made == 1


def test_message_of_an_original_is_published_with_its_bytes_unchanged(scene):
    with nep.node("listener") as node, node.new_sub("t") as sub:
        scene.native.publish("t", "json", b'{"a": 1}')
        message = sub.receive(LONG_S)
        assert (bytes(message.data), message.codec, message.seq) == (b'{"a": 1}', "json", 1)
        scene.native.stop_publishing("t", "json")
        scene.native.publish("t", "json", b'{"a": 2}')
        assert sub.receive(LONG_S).payload == {"a": 2}


def test_native_messages_are_received_and_own_ones_are_not_echoed(scene, master):
    assert scene.native.subscribe("t", "json")
    with nep.node("talker") as node:
        pub = node.new_pub("t")
        scene.native.publish("t", "json", b'"own"')
        pub.publish("first")
        pub.publish("last")
        got = []
        with node.new_sub("idle") as idle:
            for _ in range(LONG_S * 20):
                got += [message.payload for message in scene.inbox.pop_all()]
                if "last" in got:
                    break
                idle.receive(0.05)
        assert got == ["first", "last"]
        scene.native.unsubscribe("t", "json")
        for _ in range(100):
            if not pub.subscribers:
                break
            pub.publish("nobody")
        assert not scene.native._subscribers


def test_images_that_originals_cannot_decode_are_converted_to_jpeg(scene):
    np = pytest.importorskip("numpy")
    raw = nep.raw_image(np.zeros((4, 6, 3), np.uint8))
    message = Message("cam", raw.data, "image", "image", extension=raw.extension)
    assert bytes(scene.native.data_of(message)).startswith(b"\xff\xd8\xff")
    jpeg = scene.native.data_of(message)
    again = Message("cam", jpeg, "image", "image", extension={"encoding": "jpeg"})
    assert scene.native.data_of(again) == jpeg


@pytest.mark.parametrize("told", [None, "jpeg", "png", "gif"])
def test_decompression_bomb_is_not_forwarded_whatever_its_declared_encoding(scene, told):
    for name in ("gif", "png of many pixels"):
        bomb = Message(
            "cam", BOMBS[name], "image", "image", extension={} if told is None else {"encoding": told}
        )
        assert scene.native.data_of(bomb) is None
    assert [alert.id for alert in scene.alerts] == ["message:cam"]
    assert "48000 × 48000 pixels are too many" in scene.alerts[0].sentence  # noqa: RUF001


def test_pixel_types_that_originals_cannot_decode_raise_an_alert(scene):
    np = pytest.importorskip("numpy")
    depth = nep.raw_image(np.zeros((4, 6), np.uint16))
    sent = scene.native.data_of(Message("cam", depth.data, "image", "image", extension=depth.extension))
    assert bytes(sent).startswith(b"\x89PNG")
    floats = nep.raw_image(np.zeros((4, 6), np.float32))
    assert (
        scene.native.data_of(Message("cam", floats.data, "image", "image", extension=floats.extension))
        is None
    )
    assert re.search("“cam”: .*JPEG and PNG", scene.alerts[0].sentence)


@pytest.mark.parametrize("encoding", ["bgr8", ["bgr8"], {"bgr8": 1}, 7, b"jpeg"])
def test_undecodable_image_raises_an_alert_and_is_dropped(scene, encoding):
    broken = Message("cam", b"123", "image", "image", extension={"encoding": encoding, "shape": [4, 6, 3]})
    assert scene.native.data_of(broken) is None
    assert [alert.id for alert in scene.alerts] == ["message:cam"]


def test_invalid_native_topic_name_raises_an_alert_and_is_not_retried_at_once(scene):
    assert not scene.native.subscribe("not a topic", "json")
    scene.native.publish("not a topic", "json", b"1")
    (alert,) = scene.alerts
    assert re.match("“not a topic” .*the character ' '", alert.sentence)
    assert alert.hint


def test_alert_is_reported_once_and_removed_when_resolved(scene):
    scene.native.report("port:7000", "Port 7000 is taken")
    told = scene.alerts
    scene.native.report("port:7000", "Port 7000 is taken")
    assert scene.alerts is told
    scene.native.resolve("port:7000")
    assert scene.alerts == ()


def test_hostile_messages_pass_in_both_directions_and_the_next_one_arrives(scene):
    payloads = tuple(hostile.payloads({"pose": {"x": 1.0}}))
    with nep.node("stranger") as node, node.new_sub("t") as sub:
        for payload in payloads:
            scene.native.publish("t", "json", payload)
        scene.native.publish("t", "json", b'{"honest": true}')
        came = [bytes(sub.receive(LONG_S).data) for _each in range(len(payloads) + 1)]
        assert came == [*payloads, b'{"honest": true}']
        assert scene.native.subscribe("u", "json")
        pub = node.new_pub("u")
        for payload in payloads:
            pub.publish_bytes(payload)
            pub.publish_bytes(b'{"a": 1}', {"shape": payload.decode("latin-1"), "encoding": [1]})
        pub.publish({"honest": True})
        handed: list[bytes] = []
        while b'{"honest":true}' not in handed:
            messages = scene.inbox.pop_all() or [sub.receive(0.02)]
            handed += [bytes(scene.native.data_of(each)) for each in messages if each is not None]
        assert len(handed) > len(payloads)
