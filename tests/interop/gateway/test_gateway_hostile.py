"""Tests of the gateway with truncated, random and huge input on every port: it loses no valid message."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
import zmq
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nep.programs.gateway.framing import FrameError, FrameFormat
from nep.programs.gateway.requests import Request, RequestError, parse_request
from tests.examples import examples

pytestmark = [pytest.mark.ports]

GOOD = json.dumps(
    {"node": "n", "topic": "t", "mode": "many2many", "socket": "publisher", "pid": 1, "msg_type": "json"}
).encode()
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
REQUESTS = (
    st.binary(max_size=300)
    | st.integers(0, len(GOOD) - 1).map(lambda end: GOOD[:end])
    | st.dictionaries(
        st.sampled_from(["node", "topic", "mode", "socket", "pid", "msg_type", "language"]), JSON
    ).map(lambda fields: json.dumps(fields).encode("utf-8", "surrogatepass"))
    | st.just(b"[" * 100_000)
    | st.just(b'{"node":"' + b"x" * 200_000 + b'"}')
)
FRAMES = (
    st.binary(max_size=300)
    | st.binary(max_size=60).map(lambda data: b"t " + data)
    | st.binary(max_size=60).map(lambda data: b"t {" + data)
    | st.just(b"t " + b"[" * 100_000)
    | st.just(b"t" * 3_000_000)
)
quick = settings(
    max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@given(REQUESTS, st.sampled_from([7000, 50000]))
@settings(max_examples=examples(300), deadline=None)
def test_request_is_parsed_or_rejected_with_a_message(data, port):
    try:
        understood = isinstance(parse_request(data, port), Request)
    except RequestError as error:
        understood = bool(str(error))
    assert understood


@given(FRAMES, st.sampled_from(["prefixed", "bare"]), st.sampled_from(["json", "string", "image", "bytes"]))
@settings(max_examples=examples(300), deadline=None)
def test_frame_is_parsed_or_rejected_with_a_frame_error(frame, framing, codec):
    shape = FrameFormat("t", framing, codec)
    try:
        understood = isinstance(shape.decode_frame(frame), bytes)
    except FrameError as error:
        understood = bool(str(error))
    assert understood
    assert shape.matches_filter(frame) in {True, False}


@quick
@given(data=REQUESTS, port=st.sampled_from([7000, 50000]))
def test_every_request_receives_a_reply(gateway, original, data, port):
    answer = json.loads(original.ask_raw(data, port))
    assert answer["state"] in {"success", "failure"}
    assert answer["state"] == "success" or answer["error"]


def test_request_of_20_megabytes_receives_no_reply_and_later_requests_are_served(gateway, original):
    with original.socket(zmq.REQ) as asking:
        asking.connect("tcp://127.0.0.1:7000")
        asking.send(b"x" * 20_000_000)
        assert not asking.poll(300)
    assert original.ask("t")["state"] == "success"


def test_invalid_frames_are_counted_in_an_alert_and_valid_ones_between_are_forwarded(
    gateway, original, native
):
    port = original.ask("t", "subscriber")["port"]
    bad = 0
    with original.subscriber(port + 1, b"t") as subscriber, original.publisher(port) as publisher:
        original.publish_until(publisher, b't {"warm":1}', lambda: subscriber.poll(0))
        original.waiting(subscriber)
        for number in range(40):
            for frame in (b"", b"\xff" * 3, b"x" * 3_000_000, b"elsewhere {}"):
                publisher.send(frame)
                bad += 1
            publisher.send(b't {"n":%d}' % number)
        publisher.send(b't {"end":1}')
        heard = []
        while b"end" not in (frame := subscriber.recv()):
            heard.append(frame)
        assert [frame for frame in heard if b"warm" not in frame] == [b't {"n":%d}' % n for n in range(40)]
        native.wait(lambda: f"({bad} messages)" in native.alerts.get("message:t", ""))
        publisher.send(b't {"good":1}')
        native.wait(lambda: "message:t" not in native.alerts)


@quick
@given(filters=st.lists(st.binary(max_size=80), min_size=1, max_size=8))
def test_malformed_subscription_filters_do_not_affect_other_subscribers(gateway, original, native, filters):
    port = original.ask("t", "subscriber")["port"]
    with original.socket(zmq.XSUB) as odd, original.subscriber(port + 1, b"t") as subscriber:
        odd.connect(f"tcp://127.0.0.1:{port + 1}")
        for filter_ in filters:
            odd.send(filter_)
        with original.publisher(port) as publisher:
            original.publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0))
    assert not {id for id in native.alerts if id.startswith("message:")}


def test_huge_subscription_filter_closes_only_its_connection(gateway, original):
    """libzmq keeps filters in a tree: closing the socket would descend 5 million levels."""
    port = original.ask("t", "subscriber")["port"]
    code = """if True:
        import os, sys, zmq
        odd = zmq.Context().socket(zmq.XSUB)
        monitor = odd.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        odd.connect(sys.argv[1])
        odd.send(bytes([1]) + b"t" * 5_000_000)
        ended = bool(monitor.poll(60_000))
        os._exit(0 if ended else 1)  # its own tree is as deep: without closing anything
    """
    attacker = [sys.executable, "-c", code, f"tcp://127.0.0.1:{port + 1}"]
    with original.subscriber(port + 1, b"t") as subscriber, original.publisher(port) as publisher:
        original.publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0))
        assert subprocess.run(attacker, timeout=150, check=False).returncode == 0, "it was not disconnected"
        original.waiting(subscriber)
        original.publish_until(publisher, b't {"n":2}', lambda: subscriber.poll(0))
