"""Services that a page calls and serves."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from nep.errors import NepError
from nep.i18n import _
from nep.patterns.services.client import Client
from nep.patterns.services.server import Server
from nep.programs.web.context import PageContext
from nep.programs.web.limits import MAX_CALLS, MAX_SERVICES
from nep.programs.web.messages.operations import (
    AdvertiseService,
    CallService,
    OperationError,
    OperationId,
    ServiceResponse,
    UnadvertiseService,
)
from nep.programs.web.outgoing import EncodingOptions, operation_frames
from nep.programs.web.rosbridge.rosapi import RosApi, is_rosapi
from nep.text import bounded_str, quotable

RespondCallback = Callable[[CallService, object, bool], None]
"""Function that sends the result of a call to the page: (operation, values or reason, success).

Raises `NepError` if the result can't be encoded.
"""


class ServiceFailedError(NepError):
    """Error for a call that the page rejected or can no longer answer."""


class PageServices:
    """Services that one page calls and serves. Methods raise `NepError` for invalid requests."""

    def __init__(self, context: PageContext, respond: RespondCallback | None = None) -> None:
        """Initialize the services.

        Args:
            context: Shared objects of the connection.
            respond: Sends the result of a call in another protocol; None for rosbridge.
        """
        self._context = context
        self._send_response = respond or self._respond
        self._loop = asyncio.get_running_loop()
        self._clients: dict[str, Client] = {}
        self._call_tasks: set[asyncio.Task[None]] = set()
        self._servers: dict[str, Server] = {}
        self._pending_calls: dict[OperationId, tuple[str, Future[object]]] = {}
        self._call_numbers = itertools.count(1)

    # ---- calling

    def call(self, operation: CallService) -> None:
        """Start a call to a service without waiting; the reply is sent to the page later."""
        if len(self._call_tasks) >= MAX_CALLS:
            raise OperationError(
                _("this page already has {count} calls in flight, the maximum").format(count=MAX_CALLS),
                operation.id,
            )
        task = asyncio.create_task(self._call(operation))
        self._call_tasks.add(task)
        task.add_done_callback(self._call_tasks.discard)

    async def _call(self, operation: CallService) -> None:
        try:
            values, is_success = await self._call_service(operation), True
        except Exception as error:  # noqa: BLE001 - a reply of any kind must not close the page
            values, is_success = str(error) or type(error).__name__, False
        try:
            self._send_response(operation, values, is_success)
        except NepError as error:
            self._send_response(operation, str(error), False)

    async def _call_service(self, operation: CallService) -> object:
        if is_rosapi(operation.service):
            api = RosApi(self._context.node, self._context.motion_denial_reason)
            return await self._context.run_in_thread(api.execute, operation.service, operation.args)
        client = self._clients.pop(operation.service, None)
        if client is None:
            client = await self._context.run_in_thread(self._context.node.new_client, operation.service)
        self._clients[operation.service] = client
        while len(self._clients) > MAX_SERVICES:
            await self._context.run_in_thread(self._clients.pop(next(iter(self._clients))).close)
        return await client.acall(operation.args, operation.timeout_s)

    def _respond(self, operation: CallService, values: object, is_success: bool) -> None:
        response = {
            "op": "service_response",
            "service": operation.service,
            "values": values,
            "result": is_success,
        }
        if operation.id is not None:
            response["id"] = operation.id
        options = EncodingOptions(operation.compression, operation.fragment_size)
        self._context.queue.put(operation_frames(response, options))

    # ---- serving

    async def advertise(self, operation: AdvertiseService) -> None:
        """Serve a service on behalf of the page. Has no effect if the page already serves it.

        Raises `OperationError` for a service of rosapi, or if the page already serves `MAX_SERVICES`
        services.
        """
        if is_rosapi(operation.service):
            raise OperationError(_("a page can't provide services of rosapi"), operation.id)
        if operation.service in self._servers:
            return
        if len(self._servers) >= MAX_SERVICES:
            raise OperationError(
                _("this page already serves {count} services, the maximum").format(count=MAX_SERVICES),
                operation.id,
            )
        callback = partial(self._forward_call, operation.service)
        self._servers[operation.service] = await self._context.run_in_thread(
            self._context.node.new_server, operation.service, callback, threads=1
        )
        message = _("serving '{service}'").format(service=operation.service)
        self._context.send_status("info", message, operation.id)

    def _forward_call(self, service: str, request: object) -> Future[object]:
        """Forward a request to the page and return a future of its reply.

        Called in a thread of the service's server.
        """
        future: Future[object] = Future()
        self._loop.call_soon_threadsafe(self._send_call, service, request, future)
        return future

    def _send_call(self, service: str, request: object, future: Future[object]) -> None:
        if len(self._pending_calls) >= MAX_CALLS:
            future.set_exception(ServiceFailedError(_("the page has too many pending calls")))
            return
        id_ = f"call:{next(self._call_numbers)}"
        call = {"op": "call_service", "id": id_, "service": service, "args": request}
        try:
            frames = operation_frames(call, EncodingOptions())
        except NepError as error:
            future.set_exception(error)
            return
        self._pending_calls[id_] = service, future
        self._context.queue.put(frames)

    def respond(self, operation: ServiceResponse) -> None:
        """Forward a reply of the page to the caller.

        Raises `OperationError` if no such call is pending.
        """
        service, future = self._pending_calls.get(operation.id, ("", None))
        if future is None or service != operation.service:
            raise OperationError(
                _("no pending call of '{service}' has this id").format(service=quotable(operation.service)),
                operation.id,
            )
        del self._pending_calls[operation.id]
        if operation.is_success:
            future.set_result(operation.values)
        else:
            reason = operation.values
            message = bounded_str(reason) if reason else _("the page reported an error without a reason")
            future.set_exception(ServiceFailedError(message))

    async def unadvertise(self, operation: UnadvertiseService) -> None:
        """Stop serving a service; pending calls fail."""
        server = self._servers.pop(operation.service, None)
        if server is None:
            raise OperationError(
                _("this page doesn't serve '{service}'").format(service=quotable(operation.service)),
                operation.id,
                "warning",
            )
        self._fail_pending(operation.service)
        await self._context.run_in_thread(server.close)

    def cancel(self) -> None:
        """Cancel all calls after the page has disconnected.

        The page's node closes servers and clients.
        """
        for task in self._call_tasks:
            task.cancel()
        self._fail_pending()

    def _fail_pending(self, service: str = "") -> None:
        for id_, (name, future) in list(self._pending_calls.items()):
            if service in {"", name}:
                del self._pending_calls[id_]
                future.set_exception(
                    ServiceFailedError(_("the page that provides the service has disconnected"))
                )
