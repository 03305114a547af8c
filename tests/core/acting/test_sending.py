"""Tests of sending a message once or repeatedly with nodes in memory, and only while armed."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import nep
from app.clock import VirtualClock
from app.core.run.acting.arming import Arming, Target
from app.core.run.acting.sending import MAX_AGE_S, MAX_REPEATED_MESSAGES, Outbox, SendOrder
from nep.errors import NepError
from nep.nodes.node import Node
from tests.nep.programs import eventually


class Bench:
    """Outbox whose jobs run on a node in memory, immediately or when the test runs them."""

    def __init__(self, node: Node) -> None:
        self.node, self.clock = node, VirtualClock(advances_alone=False)
        self.waiting: list[object] | None = None
        self.arming = Arming(self.clock.now)
        self.outbox = Outbox(self.arming, self._submit, clock=self.clock)

    def _submit(self, _what: str, job) -> None:
        if self.waiting is None:
            job(self.node)
        else:
            self.waiting.append(job)

    def advance(self, seconds: float) -> None:
        """Advance the clock once the repeated messages that are due have been sent."""
        now = self.clock.now()
        eventually(lambda: all(each.due_s > now for each in self.outbox.repeated_messages))
        self.clock.advance(seconds)

    def arm(self, *topics: str) -> None:
        self.arming.arm()
        for topic in topics:
            assert self.arming.allow(Target("topic", topic))


@pytest.fixture
def bench(request) -> Iterator[Bench]:
    with nep.node("studio", "memory", master=request.node.name) as node:
        made = Bench(node)
        yield made
        made.outbox.close()


def order(
    topic: str = "/cmd_vel", msg_type: str = "json", payload: object = None, id: str = "a"
) -> SendOrder:
    return SendOrder(id, "Drive", topic, msg_type, lambda: {"x": 1} if payload is None else payload)


def kinds(bench: Bench) -> list[str]:
    return [each.kind for each in bench.outbox.pop_results()]


def test_sent_message_is_received_and_its_subscribers_are_counted(bench) -> None:
    heard = bench.node.new_sub("/cmd_vel", "json")
    bench.arm("/cmd_vel")
    bench.outbox.send(order())
    assert heard.listen(timeout_s=60.0) == (True, {"x": 1})
    (result,) = bench.outbox.pop_results()
    assert (result.kind, result.subscriber_count) == ("sent", 1)


def test_message_is_not_sent_when_disarmed(bench) -> None:
    heard = bench.node.new_sub("/cmd_vel", "json")
    bench.outbox.send(order())
    bench.arm("/other")
    bench.outbox.send(order())
    assert [(each.kind, each.message) for each in bench.outbox.pop_results()] == [
        ("failed", "not sent: no longer armed")
    ] * 2
    assert heard.receive(0.0) is None


def test_message_delayed_by_missing_master_is_not_sent_when_expired_or_disarmed(bench) -> None:
    heard = bench.node.new_sub("/cmd_vel", "json")
    bench.arm("/cmd_vel")
    bench.waiting = []
    bench.outbox.send(order())
    bench.outbox.send(order())
    first, second = bench.waiting
    bench.arming.disarm()
    bench.arm("/cmd_vel")
    first(bench.node)
    bench.clock.advance(MAX_AGE_S + 1)
    second(bench.node)
    said = [each.message for each in bench.outbox.pop_results()]
    assert said == ["not sent: no longer armed", "not sent: no master was running"]
    assert heard.receive(0.0) is None


@pytest.mark.parametrize(
    ("topic", "msg_type", "payload"), [("/cmd_vel", "bytes", {"x": 1}), ("bad topic", "json", 1)]
)
def test_invalid_message_fails_with_reason(bench, topic, msg_type, payload) -> None:
    bench.arm(topic)
    bench.outbox.send(order(topic, msg_type, payload))
    bench.outbox.start(order(topic, msg_type, payload), 10)
    results = bench.outbox.pop_results()
    assert [each.kind for each in results] == ["failed", "failed"]
    assert all(each.message for each in results)
    assert bench.outbox.repeated_messages == ()


def test_message_repeats_until_stopped(bench) -> None:
    heard = bench.node.new_sub("/cmd_vel", "json")
    bench.arm("/cmd_vel")
    assert bench.outbox.start(order(), 50)
    for _each in range(3):
        assert heard.listen(timeout_s=20.0) == (True, {"x": 1})
        bench.advance(0.02)
    bench.outbox.stop("a")
    assert not bench.outbox.is_sending("a")
    began, ended = bench.outbox.pop_results()
    assert (began.kind, ended.kind) == ("began", "ended")
    more = 0
    while heard.receive(0.0) is not None:
        more += 1
    assert ended.count == 3 + more
    assert heard.receive(0.1) is None


def test_disarming_ends_repetition_without_polling(bench) -> None:
    bench.arm("/cmd_vel")
    bench.outbox.start(order(), 50)
    bench.arming.disarm()
    bench.advance(0.02)
    eventually(lambda: not bench.outbox.is_sending("a"))
    assert kinds(bench) == ["began", "ended"]


def test_repeated_message_that_raises_ends_and_other_messages_continue(bench) -> None:
    heard = bench.node.new_sub("/good", "json")
    bench.arm("/good", "/bad")
    made = iter([1, 2])

    def once() -> object:
        value = next(made, None)
        if value is None:
            raise NepError("Fill in “yaw” first.")
        return value

    bench.outbox.start(SendOrder("b", "Bad", "/bad", "json", once), 50)
    bench.outbox.start(order("/good", id="g"), 50)
    bench.advance(0.02)
    eventually(lambda: not bench.outbox.is_sending("b"))
    bench.advance(0.02)
    for _each in range(3):
        assert heard.listen(timeout_s=20.0)[0]
    failed = next(each for each in bench.outbox.pop_results() if each.kind == "failed")
    assert (failed.message, failed.count) == ("Fill in “yaw” first.", 1)


def test_number_and_rate_of_repeated_messages_are_limited(bench) -> None:
    names = [f"/t{number}" for number in range(MAX_REPEATED_MESSAGES + 1)]
    bench.arm(*names)
    begun = [bench.outbox.start(order(name, id=name), 1e-9) for name in names]
    assert begun == [True] * MAX_REPEATED_MESSAGES + [False]
    assert {each.rate_hz for each in bench.outbox.repeated_messages} == {0.1}


def test_late_repetition_skips_missed_sends_without_a_burst(bench) -> None:
    heard = bench.node.new_sub("/cmd_vel", "json")
    bench.arm("/cmd_vel")
    bench.outbox.start(order(), 10)
    counts = []
    for passed_s in (0.0, 0.1, 0.45, 0.06):  # 0.2 s is late; 0.3 to 0.5 s are missed
        bench.advance(passed_s)
        assert heard.listen(timeout_s=20.0) == (True, {"x": 1})
        bench.advance(0.0)
        repeated = bench.outbox.repeated("a")
        counts.append((repeated.count, repeated.dropped_count))
    assert counts == [(1, 0), (2, 0), (3, 3), (4, 3)]
    bench.advance(0.08)
    assert heard.receive(0.1) is None
