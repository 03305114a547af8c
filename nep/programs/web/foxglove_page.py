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
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import orjson

from nep.errors import NepError
from nep.i18n import _, ngettext
from nep.messages.message import Message
from nep.messages.nesting import json_is_too_deep
from nep.nodes.loop_wait import give_way
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.programs.web.context import CLOSED_BY_USER, PAGE_IDS, ConnectedPage, WebCounts, connected_page
from nep.programs.web.limits import MAX_TOPICS
from nep.programs.web.operations import Subscribe
from nep.programs.web.outgoing import Frame
from nep.programs.web.send_queue import Feed, Queued, SendQueue
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
_NODE_CLOSE_S = 2.0
_POLICY_VIOLATION = 1008
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


class FoxglovePage:
    """See the module. `name` is that of its node. Lives in the server's event loop."""

    def __init__(
        self,
        connection: ServerConnection,
        name: str,
        new_node: Callable[[str], Node],
        channels: ChannelFormat,
        counts: WebCounts,
    ) -> None:
        self._format = channels
        self.name = name
        self.id = next(PAGE_IDS)
        self._since_s = time.time()
        self._dropped = 0
        self._connection = connection
        self._counts = counts
        self._thread = ThreadPoolExecutor(1, f"nep-{name[:40]}")
        self._node = new_node(name)
        self._queue = SendQueue(asyncio.get_running_loop().time, self._end_slow)
        self._channels: dict[str, _Channel] = {}
        self._subscriptions: dict[int, _Subscription] = {}
        self._last_id = 0
        self._is_gone = asyncio.Event()
        self._closing: asyncio.Task[None] | None = None

    @property
    def snapshot(self) -> ConnectedPage:
        """Topics and connection of the page. Thread-safe."""
        subscribed = sorted({each.channel.definition.topic for each in self._subscriptions.copy().values()})
        return connected_page(
            self._connection,
            id=self.id,
            name=self.name,
            since_s=self._since_s,
            subscribed=tuple(subscribed),
            dropped_count=self._dropped,
        )

    async def close(self) -> None:
        """Close the connection; `run` then ends."""
        await self._connection.close(_POLICY_VIOLATION, CLOSED_BY_USER)

    async def run(self) -> None:
        """Serve the client until it goes; then close its node."""
        self._tell(op="serverInfo", name="NEP", capabilities=[], metadata={}, sessionId=str(time.time_ns()))
        tasks = [asyncio.create_task(self._write()), asyncio.create_task(self._watch_topics())]
        try:
            while True:
                data = await self._connection.recv(decode=False)
                self._counts.operations += 1
                try:
                    await self._handle(bytes(data))
                except NepError as error:
                    self._counts.rejected += 1
                    self._tell(op="status", level=2, message=str(error))
                await give_way()  # other pages have their turn
        except ws_exceptions.ConnectionClosed:
            return
        finally:
            self._is_gone.set()
            for task in (*tasks, *(each.reader for each in self._subscriptions.values())):
                task.cancel()
            self._thread.submit(self._node.close, _NODE_CLOSE_S)
            await asyncio.shield(asyncio.to_thread(self._thread.shutdown))

    def _tell(self, **fields: object) -> None:
        self._queue.put([Frame(orjson.dumps(fields), is_text=True)])

    def _end_slow(self) -> None:
        said = "the client does not read its answers"
        self._closing = asyncio.create_task(self._connection.close(_POLICY_VIOLATION, said))

    # ---- topics

    async def _watch_topics(self) -> None:
        """Advertise topics as they come to the graph and go."""
        loop = asyncio.get_running_loop()
        while not self._is_gone.is_set():
            with suppress(NepError):  # the master is away: nothing is known to have changed
                view = await loop.run_in_executor(self._thread, self._node.graph, _GRAPH_TIMEOUT_S)
                found = {
                    topic: info.msg_type
                    for topic, info in view.topics.items()
                    if info.publishers and info.msg_type != "*"
                }
                await self._update(found)
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._is_gone.wait(), _REFRESH_S)

    async def _update(self, found: Mapping[str, str]) -> None:
        for topic, channel in list(self._channels.items()):
            if found.get(topic) != channel.msg_type:
                del self._channels[topic]
                await self._withdraw(channel)
        for topic, msg_type in found.items():
            if topic not in self._channels:
                self._advertise(topic, msg_type, self._format.expected(topic, msg_type))

    def _advertise(self, topic: str, msg_type: str, definition: ChannelSchema) -> None:
        self._last_id += 1
        self._channels[topic] = _Channel(self._last_id, msg_type, definition)
        data = definition.schema_data
        is_binary = definition.schema_encoding == "protobuf"
        channel = {
            "id": self._last_id,
            "topic": topic,
            "encoding": definition.message_encoding,
            "schemaName": definition.schema_name,
            "schemaEncoding": definition.schema_encoding,
            "schema": base64.b64encode(data).decode() if is_binary else data.decode(),
        }
        self._tell(op="advertise", channels=[channel])

    async def _withdraw(self, channel: _Channel) -> None:
        self._tell(op="unadvertise", channelIds=[channel.id])
        for each in [each for each in self._subscriptions.values() if each.channel is channel]:
            await self._unsubscribe(each.id)

    # ---- what the client asks

    async def _handle(self, data: bytes) -> None:
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

    async def _write(self) -> None:
        try:
            while True:
                next_up = await self._queue.take()
                frame = next_up if isinstance(next_up, Frame) else await self._frame_of(next_up)
                if frame is not None:
                    await self._connection.send(frame.data, text=frame.is_text)
                    self._counts.sent += 1
        except ws_exceptions.ConnectionClosed:
            return
        except Exception:
            _logger.exception("the page '%s' is closed because of an error", self.name)
            await self._connection.close(1011, "internal error")

    def _tell_dropped(self, feed: Feed) -> None:
        count, feed.dropped_count = feed.dropped_count, 0
        self._counts.dropped += count
        self._dropped += count
        said = ngettext(
            "this page is too slow: {count} message of '{topic}' was dropped",
            "this page is too slow: {count} messages of '{topic}' were dropped",
            count,
        )
        self._tell(op="status", level=1, message=said.format(count=count, topic=feed.topic))

    async def _frame_of(self, queued: Queued) -> Frame | None:
        if queued.feed.dropped_count:
            self._tell_dropped(queued.feed)
        message = queued.message
        known = next((each for each in self._subscriptions.values() if each.feed is queued.feed), None)
        if known is None:
            return None
        log_ns = time.time_ns()
        definition, data = self._format.encoded(message, log_ns)
        if _shape(definition) != _shape(known.channel.definition):  # raw pixels, for example
            await self._withdraw(known.channel)
            self._advertise(message.topic, known.channel.msg_type, definition)
            return None
        header = _MESSAGE_DATA.pack(1, known.id, log_ns)
        return Frame(header + data, is_text=False)


def _items(value: object) -> list[object]:
    return value if isinstance(value, list) else []


def _shape(definition: ChannelSchema) -> tuple[str, str]:
    return definition.message_encoding, definition.schema_name
