"""Tests of the rate limit: it keeps the newest message and counts replaced ones separately from lost ones."""

from __future__ import annotations

import itertools
import threading
import time

import pytest

from nep.programs.bridges.pacer import Pacer, RateLimit
from tests.nep.bridges.joined import bridged, nets, route, settled, silent, taken, topic
from tests.nep.programs import eventually

THREE = [("memory", "zeromq"), ("zeromq", "zenoh"), ("nanomsg", "memory")]


@pytest.mark.parametrize("pair", THREE, ids="-".join)
def test_rate_limit_forwards_first_and_newest_message_of_a_burst(pair):
    with nets(*pair) as (a, b), bridged(a, b, topic("/t", max_rate_hz=0.5)) as bridge:
        sub, pub = b.node("b").new_sub("/t"), a.node("a").new_pub("/t")
        started = time.monotonic()
        for number in range(100):
            pub.publish(number)
        counts = settled(route(bridge, "a", "/t"), 100)
        assert (counts.received, counts.sent, counts.thinned, counts.lost) == (100, 2, 98, 0)
        assert time.monotonic() - started >= 1.7
        assert taken(sub, 2) == [0, 99]
        assert silent(sub)


def test_every_message_of_a_rate_limited_topic_is_sent_or_counted_as_replaced():
    with nets("memory", "memory") as (a, b), bridged(a, b, topic("/t", max_rate_hz=1e6)) as bridge:
        sub, pub, never = b.node("b").new_sub("/t"), a.node("a").new_pub("/t"), threading.Event()
        for number in range(50):
            pub.publish(number)
            never.wait(0.006)  # the memory back end delivers 200 times a second
        counts = settled(route(bridge, "a", "/t"), 50)
        assert counts.sent + counts.thinned == 50
        assert taken(sub, 1) == [0]


def test_each_direction_and_topic_has_its_own_rate_limit():
    with (
        nets("memory", "memory") as (a, b),
        bridged(a, b, topic("/slow", max_rate_hz=0.001), topic("/free")) as bridge,
    ):
        on_a, on_b = a.node("a"), b.node("b")
        free = on_b.new_sub("/free")
        for pub in (on_a.new_pub("/slow"), on_b.new_pub("/slow"), on_a.new_pub("/free")):
            for number in range(20):
                pub.publish(number)
        assert taken(free, 20) == list(range(20))
        for side in ("a", "b"):
            found = route(bridge, side, "/slow")
            eventually(lambda found=found: found.counts().received == 20 and found.counts().sent)
            counts = found.counts()
            assert (counts.sent, counts.thinned, counts.waiting) == (1, 18, 1)


def test_message_held_by_the_rate_limit_is_sent_on_close():
    with nets("memory", "zeromq") as (a, b):
        sub, pub = b.node("b").new_sub("/t"), a.node("a").new_pub("/t")
        with bridged(a, b, topic("/t", max_rate_hz=0.001)) as bridge:
            for number in range(10):
                pub.publish(number)
            found = route(bridge, "a", "/t")
            eventually(lambda: found.counts().received == 10 and found.counts().sent)
        assert taken(sub, 2) == [0, 9]
        counts = found.counts()
        assert (counts.sent, counts.thinned, counts.waiting) == (2, 8, 0)


def test_latched_message_stays_latched_under_a_rate_limit():
    with nets("memory", "memory") as (a, b), bridged(a, b, topic("/t", max_rate_hz=2)) as bridge:
        pub = a.node("a").new_pub("/t", latched=True)
        for number in range(10):
            pub.publish(number)
        settled(route(bridge, "a", "/t"), 10)
        assert b.node("late").new_sub("/t").receive(30.0).payload == 9


# ---- rate limit and pacer, unit tests


def test_rate_limit_passes_the_configured_rate():
    limit = RateLimit(10.0)
    passed = [now / 1000 for now in range(10_000) if limit.try_acquire(now / 1000)]
    assert 100 <= len(passed) <= 101
    assert min(later - earlier for earlier, later in itertools.pairwise(passed)) > 0.089


def test_rate_limit_does_not_accumulate_unused_capacity():
    limit = RateLimit(10.0)
    assert limit.try_acquire(0.0)
    assert [limit.try_acquire(100.0 + n / 1000) for n in range(5)] == [True, False, False, False, False]
    assert limit.next_at == pytest.approx(100.09)


def test_pacer_calls_in_time_order_and_stops_when_closed():
    pacer, called, done = Pacer("test-pace"), [], threading.Event()
    now = time.monotonic()
    pacer.call_at(now + 3600.0, lambda: called.append("never"))
    pacer.call_at(now + 0.2, done.set)
    pacer.call_at(now + 0.1, lambda: called.append("second"))
    pacer.call_at(now - 1.0, lambda: called.append("first"))
    assert done.wait(30.0)
    assert called == ["first", "second"]
    pacer.close()
    pacer.call_at(now, lambda: called.append("never"))
    pacer.close()
    assert called == ["first", "second"]
