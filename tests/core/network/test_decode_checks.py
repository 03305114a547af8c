"""Tests of checking whether messages can be decoded: exact within a time budget, else marked as partial."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest

from app.core.network import decode_checks as module
from app.core.network.decode_checks import DecodeChecker
from nep.errors import NepError
from nep.messages.message import Message

BAD, GOOD = b"{not json", b'{"n": 1}'


def messages(*data: bytes, codec: str = "json") -> list[Message]:
    return [Message("/a", each, codec, codec, seq=n) for n, each in enumerate(data)]


class Clock:
    """Fake clock that advances by `step_s` each time it is read."""

    def __init__(self, step_s: float = 0.0) -> None:
        self.now, self.step_s = 100.0, step_s

    def __call__(self) -> float:
        self.now += self.step_s
        return self.now


def test_every_message_is_checked_and_newest_error_is_reported() -> None:
    checks = DecodeChecker(Clock())
    checks.check("/a", messages(BAD, GOOD, BAD))
    checks.check("/a", messages(GOOD))
    checks.check("/b", messages(GOOD))
    found = checks.pop_results()
    assert (found["/a"].checked_count, found["/a"].bad_count, found["/a"].unchecked_count) == (4, 2, 0)
    assert "json" in found["/a"].error
    assert found["/a"].is_newest_readable
    assert (found["/b"].checked_count, found["/b"].bad_count, found["/b"].error) == (1, 0, "")
    assert checks.pop_results() == {}


def test_20_000_malformed_messages_are_counted_as_bad_or_unchecked() -> None:
    began = time.thread_time()
    for message in (some := messages(*[BAD] * 5000)):
        with pytest.raises(NepError):
            _ = message.payload
    each_s = (time.thread_time() - began) / len(some)
    checks = DecodeChecker()  # real clocks, because the limit is on real processor time
    for _ in range(10):
        checks.check("/a", messages(*[BAD] * 2000))
    found = checks.pop_results()["/a"]
    assert found.bad_count + found.unchecked_count == 20_000
    assert not found.is_newest_readable
    # A slow machine may leave some unchecked, but only after using a good part of the time budget.
    assert found.unchecked_count == 0 or found.checked_count * each_s > 0.3 * module.MAX_BUDGET_S


def test_healthy_topic_leaves_reserve_time_to_failing_topics() -> None:
    clock = Clock(step_s=0.01)
    checks = DecodeChecker(clock, clock)
    checks.check("/a", messages(*[GOOD] * 500))
    well = checks.pop_results()["/a"]
    assert 0 < well.checked_count < 60
    assert well.checked_count + well.unchecked_count == 500
    checks.check("/b", messages(*[BAD] * 500))
    bad = checks.pop_results()["/b"]
    assert bad.bad_count == bad.checked_count > 40
    checks.check("/b", messages(*[BAD] * 500))
    assert checks.pop_results()["/b"].checked_count < 10  # budget spent; the newest is always checked
    clock.now += 10.0
    checks.check("/b", messages(*[BAD] * 500))
    assert checks.pop_results()["/b"].checked_count > 40


def test_malformed_message_allows_remaining_batch_to_use_reserve_time() -> None:
    checks = DecodeChecker(cpu_clock=Clock(step_s=0.01))
    checks.check("/a", messages(BAD, *[GOOD] * 200))
    found = checks.pop_results()["/a"]
    assert found.bad_count == 1
    assert found.checked_count > module.RESERVED_BUDGET_S / 0.01


class Reads(Clock):
    """Fake clock that counts how often it is read."""

    count = 0

    def __call__(self) -> float:
        self.count += 1
        return super().__call__()


def test_cpu_clock_is_not_read_for_every_message() -> None:
    clock = Reads(step_s=1e-6)
    checks = DecodeChecker(Clock(), clock)
    checks.check("/a", messages(*[GOOD] * 5000, BAD, *[GOOD] * 5000))
    found = checks.pop_results()["/a"]
    assert (found.checked_count, found.bad_count, found.unchecked_count) == (10_001, 1, 0)
    assert clock.count < 100


def test_cpu_clock_is_read_after_each_large_message() -> None:
    clock = Reads(step_s=1e-6)
    checks = DecodeChecker(Clock(), clock)
    checks.check("/a", messages(*[GOOD] * 1000, *[b" " * 64_000 + GOOD] * 200))
    assert checks.pop_results()["/a"].checked_count == 1200
    assert clock.count > 190


def test_clock_that_jumps_back_does_not_reduce_checks() -> None:
    clock = Clock()
    checks = DecodeChecker(clock, clock)
    clock.now -= 50.0
    checks.check("/a", messages(BAD, BAD))
    assert checks.pop_results()["/a"].bad_count == 2


@pytest.mark.parametrize("codec", ["bytes", "image"])
def test_bytes_images_and_empty_batches_are_not_checked(codec: str) -> None:
    checks = DecodeChecker()
    checks.check("/a", messages(BAD, codec=codec))
    checks.check("/b", [])
    assert checks.pop_results() == {}


def test_large_message_is_not_checked() -> None:
    large = messages(b"[" * (module.LARGE_BYTES + 1))
    checks = DecodeChecker()
    checks.check("/a", large)
    assert checks.pop_results()["/a"].bad_count == 0


def test_counts_are_exact_across_threads() -> None:
    checks = DecodeChecker()
    done = threading.Event()
    counted = 0

    def looks(topic: str) -> Callable[[], None]:
        def run() -> None:
            for _ in range(300):
                checks.check(topic, messages(BAD, GOOD))

        return run

    threads = [threading.Thread(target=looks(topic)) for topic in ("/a", "/b")]
    for thread in threads:
        thread.start()
    while not done.is_set():
        if not any(thread.is_alive() for thread in threads):
            done.set()
        counted += sum(found.checked_count + found.unchecked_count for found in checks.pop_results().values())
    for thread in threads:
        thread.join()
    assert counted == 2 * 300 * 2


def test_topic_without_recent_errors_loses_reserve_time() -> None:
    clock = Clock()
    checks = DecodeChecker(clock, Clock(step_s=0.01))
    checks.check("/a", messages(BAD))
    clock.now += module.SUSPECT_TIMEOUT_S - 1
    checks.check("/a", messages(*[GOOD] * 500))
    suspect = checks.pop_results()["/a"].checked_count
    clock.now += module.SUSPECT_TIMEOUT_S + 20
    checks.check("/a", messages(*[GOOD] * 500))
    assert checks.pop_results()["/a"].checked_count < suspect - module.RESERVED_BUDGET_S / 0.01 / 2
