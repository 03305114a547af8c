"""Tests of the bounded mailbox: the newest messages are kept, dropped ones are counted exactly."""

from __future__ import annotations

import threading

from app.core.network.mailbox import Mailbox
from nep.messages.message import Message


def message(topic: str, number: int, size: int = 10) -> Message:
    data = memoryview(bytes(size)).toreadonly()
    return Message(topic=topic, data=data, codec="bytes", msg_type="bytes", seq=number)


def test_drain_returns_batches_by_topic_in_order() -> None:
    mailbox = Mailbox()
    mailbox.post("a", [message("a", 1)])
    mailbox.post("b", [message("b", 1)])
    mailbox.post("a", [message("a", 2)])
    drained = mailbox.drain()
    assert [m.seq for m in drained["a"].messages] == [1, 2]
    assert [m.seq for m in drained["b"].messages] == [1]
    assert mailbox.drain() == {}


def test_full_queue_keeps_newest_messages_and_counts_dropped_ones() -> None:
    mailbox = Mailbox(messages_per_topic=3)
    mailbox.post("a", [message("a", number) for number in range(10)])
    batch = mailbox.drain()["a"]
    assert [m.seq for m in batch.messages] == [7, 8, 9]
    assert batch.dropped == 7
    assert batch.arrived_count == 10


def test_successive_batches_keep_newest_messages_and_exact_drop_count() -> None:
    mailbox = Mailbox(messages_per_topic=4)
    for first in range(0, 30, 3):
        mailbox.post("a", [message("a", number) for number in range(first, first + 3)])
    batch = mailbox.drain()["a"]
    assert [m.seq for m in batch.messages] == [26, 27, 28, 29]
    assert (batch.dropped, batch.arrived_count) == (26, 30)


def test_queue_is_limited_in_bytes_but_keeps_one_message_of_any_size() -> None:
    mailbox = Mailbox(bytes_per_topic=100)
    mailbox.post("a", [message("a", 1, 60), message("a", 2, 60), message("a", 3, 500)])
    batch = mailbox.drain()["a"]
    assert [m.seq for m in batch.messages] == [3]
    assert batch.dropped == 2


def test_events_keep_their_order_and_an_overflow_is_counted() -> None:
    mailbox = Mailbox(max_events=2)
    for event in ("one", "two", "three"):
        mailbox.post_event(event)
    assert mailbox.drain_events() == (["one", "two"], 1)
    assert mailbox.drain_events() == ([], 0)


def test_every_message_is_counted_with_many_threads() -> None:
    mailbox = Mailbox(messages_per_topic=50)
    threads = [
        threading.Thread(target=lambda: [mailbox.post("a", [message("a", n)]) for n in range(2000)])
        for _ in range(4)
    ]
    arrived = 0
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        batch = mailbox.drain().get("a")
        arrived += batch.arrived_count if batch else 0
    for thread in threads:
        thread.join()
    batch = mailbox.drain().get("a")
    arrived += batch.arrived_count if batch else 0
    assert arrived == 8000


def test_topic_can_temporarily_have_a_larger_queue() -> None:
    mailbox = Mailbox(messages_per_topic=4)
    messages = [Message("/a", b"1", "json", "json", seq=n) for n in range(10)]
    mailbox.set_capacity("/a", 8)
    mailbox.post("/a", messages)
    mailbox.post("/b", messages)
    drained = mailbox.drain()
    assert [(len(each.messages), each.dropped) for each in drained.values()] == [(8, 2), (4, 6)]
    mailbox.set_capacity("/a", None)
    mailbox.post("/a", messages)
    assert len(mailbox.drain()["/a"].messages) == 4
