"""`PageConnection`: base class for the connection of a page in any protocol.

A connection has a node, a send queue, and a task that sends queued messages.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, ClassVar

from nep.errors import NepError
from nep.i18n import ngettext
from nep.nodes.node import Node
from nep.programs.web.context import ConnectedPage, PageTopic, Protocol, WebCounts
from nep.programs.web.outgoing import Frame
from nep.programs.web.send_queue import QueuedMessage, SendQueue
from nep.programs.web.visitors import client_name, device_kind, page_title
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from websockets import exceptions as ws_exceptions
    from websockets.asyncio.server import ServerConnection
else:
    ws_exceptions = lazy_module("websockets.exceptions")


_logger = logging.getLogger("nep.programs.web")
_POLICY_VIOLATION = 1008
_INTERNAL_ERROR = 1011
_NODE_CLOSE_TIMEOUT_S = 2.0
_CLOSE_TIMEOUT_S = 1.0
_ids = itertools.count(1)


class PageConnection:
    """Base class for the WebSocket connection of a page. Runs in the server's event loop.

    Subclasses implement a protocol: `_encode_frames`, `_warn`, `_reject` and `_topic_list`.

    Args:
        connection: WebSocket connection.
        name: Name of the page's node.
        new_node: Creates the node.
        counts: Counters of the server.
    """

    protocol: ClassVar[Protocol]

    def __init__(
        self, connection: ServerConnection, name: str, new_node: Callable[[str], Node], counts: WebCounts
    ) -> None:
        self.name = name
        self.id = next(_ids)
        self._connection = connection
        self._counts = counts
        self._connected_at_s = time.time()
        self._dropped_count = 0
        self._thread = ThreadPoolExecutor(1, f"nep-{name[:40]}")
        self._node = new_node(name)
        self._queue = SendQueue(asyncio.get_running_loop().time, self._close_slow_page)
        self._close_task: asyncio.Task[None] | None = None
        self.is_closing = False
        """True if the page's messages are ignored because it is being disconnected.

        Set from any thread before `start_closing` is scheduled.
        """

    # ---- implemented by subclasses

    @property
    def _topic_list(self) -> tuple[PageTopic, ...]:
        """Topics that the page publishes or subscribes to. Thread-safe."""
        raise NotImplementedError

    async def _encode_frames(self, queued: QueuedMessage) -> list[Frame]:
        """Encode a message of a topic. Raises `NepError` if the protocol can't represent the message."""
        raise NotImplementedError

    def _warn(self, message: str) -> None:
        """Send a warning to the page."""
        raise NotImplementedError

    def _reject(self, error: NepError) -> None:
        """Count an error and report it to the page."""
        raise NotImplementedError

    # ---- the connection

    @property
    def snapshot(self) -> ConnectedPage:
        """Snapshot of the page's connection and topics. Thread-safe."""
        address = self._connection.remote_address
        path, origin, referer, user_agent = self._request
        return ConnectedPage(
            id=self.id,
            name=self.name,
            address=str(address[0]) if isinstance(address, tuple) else str(address),
            origin=origin,
            since_s=self._connected_at_s,
            client=client_name(user_agent, is_foxglove=self.protocol == "foxglove"),
            protocol=self.protocol,
            title=page_title(path, referer, origin) or self.name,
            topics=self._topic_list,
            dropped_count=self._dropped_count,
            device=device_kind(user_agent),
        )

    @property
    def _request(self) -> tuple[str, str, str, str]:
        """Path, Origin, Referer and User-Agent of the handshake; "" for a missing or repeated header."""
        request = self._connection.request
        if request is None:
            return "", "", "", ""
        headers = (request.headers.get_all(name) for name in ("Origin", "Referer", "User-Agent"))
        origin, referer, user_agent = (each[0] if len(each) == 1 else "" for each in headers)
        return request.path, origin, referer, user_agent

    @property
    def connection(self) -> ServerConnection:
        """WebSocket connection of the page."""
        return self._connection

    def start_closing(self, reason: str) -> None:
        """Close the connection within a few seconds, even if the page does not respond.

        `run` returns when the connection is closed.
        """
        self.is_closing = True
        self._close_task = asyncio.create_task(self._close_connection(_POLICY_VIOLATION, reason))

    async def _close_connection(self, code: int, reason: str) -> None:
        # A page that does not read does not receive a close frame either.
        try:
            await asyncio.wait_for(self._connection.close(code, reason), _CLOSE_TIMEOUT_S)
        except asyncio.TimeoutError:
            self._connection.transport.abort()

    async def _receive(self) -> bytes:
        """Return the next message from the page. Raises `ConnectionClosed` when the connection is closed.

        Messages that arrive while the page is being disconnected are ignored.
        """
        while True:
            data = bytes(await self._connection.recv(decode=False))
            if not self.is_closing:
                return data

    def _close_slow_page(self) -> None:
        _logger.warning(
            "the page '%s' is disconnected: it doesn't read the replies to its requests", self.name
        )
        self.start_closing("the page does not read its replies")

    def _log_connection(self) -> None:
        """Log the connection through the page's node, because the graph doesn't show a node without topics.

        Called in the page's thread.
        """
        self._node.log.info("the page connected from %s", self._connection.remote_address)

    async def _close_node(self) -> None:
        future = self._thread.submit(self._node.close, _NODE_CLOSE_TIMEOUT_S)
        await asyncio.shield(asyncio.wrap_future(future))
        self._thread.shutdown()  # returns at once: the thread is idle

    # ---- sending

    async def _write(self) -> None:
        """Send queued messages until the connection is closed, as fast as the page reads them."""
        try:
            while True:
                await self._send(await self._queue.pop())
        except ws_exceptions.ConnectionClosed:
            return
        except Exception:
            _logger.exception("the page '%s' is closed because of an error", self.name)
            await self._close_connection(_INTERNAL_ERROR, "internal error")

    async def _send(self, item: Frame | QueuedMessage) -> None:
        if isinstance(item, Frame):
            await self._connection.send(item.data, text=item.is_text)
            self._counts.sent += 1
            return
        feed = item.feed
        frames = await self._encode_message(item)
        del item  # a slow page may block; release the message, which may be in shared memory
        for frame in frames:
            await self._connection.send(frame.data, text=frame.is_text)
        if frames:
            self._counts.sent += 1
            feed.send_rate.count(sum(len(frame.data) for frame in frames))

    async def _encode_message(self, queued: QueuedMessage) -> list[Frame]:
        feed = queued.feed
        if feed.dropped_count:
            self._report_dropped(feed.topic, feed.dropped_count)
            feed.dropped_count = 0
        try:
            return await self._encode_frames(queued)
        except NepError as error:
            self._reject(error)
            return []

    def _report_dropped(self, topic: str, count: int) -> None:
        self._counts.dropped += count
        self._dropped_count += count
        template = ngettext(
            "this page is too slow: {count} message of '{topic}' was dropped",
            "this page is too slow: {count} messages of '{topic}' were dropped",
            count,
        )
        self._warn(template.format(count=count, topic=topic))
