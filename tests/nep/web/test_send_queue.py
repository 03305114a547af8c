"""Tests of a page's send queue: bounded, oldest messages dropped first, round-robin topics, throttled."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from nep.messages.message import Message
from nep.programs.web.limits import MAX_CONTROL_BYTES
from nep.programs.web.messages.operations import Subscribe
from nep.programs.web.outgoing import Frame
from nep.programs.web.send_queue import Feed, QueuedMessage, SendQueue


def message(number: int, *, size: int = 1) -> Message:
    return Message("/t", b"1" * size, "json", "json", seq=number)


def feed(**wishes: object) -> Feed:
    made = Feed("/t")
    made.subscribe(replace(Subscribe("s", "/t"), **wishes), as_pixels=False)
    return made


def numbers(source: Feed) -> list[int | None]:
    return [source.pop(0.0).seq for _left in range(len(source))]


def test_oldest_messages_of_a_slow_page_are_dropped() -> None:
    slow = feed(queue_length=3)
    for number in range(10):
        slow.add(message(number))
    assert slow.dropped_count == 7
    assert numbers(slow) == [7, 8, 9]


def test_image_topic_has_a_short_queue_unless_the_page_requests_another_length() -> None:
    for queue_length, kept in ((0, [6, 7, 8, 9]), (6, [4, 5, 6, 7, 8, 9])):
        camera = Feed("/camera", "image")
        camera.subscribe(Subscribe("s", "/camera", queue_length=queue_length), as_pixels=False)
        for number in range(10):
            camera.add(message(number))
        assert numbers(camera) == kept


def test_throttled_subscription_keeps_the_newest_message() -> None:
    slow = feed(throttle_s=0.5)
    for number in range(10):
        slow.add(message(number))
    assert (slow.dropped_count, slow.throttled_count) == (0, 9)
    assert slow.pop(100.0).seq == 9
    assert slow.next_at == 100.5


def test_subscriptions_of_a_page_to_one_topic_are_combined() -> None:
    both = feed(throttle_s=0.5, queue_length=2, fragment_size=900, compression="png")
    both.subscribe(Subscribe("t", "/t", "", 0.1, 5, 300, "cbor"), as_pixels=False)
    assert (both.options.compression, both.options.fragment_size) == ("cbor", 300)
    for number in range(10):
        both.add(message(number))
    assert len(both) == 5
    assert both.pop(1.0) is not None
    assert both.next_at == pytest.approx(1.1)
    assert both.unsubscribe("t")
    assert not both.unsubscribe("t")
    assert both.options.compression == "png"
    assert both.unsubscribe(None)
    assert both.subscription_count == 0


def test_queued_bytes_of_a_page_are_bounded() -> None:
    async def fill() -> None:
        waiting, first, second = SendQueue(lambda: 0.0, max_bytes=1_000), feed(), feed()
        for number in range(20):
            waiting.add(first, message(number, size=100))
        assert (first.size_bytes, first.dropped_count) == (1_000, 10)
        waiting.add(second, message(0, size=600))
        assert (first.size_bytes, second.size_bytes) == (400, 600)
        waiting.add(second, message(0, size=5_000))
        assert first.size_bytes + second.size_bytes <= 1_000
        waiting.remove(first)
        waiting.add(second, message(0, size=5_000))  # a single message above the limit is sent
        assert len(second) == 1

    asyncio.run(fill())


def test_topics_are_sent_round_robin_after_other_operations() -> None:
    async def drain() -> list[object]:
        waiting, busy, quiet = SendQueue(lambda: 0.0), feed(), feed()
        for number in range(3):
            waiting.add(busy, message(number))
        waiting.add(quiet, message(9))
        waiting.put([Frame(b"status", is_text=True)])
        taken = [await waiting.pop() for _left in range(5)]
        return [each.message.seq if isinstance(each, QueuedMessage) else each.data for each in taken]

    assert asyncio.run(drain()) == [b"status", 0, 9, 1, 2]


def test_page_that_does_not_read_replies_is_disconnected_once() -> None:
    async def fill() -> int:
        ended: list[bool] = []
        waiting = SendQueue(lambda: 0.0, lambda: ended.append(True))
        for _number in range(40):
            waiting.put([Frame(b"x" * 2**20, is_text=True)])
        assert waiting._frames_bytes <= MAX_CONTROL_BYTES + 2**20
        return len(ended)

    assert asyncio.run(fill()) == 1


def test_throttled_message_is_sent_after_its_interval() -> None:
    async def wait() -> float:
        loop = asyncio.get_running_loop()
        waiting, slow = SendQueue(loop.time), feed(throttle_s=0.05)
        waiting.add(slow, message(1))
        await waiting.pop()
        began = loop.time()
        waiting.add(slow, message(2))
        await waiting.pop()
        return loop.time() - began

    assert asyncio.run(wait()) >= 0.03
