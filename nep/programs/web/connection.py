"""Connection of one page: its node, its send queue, and the task that sends. Base of both protocols."""

from __future__ import annotations

import asyncio
import itertools
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from nep.errors import NepError
from nep.i18n import ngettext
from nep.nodes.node import Node
from nep.programs.web.context import ConnectedPage, WebCounts
from nep.programs.web.outgoing import Frame
from nep.programs.web.send_queue import Queued, SendQueue
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from websockets import exceptions as ws_exceptions
    from websockets.asyncio.server import ServerConnection
else:
    ws_exceptions = lazy_module("websockets.exceptions")

__all__ = ["PageConnection"]

_logger = logging.getLogger("nep.programs.web")
_POLICY_VIOLATION = 1008
_INTERNAL_ERROR = 1011
_NODE_CLOSE_S = 2.0
_ids = itertools.count(1)


class PageConnection:
    """A page at a WebSocket connection. Lives in the server's event loop.

    Subclasses implement a protocol: `_frames_of`, `_warn`, `_reject`, `_subscribed` and `_published`.
    """

    def __init__(
        self, connection: ServerConnection, name: str, new_node: Callable[[str], Node], counts: WebCounts
    ) -> None:
        self.name = name
        self.id = next(_ids)
        self._connection = connection
        self._counts = counts
        self._since_s = time.time()
        self._dropped = 0
        self._thread = ThreadPoolExecutor(1, f"nep-{name[:40]}")
        self._node = new_node(name)
        self._queue = SendQueue(asyncio.get_running_loop().time, self._end_slow)
        self._closing: asyncio.Task[None] | None = None

    # ---- implemented by subclasses

    @property
    def _subscribed(self) -> tuple[str, ...]:
        """Topics that the page subscribes to. Thread-safe."""
        raise NotImplementedError

    @property
    def _published(self) -> tuple[str, ...]:
        """Topics that the page publishes. Thread-safe."""
        raise NotImplementedError

    async def _frames_of(self, queued: Queued) -> list[Frame]:
        """Encode a message of a topic. Raises `NepError` if it can't be sent to this page."""
        raise NotImplementedError

    def _warn(self, sentence: str) -> None:
        """Send a warning to the page."""
        raise NotImplementedError

    def _reject(self, error: NepError) -> None:
        """Count an error and send it to the page."""
        raise NotImplementedError

    # ---- the connection

    @property
    def snapshot(self) -> ConnectedPage:
        """Topics and connection of the page. Thread-safe."""
        address, request = self._connection.remote_address, self._connection.request
        return ConnectedPage(
            self.id,
            self.name,
            str(address[0]) if isinstance(address, tuple) else str(address),
            ("" if request is None else request.headers.get("Origin")) or "",
            self._since_s,
            self._subscribed,
            self._published,
            self._dropped,
        )

    async def close(self) -> None:
        """Close the connection; `run` then ends."""
        await self._connection.close(_POLICY_VIOLATION, "disconnected by the user of the server")

    def _end_slow(self) -> None:
        _logger.warning("the page '%s' is closed: it does not read the answers that it asked for", self.name)
        self._closing = asyncio.create_task(
            self._connection.close(_POLICY_VIOLATION, "the page does not read its answers")
        )

    async def _close_node(self) -> None:
        self._thread.submit(self._node.close, _NODE_CLOSE_S)
        await asyncio.shield(asyncio.to_thread(self._thread.shutdown))

    # ---- sending

    async def _write(self) -> None:
        """Send queued messages, as fast as the page reads them."""
        try:
            while True:
                next_up = await self._queue.take()
                frames = [next_up] if isinstance(next_up, Frame) else await self._frames_of_message(next_up)
                for frame in frames:
                    await self._connection.send(frame.data, text=frame.is_text)
                self._counts.sent += bool(frames)
        except ws_exceptions.ConnectionClosed:
            return
        except Exception:
            _logger.exception("the page '%s' is closed because of an error", self.name)
            await self._connection.close(_INTERNAL_ERROR, "internal error")

    async def _frames_of_message(self, queued: Queued) -> list[Frame]:
        feed = queued.feed
        if feed.dropped_count:
            self._tell_dropped(feed.topic, feed.dropped_count)
            feed.dropped_count = 0
        try:
            return await self._frames_of(queued)
        except NepError as error:
            self._reject(error)
            return []

    def _tell_dropped(self, topic: str, count: int) -> None:
        self._counts.dropped += count
        self._dropped += count
        said = ngettext(
            "this page is too slow: {count} message of '{topic}' was dropped",
            "this page is too slow: {count} messages of '{topic}' were dropped",
            count,
        )
        self._warn(said.format(count=count, topic=topic))
