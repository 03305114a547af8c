"""Client for requests to a master over one DEALER socket. Thread-safe."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import zmq

from nep.backends.bases.rejections import RejectionCounter
from nep.backends.zeromq.sockets import CONNECT_TIMEOUT_MS, Socket
from nep.errors import ClosedError, MasterUnreachable, RequestRefusedError, WireError
from nep.i18n import _
from nep.protocol.encoding import call_of_reply, decode_reply, encode_request
from nep.protocol.requests import Push, RejectedReply, Reply, Request
from nep.system.addresses import endpoint_of, is_loopback
from nep.system.waits import wait_until

_logger = logging.getLogger("nep")

_MAX_MESSAGES_PER_READ = 50
"""Maximum number of replies read before other sockets are served."""
_RESEND_INTERVAL_S = 0.5
"""Interval in seconds for sending an unanswered request again, for example to a restarted master."""
_MAX_REQUESTS = 256

ReplyCallback = Callable[[Reply], None]


@dataclass
class PendingRequest:
    """Request in flight."""

    body: bytes
    has_waiter: bool
    callback: ReplyCallback | None = None
    reply: Reply | None = None
    is_sent: bool = False
    problem: str = ""
    """Reason why the reply can't be read."""


class ReceivedMessage(NamedTuple):
    """Message from the master.

    Attributes:
        content: Reply or notification.
        callback: Callback of the request that the message replies to, or None.
    """

    content: Reply | Push
    callback: ReplyCallback | None


class RpcClient:
    """Client for requests to a master.

    Args:
        socket: DEALER socket.
        address: Address of the master.
        after_use: Called when the socket may have input that its descriptor no longer signals.
    """

    def __init__(self, socket: Socket, address: str, after_use: Callable[[], None]) -> None:
        self.address = address
        self._socket = socket
        self._after_use = after_use
        self._requests: dict[int, PendingRequest] = {}
        self._numbers = itertools.count(1)
        self._is_closed = False
        self.rejections = RejectionCounter()
        self.has_more = False
        """True if `read` has left messages unread."""
        self.is_connected = False
        """True if a master was connected at the last `read`."""
        self._changed = threading.Condition(threading.Lock())
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.IMMEDIATE, 1)  # queue nothing while no master is connected
        socket.setsockopt(zmq.RECONNECT_IVL, 50)
        socket.setsockopt(zmq.RECONNECT_IVL_MAX, 400)
        if not is_loopback(address):  # a computer that loses power doesn't close its connections
            socket.setsockopt(zmq.HEARTBEAT_IVL, 1000)
            socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, 3000)
            socket.setsockopt(zmq.CONNECT_TIMEOUT, CONNECT_TIMEOUT_MS)
        self.endpoint = ""
        """Endpoint of the connection; "" before `connect`."""
        self.fd = int(socket.getsockopt(zmq.FD))

    @property
    def has_waiting_requests(self) -> bool:
        """True if a thread waits for a reply."""
        with self._changed:
            return any(each.has_waiter for each in self._requests.values())

    def connect(self, address: str) -> None:
        """Disconnect from the previous address and connect to `address`. Thread-safe."""
        with self._changed:
            if self._is_closed or self.endpoint == endpoint_of(address):
                return
            if self.endpoint:
                self._socket.disconnect(self.endpoint)
            self.endpoint = endpoint_of(address)
            self._socket.connect(self.endpoint)
        self._after_use()

    def reconnect(self) -> None:
        """Reconnect, because the local address has changed or the handshake has failed."""
        with self._changed:
            if self._is_closed or not self.endpoint:
                return
            self._socket.disconnect(self.endpoint)
            self._socket.connect(self.endpoint)
            self.is_connected = False

    def request(self, request: Request, timeout_s: float | None) -> Reply:
        """Send a request and wait for the reply.

        Args:
            request: Request to the master.
            timeout_s: Seconds to wait for the reply; None waits forever.

        Raises:
            MasterUnreachable: No reply arrived within `timeout_s`.
            RequestRefusedError: The master rejected the request.
            ClosedError: The client was closed in the meantime.
        """
        return self.wait(self.send_request(request), timeout_s)

    def send_request(self, request: Request) -> PendingRequest:
        """Send a request without waiting; return the object to pass to `wait`."""
        return self._send(request, has_waiter=True, callback=None)

    def wait(self, request: PendingRequest, timeout_s: float | None) -> Reply:
        """Wait for the reply to a request sent with `send_request`. Raises the same errors as `request`."""
        started_at = time.monotonic()
        with self._changed:
            while not wait_until(
                self._changed,
                lambda: request.reply is not None or bool(request.problem) or self._is_closed,
                _remaining_s(started_at, timeout_s),
            ):
                if timeout_s is not None and time.monotonic() - started_at >= timeout_s:
                    self._requests = {
                        number: each for number, each in self._requests.items() if each is not request
                    }
                    raise MasterUnreachable(self.address, timeout_s)
                request.is_sent = False  # requests are idempotent, so they may be resent
                self._flush_locked()
                self._after_use()
        if request.problem:
            reason = _("the master's reply can't be read: {reason}").format(reason=request.problem)
            raise RequestRefusedError(reason)
        if request.reply is None:
            raise ClosedError("the node")
        if isinstance(request.reply, RejectedReply):
            raise RequestRefusedError(request.reply.reason)
        return request.reply

    def notify(self, request: Request, callback: ReplyCallback | None = None) -> None:
        """Send a request without waiting; the request is dropped if no master is connected.

        Args:
            request: Request to the master.
            callback: Called with the reply in the I/O thread; None to ignore the reply.
        """
        self._send(request, has_waiter=False, callback=callback)

    def read(self) -> list[ReceivedMessage]:
        """Return up to `_MAX_MESSAGES_PER_READ` received messages and send pending requests.

        Call only in the I/O thread.
        """
        messages: list[ReceivedMessage] = []
        events = 0
        with self._changed:
            while not (has_more := len(messages) >= _MAX_MESSAGES_PER_READ):
                events = self._events()
                if events & zmq.POLLIN:
                    message = self._read_one_locked()
                    if message is not None:
                        messages.append(message)
                elif not self._flush_locked():  # zmq_send may consume input
                    break
            self.has_more = has_more
            self.is_connected = bool(events & zmq.POLLOUT)
        return messages

    def stop(self) -> None:
        """Fail all waiting requests with `ClosedError` and stop sending."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    def release(self) -> None:
        """Close the socket. The I/O thread must have stopped serving it."""
        with self._changed:
            self._is_closed = True
            self._socket.close(0)

    def _send(self, request: Request, *, has_waiter: bool, callback: ReplyCallback | None) -> PendingRequest:
        with self._changed:
            number = next(self._numbers)
            pending_request = PendingRequest(encode_request(request, number), has_waiter, callback)
            if self._is_closed:
                return pending_request
            self._requests[number] = pending_request
            if len(self._requests) > _MAX_REQUESTS:
                self._drop_oldest_locked()
            self._flush_locked()
            events = self._events()
            if events & zmq.POLLOUT and not pending_request.is_sent:
                self._flush_locked()  # the socket has just connected, and this was the only signal
                events = self._events()
        if events & zmq.POLLIN:
            self._after_use()
        return pending_request

    def _drop_oldest_locked(self) -> None:
        # Requests without a waiting thread would pile up while the master hangs.
        oldest_number = next((number for number, each in self._requests.items() if not each.has_waiter), None)
        if oldest_number is not None:
            del self._requests[oldest_number]

    def _flush_locked(self) -> bool:
        # Requests without a waiting thread are dropped if they can't be sent.
        # Returns True if anything was sent.
        has_sent = False
        for number, pending_request in list(self._requests.items()):
            if pending_request.is_sent or self._is_closed:
                continue
            try:
                self._socket.send(pending_request.body, zmq.DONTWAIT)
                pending_request.is_sent = has_sent = True
            except zmq.Again:
                if not pending_request.has_waiter:
                    del self._requests[number]
        return has_sent

    def _read_one_locked(self) -> ReceivedMessage | None:
        body = self._socket.recv_multipart(zmq.DONTWAIT)[-1]
        try:
            number, reply = decode_reply(body)
        except WireError as error:
            self._reject(error)
            rejected_request = self._requests.pop(call_of_reply(body) or 0, None)
            if rejected_request is not None:
                rejected_request.problem = error.reason
                self._changed.notify_all()
            return None
        pending_request = self._requests.pop(number, None)
        if pending_request is None or isinstance(reply, Push):
            return ReceivedMessage(reply, None)
        pending_request.reply = reply
        self._changed.notify_all()
        return ReceivedMessage(reply, pending_request.callback)

    def _reject(self, error: WireError) -> None:
        if self.rejections.add(error.reason):
            _logger.warning(
                "malformed message from the master at '%s' (%d so far): %s",
                self.address,
                self.rejections.count,
                error,
            )

    def _events(self) -> int:
        return 0 if self._socket.closed else int(self._socket.getsockopt(zmq.EVENTS))


def _remaining_s(started_at: float, timeout_s: float | None) -> float:
    if timeout_s is None:
        return _RESEND_INTERVAL_S
    return max(0.0, min(_RESEND_INTERVAL_S, started_at + timeout_s - time.monotonic()))
