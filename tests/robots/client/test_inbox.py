"""Tests of the bounded buffer for messages of unknown publishers; a flood evicts only its own messages."""

from __future__ import annotations

import nep
from app.robots.client.inbox import PendingMessages, ReplyInbox, Senders
from tests.robots.client.views import REPLY, view


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


def test_later_replies_of_a_publisher_wait_behind_its_held_ones() -> None:
    senders = Senders()
    inbox = ReplyInbox(senders)
    first, second = message(1, 1), message(1, 2)
    assert inbox.sender_of(first) is None
    senders.update(view({1: "own"}), [REPLY])
    assert inbox.sender_of(second) is None
    assert inbox.sender_of(nep.Message(REPLY, b"{}", "json", "robot/answer", publisher=2)) is None
    assert inbox.pop_listed() == [("own", first), ("own", second)]
    assert not inbox
    assert inbox.sender_of(message(1, 3)) == "own"


def test_messages_of_other_programs_count_only_on_topics_that_the_robot_does_not_publish() -> None:
    senders, graph = Senders(), view({1: "own", 2: "evil"})
    senders.update(graph, [REPLY])
    own, foreign, unlisted = message(1), message(2), message(3)
    assert [senders.is_own(graph, each, "own") for each in (own, foreign, unlisted)] == [True, False, None]
    assert senders.is_own(graph, foreign, "camera")
    assert senders.is_own(graph, foreign, None)
