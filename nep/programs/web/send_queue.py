"""Send queue of a page, for messages of topics, which can be dropped, and for other messages.

A `Feed` contains the messages of one topic, within the limits that the page's subscriptions request.
`SendQueue` serves all feeds of a page in turn, so that a topic with many messages does not delay the others.
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

_MAX_QUEUED_IMAGES = 4
"""Maximum number of queued images if the page doesn't request a queue length.

A longer queue would only add delay.
"""
_MAX_LATCHED_BYTES = MAX_QUEUED_BYTES // 4
"""Maximum size in bytes of a topic's latched messages, which are sent to further subscriptions of a page."""


class QueuedMessage(NamedTuple):
    """Message taken from a feed."""

    feed: Feed
    message: Message


class Feed:
    """Queue of a topic's messages to a page. If the page is too slow, the oldest messages are dropped.

    Several subscriptions of the page share one feed, with the shortest throttle time, the longest queue and
    the smallest fragments.

    Args:
        topic: Name of the topic.
        msg_type: Message type, which determines the default queue length.
        clock: Monotonic clock in seconds.
    """

    def __init__(self, topic: str, msg_type: str = "", clock: Callable[[], float] = time.monotonic) -> None:
        self.topic = topic
        is_image = bool(msg_type) and codec_for(msg_type).content == "image"
        self._default_capacity = _MAX_QUEUED_IMAGES if is_image else MAX_QUEUED_MESSAGES
        self.send_rate = RateMeter(clock)
        self.options = EncodingOptions()
        self.dropped_count = 0
        """Number of messages dropped since the page was last notified of drops."""
        self.total_dropped_count = 0
        self.throttled_count = 0
        """Number of messages omitted because of the rate limit that the page requested."""
        self.size_bytes = 0
        self._subscriptions: dict[OperationId, Subscribe] = {}
        self._throttle_s = 0.0
        self._capacity = self._default_capacity
        self._messages: deque[Message] = deque()
        self._latched_messages: dict[int | None, Message] = {}
        self._next_at = 0.0

    def __len__(self) -> int:
        return len(self._messages)

    @property
    def subscription_count(self) -> int:
        """Number of the page's subscriptions that share the feed."""
        return len(self._subscriptions)

    def subscribe(self, request: Subscribe, *, as_pixels: bool) -> None:
        """Add a subscription, or replace the one with the same id.

        A further subscription receives the latched messages again.

        Args:
            request: Subscription that the page requests.
            as_pixels: Send images as the pixels of ``sensor_msgs/Image``.
        """
        if self._subscriptions and request.id not in self._subscriptions:
            for message in tuple(self._latched_messages.values()):
                self.add(message)
        self._subscriptions[request.id] = request
        self._update_options(as_pixels=as_pixels)

    def unsubscribe(self, id_: OperationId) -> bool:
        """End the subscription with an id, or all subscriptions if the id is None.

        Returns:
            False if there was no such subscription.
        """
        was_subscribed = bool(self._subscriptions) if id_ is None else id_ in self._subscriptions
        if id_ is None:
            self._subscriptions.clear()
        else:
            self._subscriptions.pop(id_, None)
        if self._subscriptions:
            self._update_options(as_pixels=self.options.as_pixels)
        return was_subscribed

    def _update_options(self, *, as_pixels: bool) -> None:
        subscriptions = self._subscriptions.values()
        sizes = [each.fragment_size for each in subscriptions if each.fragment_size is not None]
        compression = max((each.compression for each in subscriptions), key=COMPRESSIONS.index)
        self.options = EncodingOptions(compression, min(sizes, default=None), as_pixels)
        self._throttle_s = min(each.throttle_s for each in subscriptions)
        queue_length = max(each.queue_length for each in subscriptions)
        self._capacity = queue_length or (1 if self._throttle_s else self._default_capacity)

    def add(self, message: Message) -> None:
        """Append a message, and drop the oldest ones that exceed the queue length."""
        if message.is_latched:
            self._store_latched(message)
        self._messages.append(message)
        self.size_bytes += message.size_bytes
        while len(self._messages) > self._capacity:
            self.drop_oldest()

    def _store_latched(self, message: Message) -> None:
        self._latched_messages.pop(message.publisher, None)
        self._latched_messages[message.publisher] = message
        while sum(each.size_bytes for each in self._latched_messages.values()) > _MAX_LATCHED_BYTES:
            del self._latched_messages[next(iter(self._latched_messages))]

    def drop_oldest(self) -> None:
        """Drop the oldest message. With a throttle time it counts as throttled, else as dropped."""
        self.size_bytes -= self._messages.popleft().size_bytes
        if self._throttle_s:
            self.throttled_count += 1
        else:
            self.dropped_count += 1
            self.total_dropped_count += 1

    @property
    def max_rate_hz(self) -> float | None:
        """Maximum number of messages per second that the page requested; None for no limit."""
        return 1 / self._throttle_s if self._throttle_s else None

    @property
    def next_at(self) -> float:
        """Earliest time at which the next message may be taken, on the clock of `pop`."""
        return self._next_at

    def pop(self, now: float) -> Message:
        """Remove and return the oldest message.

        Args:
            now: Current time in seconds, from which the throttle time is counted.
        """
        message = self._messages.popleft()
        self.size_bytes -= message.size_bytes
        self._next_at = now + self._throttle_s
        return message

    def clear(self) -> None:
        """Discard all queued and latched messages."""
        self._messages.clear()
        self._latched_messages.clear()
        self.size_bytes = 0


class SendQueue:
    """Queue of all messages to be sent to one page.

    Args:
        clock: Clock of the event loop in seconds.
        on_overflow: Called once when messages that can't be dropped exceed their limit, because the page
            does not read. After this, nothing more is sent.
        max_bytes: Maximum total size in bytes of queued messages of topics.
    """

    def __init__(
        self,
        clock: Callable[[], float],
        on_overflow: Callable[[], object] = lambda: None,
        *,
        max_bytes: int = MAX_QUEUED_BYTES,
    ) -> None:
        self._on_overflow = on_overflow
        self._has_overflowed = False
        self._max_bytes = max_bytes
        self._clock = clock
        self._frames: deque[Frame] = deque()
        self._frames_bytes = 0
        self._active_feeds: deque[Feed] = deque()
        self._not_empty = asyncio.Event()

    def put(self, frames: list[Frame]) -> None:
        """Append messages that can't be dropped. Does nothing after an overflow."""
        if self._has_overflowed:
            return
        self._frames.extend(frames)
        self._frames_bytes += sum(len(each.data) for each in frames)
        self._not_empty.set()
        if self._frames_bytes > MAX_CONTROL_BYTES and len(self._frames) > len(frames):
            self._has_overflowed = True
            self._on_overflow()

    def add(self, feed: Feed, message: Message) -> None:
        """Append a message of a topic.

        When the size limit is exceeded, the oldest message of the largest feed is dropped.
        """
        feed.add(message)
        self.activate(feed)
        while sum(each.size_bytes for each in self._active_feeds) > self._max_bytes:
            largest = max(self._active_feeds, key=lambda each: (len(each) > 1, each.size_bytes))
            if len(self._active_feeds) == 1 and len(largest) == 1:
                return  # the only message, larger than the limit
            largest.drop_oldest()
            if not len(largest):
                self._active_feeds.remove(largest)

    def activate(self, feed: Feed) -> None:
        """Add a feed that has messages to the feeds that are served in turn."""
        if len(feed) and feed not in self._active_feeds:
            self._active_feeds.append(feed)
        self._not_empty.set()

    def remove(self, feed: Feed) -> None:
        """Remove a feed and discard its messages."""
        feed.clear()
        if feed in self._active_feeds:
            self._active_feeds.remove(feed)

    async def pop(self) -> Frame | QueuedMessage:
        """Wait for the next item to be sent, and return it. Frames added by `put` come first."""
        while True:
            if self._frames:
                frame = self._frames.popleft()
                self._frames_bytes -= len(frame.data)
                return frame
            now = self._clock()
            queued = self._pop_next(now)
            if queued is not None:
                return queued
            self._not_empty.clear()
            wait_s = min((each.next_at for each in self._active_feeds), default=float("inf")) - now
            await self._wait(None if wait_s == float("inf") else max(0.0, wait_s))

    def _pop_next(self, now: float) -> QueuedMessage | None:
        for _turn in range(len(self._active_feeds)):
            feed = self._active_feeds.popleft()
            if not len(feed):
                continue
            if feed.next_at > now:
                self._active_feeds.append(feed)
                continue
            message = feed.pop(now)
            if len(feed):
                self._active_feeds.append(feed)
            return QueuedMessage(feed, message)
        return None

    async def _wait(self, timeout_s: float | None) -> None:
        if timeout_s is None:
            await self._not_empty.wait()
            return
        try:
            await asyncio.wait_for(self._not_empty.wait(), timeout_s)
        except asyncio.TimeoutError:
            return
