"""What waits for a page: messages of topics, which can be dropped, and the rest, which can't.

A `Feed` has the messages of one topic, within the wishes of the page's subscriptions. An `SendQueue` has all
feeds of a page and takes turns between them, so that a topic with many messages does not hold up the others.
Used in the event loop's thread only.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from nep.messages.codecs import codec_for
from nep.messages.message import Message
from nep.programs.web.limits import MAX_CONTROL_BYTES, MAX_QUEUED_BYTES, MAX_QUEUED_MESSAGES
from nep.programs.web.messages.operations import COMPRESSIONS, OperationId, Subscribe
from nep.programs.web.outgoing import EncodingOptions, Frame
from nep.programs.web.rates import RateMeter

__all__ = ["Feed", "Queued", "SendQueue"]

_MAX_QUEUED_IMAGES = 4
"""Images of a topic that wait for a page which doesn't say how many: of older ones it would show the past."""
_MAX_LATCHED_BYTES = MAX_QUEUED_BYTES // 4
"""Latched messages of a topic that are kept for further subscriptions of a page."""


class Queued(NamedTuple):
    """A message and its feed."""

    feed: Feed
    message: Message


class Feed:
    """Messages of one topic on their way to a page, the oldest of which are dropped when it is slow.

    Several subscriptions of the page are served as one: with the shortest throttle time, the longest queue
    and the smallest fragments.
    """

    def __init__(self, topic: str, msg_type: str = "", clock: Callable[[], float] = time.monotonic) -> None:
        self.topic = topic
        is_image = bool(msg_type) and codec_for(msg_type).name == "image"
        self._default_capacity = _MAX_QUEUED_IMAGES if is_image else MAX_QUEUED_MESSAGES
        self.sent = RateMeter(clock)
        self.form = EncodingOptions()
        self.dropped_count = 0
        """Messages that the page was too slow for, since it was told so last."""
        self.total_dropped_count = 0
        self.throttled_count = 0
        """Messages that were left out because the page asked for fewer."""
        self.size_bytes = 0
        self._wishes: dict[OperationId, Subscribe] = {}
        self._throttle_s = 0.0
        self._capacity = self._default_capacity
        self._messages: deque[Message] = deque()
        self._latched: dict[int | None, Message] = {}
        self._next_at = 0.0

    def __len__(self) -> int:
        return len(self._messages)

    @property
    def subscription_count(self) -> int:
        """How many subscriptions of the page it serves."""
        return len(self._wishes)

    def subscribe(self, wish: Subscribe, *, as_pixels: bool) -> None:
        """Add or replace a subscription; a further one gets what is latched, which the first one had."""
        if self._wishes and wish.id not in self._wishes:
            for each in tuple(self._latched.values()):
                self.add(each)
        self._wishes[wish.id] = wish
        self._combine(as_pixels=as_pixels)

    def unsubscribe(self, id_: OperationId) -> bool:
        """End the subscription with this id, all without one; whether there was one."""
        found = bool(self._wishes) if id_ is None else id_ in self._wishes
        if id_ is None:
            self._wishes.clear()
        else:
            self._wishes.pop(id_, None)
        if self._wishes:
            self._combine(as_pixels=self.form.as_pixels)
        return found

    def _combine(self, *, as_pixels: bool) -> None:
        wishes = self._wishes.values()
        sizes = [each.fragment_size for each in wishes if each.fragment_size is not None]
        compression = max((each.compression for each in wishes), key=COMPRESSIONS.index)
        self.form = EncodingOptions(compression, min(sizes, default=None), as_pixels)
        self._throttle_s = min(each.throttle_s for each in wishes)
        longest = max(each.queue_length for each in wishes)
        self._capacity = longest or (1 if self._throttle_s else self._default_capacity)

    def add(self, message: Message) -> None:
        """Append a message; drop the oldest beyond the queue's length."""
        if message.is_latched:
            self._keep_latched(message)
        self._messages.append(message)
        self.size_bytes += message.size_bytes
        while len(self._messages) > self._capacity:
            self.drop_oldest()

    def _keep_latched(self, message: Message) -> None:
        self._latched.pop(message.publisher, None)
        self._latched[message.publisher] = message
        while sum(each.size_bytes for each in self._latched.values()) > _MAX_LATCHED_BYTES:
            del self._latched[next(iter(self._latched))]

    def drop_oldest(self) -> None:
        """Drop one message, and count it."""
        self.size_bytes -= self._messages.popleft().size_bytes
        if self._throttle_s:
            self.throttled_count += 1
        else:
            self.dropped_count += 1
            self.total_dropped_count += 1

    @property
    def at_most_per_s(self) -> float | None:
        """Messages per second that the page asked for at most; None without a limit."""
        return 1 / self._throttle_s if self._throttle_s else None

    @property
    def next_at(self) -> float:
        """When the next message may be taken, by the clock of `take`."""
        return self._next_at

    def pop(self, now: float) -> Message:
        """Return the oldest message."""
        message = self._messages.popleft()
        self.size_bytes -= message.size_bytes
        self._next_at = now + self._throttle_s
        return message

    def clear(self) -> None:
        """Forget what waits: nobody wants it any more."""
        self._messages.clear()
        self._latched.clear()
        self.size_bytes = 0


class SendQueue:
    """Everything that waits for one page.

    `clock` is the event loop's. Messages of topics have `max_bytes` together. `on_overflow` is called once,
    when more waits than may of what can't be dropped: the page does not read, and gets nothing any more.
    """

    def __init__(
        self,
        clock: Callable[[], float],
        on_overflow: Callable[[], object] = lambda: None,
        *,
        max_bytes: int = MAX_QUEUED_BYTES,
    ) -> None:
        self._on_overflow = on_overflow
        self._is_overfull = False
        self._max_bytes = max_bytes
        self._clock = clock
        self._frames: deque[Frame] = deque()
        self._frames_bytes = 0
        self._active: deque[Feed] = deque()
        self._is_filled = asyncio.Event()

    def put(self, frames: list[Frame]) -> None:
        """Append messages that can't be dropped."""
        if self._is_overfull:
            return
        self._frames.extend(frames)
        self._frames_bytes += sum(len(each.data) for each in frames)
        self._is_filled.set()
        if self._frames_bytes > MAX_CONTROL_BYTES and len(self._frames) > len(frames):
            self._is_overfull = True
            self._on_overflow()

    def add(self, feed: Feed, message: Message) -> None:
        """Append a message of a topic; beyond the limit the oldest of the largest feed is dropped."""
        feed.add(message)
        self.activate(feed)
        while sum(each.size_bytes for each in self._active) > self._max_bytes:
            largest = max(self._active, key=lambda each: (len(each) > 1, each.size_bytes))
            if len(self._active) == 1 and len(largest) == 1:
                return  # larger than the limit by itself, and the only one
            largest.drop_oldest()
            if not len(largest):
                self._active.remove(largest)

    def activate(self, feed: Feed) -> None:
        """Serve a feed that may have messages."""
        if len(feed) and feed not in self._active:
            self._active.append(feed)
        self._is_filled.set()

    def remove(self, feed: Feed) -> None:
        """Forget a feed and what waits in it."""
        feed.clear()
        if feed in self._active:
            self._active.remove(feed)

    async def pop(self) -> Frame | Queued:
        """Return what is to be sent next, as soon as there is something."""
        while True:
            if self._frames:
                frame = self._frames.popleft()
                self._frames_bytes -= len(frame.data)
                return frame
            now = self._clock()
            queued = self._take_turn(now)
            if queued is not None:
                return queued
            self._is_filled.clear()
            wait_s = min((each.next_at for each in self._active), default=float("inf")) - now
            await self._wait(None if wait_s == float("inf") else max(0.0, wait_s))

    def _take_turn(self, now: float) -> Queued | None:
        for _turn in range(len(self._active)):
            feed = self._active.popleft()
            if not len(feed):
                continue
            if feed.next_at > now:
                self._active.append(feed)
                continue
            message = feed.pop(now)
            if len(feed):
                self._active.append(feed)
            return Queued(feed, message)
        return None

    async def _wait(self, timeout_s: float | None) -> None:
        if timeout_s is None:
            await self._is_filled.wait()
            return
        try:
            await asyncio.wait_for(self._is_filled.wait(), timeout_s)
        except asyncio.TimeoutError:
            return
