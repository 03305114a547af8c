"""Tests of latency between two computers, simulated by programs of which one has another clock."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import pytest

import nep
from nep.backends.bases.loss import PublisherTracker
from nep.backends.zeromq import master_session
from nep.masters.clocks import Clocks
from nep.masters.master import Master
from nep.messages.clocks import SAME_CLOCK, ClockDifference
from nep.messages.message import Message
from nep.nodes.subscriber import Subscriber
from nep.protocol.requests import PublisherRecord, RemotePublisher
from nep.system import computer
from nep.system.computer import computer_id
from tests.nep.programs import eventually, running

ELSEWHERE = """
    import select, sys, time
    real_ns, shift_ns = time.time_ns, round(float(sys.argv[2]) * 1e9)
    time.time_ns = lambda: real_ns() + shift_ns
    from nep.system import computer
    computer.system_identifier = lambda: "another computer"
    import nep
    with nep.node("far", master=sys.argv[1]) as node:
        pub = node.new_pub("/far")
        print("ready")
        while True:
            pub.publish({"x": 1})
            if select.select([sys.stdin], [], [], 0.02)[0]:
                said = sys.stdin.readline().strip()
                if not said:
                    break
                shift_ns = round(float(said) * 1e9)
                print("set")
"""
NEAR = """
    import sys, nep
    with nep.node("near", master=sys.argv[1]) as node:
        pub = node.new_pub("/near")
        print("ready")
        sys.stdin.readline()
        pub.publish({"x": 1})
        sys.stdin.readline()
"""
LONG_S = 30.0


@dataclass(frozen=True)
class Place:
    x: float


def heard(sub: Subscriber, is_wanted: Callable[[Message], bool]) -> Message:
    """Wait for the first message that meets a condition, evaluated on receipt."""
    until = time.monotonic() + LONG_S
    while time.monotonic() < until:
        message = sub.receive(1.0)
        if message is not None and is_wanted(message):
            return message
    raise AssertionError("no such message came")


def is_compared(message: Message) -> bool:
    return message.latency_uncertainty_s is not None


def is_near(message: Message) -> bool:
    """Return True for a message with a corrected latency, unless it or the comparison was delayed."""
    latency_s, uncertainty_s = message.latency_s, message.latency_uncertainty_s
    return latency_s is not None and uncertainty_s is not None and abs(latency_s) < 1.0 > 2 * uncertainty_s


def check_corrected(message: Message, shift_s: float) -> None:
    latency_s, uncertainty_s = message.latency_s, message.latency_uncertainty_s
    assert latency_s is not None
    assert uncertainty_s is not None
    assert 0.0 < uncertainty_s < 0.5 < abs(shift_s)
    assert -uncertainty_s <= latency_s < 1.0


def test_clock_of_another_computer_is_compared_and_corrected() -> None:
    shift_s = -86_400.0 * 400
    with Master("127.0.0.1:0", learn_s=0.0) as master, nep.node("here", master=master.address) as node:
        sub = node.new_sub("/far", keep="latest")
        with running(ELSEWHERE, master.address, str(shift_s)) as program:
            assert program.line() == "ready"
            first = heard(sub, lambda message: True)
            if not is_compared(first):
                assert first.latency_s == pytest.approx(-shift_s, abs=60.0)
            check_corrected(heard(sub, is_near), shift_s)
            far = next(each for each in node.graph().nodes.values() if each.name == "far")
            assert far.clock_offset_ns == pytest.approx(-shift_s * 1e9, abs=60e9)
            assert far.clock_uncertainty_ns is not None
            assert far.clock_uncertainty_ns > 0
            # The other clock is set: the known offset is discarded and measured again.
            program.say("3.7")
            assert program.line() == "set"
            check_corrected(heard(sub, is_near), 3.7)


@pytest.mark.usefixtures("patient")
def test_programs_on_one_computer_share_a_clock() -> None:
    with (
        Master("127.0.0.1:0", learn_s=0.0) as master,
        nep.node("here", master=master.address) as node,
        running(NEAR, master.address) as program,
    ):
        assert program.line() == "ready"
        sub = node.new_sub("/near")
        program.say("now")
        message = heard(sub, lambda message: True)
        assert message.latency_uncertainty_s == 0.0
        assert message.latency_s is not None
        assert 0.0 <= message.latency_s < 60.0
        assert message.latency_s == message.latency_s
        assert message.stamp_ns is not None
        assert message.seen_ns > message.stamp_ns


def test_message_without_time_stamp_has_no_latency() -> None:
    message = Message("t", b"1", "json", "json")
    assert message.latency_s is None
    assert message.latency_uncertainty_s is None


def test_message_without_clock_comparison_has_latency_of_unknown_uncertainty() -> None:
    message = Message("t", b"1", "json", "json", stamp_ns=time.time_ns() - 10**9)
    latency_s = message.latency_s
    assert latency_s is not None
    assert 1.0 <= latency_s < 60.0
    assert message.latency_uncertainty_s is None
    assert message.latency_s == latency_s, "it is that of the first look"


def test_latency_within_a_process_has_zero_uncertainty() -> None:
    with nep.node("memory", transport="memory") as node:
        sub, pub = node.new_sub("m"), node.new_pub("m")
        pub.publish({"x": 1})
        message = sub.receive(LONG_S)
        assert message is not None
        assert message.latency_uncertainty_s == 0.0


def test_typed_messages_within_a_process_have_latency_with_zero_uncertainty() -> None:
    with nep.node("memory", transport="memory") as node:
        sub, pub = node.new_sub("m", Place), node.new_pub("m", Place)
        pub.publish(Place(1.0))
        message = sub.receive(LONG_S)
        assert message is not None
        assert message.payload == Place(1.0)
        assert message.latency_uncertainty_s == 0.0
        assert message.latency_s is not None
        assert 0.0 <= message.latency_s < 60.0


@pytest.mark.parametrize(
    ("clocks", "times"),
    [
        ({"0123456789abcdef": (2**64 - 1, 5)}, ()),
        ({"0123456789abcdef": (5,)}, ()),
        ({"0123456789abcdef": (5, -2)}, ()),
        ({"0123456789abcdef": (5, 2**64 - 1)}, ()),
        ({"0123456789abcdef": ("x", 1)}, ()),
        ({"0123456789abcdef": (float("nan"), 1)}, ()),
        ({}, (1,)),
        ({}, (1, 2, 3)),
        ({}, ("x", 2)),
    ],
)
def test_invalid_clock_data_of_a_master_is_counted_and_ignored(
    clocks: object, times: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Clocks, "differences", lambda *_args: clocks)
    monkeypatch.setattr(Clocks, "renewal_timestamps", lambda *_args: times)
    monkeypatch.setattr(master_session, "RENEW_INTERVAL_S", 0.02)
    with Master("127.0.0.1:0", learn_s=0.0) as master, nep.node("here", master=master.address) as node:
        sub, pub = node.new_sub("t"), node.new_pub("t")
        session = node._transport._sessions[master.address]
        eventually(lambda: session._client.rejections.count > 0)
        pub.publish({"x": 1})
        message = sub.receive(LONG_S)
        assert message is not None
        assert message.latency_uncertainty_s == 0.0
        assert session._clock.offset() is None


def test_latest_reported_clock_difference_is_used() -> None:
    far = RemotePublisher(PublisherRecord(7, "t", "json", "json", ("tcp://10.0.0.9:1",)), "n", "far", "far")
    sources = PublisherTracker()
    source = sources.add_listed(far)
    assert source.clock.difference is None
    known = ClockDifference(5, 6, 7)
    sources.set_clock_differences({"n": known, "m": ClockDifference(1, 1, 1)})
    assert source.clock.difference is known
    assert sources.add_listed(far).clock.difference is known, "it is listed again when its address changes"
    sources.set_clock_differences({})
    assert source.clock.difference is None


@pytest.mark.parametrize(
    ("endpoint", "told", "is_here"),
    [
        ("tcp://127.0.0.1:5", "", True),
        ("ipc://@nep-5", "", True),
        ("tcp://10.0.0.9:5", "", False),
        ("tcp://127.0.0.1:5", "another", False),
        ("tcp://10.0.0.9:5", None, True),
        ("nonsense", "", False),
        ("", "", False),
    ],
)
def test_publisher_is_located_by_its_computer_id_or_else_by_its_address(
    endpoint: str, told: str | None, is_here: bool
) -> None:
    endpoints = (endpoint,) if endpoint else ()
    where = computer_id() if told is None else told
    far = RemotePublisher(PublisherRecord(7, "t", "json", "json", endpoints), "n", "far", where)
    assert (PublisherTracker().add_listed(far).clock.difference is SAME_CLOCK) is is_here


def test_computer_id_does_not_reveal_the_machine_identifier(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(computer_id()) == 16
    assert computer.system_identifier() not in computer_id()
    monkeypatch.setattr(computer, "_IDENTIFIER_QUERIES", {})
    assert computer.system_identifier() == ""
    assert computer.computer_id.__wrapped__() == ""
    monkeypatch.setattr(
        computer, "_IDENTIFIER_QUERIES", {sys.platform: lambda: (_ for _ in ()).throw(OSError)}
    )
    assert computer.system_identifier() == ""
