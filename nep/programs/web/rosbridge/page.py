"""`RosbridgePage`: rosbridge connection with its own node, which is closed with the connection."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any

from nep.errors import NepError
from nep.i18n import _
from nep.nodes.loop_wait import yield_to_loop
from nep.nodes.node import Node
from nep.programs.robots.guard import MotionGuard
from nep.programs.web.access import AuthVerifier
from nep.programs.web.connection import PageConnection
from nep.programs.web.context import PageContext, PageTopic, WebCounts
from nep.programs.web.limits import AUTH_TIMEOUT_S, MAX_NESTED_OPERATIONS
from nep.programs.web.messages import operations as op
from nep.programs.web.messages.fragments import FragmentBuffer
from nep.programs.web.messages.png import decode_png
from nep.programs.web.outgoing import Frame, publish_frames
from nep.programs.web.rosbridge.page_services import PageServices
from nep.programs.web.rosbridge.page_topics import PageTopics
from nep.programs.web.send_queue import QueuedMessage
from nep.system.lazy_import import lazy_module
from nep.system.log_rarely import is_logged

if TYPE_CHECKING:
    from websockets import exceptions as ws_exceptions
    from websockets.asyncio.server import ServerConnection
else:
    ws_exceptions = lazy_module("websockets.exceptions")


_logger = logging.getLogger("nep.programs.web")


class RosbridgePage(PageConnection):
    """Connection of a page or program with the rosbridge protocol. Runs in the server's event loop.

    Args:
        connection: WebSocket connection.
        name: Name of the page's node.
        new_node: Creates the node.
        guard: Motion guard that decides on which topics the page may publish.
        counts: Counters of the server.
        on_robot_rejected: Called with the name of a robot that the page may not move, and the reason.
    """

    protocol = "rosbridge"

    def __init__(
        self,
        connection: ServerConnection,
        name: str,
        new_node: Callable[[str], Node],
        guard: MotionGuard,
        counts: WebCounts,
        on_robot_rejected: Callable[[str, str], object],
    ) -> None:
        super().__init__(connection, name, new_node, counts)
        self._context = PageContext(
            self._node, self._queue, self._thread, guard, counts, on_robot_rejected=on_robot_rejected
        )
        self._topics = PageTopics(self._context)
        self._services = PageServices(self._context)
        self._fragments = FragmentBuffer()
        self._rejected_count = 0
        self._handlers: dict[type, Callable[[Any], Awaitable[None] | None]] = {
            op.Publish: self._topics.publish,
            op.Advertise: self._topics.advertise,
            op.Unadvertise: self._topics.unadvertise,
            op.Subscribe: self._topics.subscribe,
            op.Unsubscribe: self._topics.unsubscribe,
            op.CallService: self._services.call,
            op.AdvertiseService: self._services.advertise,
            op.UnadvertiseService: self._services.unadvertise,
            op.ServiceResponse: self._services.respond,
            op.SetLevel: self._set_level,
            op.PageStatus: self._log_status,
            op.Auth: _ignore_auth,
        }

    # ---- the connection

    @property
    def _topic_list(self) -> tuple[PageTopic, ...]:
        return self._topics.topics

    async def run(self) -> None:
        """Serve the page until it disconnects, and close its node."""
        writer = asyncio.create_task(self._write())
        try:
            await self._context.run_in_thread(self._log_connection)
            while True:
                await self.handle(await self._receive())
                await yield_to_loop()  # let other pages run
        except ws_exceptions.ConnectionClosed:
            return
        finally:
            writer.cancel()
            self._topics.cancel()
            self._services.cancel()
            await self._close_node()

    async def _encode_frames(self, queued: QueuedMessage) -> list[Frame]:
        topic = queued.feed.topic
        try:
            return publish_frames(topic, queued.message, queued.feed.options)
        except NepError as error:
            raise op.OperationError(f"'{topic}': {error}", level="warning") from error

    def _warn(self, message: str) -> None:
        self._context.send_status("warning", message)

    # ---- operations

    async def handle(self, data: bytes) -> None:
        """Execute the operation in a message from the page. Never raises because of the message's content."""
        self._counts.operations += 1
        try:
            await self._execute(op.parse(data))
        except NepError as error:
            self._reject(error)
        except Exception:
            _logger.exception("an operation of the page '%s' failed", self.name)
            self._reject(
                op.OperationError(_("an operation failed because of an internal error of the server"))
            )

    async def _execute(self, operation: op.Operation) -> None:
        for _nested in range(MAX_NESTED_OPERATIONS):
            if not isinstance(operation, op.Fragment | op.Png):
                break
            inner = self._unwrap(operation)
            if inner is None:
                return
            operation = inner
        handler = self._handlers.get(type(operation))
        if handler is None:
            raise op.OperationError(_("an operation has too many levels of nested fragments"), operation.id)
        try:
            awaitable = handler(operation)
            if awaitable is not None:
                await awaitable
        except op.OperationError:
            raise
        except NepError as error:
            raise op.OperationError(str(error), operation.id) from error

    def _unwrap(self, part: op.Fragment | op.Png) -> op.Operation | None:
        """Return the operation in fragments or in a PNG once all parts have arrived, else None."""
        try:
            text = self._fragments.add(part)
            if text is None:
                return None
            data = decode_png(text) if isinstance(part, op.Png) else text.encode("utf-8", "replace")
            return op.parse(data)
        except op.OperationError as error:
            error.id = part.id if error.id is None else error.id
            raise

    def _set_level(self, operation: op.SetLevel) -> None:
        self._context.level = operation.level

    def _log_status(self, operation: op.PageStatus) -> None:
        log_by_level = {"error": self._node.log.error, "warning": self._node.log.warning}
        log_by_level.get(operation.level, self._node.log.info)("%s", op.log_text(operation.msg))

    def _reject(self, error: NepError) -> None:
        # Logged at increasing intervals: a page can send any number of invalid operations.
        self._counts.rejected += 1
        self._rejected_count += 1
        if is_logged(self._rejected_count):
            _logger.warning("page '%s': %s (%d so far)", self.name, error, self._rejected_count)
        operation_error = error if isinstance(error, op.OperationError) else op.OperationError(str(error))
        self._context.send_status(operation_error.level, str(operation_error), operation_error.id)


async def authenticate(connection: ServerConnection, verifier: AuthVerifier) -> bool:
    """Return True if the client's first message is a valid ``auth`` operation.

    Returns False if the message does not arrive within the time limit, or the connection is closed.
    """
    try:
        data = await asyncio.wait_for(connection.recv(decode=False), AUTH_TIMEOUT_S)
        return isinstance(auth := op.parse(bytes(data)), op.Auth) and verifier.verify(auth)
    except (op.OperationError, asyncio.TimeoutError, ws_exceptions.ConnectionClosed):
        return False


def _ignore_auth(_operation: op.Auth) -> None:
    """Ignore credentials on a connection that does not require them."""
