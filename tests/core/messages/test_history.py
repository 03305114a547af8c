"""Tests of a topic's history.

It is bounded in messages and bytes, its message numbers are stable, and it stores undecoded copies.
"""

from __future__ import annotations

from app.core.messages.history import MessageHistory
from app.core.network.mailbox import Batch
from app.core.series.feed import SeriesFeed
from nep.messages.message import UNDECODED, Message


def message(number: int, size: int = 10) -> Message:
    return Message("/a", b'"%0*d"' % (size - 2, number), "json", "json", seq=number, stamp_ns=number)


def numbers(history: MessageHistory) -> list[int | None]:
    return [kept.seq for kept in history]


def test_oldest_messages_are_evicted_and_remaining_messages_keep_their_index() -> None:
    history = MessageHistory(max_messages=3)
    for number in range(5):
        history.add(message(number))
    assert (numbers(history), history.first, history.end, len(history)) == ([2, 3, 4], 2, 5, 3)
    assert [history.at(number) and history.at(number).seq for number in range(-1, 7)] == [  # type: ignore[union-attr]
        None, None, None, 2, 3, 4, None, None,
    ]  # fmt: skip
    assert [history.nearest(number) for number in (-5, 0, 3, 99)] == [2, 2, 3, 4]


def test_history_is_limited_in_bytes_but_keeps_newest_message_of_any_size() -> None:
    history = MessageHistory(max_bytes=100)
    for number in range(20):
        history.add(message(number, 30))
    assert (len(history), history.size_bytes) == (3, 90)
    history.add(message(99, 1000))
    assert (numbers(history), history.size_bytes) == ([99], 1000)
    history.add(message(100, 30))
    assert (numbers(history), history.size_bytes) == ([100], 30)


def test_history_copies_borrowed_bytes_and_keeps_messages_undecoded() -> None:
    history = MessageHistory()
    ground = bytearray(b'{"a": 1}')
    lent = Message("/a", memoryview(ground), "json", "json")
    assert lent.payload == {"a": 1}
    history.add(lent)
    ground[:] = b'{"a": 2}'
    again = history.at(0)
    assert again is not None
    assert again.payload == {"a": 1}
    assert [kept.decoded for kept in history] == [UNDECODED]


def test_latency_is_computed_once_on_arrival() -> None:
    history = MessageHistory()
    sent = message(1)
    history.add(sent)
    first, again = history.at(0), history.at(0)
    assert first is not None
    assert again is not None
    assert sent.latency_s is not None
    assert first.latency_s == again.latency_s == sent.latency_s


def test_dropped_messages_are_counted_and_reset_clears_history() -> None:
    history = MessageHistory()
    history.process(Batch([message(1), message(2)], dropped=7), 0)
    assert (numbers(history), history.dropped_count) == ([1, 2], 7)
    history.reset()
    assert (len(history), history.size_bytes, history.first, history.dropped_count, history.at(0)) == (
        0,
        0,
        0,
        0,
        None,
    )


class Watching:
    def __init__(self, log: list[str]) -> None:
        self.log = log

    def rest(self) -> None:
        """Nothing to do."""

    def wake(self) -> None:
        """Nothing to do."""

    def close(self) -> None:
        self.log.append("closed")


def test_only_lossless_history_requests_a_larger_queue() -> None:
    log: list[str] = []
    feed = SeriesFeed(
        lambda _topic: Watching(log), lambda: 0, lambda topic, room: log.append(f"{topic} {room}")
    )
    shallow, deep = MessageHistory(), MessageHistory()
    feed.register("/a", shallow, is_lossless=False)
    assert log == []
    feed.register("/a", deep)
    assert log == ["/a 8192"]
    feed.dispatch({"/a": Batch([message(1)])})
    assert numbers(shallow) == numbers(deep) == [1]
    feed.unregister("/a", deep)
    feed.unregister("/a", deep)
    assert log == ["/a 8192", "/a None"]
    feed.dispatch({"/a": Batch([message(2)])})
    assert (numbers(shallow), numbers(deep)) == ([1, 2], [1])
    feed.unregister("/a", shallow)
    assert log == ["/a 8192", "/a None", "closed"]
    assert feed.topics == ()
