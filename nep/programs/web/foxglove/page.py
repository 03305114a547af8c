"""Connection of Foxglove or Lichtblick with Foxglove's WebSocket protocol.

The server of the package foxglove-sdk (0.30.3) accepts every Origin and has no token, so any web page in the
user's browser could read all topics. Here, Foxglove's clients must pass the same checks as rosbridge's, and
share the code that publishes, calls services and guards robots. Encodings and schemas are the same as in
recordings (`nep.recordings.formats.channels`).
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from nep.errors import NepError
from nep.i18n import _
from nep.nodes.loop_wait import yield_to_loop
from nep.nodes.node import Node
from nep.programs.robots.guard import MotionGuard
from nep.programs.web.connection import PageConnection
from nep.programs.web.context import PageContext, PageTopic, WebCounts
from nep.programs.web.foxglove import protocol as wire
from nep.programs.web.foxglove.channels import ChannelFormat, Channels
from nep.programs.web.foxglove.graph import GraphUpdates
from nep.programs.web.limits import MAX_TOPICS
from nep.programs.web.messages import operations as op
from nep.programs.web.messages.ros_definitions import JSON_TYPE
from nep.programs.web.outgoing import Frame, encode_json
from nep.programs.web.rosbridge.page_services import PageServices
from nep.programs.web.rosbridge.page_topics import PageTopics
from nep.programs.web.rosbridge.rosapi import is_visible
from nep.programs.web.send_queue import QueuedMessage
from nep.system.lazy_import import lazy_module
from nep.system.log_rarely import is_logged
from nep.text import bounded_str, quotable

if TYPE_CHECKING:
    from websockets import exceptions as ws_exceptions
    from websockets.asyncio.server import ServerConnection
else:
    ws_exceptions = lazy_module("websockets.exceptions")

__all__ = ["ChannelFormat", "FoxglovePage"]

_logger = logging.getLogger("nep.programs.web")
_REFRESH_S = 1.0
_GRAPH_TIMEOUT_S = 2.0
_MAX_REASON_LENGTH = 1_000
_STATUS_LEVELS = {"info": 0, "warning": 1, "error": 2, "none": 0}
_ROS_TYPES = {
    "": JSON_TYPE,
    "nep.Text": "std_msgs/String",
    "nep.Bytes": "std_msgs/UInt8MultiArray",
    "foxglove.CompressedImage": "sensor_msgs/CompressedImage",
    "foxglove.RawImage": "sensor_msgs/Image",
}
"""ROS types by the Foxglove schema that has the same fields."""


class FoxglovePage(PageConnection):
    """Connection of a client with Foxglove's WebSocket protocol. Runs in the server's event loop.

    Args:
        connection: WebSocket connection.
        name: Name of the page's node.
        new_node: Creates the node.
        counts: Counters of the server.
        channels: Encoder of messages.
        guard: Motion guard that decides on which topics the client may publish.
        on_robot_rejected: Called with the name of a robot that the client may not move, and the reason.
    """

    protocol = "foxglove"

    def __init__(
        self,
        connection: ServerConnection,
        name: str,
        new_node: Callable[[str], Node],
        counts: WebCounts,
        *,
        channels: ChannelFormat,
        guard: MotionGuard,
        on_robot_rejected: Callable[[str, str], object],
    ) -> None:
        super().__init__(connection, name, new_node, counts)
        context = PageContext(
            self._node,
            self._queue,
            self._thread,
            guard,
            counts,
            on_robot_rejected=on_robot_rejected,
            send_status=self._send_status,
        )
        self._context = context
        self._channels = Channels(context, channels, self._send_fields)
        self._topics = PageTopics(context)
        self._services = PageServices(context, self._respond)
        self._advertised: dict[int, op.Advertise] = {}
        """Advertised topics of the client by channel id."""
        self._updates = GraphUpdates()
        self._rejected_count = 0
        self._disconnected = asyncio.Event()

    @property
    def _topic_list(self) -> tuple[PageTopic, ...]:
        return (*self._channels.subscribed_topics, *self._topics.topics)

    async def run(self) -> None:
        """Serve the client until it disconnects, and close its node."""
        self._send_fields(
            {
                "op": "serverInfo",
                "name": "NEP",
                "capabilities": wire.CAPABILITIES,
                "supportedEncodings": [wire.ENCODING],
                "metadata": {},
                "sessionId": str(time.time_ns()),
            }
        )
        tasks = [asyncio.create_task(self._write()), asyncio.create_task(self._watch_graph())]
        try:
            await self._context.run_in_thread(self._log_connection)
            while True:
                await self._handle(await self._receive())
                await yield_to_loop()  # let other pages run
        except ws_exceptions.ConnectionClosed:
            return
        finally:
            self._disconnected.set()
            for task in tasks:
                task.cancel()
            self._channels.cancel()
            self._services.cancel()
            await self._close_node()

    def _send_fields(self, fields: Mapping[str, object]) -> None:
        self._queue.put([wire.control_frame(fields)])

    def _send_status(self, level: op.Level, message: str) -> None:
        self._send_fields({"op": "status", "level": _STATUS_LEVELS[level], "message": message})

    def _warn(self, message: str) -> None:
        self._send_status("warning", message)

    def _reject(self, error: NepError) -> None:
        self._counts.rejected += 1
        self._rejected_count += 1
        if is_logged(self._rejected_count):
            _logger.warning("page '%s': %s (%d so far)", self.name, error, self._rejected_count)
        self._send_status(error.level if isinstance(error, op.OperationError) else "error", str(error))

    async def _encode_frames(self, queued: QueuedMessage) -> list[Frame]:
        return await self._channels.encode_frames(queued)

    # ---- the graph

    async def _watch_graph(self) -> None:
        """Advertise and unadvertise topics and services as the graph changes."""
        while not self._disconnected.is_set():
            try:
                view = await self._context.run_in_thread(self._node.graph, _GRAPH_TIMEOUT_S)
                await self._channels.update(
                    {
                        topic: info.msg_type
                        for topic, info in view.topics.items()
                        if info.publishers and info.msg_type != "*" and is_visible(topic)
                    }
                )
                for message in self._updates.update(view):
                    self._send_fields(message)
            except NepError as error:  # the master is down: keep the last known graph
                _logger.debug("the page '%s' keeps its channels: %s", self.name, error)
            except Exception:
                _logger.exception("the channels of the page '%s' could not be updated", self.name)
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._disconnected.wait(), _REFRESH_S)

    # ---- requests of the client

    async def _handle(self, data: bytes) -> None:
        """Execute one message from the client. Never raises because of the message's content."""
        self._counts.operations += 1
        try:
            request = wire.parse(data)
            if isinstance(request, wire.ClientMessage):
                await self._publish(request)
            elif isinstance(request, wire.ServiceRequest):
                self._call(request)
            else:
                await self._execute(request)
        except NepError as error:
            self._reject(error)
        except Exception:
            _logger.exception("an operation of the page '%s' failed", self.name)
            self._reject(NepError(_("an operation failed because of an internal error of the server")))

    async def _execute(self, fields: Mapping[str, object]) -> None:
        name = str(fields.get("op"))
        if name in {"subscribeConnectionGraph", "unsubscribeConnectionGraph"}:
            self._updates.set_connections_enabled(is_enabled=name == "subscribeConnectionGraph")
            return
        for operation, field, execute in (
            ("subscribe", "subscriptions", self._subscribe),
            ("unsubscribe", "subscriptionIds", self._unsubscribe),
            ("advertise", "channels", self._advertise),
            ("unadvertise", "channelIds", self._unadvertise),
        ):
            if name == operation:
                for item in wire.as_list(fields.get(field)):
                    await execute(item)
                return
        raise NepError(_("the operation '{op}' isn't supported here").format(op=quotable(name)))

    async def _subscribe(self, request: object) -> None:
        if not isinstance(request, dict):
            raise NepError(_("a subscription needs 'id' and 'channelId'"))
        await self._channels.subscribe(request.get("id"), request.get("channelId"))

    async def _unsubscribe(self, id_: object) -> None:
        if isinstance(id_, int):
            await self._channels.unsubscribe(id_)

    # ---- publishing

    async def _advertise(self, channel: object) -> None:
        fields = channel if isinstance(channel, dict) else {}
        id_, schema_name = fields.get("id"), fields.get("schemaName")
        if type(id_) is not int or not 0 <= id_ <= wire.MAX_ID or id_ in self._advertised:
            raise NepError(
                _("a channel needs an 'id' that is a whole number from 0 to {most} and not in use").format(
                    most=wire.MAX_ID
                )
            )
        if fields.get("encoding") != wire.ENCODING:
            raise NepError(
                _("messages with the encoding '{encoding}' can't be published; use 'json'").format(
                    encoding=quotable(fields.get("encoding"))
                )
            )
        if len(self._advertised) >= MAX_TOPICS:
            raise NepError(
                _("this page already publishes {count} topics, the maximum").format(count=MAX_TOPICS)
            )
        topic, schema = fields.get("topic"), schema_name if isinstance(schema_name, str) else ""
        advertised_type = self._channels.ros_type(topic, schema) if isinstance(topic, str) else ""
        ros_type = advertised_type or _ROS_TYPES.get(schema, schema)
        operation = op.parse_operation({"op": "advertise", "topic": topic, "type": ros_type, "id": id_})
        if isinstance(operation, op.Advertise):
            self._advertised[id_] = operation  # even if it is rejected: the robot may be allowed later
            await self._topics.advertise(operation)

    async def _unadvertise(self, id_: object) -> None:
        advertisement = self._advertised.pop(id_, None) if isinstance(id_, int) else None
        if advertisement is None:
            raise NepError(_("unknown channel id {id}").format(id=quotable(id_)))
        if self._topics.is_advertised(advertisement.topic):
            await self._topics.unadvertise(op.Unadvertise(advertisement.id, advertisement.topic))

    async def _publish(self, message: wire.ClientMessage) -> None:
        advertisement = self._advertised.get(message.channel_id)
        if advertisement is None:
            raise NepError(_("unknown channel id {id}").format(id=message.channel_id))
        msg = op.parse_json(message.data)
        if not self._topics.is_advertised(advertisement.topic):
            await self._topics.advertise(advertisement)
        await self._topics.publish(op.Publish(advertisement.id, advertisement.topic, msg, len(message.data)))

    # ---- services

    def _call(self, request: wire.ServiceRequest) -> None:
        operation_id = f"{request.service_id}:{request.call_id}"
        operation = op.CallService(operation_id, self._updates.service_name(request.service_id), {})
        try:
            if not operation.service:
                raise NepError(_("unknown service id {id}").format(id=request.service_id))
            if request.encoding != wire.ENCODING:
                raise NepError(
                    _("requests with the encoding '{encoding}' can't be read; use 'json'").format(
                        encoding=quotable(request.encoding)
                    )
                )
            self._services.call(replace(operation, args=op.parse_json(request.data)))
        except NepError as error:
            self._counts.rejected += 1
            self._respond(operation, str(error), False)

    def _respond(self, operation: op.CallService, values: object, is_success: bool) -> None:
        service_id, call_id = map(int, str(operation.id).split(":"))
        if is_success:
            self._queue.put([wire.response_frame(service_id, call_id, encode_json(values))])
            return
        self._send_fields(
            {
                "op": "serviceCallFailure",
                "serviceId": service_id,
                "callId": call_id,
                "message": bounded_str(values, _MAX_REASON_LENGTH),
            }
        )
        # Lichtblick ignores failures of calls, so the reason is also sent as a status.
        self._send_status("warning", bounded_str(values, _MAX_REASON_LENGTH))
