"""Tests of invalid arguments: rejected at the call with an error that names the allowed values.

A rejected call leaves nothing registered.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import pytest

import nep
from nep.backends.zeromq.sub_socket import SubSocket
from nep.masters.master import Master
from nep.protocol.requests import PublisherRecord, RemotePublisher
from nep.system.addresses import is_endpoint, master_address
from tests.nep.programs import eventually


@pytest.fixture(params=["memory", "zeromq"])
def node(request: pytest.FixtureRequest, master: Master) -> Iterator[nep.Node]:
    where = "arguments" if request.param == "memory" else master.address
    with nep.node("arguments", request.param, master=where) as made:
        yield made


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"keep": "last"}, "keep is 'last'; use 'all' or 'latest'"),
        ({"keep": None}, "keep is None; use 'all' or 'latest'"),
        ({"max_messages": -5}, "max_messages must be a whole number of at least 1, not -5"),
        ({"max_messages": 0}, "max_messages must be a whole number of at least 1, not 0"),
        ({"max_messages": 2.5}, "max_messages must be a whole number of at least 1, not 2.5"),
        ({"max_messages": True}, "max_messages must be a whole number of at least 1, not True"),
        ({"sink": "print"}, "sink must be a function, not 'str'"),
        ({"msg_type": 5}, "msg_type must be a 'str', not 'int'"),
        ({"msg_type": ""}, "msg_type is empty; use a name such as 'json'"),
        (
            {"msg_type": "json\x00"},
            "msg_type is 'json\\\\x00'; use at most 200 characters, without control characters",
        ),
        ({"msg_type": "x" * 201}, "characters\\)'; use at most 200 characters"),
        ({"topic": b"t"}, "a topic name must be a 'str'"),
        ({"qos": "sensor"}, r"the back end '(memory|zeromq)' .*\bqos"),
        (
            {"configuration": "direct"},
            "'configuration' is a 'str'; create it with 'node.hybrid' or 'node.direct'",
        ),
    ],
)
def test_subscriber_with_invalid_arguments_is_rejected(
    node: nep.Node, given: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        node.new_sub(**{"topic": "t", **given})
    assert not node.graph().topics


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"latched": 1}, "latched must be True or False, not 1"),
        ({"latched": "no"}, "latched must be True or False, not 'no'"),
        ({"msg_type": None}, "msg_type must be a 'str', not 'NoneType'"),
        ({"topic": 5}, "a topic name must be a 'str'"),
        ({"qos": "sensor"}, r"the back end '(memory|zeromq)' .*\bqos"),
    ],
)
def test_publisher_with_invalid_arguments_is_rejected(
    node: nep.Node, given: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        node.new_pub(**{"topic": "t", **given})
    assert not node.graph().topics


def test_strict_must_be_a_bool() -> None:
    with pytest.raises(ValueError, match="strict"):
        nep.node("x", "memory", strict="yes")  # type: ignore[arg-type]


def test_callback_must_be_callable(node: nep.Node) -> None:
    with pytest.raises(ValueError, match="callback must be a function, not 'str'"):
        node.new_callback("t", "json", "print")  # type: ignore[arg-type]
    assert not node.graph().topics


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"keep": "last"}, "keep is 'last'; use 'all' or 'latest'"),
        ({"max_messages": 0}, "max_messages must be a whole number of at least 1, not 0"),
        ({"max_messages": True}, "max_messages must be a whole number of at least 1, not True"),
        ({"with_message": 1}, "with_message must be True or False, not 1"),
        ({"topic": 5}, "a topic name must be a 'str'"),
        ({"qos": "sensor"}, r"the back end '(memory|zeromq)' .*\bqos"),
    ],
)
def test_callback_with_invalid_arguments_is_rejected(
    node: nep.Node, given: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        node.new_callback(**{"topic": "t", "msg_type": "json", "callback": print, **given})
    assert not node.graph().topics


@pytest.mark.parametrize("period_s", [0, 0.0, -1.0, math.nan, math.inf, None, "1", True])
def test_timer_with_invalid_period_or_callback_is_rejected(node: nep.Node, period_s: Any) -> None:
    with pytest.raises(ValueError, match=r"period_s must be a number of seconds greater than 0, not .*"):
        node.new_timer(period_s, print)
    with pytest.raises(ValueError, match="callback must be a function, not 'str'"):
        node.new_timer(1.0, "print")  # type: ignore[arg-type]


@pytest.mark.parametrize("time_s", [-1.0, -0.001, math.nan, -math.inf])
def test_negative_nan_or_non_numeric_timeouts_are_rejected(node: nep.Node, time_s: float) -> None:
    sub, pub = node.new_sub("t"), node.new_pub("t")
    sentence = r"_s must be a number of seconds \(0 or greater\) or None, not .*"
    for call in (sub.receive, node.spin, node.graph, pub.close, node.close):
        with pytest.raises(ValueError, match=sentence):
            call(time_s)  # type: ignore[operator]
    with pytest.raises(ValueError, match=sentence):
        sub.listen(timeout_s=time_s)
    with pytest.raises(ValueError, match=sentence):
        nep.node("n", wait_s=time_s)
    with pytest.raises(ValueError, match=r"wait_s must be a number of seconds .*, not '2'"):
        nep.node("n", wait_s="2")  # type: ignore[arg-type]
    for called in (sub.receive, lambda given: sub.listen(timeout_s=given)):
        with pytest.raises(ValueError, match=r"timeout_s must be a number of seconds .*, not '2'"):
            called("2")  # type: ignore[arg-type]
    for close in (pub.close, node.close):
        with pytest.raises(
            ValueError, match=r"timeout_s must be a number of seconds \(0 or greater\), not None"
        ):
            close(None)  # type: ignore[arg-type]
    pub.publish(1)
    assert sub.listen(timeout_s=math.inf) == (True, 1)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (
            {"ip": "[::1]"},
            r"'\[::1\]' is an IPv6 address, .*'127\.0\.0\.1'",
        ),
        ({"ip": "fe80::1"}, "'fe80::1' is an IPv6 address"),
        ({"ip": "http://robot"}, "'http://robot' is a URL"),
        ({"ip": "robot:7780"}, "'robot:7780' isn't a valid computer address"),
        ({"ip": "a b"}, "'a b' isn't a valid computer address"),
        ({"ip": ""}, "'' isn't a valid computer address"),
        ({"ip": "999.1.1.1"}, "'999.1.1.1' isn't a valid computer address"),
        ({"ip": "1.2.3"}, "'1.2.3' isn't a valid computer address"),
        ({"ip": None}, "'None' isn't a valid computer address"),
        ({"port": 0}, "'0' .*from 1 to 65535"),
        ({"port": True}, "'True' .*from 1 to 65535"),
        ({"wire": "nativ"}, "wire is 'nativ'; use 'original', 'native' or 'tcp'"),
        ({"generation": "C"}, "generation is 'C'; use 'A' or 'B'"),
    ],
)
def test_direct_connection_with_invalid_address_wire_or_generation_is_rejected(
    given: dict[str, Any], sentence: str
) -> None:
    with nep.node("direct") as node, pytest.raises((nep.NepError, ValueError), match=sentence):
        node.direct(**given)


@pytest.mark.parametrize("wire", ["original", "native"])
def test_failed_direct_connection_leaves_no_open_socket(wire: Any) -> None:
    with nep.node("direct") as node:  # closing the node would wait for a leaked socket
        anywhere = node.direct("*", 5003, "many2one", wire=wire)
        with pytest.raises(nep.NepError, match=r"'\*:5003'; .*a computer's address"):
            node.new_pub("t", "json", anywhere)
        elsewhere = node.direct("192.0.2.1", 5003, "one2many", wire=wire)
        with pytest.raises(nep.AddressInUseError, match=r"'192\.0\.2\.1:5003'"):
            node.new_pub("t", "json", elsewhere)
        last = node.direct("127.0.0.1", 65535, "many2many", wire=wire)  # a subscriber's port is one higher
        with pytest.raises(nep.NepError, match=r"'127\.0\.0\.1:65536'; .*up to 65535"):
            node.new_sub("t", "json", last)


def test_ipv6_and_malformed_master_addresses_are_rejected() -> None:
    for given in ("[::1]:7780", "::1", "[::1]"):
        with pytest.raises(nep.NepError, match=r"::1.*' is an IPv6 address, .*'127\.0\.0\.1'"):
            master_address(given)
    for given in ("http://robot", "robot:7780:1", "a:b:c"):
        with pytest.raises(nep.NepError, match=rf"'{given}.*use an address such as '127\.0\.0\.1:7780'"):
            master_address(given)
    with pytest.raises(ValueError, match="a 'str' such as '"):
        master_address(7780)  # type: ignore[arg-type]


BAD_ENDPOINTS = [
    "",
    "nonsense",
    "tcp://",
    "tcp://nowhere",
    "tcp://127.0.0.1:0",
    "tcp://127.0.0.1:99999",
    "tcp://127.0.0.1:x",
    "tcp://*:5000",
    "tcp://[::1]:5000",
    "tcp://a b:5000",
    "tcp://a;b:5000",
    "inproc://pyzmq",
    "ipc:///tmp/file",
    "ipc://@other-5000",
    "ipc://@nep-1/2",
    "udp://127.0.0.1:5000",
    "tcp://127.0.0.1:5000\0",
    "tcp://127.0.0.1:5000\n",
    "tcp://" + "a" * 100_000 + ":1",
    "\x1b[2J",
]


@pytest.mark.parametrize("endpoint", BAD_ENDPOINTS)
def test_invalid_endpoint_does_not_block_other_publishers(
    master: Master, endpoint: str, caplog: pytest.LogCaptureFixture
) -> None:
    with nep.node("good", master=master.address) as good, nep.node("victim", master=master.address) as victim:
        pub, sub = good.new_pub("t"), victim.new_sub("t")
        transport: Any = sub._transport
        socket: SubSocket = transport._readable
        bad = [
            RemotePublisher(PublisherRecord(number, "t", "json", "json", (endpoint,)), "bad", "bad")
            for number in (7, 8)
        ]
        (known,) = (source.remote for source in socket.sources.by_id.values())
        assert known is not None
        transport.connect((bad[0], known, bad[1]))
        transport.connect(bad)  # connecting again has no effect
        pub.publish("heard")
        assert sub.listen(timeout_s=30.0) == (True, "heard")
        assert sub.refused == (2 if endpoint else 0)
        if endpoint:
            assert re.search(r"'.*' of 'bad': .*\(2 so far\)", transport.counts().problem)
            assert "\x1b" not in transport.counts().problem + caplog.text
            for each in bad:
                transport.handle_publisher_removed(each.publisher.id, 0, is_closed=False)
            socket.rejections = type(socket.rejections)()
            assert transport.counts().problem == ""


@pytest.mark.parametrize("endpoint", ["tcp://127.0.0.1:1", "tcp://my-host.local:65535", "ipc://@nep-41234"])
def test_tcp_and_ipc_endpoints_are_valid(endpoint: str) -> None:
    assert is_endpoint(endpoint)


def test_subscriber_whose_creation_is_interrupted_is_not_registered(master: Master) -> None:
    """Ctrl+C may interrupt the wait for an echo; the caller has no subscriber then that it could close."""

    class BrokenOff(BaseException):
        pass

    with nep.node("n", master=master.address) as node, nep.node("o", master=master.address) as other:
        other.new_pub("t")
        transport: Any = node._transport

        class Waker:
            def __enter__(self) -> None:
                raise BrokenOff

            def __exit__(self, *_exc: object) -> None: ...

        usual, transport._waker = transport._waker, Waker
        with pytest.raises(BrokenOff):
            node.new_sub("t")
        transport._waker = usual
        eventually(lambda: not node.graph().topics["t"].subscribers)
        assert not transport._subscribers
