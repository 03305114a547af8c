"""Tests of the bounded buffer for messages of unknown publishers; a flood evicts only its own messages."""

from __future__ import annotations

import nep
from app.robots.message_buffer import PendingMessages


def message(publisher: int, seq: int = 1) -> nep.Message:
    return nep.Message("/Pepper/answer", b"{}", "json", "robot/answer", publisher=publisher, seq=seq)


def test_full_queue_of_a_publisher_evicts_only_messages_of_that_publisher() -> None:
    held = PendingMessages(per_publisher=2)
    held.add(message(1))
    for seq in range(1000):
        held.add(message(2, seq))
    assert [(each.publisher, each.seq) for each in held.pop_all()] == [(1, 1), (2, 998), (2, 999)]
    assert not held


def test_publishers_beyond_the_limit_do_not_evict_earlier_publishers() -> None:
    held = PendingMessages(publishers=8)
    for publisher in range(1000):
        held.add(message(publisher))
    assert [each.publisher for each in held.pop_all()] == list(range(8))
    held.add(message(1000))
    assert held.has_messages_of(1000)
