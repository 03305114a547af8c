"""Channels of a Foxglove connection: the advertised topics and the client's subscriptions."""

from __future__ import annotations

import asyncio
import base64
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from nep.errors import NepError
from nep.i18n import _
from nep.messages.codecs import CODECS, codec_for
from nep.messages.message import Message
from nep.nodes.loop_wait import yield_to_loop
from nep.nodes.subscriber import Subscriber
from nep.programs.web.context import PageContext, PageTopic
from nep.programs.web.foxglove.protocol import MAX_ID, message_frame
from nep.programs.web.limits import MAX_TOPICS
from nep.programs.web.messages.operations import Subscribe
from nep.programs.web.messages.payloads import ros_type_of
from nep.programs.web.outgoing import Frame, encode_json
from nep.programs.web.rosbridge.page_topics import read_messages, subscribed_topic
from nep.programs.web.send_queue import Feed, QueuedMessage

_MAX_CHANNELS_PER_MESSAGE = 100
"""Maximum number of channels in one message, because each channel includes its schema."""


class ChannelSchema(Protocol):
    """Channel with its schema, as defined by `nep.recordings.formats.channels`."""

    @property
    def topic(self) -> str:
        """Topic of the channel."""

    @property
    def message_encoding(self) -> str:
        """Encoding of the messages, such as `json`."""

    @property
    def schema_name(self) -> str:
        """Name of the message type."""

    @property
    def schema_encoding(self) -> str:
        """Encoding of the schema, such as `jsonschema`; "" without a schema."""

    @property
    def schema_data(self) -> bytes:
        """Schema in the encoding `schema_encoding`."""


class ChannelFormat(Protocol):
    """Encoder of live messages, implemented by `nep.recordings.formats.channels.LiveChannels`."""

    def expected_channel(self, topic: str, msg_type: str) -> ChannelSchema:
        """Return the most likely channel for a topic on which no message was received yet."""

    def encode(self, message: Message, log_ns: int) -> tuple[ChannelSchema, bytes]:
        """Return the channel of a message that was received at `log_ns`, and the message's encoded data."""


@dataclass
class _Channel:
    id: int
    msg_type: str
    definition: ChannelSchema


@dataclass
class _Subscription:
    id: int
    channel: _Channel
    subscriber: Subscriber
    feed: Feed
    read_task: asyncio.Task[None]


class Channels:
    """Channels of one Foxglove connection. Methods raise `NepError` for invalid requests.

    Args:
        context: Shared objects of the connection.
        channel_format: Encoder of messages.
        send: Sends a JSON message with the given fields to the client.
    """

    def __init__(
        self,
        context: PageContext,
        channel_format: ChannelFormat,
        send: Callable[[Mapping[str, object]], None],
    ) -> None:
        self._context = context
        self._format = channel_format
        self._send = send
        self._channels: dict[str, _Channel] = {}
        self._subscriptions: dict[int, _Subscription] = {}
        self._last_id = 0

    @property
    def subscribed_topics(self) -> tuple[PageTopic, ...]:
        """Topics to which the client subscribes. Thread-safe."""
        return tuple(subscribed_topic(each.feed) for each in self._subscriptions.copy().values())

    def ros_type(self, topic: str, schema_name: str) -> str:
        """Return the ROS type of a topic that was advertised to the client with this schema, or "".

        Args:
            topic: Name of the topic.
            schema_name: Name of the schema that the client uses.
        """
        channel = self._channels.get(topic)
        is_known = channel is not None and channel.definition.schema_name == schema_name
        return ros_type_of(channel.msg_type) if channel is not None and is_known else ""

    # ---- topics

    async def update(self, types_by_topic: Mapping[str, str]) -> None:
        """Advertise new topics, unadvertise removed ones, and readvertise topics whose type has changed.

        Args:
            types_by_topic: Message types of all current topics, by topic.
        """
        for topic, channel in list(self._channels.items()):
            if types_by_topic.get(topic) != channel.msg_type:
                del self._channels[topic]
                await self._unadvertise(channel)
        new_topics = [
            (topic, msg_type) for topic, msg_type in types_by_topic.items() if topic not in self._channels
        ]
        for begin in range(0, len(new_topics), _MAX_CHANNELS_PER_MESSAGE):
            self._advertise(
                (topic, msg_type, self._format.expected_channel(topic, _readable_type(msg_type)))
                for topic, msg_type in new_topics[begin : begin + _MAX_CHANNELS_PER_MESSAGE]
            )
            await yield_to_loop()

    def _advertise(self, topics: Iterable[tuple[str, str, ChannelSchema]]) -> None:
        channels = []
        for topic, msg_type, definition in topics:
            self._last_id += 1
            self._channels[topic] = _Channel(self._last_id, msg_type, definition)
            data = definition.schema_data
            is_binary = definition.schema_encoding == "protobuf"
            channels.append(
                {
                    "id": self._last_id,
                    "topic": topic,
                    "encoding": definition.message_encoding,
                    "schemaName": definition.schema_name,
                    "schemaEncoding": definition.schema_encoding,
                    "schema": base64.b64encode(data).decode() if is_binary else data.decode(),
                }
            )
        self._send({"op": "advertise", "channels": channels})

    async def _unadvertise(self, channel: _Channel) -> None:
        self._send({"op": "unadvertise", "channelIds": [channel.id]})
        for subscription in [
            subscription for subscription in self._subscriptions.values() if subscription.channel is channel
        ]:
            await self.unsubscribe(subscription.id)

    # ---- subscriptions

    async def subscribe(self, id_: object, channel_id: object) -> None:
        """Start sending the messages of a channel to the client.

        Args:
            id_: Id of the subscription, chosen by the client.
            channel_id: Id of the channel.
        """
        channel = next((each for each in self._channels.values() if each.id == channel_id), None)
        if type(id_) is not int or not 0 <= id_ <= MAX_ID or id_ in self._subscriptions or channel is None:
            raise NepError(
                _(
                    "a subscription needs an 'id' that is a whole number from 0 to {most} and not in use, "
                    "and the 'channelId' of a topic"
                ).format(most=MAX_ID)
            )
        if any(each.channel is channel for each in self._subscriptions.values()):
            raise NepError(_("this channel already has a subscription"))
        if len(self._subscriptions) >= MAX_TOPICS:
            raise NepError(
                _("this page already subscribes to {count} topics, the maximum").format(count=MAX_TOPICS)
            )
        topic, msg_type = channel.definition.topic, channel.msg_type
        subscriber = await self._context.run_in_thread(
            self._context.node.new_sub, topic, msg_type, wildcards=False
        )
        feed = Feed(topic, msg_type)
        feed.subscribe(Subscribe(id_, topic), as_pixels=False)
        read_task = asyncio.create_task(read_messages(subscriber, feed, self._context.queue))
        self._subscriptions[id_] = _Subscription(id_, channel, subscriber, feed, read_task)

    async def unsubscribe(self, id_: int) -> None:
        """End a subscription.

        Unknown ids are ignored, because the channel may have been unadvertised in the meantime.
        """
        subscription = self._subscriptions.pop(id_, None)
        if subscription is None:
            return
        subscription.read_task.cancel()
        self._context.queue.remove(subscription.feed)
        await self._context.run_in_thread(subscription.subscriber.close)

    async def encode_frames(self, queued: QueuedMessage) -> list[Frame]:
        """Encode a message for the client. Raises `NepError` if the message can't be decoded.

        Returns no frames if the client has unsubscribed, or must subscribe again because the channel
        has changed.
        """
        message = queued.message
        subscription = next((each for each in self._subscriptions.values() if each.feed is queued.feed), None)
        if subscription is None:
            return []
        log_ns = time.time_ns()
        definition, data = self._format.encode(_readable_message(message), log_ns)
        if _schema_key(definition) != _schema_key(subscription.channel.definition):  # raw pixels, for example
            await self._unadvertise(subscription.channel)
            self._advertise([(message.topic, subscription.channel.msg_type, definition)])
            return []
        return [message_frame(subscription.id, log_ns, data)]

    def cancel(self) -> None:
        """Stop reading messages after the client has disconnected.

        The client's node closes the subscribers.
        """
        for subscription in self._subscriptions.values():
            subscription.read_task.cancel()
            subscription.feed.clear()


def _readable_type(msg_type: str) -> str:
    """Return the message type for a topic's channel, with msgpack replaced by JSON for the clients."""
    return "json" if codec_for(msg_type).recorded_as == "msgpack" else msg_type


def _readable_message(message: Message) -> Message:
    codec = CODECS.get(message.codec)
    if codec is None or codec.recorded_as != "msgpack":
        return message
    data = encode_json(message.payload)
    return Message(message.topic, data, "json", "json", seq=message.seq, stamp_ns=message.stamp_ns)


def _schema_key(definition: ChannelSchema) -> tuple[str, str]:
    return definition.message_encoding, definition.schema_name
