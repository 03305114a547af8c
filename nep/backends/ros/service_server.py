"""Server for a ROS service. Each connection has a thread of rospy that waits for the reply."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

from nep.backends.bases.server import BaseServer
from nep.backends.ros.process import RosProcess
from nep.backends.ros.service_types import NEP_CALL, ServiceType, service_type_for
from nep.backends.services import (
    ServerSpec,
    limit_reply_size,
)
from nep.errors import NepError
from nep.i18n import _
from nep.protocol.service_wire import CallKind, Reply, error_reply, read_error_reply


class _PendingReply:
    # Reply for which a thread of rospy waits.
    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._body: bytes | None = None
        self._reason = ""

    def set_result(self, body: bytes | None, reason: str = "") -> bool:
        # Sets the response, or None and the error. Returns False if it was already set.
        with self._lock:
            if self._ended.is_set():
                return False
            self._body, self._reason = body, reason
            self._ended.set()
            return True

    def wait(self) -> tuple[bytes | None, str]:
        self._ended.wait()
        return self._body, self._reason


class RosServer(BaseServer):
    """Server with a call queue."""

    def __init__(
        self, process: RosProcess, spec: ServerSpec, on_close: Callable[[RosServer], object]
    ) -> None:
        super().__init__(spec)
        self.process = process
        self.service = process.resolve_name(spec.service)
        self._on_close = on_close
        self._type = service_type_for(spec.msg_type)
        self._changed = threading.Condition(threading.Lock())
        self._pending_replies: set[_PendingReply] = set()
        self._unregister_thread: threading.Thread | None = None
        process.shutdown_callbacks.add(self._on_rospy_shutdown)
        self._response = _message_class(process.rospy, f"{self._type.name}Response", self._type)
        self._rospy_service: Any = process.create_server(self.service, _service_class(process.rospy,
        self._type,
            self._response), self._handle)  # fmt: skip

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Address of the server."""
        return (str(self._rospy_service.uri),)

    # ---- callbacks of rospy, in a thread per connection

    def _handle(self, request: Any) -> Any:  # noqa: ANN401 - rospy is not typed
        pending_reply = _PendingReply()
        with self._changed:
            self._pending_replies.add(pending_reply)
        try:
            self._queue_call(request.body, pending_reply)
            body, reason = pending_reply.wait()
            if body is None:
                raise self.process.rospy.ServiceException(reason)  # rospy sends it to the client
            response = self._response()
            response.body = body
            return response
        finally:
            with self._changed:
                self._pending_replies.discard(pending_reply)
                self._changed.notify_all()

    def _queue_call(self, body: bytes, pending_reply: _PendingReply) -> None:
        # Queues the call or rejects it.
        try:
            call = self._type.decode_call(body)
        except NepError as error:
            self._reply(pending_reply, error_reply(CallKind.REJECTED, "", str(error)))
            return
        incoming = self._new_call(*call, lambda reply: self._reply(pending_reply, limit_reply_size(reply)))
        if self.is_closed:
            self._reject(incoming)
        else:
            self._enqueue(incoming)

    def _reply(self, pending_reply: _PendingReply, reply: Reply) -> bool:
        body: bytes | None = None
        if self._type is NEP_CALL or reply.kind == CallKind.REPLY:
            try:
                body = self._type.encode_reply(reply)
            except NepError as error:  # the callback's result doesn't fit the type
                reply = error_reply(CallKind.ERROR, type(error).__name__, str(error))
        self.stats.add(reply)
        if body is not None:
            return pending_reply.set_result(body)
        return pending_reply.set_result(None, ": ".join(filter(None, read_error_reply(reply.data))))

    # ---- closing

    def begin_close(self) -> None:
        """Unregister the server and reject its queued calls."""
        with self._changed:
            if self._unregister_thread is not None:
                return
            thread = threading.Thread(target=self._unregister, name="nep-ros-unregister", daemon=True)
            with contextlib.suppress(RuntimeError):  # see `process.run_with_timeout`
                thread.start()
                self._unregister_thread = thread
        super().begin_close()

    def _on_rospy_shutdown(self) -> None:
        self.is_closed = True
        super().begin_close()

    def _unregister(self) -> None:
        if not self.process.is_shut_down:
            with contextlib.suppress(Exception):  # rospy has logged it
                self._rospy_service.shutdown()

    def close(self, timeout_s: float) -> None:
        """Close the server; pending replies are sent for up to `timeout_s` seconds."""
        deadline = time.monotonic() + timeout_s
        self.begin_close()
        if self._unregister_thread is not None:
            self._unregister_thread.join(max(0.0, timeout_s))
        with self._changed:
            self._changed.wait_for(lambda: not self._pending_replies, max(0.0, deadline - time.monotonic()))
            self.is_closed = True
            for pending_reply in self._pending_replies:
                pending_reply.set_result(None, _("the server is closing"))
        self.process.shutdown_callbacks.discard(self._on_rospy_shutdown)
        self._on_close(self)


def _message_class(rospy: Any, name: str, kind: ServiceType) -> type:  # noqa: ANN401 - rospy is not typed
    # Creates a message class whose instances contain encoded bodies.
    def serialize(message: Any, buffer: Any) -> None:  # noqa: ANN401 - rospy is not typed
        buffer.write(message.body)

    def deserialize(message: Any, body: bytes) -> Any:  # noqa: ANN401 - rospy is not typed
        message.body = bytes(body)
        return message

    return type(
        "EncodedBody",
        (rospy.msg.genpy.Message,),
        {
            "__slots__": ["body"], "_slot_types": ["uint8[]"], "_has_header": False, "_type": name,
            "_md5sum": kind.md5sum, "_full_text": "", "serialize": serialize, "deserialize": deserialize,
        },
    )  # fmt: skip


def _service_class(rospy: Any, kind: ServiceType, response: type) -> type:  # noqa: ANN401 - rospy is not typed
    return type(
        "EncodedService",
        (),
        {
            "_type": kind.name,
            "_md5sum": kind.md5sum,
            "_request_class": _message_class(rospy, f"{kind.name}Request", kind),
            "_response_class": response,
        },
    )
