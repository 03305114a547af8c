"""Tests of malformed requests at the master: they are replied to, counted, logged and shown as an alert."""

from __future__ import annotations

import logging

import pytest
import zmq

import nep
from nep.masters.bad_requests import BadRequestCounter, describe_sender
from nep.masters.master import Master
from nep.messages.packing import pack
from nep.protocol import encoding
from nep.protocol.requests import RejectedReply
from tests.nep.programs import eventually


def test_each_sender_is_counted_and_reported_for_some_seconds() -> None:
    bad = BadRequestCounter()
    assert bad.alerts(0.0) == ()
    for _ in range(3):
        bad.add("a", "“A”", "the body isn't a map", 10.0)
    bad.add("b", "“B”", "the body isn't valid msgpack", 10.0)
    first, second = bad.alerts(10.0)
    assert (first.id, second.id) == ("request:a", "request:b")
    assert first.sentence == ("“A” sent 3 requests that the master can't read: the body isn't a map")
    assert second.sentence == "“B” sent a request that the master can't read: the body isn't valid msgpack"
    assert first.hint
    bad.add("a", "“A”", "the body isn't a map", 19.0)
    (alert,) = bad.alerts(21.0)
    assert " 4 requests " in alert.sentence
    assert bad.alerts(29.5) == ()


def test_alert_text_is_not_updated_on_every_bad_request() -> None:
    bad = BadRequestCounter()
    bad.add("a", "“A”", "reason", 10.0)
    before = bad.alerts(10.0)
    bad.add("a", "“A”", "reason", 10.1)
    assert bad.alerts(10.9) is before
    assert " 2 requests " in bad.alerts(11.0)[0].sentence


def test_memory_for_senders_of_bad_requests_is_bounded() -> None:
    bad = BadRequestCounter()
    for n in range(10_000):
        bad.add(f"s{n}", f"S{n}", "reason " * 1000, 10.0)
    assert len(bad._senders) == 100
    told = bad.alerts(10.0)
    assert len(told) == 6
    assert told[0].sentence == "95 more programs send requests that the master can't read"
    assert max(len(each.sentence) for each in told) < 400


def test_control_characters_in_bad_requests_are_escaped() -> None:
    bad = BadRequestCounter()
    bad.add("a", "“A”", "unknown request 'x\nERROR all is lost\x1b[31m'", 10.0)
    assert bad.alerts(10.0)[0].sentence.isprintable()


def test_unknown_senders_are_grouped_by_computer_and_nodes_counted_individually() -> None:
    assert describe_sender("00000000000000ff", "camera", "10.0.0.1") == ("00000000000000ff", "“camera”")
    assert describe_sender("", "", "10.0.0.1") == ("10.0.0.1", "A program on 10.0.0.1")
    assert describe_sender("", "", "") == ("", "A program on an unknown computer")


def test_master_logs_the_first_bad_request_then_rarely_and_raises_an_alert(
    master: Master, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING, "nep.master")
    context = zmq.Context()
    with nep.node("tester") as node:
        for n in range(25):  # each time as a new client
            with context.socket(zmq.DEALER) as socket:
                socket.setsockopt(zmq.LINGER, 0)
                socket.connect(f"tcp://{master.address}")
                socket.send(b"\xc1" if n % 2 else pack({"do": "fly", "call": 3}))
                assert socket.poll(60_000)
                assert isinstance(encoding.decode_reply(socket.recv())[1], RejectedReply)
        eventually(lambda: any(" 25 requests " in each.sentence for each in node.graph().alerts))
        (alert,) = node.graph().alerts
    context.term()
    assert alert.id == "request:127.0.0.1"
    assert alert.sentence.startswith("A program on 127.0.0.1 sent 25 requests that the master can't read: ")
    assert "unknown request 'fly'" in alert.sentence
    logged = [each.getMessage() for each in caplog.records]
    assert len(logged) == 2
    assert " sent a request " in logged[0]
    assert " sent 10 requests " in logged[1]


def test_malformed_renewal_counts_as_a_bad_request(master: Master) -> None:
    context = zmq.Context()
    with context.socket(zmq.DEALER) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.connect(f"tcp://{master.address}")
        socket.send(pack({"do": "renew", "call": 3, "what": [1]}))
        assert socket.poll(60_000)
        assert isinstance(encoding.decode_reply(socket.recv())[1], RejectedReply)
    context.term()
    eventually(lambda: bool(master.view().alerts))
