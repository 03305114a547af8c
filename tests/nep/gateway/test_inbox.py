from __future__ import annotations

import select
import threading

import pytest

from nep.messages.message import Message
from nep.programs.gateway.inbox import NativeInbox


@pytest.fixture
def inbox():
    made = NativeInbox(max_messages=3, max_bytes=100)
    yield made
    made.close()


def message(data=b"1"):
    return Message("t", data, "json", "json")


def test_posted_messages_are_returned_in_order_and_wake_the_reader(inbox):
    assert not select.select([inbox], [], [], 0)[0]
    first, second = message(), message()
    poster = threading.Thread(target=lambda: (inbox.post(first), inbox.post(second)))
    poster.start()
    assert select.select([inbox], [], [], 60)[0]
    poster.join()
    assert inbox.pop_all() == [first, second]
    assert not select.select([inbox], [], [], 0)[0]
    assert inbox.pop_all() == []


def test_inbox_is_bounded_in_messages_and_bytes_and_counts_drops(inbox):
    for _ in range(5):
        inbox.post(message())
    assert (len(inbox.pop_all()), inbox.dropped) == (3, 2)
    inbox.post(message(b"x" * 90))
    inbox.post(message(b"x" * 20))
    assert (len(inbox.pop_all()), inbox.dropped) == (1, 3)
    inbox.post(message(b"x" * 90))
    assert len(inbox.pop_all()) == 1


def test_wake_after_close_is_harmless(inbox):
    inbox.close()
    inbox.wake()
