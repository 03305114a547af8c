"""Tests of service calls by hand with nodes in memory: replies, durations and all failures."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

import nep
from app.core.run.acting.arming import Arming, Target
from app.core.run.acting.calling import MAX_RECORDS, MAX_REPLIES, CallRecord, ServiceCalls
from nep.errors import NepError
from nep.nodes.node import Node
from tests.nep.programs import eventually


class Bench:
    """Service calls whose jobs run on a node in memory, immediately or when the test runs them."""

    def __init__(self, node: Node) -> None:
        self.node, self.now = node, 0.0
        self.waiting: list[object] | None = None
        self.arming = Arming(lambda: self.now)
        self.arming.arm()
        self.arming.allow(Target("service", "/sum"))
        self.calls = ServiceCalls(self.arming, self._submit, lambda: self.now, lambda: 1000.0 + self.now)

    def _submit(self, _what: str, job) -> None:
        if self.waiting is None:
            job(self.node)
        else:
            self.waiting.append(job)

    def call(self, request: object = None, timeout_s: float = 20.0) -> None:
        self.calls.call("/sum", request, "{}", timeout_s)

    def end(self) -> CallRecord:
        """Wait until the call has ended and return its record."""
        ended: list[CallRecord] = []
        eventually(lambda: bool(ended.extend(self.calls.tick()) or ended))
        return ended[-1]


@pytest.fixture
def bench(request) -> Iterator[Bench]:
    with nep.node("studio", "memory", master=request.node.name) as node:
        made = Bench(node)
        yield made
        made.calls.close()


def test_reply_is_recorded_with_duration_and_json(bench) -> None:
    bench.node.new_server("/sum", lambda asked: {"sum": asked["a"] + 1, "raw": [1.5]}, threads=1)
    bench.call({"a": 2})
    waiting = bench.calls.in_flight
    assert waiting is not None
    record = bench.end()
    assert (record.state, record.reply) == ("answered", {"sum": 3, "raw": [1.5]})
    assert record.duration_s > 0
    assert record.text == '{\n  "sum": 3,\n  "raw": [\n    1.5\n  ]\n}'
    assert bench.calls.in_flight is None


def test_server_exception_is_recorded_as_failed_call_with_its_text(bench) -> None:
    def refuse(_asked: object) -> object:
        raise ValueError("no face in sight")

    bench.node.new_server("/sum", refuse, threads=1)
    bench.call()
    record = bench.end()
    assert (record.state, record.error) == ("failed", "rejected: no face in sight")


def test_call_without_server_fails(bench) -> None:
    bench.call(timeout_s=0.1)
    assert bench.end().error == "no server"


def test_call_times_out_and_can_be_canceled(bench) -> None:
    go_on = threading.Event()
    bench.node.new_server("/sum", lambda _asked: go_on.wait(30), threads=2)
    bench.call(timeout_s=0.2)
    assert bench.end().error == "no reply within 0.2 s"
    bench.call()
    with pytest.raises(NepError, match="Wait for the reply of /sum first"):
        bench.call()
    bench.now += 3
    assert bench.calls.elapsed_s == 3
    bench.calls.cancel()
    last = bench.calls.records[-1]
    assert (last.state, last.duration_s) == ("canceled", 3)
    assert bench.calls.in_flight is None
    go_on.set()


def test_call_is_not_sent_when_disarmed(bench) -> None:
    asked: list[object] = []
    bench.node.new_server("/sum", asked.append, threads=1)
    bench.arming.disarm()
    bench.call()
    assert bench.end().error == "not called: no longer armed"
    assert asked == []


def test_call_without_master_times_out_and_is_not_sent_later(bench) -> None:
    asked: list[object] = []
    bench.node.new_server("/sum", asked.append, threads=1)
    bench.waiting = []
    bench.call(timeout_s=2.0)
    assert bench.calls.tick() == []
    bench.now += 2.1
    (record,) = bench.calls.tick()
    assert record.error == "no master was found within 2 s"
    (job,) = bench.waiting
    job(bench.node)
    assert bench.calls.tick() == []
    assert asked == []


def test_unencodable_request_fails_with_reason(bench) -> None:
    bench.call({"a": object()})
    record = bench.end()
    assert record.state == "failed"
    assert record.error


def test_call_history_and_stored_replies_are_bounded(bench) -> None:
    bench.node.new_server("/sum", lambda _asked: {"a": 1}, threads=1)
    bench.call()
    first = bench.end()
    bench.arming.disarm()
    for _each in range(MAX_RECORDS + 5):
        bench.call()
        bench.calls.tick()
    records = bench.calls.records
    assert len(records) == MAX_RECORDS
    assert first.number not in {each.number for each in records}
    assert sum(each.is_retained for each in records) == MAX_REPLIES
    bench.calls.clear()
    assert list(bench.calls.records) == []
