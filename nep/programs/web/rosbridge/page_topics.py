"""Topics that a page publishes and subscribes to."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from nep.i18n import _
from nep.nodes.publisher import Publisher
from nep.nodes.subscriber import Subscriber
from nep.programs.web.context import PageContext, PageTopic
from nep.programs.web.limits import MAX_SUBSCRIPTION_IDS, MAX_TOPICS
from nep.programs.web.messages.operations import (
    Advertise,
    OperationError,
    OperationId,
    Publish,
    Subscribe,
    Unadvertise,
    Unsubscribe,
)
from nep.programs.web.messages.payloads import from_ros, is_compatible, nep_type_of, ros_type_of
from nep.programs.web.messages.ros_definitions import bare_type, definition_of
from nep.programs.web.rates import RateMeter
from nep.programs.web.send_queue import Feed, SendQueue
from nep.text import quotable

_GRAPH_TIMEOUT_S = 2.0
_DESCRIPTIONS_TIMEOUT_S = 0.5
"""Maximum time in seconds that opening a publisher waits for the descriptions of robots."""
_RAW_IMAGE_TYPE = "sensor_msgs/Image"
_NS_PER_S = 1_000_000_000


@dataclass
class _Publication:
    publisher: Publisher
    ros_type: str
    ids: set[OperationId] = field(default_factory=set)
    receive_rate: RateMeter = field(default_factory=lambda: RateMeter(time.monotonic))


@dataclass
class _Subscription:
    subscriber: Subscriber
    feed: Feed
    read_task: asyncio.Task[None]


class PageTopics:
    """Topics that one page publishes and subscribes to. Methods raise `NepError` for invalid requests."""

    def __init__(self, context: PageContext) -> None:
        self._context = context
        self._publications: dict[str, _Publication] = {}
        self._subscriptions: dict[str, _Subscription] = {}

    @property
    def topics(self) -> tuple[PageTopic, ...]:
        """Topics to which the page subscribes, followed by topics that it publishes. Thread-safe."""
        feeds = [each.feed for each in self._subscriptions.copy().values()]
        return (*map(subscribed_topic, feeds), *map(_published_topic, self._publications.copy().items()))

    # ---- publishing

    def is_advertised(self, topic: str) -> bool:
        """Return True if the page has advertised a topic."""
        return topic in self._publications

    async def advertise(self, operation: Advertise) -> None:
        """Open a publisher for the page, or add the id to the existing one.

        Raises `OperationError` if the topic has another type, the page may not move the robot, or the
        page already publishes `MAX_TOPICS` topics.
        """
        publication = self._publications.get(operation.topic)
        if publication is None:
            publication = await self._open_publication(operation)
        elif bare_type(publication.ros_type) != bare_type(operation.ros_type):
            raise _type_conflict(
                operation.topic, operation.ros_type, publication.publisher.msg_type, operation.id
            )
        if len(publication.ids) < MAX_SUBSCRIPTION_IDS:
            publication.ids.add(operation.id)
        self._context.send_status(
            "info", _("advertised '{topic}'").format(topic=operation.topic), operation.id
        )

    async def _open_publication(self, operation: Advertise) -> _Publication:
        if len(self._publications) >= MAX_TOPICS:
            raise OperationError(
                _("this page already publishes {count} topics, the maximum").format(count=MAX_TOPICS),
                operation.id,
            )
        publisher = await self._context.run_in_thread(self._open_publisher, operation)
        publication = self._publications[operation.topic] = _Publication(publisher, operation.ros_type)
        return publication

    def _open_publisher(self, operation: Advertise) -> Publisher:
        """Open the publisher of a topic. Called in the page's thread."""
        current_type = self._type_of(operation.topic)
        if not is_compatible(operation.ros_type, current_type):
            raise _type_conflict(operation.topic, operation.ros_type, current_type, operation.id)
        msg_type = current_type or nep_type_of(operation.ros_type)
        self._context.guard.wait_for_descriptions(_DESCRIPTIONS_TIMEOUT_S)
        self._check_motion(operation.topic, msg_type, operation.id)
        return self._context.node.new_pub(operation.topic, msg_type, latched=operation.is_latched)

    def _type_of(self, topic: str) -> str:
        """Return the NEP type that other nodes use on a topic; "" if there are none."""
        node = self._context.node
        info = node.graph(_GRAPH_TIMEOUT_S).topics.get(topic)
        if info is None or info.msg_type == "*":
            return ""
        node_ids = {each.node_id for each in info.publishers} | {each.node_id for each in info.subscribers}
        return "" if node_ids <= {node.id} else info.msg_type

    def _check_motion(self, topic: str, msg_type: str, id_: OperationId) -> None:
        reason = self._context.motion_denial_reason(topic, msg_type)
        if reason:
            self._context.counts.motions_rejected += 1
            raise OperationError(reason, id_)

    async def publish(self, operation: Publish) -> None:
        """Publish a message. The topic need not be advertised if its type is known from other nodes."""
        publication = self._publications.get(operation.topic)
        if publication is None:
            publication = await self._open_by_type(operation)
        publisher = publication.publisher
        self._check_motion(operation.topic, publisher.msg_type, operation.id)
        msg = _with_header(operation.msg, publication.ros_type)
        publisher.publish(from_ros(msg, publication.ros_type, publisher.msg_type), strict=True)
        publication.receive_rate.count(operation.size_bytes)

    async def _open_by_type(self, operation: Publish) -> _Publication:
        msg_type = await self._context.run_in_thread(self._type_of, operation.topic)
        if not msg_type:
            raise OperationError(
                _("topic '{topic}' isn't advertised; advertise it before you publish").format(
                    topic=quotable(operation.topic)
                ),
                operation.id,
            )
        advertisement = Advertise(operation.id, operation.topic, ros_type_of(msg_type), is_latched=False)
        return await self._open_publication(advertisement)

    async def unadvertise(self, operation: Unadvertise) -> None:
        """Remove one advertisement of a topic, or all of them if there is no id.

        The publisher is closed with the last advertisement.
        """
        publication = self._publications.get(operation.topic)
        if publication is None:
            raise OperationError(
                _("this page doesn't publish '{topic}'").format(topic=quotable(operation.topic)),
                operation.id,
                "warning",
            )
        publication.ids.discard(operation.id)
        if operation.id is None or not publication.ids:
            del self._publications[operation.topic]
            await self._context.run_in_thread(publication.publisher.close)
        self._context.send_status(
            "info", _("unadvertised '{topic}'").format(topic=operation.topic), operation.id
        )

    # ---- subscribing

    async def subscribe(self, operation: Subscribe) -> None:
        """Start sending the messages of a topic to the page."""
        as_pixels = bare_type(operation.ros_type) == _RAW_IMAGE_TYPE
        subscription = self._subscriptions.get(operation.topic)
        if subscription is None:
            await self._open_subscription(operation, as_pixels=as_pixels)
        else:
            if not is_compatible(operation.ros_type, subscription.subscriber.msg_type):
                raise _type_conflict(
                    operation.topic, operation.ros_type, subscription.subscriber.msg_type, operation.id
                )
            if subscription.feed.subscription_count >= MAX_SUBSCRIPTION_IDS:
                raise OperationError(
                    _("this page already has {count} subscriptions to '{topic}', the maximum").format(
                        count=MAX_SUBSCRIPTION_IDS, topic=quotable(operation.topic)
                    ),
                    operation.id,
                )
            subscription.feed.subscribe(operation, as_pixels=as_pixels)
            self._context.queue.activate(subscription.feed)
        self._context.send_status(
            "info", _("subscribed to '{topic}'").format(topic=operation.topic), operation.id
        )

    async def _open_subscription(self, operation: Subscribe, *, as_pixels: bool) -> None:
        if len(self._subscriptions) >= MAX_TOPICS:
            raise OperationError(
                _("this page already subscribes to {count} topics, the maximum").format(count=MAX_TOPICS),
                operation.id,
            )
        subscriber = await self._context.run_in_thread(self._open_subscriber, operation)
        feed = Feed(operation.topic, subscriber.msg_type)
        feed.subscribe(operation, as_pixels=as_pixels)
        read_task = asyncio.create_task(read_messages(subscriber, feed, self._context.queue))
        self._subscriptions[operation.topic] = _Subscription(subscriber, feed, read_task)

    def _open_subscriber(self, operation: Subscribe) -> Subscriber:
        """Open the subscriber of a topic. Called in the page's thread."""
        current_type = self._type_of(operation.topic)
        if not is_compatible(operation.ros_type, current_type):
            raise _type_conflict(operation.topic, operation.ros_type, current_type, operation.id)
        msg_type = current_type or (nep_type_of(operation.ros_type) if operation.ros_type else "json")
        return self._context.node.new_sub(operation.topic, msg_type, wildcards=False)

    async def unsubscribe(self, operation: Unsubscribe) -> None:
        """End one subscription to a topic, or all of them if there is no id."""
        subscription = self._subscriptions.get(operation.topic)
        if subscription is None or not subscription.feed.unsubscribe(operation.id):
            return  # no error, as in rosbridge: roslib unsubscribes again when it reconnects
        if not subscription.feed.subscription_count:
            del self._subscriptions[operation.topic]
            await self._close_subscription(subscription)
        self._context.send_status(
            "info", _("unsubscribed from '{topic}'").format(topic=operation.topic), operation.id
        )

    async def _close_subscription(self, subscription: _Subscription) -> None:
        subscription.read_task.cancel()
        self._context.queue.remove(subscription.feed)
        await self._context.run_in_thread(subscription.subscriber.close)

    def cancel(self) -> None:
        """Stop reading messages after the page has disconnected.

        The page's node closes publishers and subscribers.
        """
        for subscription in self._subscriptions.values():
            subscription.read_task.cancel()
            subscription.feed.clear()


async def read_messages(subscriber: Subscriber, feed: Feed, queue: SendQueue) -> None:
    """Append the messages of a subscriber to a page's queue until the task is cancelled.

    Args:
        subscriber: Subscriber to read from.
        feed: Feed of the topic in the queue.
        queue: Send queue of the page.
    """
    async for message in subscriber:
        queue.add(feed, message)
        del message  # may be in shared memory, which is released with the last reference


def subscribed_topic(feed: Feed) -> PageTopic:
    """Return a snapshot of a feed's rate limit, rates and counts. Thread-safe."""
    rate_hz, bytes_per_s = feed.send_rate.rates()
    return PageTopic(
        feed.topic,
        False,
        feed.max_rate_hz,
        rate_hz,
        bytes_per_s,
        feed.send_rate.total,
        feed.total_dropped_count,
    )


def _published_topic(item: tuple[str, _Publication]) -> PageTopic:
    topic, publication = item
    rate_hz, bytes_per_s = publication.receive_rate.rates()
    return PageTopic(topic, True, None, rate_hz, bytes_per_s, publication.receive_rate.total)


def _type_conflict(topic: str, ros_type: str, current_type: str, id_: OperationId) -> OperationError:
    return OperationError(
        _("'{topic}' has the type '{known}', not '{given}'").format(
            topic=quotable(topic), known=quotable(ros_type_of(current_type)), given=quotable(ros_type)
        ),
        id_,
    )


def _with_header(msg: object, ros_type: str) -> object:
    """Add the current time to a message whose type has a header, unless the message has a stamp."""
    definition = definition_of(bare_type(ros_type))
    if definition is None or not definition.has_header or not isinstance(msg, Mapping):
        return msg
    header = msg.get("header", {})
    if not isinstance(header, Mapping) or "stamp" in header:
        return msg
    sec, nanosec = divmod(time.time_ns(), _NS_PER_S)
    stamped_header = {"frame_id": "", **header, "stamp": {"sec": sec, "nanosec": nanosec}}
    return {**msg, "header": stamped_header}
