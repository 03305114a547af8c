"""FoxglovePage: a read-only connection of Lichtblick or Foxglove, by Foxglove's WebSocket protocol.

The server of the package foxglove-sdk accepts every Origin and has no token (0.30.3), so any web page in the
user's browser could read all topics. Here Foxglove's clients pass the same checks as rosbridge's.
Channels have the encodings and schemas of recordings (`nep.recordings.formats.channels`).
"""

from __future__ import annotations

import asyncio
import base64
import json
import logging
import struct
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import orjson

from nep.errors import NepError
from nep.i18n import _
from nep.messages.message import Message
from nep.messages.nesting import json_is_too_deep
from nep.nodes.loop_wait import give_way
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.programs.web.connection import PageConnection
from nep.programs.web.context import PageTopic, WebCounts
from nep.programs.web.limits import MAX_TOPICS
from nep.programs.web.operations import Subscribe
from nep.programs.web.outgoing import Frame
from nep.programs.web.page_topics import subscribed_topic
from nep.programs.web.send_queue import Feed, Queued
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from websockets import exceptions as ws_exceptions
    from websockets.asyncio.server import ServerConnection
else:
    ws_exceptions = lazy_module("websockets.exceptions")

__all__ = ["SUBPROTOCOLS", "ChannelFormat", "FoxglovePage"]

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
_logger = logging.getLogger("nep.programs.web")
_REFRESH_S = 1.0
_GRAPH_TIMEOUT_S = 2.0
_ADVERTISED_TOGETHER = 100
"""Channels in one message: each has its schema."""
_MAX_ID = 2**32 - 1
_MESSAGE_DATA = struct.Struct("<BIQ")
"""Opcode 1, subscription id, log time in nanoseconds."""


class ChannelSchema(Protocol):
    """A channel and its schema, as `nep.recordings.formats.channels` has them."""

    @property
    def topic(self) -> str: ...
    @property
    def message_encoding(self) -> str: ...
    @property
    def schema_name(self) -> str: ...
    @property
    def schema_encoding(self) -> str: ...
    @property
    def schema_data(self) -> bytes: ...


class ChannelFormat(Protocol):
    """Encodes messages for channels: `nep.recordings.formats.channels.LiveChannels`."""

    def expected(self, topic: str, msg_type: str) -> ChannelSchema:
        """Return the most likely channel of a topic that has had no message yet."""

    def encoded(self, message: Message, log_ns: int) -> tuple[ChannelSchema, bytes]:
        """Return the channel of a message, and its bytes in that channel."""


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
    reader: asyncio.Task[None]


class FoxglovePage(PageConnection):
    """See the module. `name` is that of its node. Lives in the server's event loop."""

    protocol = "foxglove"

    def __init__(
        self,
        connection: ServerConnection,
        name: str,
        new_node: Callable[[str], Node],
        channels: ChannelFormat,
        counts: WebCounts,
    ) -> None:
        super().__init__(connection, name, new_node, counts)
        self._format = channels
        self._channels: dict[str, _Channel] = {}
        self._subscriptions: dict[int, _Subscription] = {}
        self._last_id = 0
        self._is_gone = asyncio.Event()

    @property
    def _topic_list(self) -> tuple[PageTopic, ...]:
        return tuple(subscribed_topic(each.feed) for each in self._subscriptions.copy().values())

    async def run(self) -> None:
        """Serve the client until it goes; then close its node."""
        self._tell(op="serverInfo", name="NEP", capabilities=[], metadata={}, sessionId=str(time.time_ns()))
        tasks = [asyncio.create_task(self._write()), asyncio.create_task(self._watch_topics())]
        try:
            while True:
                await self._handle(await self._receive())
                await give_way()  # other pages have their turn
        except ws_exceptions.ConnectionClosed:
            return
        finally:
            self._is_gone.set()
            for task in (*tasks, *(each.reader for each in self._subscriptions.values())):
                task.cancel()
            await self._close_node()

    def _tell(self, **fields: object) -> None:
        self._queue.put([Frame(orjson.dumps(fields), is_text=True)])

    def _warn(self, sentence: str) -> None:
        self._tell(op="status", level=1, message=sentence)

    def _reject(self, error: NepError) -> None:
        self._counts.rejected += 1
        self._tell(op="status", level=2, message=str(error))

    # ---- topics

    async def _watch_topics(self) -> None:
        """Advertise topics as they come to the graph and go."""
        loop = asyncio.get_running_loop()
        while not self._is_gone.is_set():
            try:
                view = await loop.run_in_executor(self._thread, self._node.graph, _GRAPH_TIMEOUT_S)
                found = {
                    topic: info.msg_type
                    for topic, info in view.topics.items()
                    if info.publishers and info.msg_type != "*"
                }
                await self._update(found)
            except NepError as error:  # the master is away: nothing is known to have changed
                _logger.debug("the page '%s' keeps its channels: %s", self.name, error)
            except Exception:
                _logger.exception("the channels of the page '%s' could not be updated", self.name)
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._is_gone.wait(), _REFRESH_S)

    async def _update(self, found: Mapping[str, str]) -> None:
        for topic, channel in list(self._channels.items()):
            if found.get(topic) != channel.msg_type:
                del self._channels[topic]
                await self._withdraw(channel)
        new = [(topic, msg_type) for topic, msg_type in found.items() if topic not in self._channels]
        for begin in range(0, len(new), _ADVERTISED_TOGETHER):
            self._advertise(
                (topic, msg_type, self._format.expected(topic, msg_type))
                for topic, msg_type in new[begin : begin + _ADVERTISED_TOGETHER]
            )
            await give_way()

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
        self._tell(op="advertise", channels=channels)

    async def _withdraw(self, channel: _Channel) -> None:
        self._tell(op="unadvertise", channelIds=[channel.id])
        for each in [each for each in self._subscriptions.values() if each.channel is channel]:
            await self._unsubscribe(each.id)

    # ---- what the client asks

    async def _handle(self, data: bytes) -> None:
        """Process one message of the client. Never raises because of its contents."""
        self._counts.operations += 1
        try:
            await self._carry_out(data)
        except NepError as error:
            self._reject(error)
        except Exception:
            _logger.exception("an operation of the page '%s' failed", self.name)
            self._reject(NepError(_("an operation failed because of an error in the server")))

    async def _carry_out(self, data: bytes) -> None:
        fields = None
        if not json_is_too_deep(data):
            with suppress(json.JSONDecodeError):  # orjson's error is one, too
                fields = orjson.loads(data)
        fields = fields if isinstance(fields, dict) else {}
        if fields.get("op") == "subscribe":
            for wish in _items(fields.get("subscriptions")):
                if not isinstance(wish, dict):
                    raise NepError(_("a subscription needs 'id' and 'channelId'"))
                await self._subscribe(wish.get("id"), wish.get("channelId"))
        elif fields.get("op") == "unsubscribe":
            for id_ in _items(fields.get("subscriptionIds")):
                if isinstance(id_, int):
                    await self._unsubscribe(id_)
        else:
            raise NepError(_("this connection only reads topics; it can't publish or call services"))

    async def _subscribe(self, id_: object, channel_id: object) -> None:
        channel = next((each for each in self._channels.values() if each.id == channel_id), None)
        if type(id_) is not int or not 0 <= id_ <= _MAX_ID or id_ in self._subscriptions or channel is None:
            raise NepError(_("a subscription needs an unused 'id' and the 'channelId' of a topic"))
        if any(each.channel is channel for each in self._subscriptions.values()):
            raise NepError(_("a channel has one subscription at a time"))
        if len(self._subscriptions) >= MAX_TOPICS:
            raise NepError(
                _("this page subscribes to {count} topics, and may have no more").format(count=MAX_TOPICS)
            )
        topic, msg_type = channel.definition.topic, channel.msg_type
        loop = asyncio.get_running_loop()
        subscriber = await loop.run_in_executor(
            self._thread, lambda: self._node.new_sub(topic, msg_type, wildcards=False)
        )
        feed = Feed(topic)
        feed.subscribe(Subscribe(id_, topic), as_pixels=False)
        reader = asyncio.create_task(self._read(subscriber, feed))
        self._subscriptions[id_] = _Subscription(id_, channel, subscriber, feed, reader)

    async def _read(self, subscriber: Subscriber, feed: Feed) -> None:
        async for message in subscriber:
            self._queue.add(feed, message)

    async def _unsubscribe(self, id_: int) -> None:
        known = self._subscriptions.pop(id_, None)
        if known is None:
            return
        known.reader.cancel()
        self._queue.remove(known.feed)
        await asyncio.get_running_loop().run_in_executor(self._thread, known.subscriber.close)

    # ---- sending

    async def _frames_of(self, queued: Queued) -> list[Frame]:
        message = queued.message
        known = next((each for each in self._subscriptions.values() if each.feed is queued.feed), None)
        if known is None:
            return []
        log_ns = time.time_ns()
        definition, data = self._format.encoded(message, log_ns)
        if _shape(definition) != _shape(known.channel.definition):  # raw pixels, for example
            await self._withdraw(known.channel)
            self._advertise([(message.topic, known.channel.msg_type, definition)])
            return []
        header = _MESSAGE_DATA.pack(1, known.id, log_ns)
        return [Frame(header + data, is_text=False)]


def _items(value: object) -> list[object]:
    return value if isinstance(value, list) else []


def _shape(definition: ChannelSchema) -> tuple[str, str]:
    return definition.message_encoding, definition.schema_name
