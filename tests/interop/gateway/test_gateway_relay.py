"""Tests of the forwarding of frames between original and native programs."""

from __future__ import annotations

import pytest
import zmq

from nep.messages.message import Message

pytestmark = [pytest.mark.ports]


def test_original_frames_are_forwarded_once_to_both_framings_and_to_native_subscribers(
    gateway, original, native
):
    a, b = original.ask("t", port=7000)["port"], original.ask("t", port=50000)["port"]
    with (
        original.subscriber(a + 1, b"t") as to_a,
        original.subscriber(b + 1) as to_b,
        original.publisher(a) as from_a,
        original.publisher(b) as from_b,
    ):
        original.publish_until(from_a, b't {"warm":"a"}', lambda: to_b.poll(0) and to_a.poll(0))
        original.publish_until(
            from_b, b'{"warm": "b"}', lambda: any(b"b" in each[2] for each in native.published)
        )
        for number in range(40):
            from_a.send(b't {"a":%d}' % number)
            from_b.send(b'{"b":%d}' % number)
        from_a.send(b't {"end":1}')
        from_b.send(b'{"end":2}')
        heard_a, heard_b = read_to_end(to_a), read_to_end(to_b)
        native.wait(lambda: sum(b"end" in each[2] for each in native.published) == 2)
    heard_native = [data for _, _, data in native.published]
    for number in range(40):
        assert heard_a.count(b't {"a":%d}' % number) == heard_a.count(b't {"b":%d}' % number) == 1
        assert heard_b.count(b'{"a":%d}' % number) == heard_b.count(b'{"b":%d}' % number) == 1
        assert heard_native.count(b'{"a":%d}' % number) == heard_native.count(b'{"b":%d}' % number) == 1


def read_to_end(subscriber):
    frames = []
    while sum(b"end" in frame for frame in frames) < 2:
        frames.append(subscriber.recv())
    while subscriber.poll(200):
        frames.append(subscriber.recv())
    return frames


def test_native_topic_is_subscribed_only_while_an_original_subscribes(gateway, original, native):
    port = original.ask("t", "subscriber", port=50000)["port"]
    assert not native.subscribed
    with original.subscriber(port + 1) as subscriber:
        native.wait(lambda: native.subscribed == {("t", "json")})
        native.inbox.post(Message("t", b'{"native":1}', "json", "json"))
        assert subscriber.recv() == b'{"native":1}'
        assert not native.published
    native.wait(lambda: not native.subscribed)


def test_native_string_is_not_forwarded_to_json_subscribers(gateway, original, native):
    port = original.ask("t", "subscriber")["port"]
    with original.subscriber(port + 1, b"t") as subscriber:
        native.wait(lambda: native.subscribed)
        native.inbox.post(Message("t", b"hello", "string", "string"))
        native.inbox.post(Message("t", b'{"native":1}', "json", "json"))
        assert subscriber.recv() == b't {"native":1}'


def test_program_binds_and_gateway_connects_in_one2many_mode(gateway, original, native):
    port = original.ask("t", "publisher", mode="one2many")["port"]
    other = original.ask("t", "subscriber", mode="one2many")["port"]
    prefixed = original.ask("t", "subscriber")["port"]
    with (
        original.socket(zmq.PUB) as publisher,
        original.subscriber(other, b"t") as subscriber,
        original.subscriber(prefixed + 1, b"t") as many,
    ):
        publisher.bind(f"tcp://127.0.0.1:{port}")
        original.publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0) and many.poll(0))
        native.wait(lambda: native.published)


def test_subscriber_binds_and_gateway_connects_in_many2one_mode(gateway, original, native):
    port = original.ask("t", "subscriber", mode="many2one")["port"]
    other = original.ask("t", "publisher", mode="many2one")["port"]
    with original.socket(zmq.SUB) as subscriber, original.publisher(other) as publisher:
        subscriber.setsockopt(zmq.SUBSCRIBE, b"t")
        subscriber.bind(f"tcp://127.0.0.1:{port}")
        original.publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0))
        native.wait(lambda: native.published)
