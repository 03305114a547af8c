"""Tests of malformed and very fast streams on a real network: no blocking, bounded memory, exact counts."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import nep
from app.core.network.mailbox import MAX_MESSAGES_PER_TOPIC
from app.core.session import Session
from nep.masters.master import Master
from nep.nodes.log_handler import LAST_ERRORS_TOPIC, LOG_TOPIC
from tests.core.waiting import tick_until
from tests.e2e.waiting import until

BAD, GOOD = b'{"joints": [1, 2, 3', b'{"joints": [1, 2]}'


@pytest.fixture
def talker(master: Master) -> Iterator[nep.Node]:
    with nep.node("talker") as node:
        yield node


def publisher_of(session: Session, talker: nep.Node, topic: str, kind: str = "json") -> nep.Publisher:
    publisher = talker.new_pub(topic, kind)
    tick_until(session, lambda: publisher.subscribers == 1)
    return publisher


def bad_count(session: Session, topic: str) -> int:
    return next((alert.count for alert in session.alerts.active if alert.id == f"message:{topic}"), 0)


def test_malformed_messages_at_1000_hz_are_one_alert_with_exact_count(
    session: Session, talker: nep.Node
) -> None:
    with session.live.watch("/bad"):
        publisher = publisher_of(session, talker, "/bad")
        pause, began = threading.Event(), time.perf_counter()
        for number in range(1500):
            while time.perf_counter() < began + number / 1000:
                pause.wait(0.002)
                session.tick()
            publisher.publish_bytes(BAD)
        tick_until(session, lambda: bad_count(session, "/bad") >= 1500)
        (alert,) = session.alerts.active
        assert alert.count == 1500
        assert "1500 messages on /bad" in alert.title
        publisher.publish({"good": True})
        tick_until(session, lambda: not session.alerts.active)


def test_malformed_count_is_exact_after_window_was_busy(session: Session, talker: nep.Node) -> None:
    with session.live.watch("/bad"):
        publisher = publisher_of(session, talker, "/bad")
        sent = 10 * MAX_MESSAGES_PER_TOPIC
        for _ in range(sent):
            publisher.publish_bytes(BAD)
        tried = session.live._decode_checker._results
        until(
            lambda: "/bad" in tried and tried["/bad"].checked_count == sent, "all arrive while nobody ticks"
        )
        tick_until(session, lambda: session.live.topics["/bad"].received == sent)
        assert bad_count(session, "/bad") == sent
        assert f"{sent} messages on /bad" in session.alerts.active[0].title
        assert session.live.topics["/bad"].displayed_and_sent_counts == (
            MAX_MESSAGES_PER_TOPIC,
            sent,
        )  # although the ring buffer was full


def ticking_s(session: Session, publisher: nep.Publisher, data: bytes, sent: int) -> float:
    """Return the CPU time in seconds that the window's ticks take while `sent` messages are published."""
    worked = 0.0
    for number in range(sent):
        publisher.publish_bytes(data)
        if number % 2000 == 0:
            began = time.thread_time()
            session.tick()
            worked += time.thread_time() - began
    return worked


def test_30_000_malformed_messages_are_all_counted(session: Session, talker: nep.Node) -> None:
    sent = 30_000
    with session.live.watch("/good"):
        good_s = ticking_s(session, publisher_of(session, talker, "/good"), GOOD, sent)
    with session.live.watch("/bad"):
        publisher = publisher_of(session, talker, "/bad")
        bad_s = ticking_s(session, publisher, BAD, sent)
        publisher.publish_bytes(BAD)
        topic = session.live.topics["/bad"]

        def all_told() -> bool:
            publisher.publish_bytes(BAD)  # a loss is detected by the next message that arrives
            session.traffic.count_lost(session.live.source.lost_counts(), time.monotonic())
            return topic.received + topic.missed >= sent

        tick_until(session, all_told)
        tick_until(session, lambda: topic.received + topic.missed == publisher.count)
        (alert,) = session.alerts.active
        health = session._health._bad_topics["/bad"]
        assert alert.count == health.count
        assert health.count + health.unchecked_count == topic.received
        assert bad_s < 3 * good_s  # malformed messages hardly slow down a tick


def test_topic_can_change_its_type(session: Session, talker: nep.Node) -> None:
    with session.live.watch("/thing"):
        first = publisher_of(session, talker, "/thing", "json")
        first.publish({"n": 1})
        tick_until(session, lambda: session.live.topics["/thing"].newest is not None)
        first.close()
        second = talker.new_pub("/thing", "string")
        tick_until(session, lambda: second.subscribers == 1)
        second.publish("hello")

        def newest() -> object:
            message = session.live.topics["/thing"].newest
            return message is not None and message.codec == "string" and message.payload == "hello"

        tick_until(session, newest)
        tick_until(session, lambda: session.live.topics["/thing"].msg_type == "string")
        tick_until(session, lambda: not session.alerts.active)


def test_messages_of_50_mb_are_received_or_counted_as_lost(session: Session, talker: nep.Node) -> None:
    with session.live.watch("/huge"):
        publisher = publisher_of(session, talker, "/huge", "bytes")
        data = bytes(50_000_000)
        for _ in range(3):
            publisher.publish_bytes(data)

        def arrived() -> bool:
            session.traffic.count_lost(session.live.source.lost_counts(), time.monotonic())
            topic = session.live.topics.get("/huge")
            return topic is not None and topic.received + topic.missed == 3

        tick_until(session, arrived)
        newest = session.live.topics["/huge"].newest
        assert newest is not None
        assert newest.size_bytes == len(data)


def test_publisher_can_restart_30_times(session: Session, master: Master) -> None:
    threads = threading.active_count()
    with session.live.watch("/phoenix"):
        sent = 0
        for life in range(30):
            node = nep.node("phoenix", master=master.address)
            publisher = node.new_pub("/phoenix", "json")
            publisher.publish({"life": life})
            sent += publisher.count
            node.close()
            session.tick()
        with nep.node("phoenix", master=master.address) as node:
            publisher = node.new_pub("/phoenix", "json")
            tick_until(session, lambda: publisher.subscribers == 1)
            publisher.publish({"life": "last"})
            tick_until(session, lambda: _last_life(session) == "last")
            tick_until(session, lambda: session.live.topics["/phoenix"].publisher_nodes == ("phoenix",))
        assert session.live.source._subscribers.keys() <= {"/phoenix", LOG_TOPIC, LAST_ERRORS_TOPIC}
        tick_until(session, lambda: len(session.live.nodes) < 20)
    tick_until(session, lambda: threading.active_count() <= threads + 2)
    tick_until(
        session, lambda: not session.alerts.active
    )  # a new life may overlap with the lease of the last


def _last_life(session: Session) -> object:
    topic = session.live.topics.get("/phoenix")
    payload = topic.newest.payload if topic is not None and topic.newest is not None else None
    return payload.get("life") if isinstance(payload, dict) else None


FLOOD = """
import nep
with nep.node("flood") as node:
    publisher = node.new_pub("/flood", "json")
    print("ready", flush=True)
    while True:
        for _ in range(1000):
            publisher.publish_bytes(b'{"n": 1}')
"""


def test_session_closes_during_a_message_flood(session: Session, master: Master) -> None:
    flood = subprocess.Popen(
        [sys.executable, "-c", FLOOD],
        stdout=subprocess.PIPE,
        env={**os.environ, "NEP_MASTER": master.address, "PYTHONPATH": str(Path(__file__).parents[3])},
    )
    try:
        assert flood.stdout is not None
        assert flood.stdout.readline().strip() == b"ready"
        session.live.watch("/flood")
        tick_until(
            session,
            lambda: "/flood" in session.live.topics and session.live.topics["/flood"].dropped > 1000,
        )
        session.close()
        assert flood.poll() is None  # the publisher was still running
    finally:
        flood.kill()
        flood.communicate()
