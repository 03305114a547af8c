"""Client for ROS 2 services. Without a configured type, the server's type is used.

DDS delivers a request to all servers of a service; the first response is used.
"""

from __future__ import annotations

import contextlib
import logging
import math
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass

from nep.backends.bases.deadlines import Deadlines
from nep.backends.bases.pending_calls import OutcomeCallback, PendingCall, PendingCalls
from nep.backends.ros2.names import dds_service, ros_service, service_type_name, service_type_of
from nep.backends.ros2.participant import Participant
from nep.backends.ros2.publisher import wait_for_matches
from nep.backends.ros2.services.channel import CallId, ReceivedSample, ServiceChannel
from nep.backends.ros2.services.definitions import find_service_type
from nep.backends.services import ClientSpec, OpenCall, Outcome
from nep.errors import NepError, ServerGoneError
from nep.i18n import _
from nep.protocol.requests import SubscriberRecord
from nep.protocol.service_wire import SERVICE_TYPE, Reply, topic_of

_logger = logging.getLogger("nep")
_DISCOVERY_POLL_S, _SERVER_CHECK_S = 0.02, 0.1
"""Intervals in seconds: for discovering a server, and for checking that it still exists."""


@dataclass(eq=False)
class _Call(PendingCall):
    # Call in flight. `servers` may respond; None if it isn't sent yet.
    servers: frozenset[bytes] | None = None
    is_server_missing: bool = False


class Ros2Client(PendingCalls[_Call]):
    """Client with its calls in flight. The constructor raises `BadTopicError` or `NepError`.

    Lock order: the participant's lock before `_lock`.
    """

    def __init__(
        self,
        participant: Participant,
        node_id: str,
        spec: ClientSpec,
        deadlines: Deadlines,
        on_close: Callable[[Ros2Client], object],
    ) -> None:
        super().__init__(spec, _Call)
        self._participant = participant
        self._node_id = node_id
        self._deadlines = deadlines
        self._on_close = on_close
        self._request_topic, _response_topic = dds_service(spec.service)
        self._guid = secrets.randbits(63)
        self._channel: ServiceChannel | None = None
        given_name = service_type_name(spec.msg_type)
        self._specified_type = (
            None if given_name is None else find_service_type(participant.types, given_name)
        )
        try:
            channel: ServiceChannel | None = None
            with contextlib.suppress(NepError):  # reported by calls: another server may appear meanwhile
                channel = self._open_channel()
            if channel is not None:
                wait_for_matches(participant, channel.discovered_peers, lambda: channel.entities)
        except BaseException:  # also Ctrl+C: the caller has no object to close yet
            self.close()
            raise

    def _open_channel(self) -> ServiceChannel | None:
        # Returns None while the type is unknown: neither given nor announced by a server.
        with self._participant.changed:
            type_names = [
                name
                for each in self._participant.endpoints("reader", self._request_topic)
                if (name := service_type_of(each.type)) is not None
            ]
            type_name = (
                self._specified_type.name
                if self._specified_type is not None
                else next(iter(sorted(type_names)), "")
            )
            channel = self._channel
            if (
                not type_name
                or self.is_closed
                or (channel is not None and channel.service_type.name == type_name)
            ):
                return channel
            if channel is not None:
                channel.close()
            self._channel = ServiceChannel(
                self._participant,
                self._node_id,
                self.spec.service,
                self._specified_type or find_service_type(self._participant.types, type_name),
                self.spec.id,
                guid=self._guid,
                on_sample=self._handle_response,
                on_failure=self._handle_failure,
            )
            return self._channel

    @property
    def record(self) -> SubscriberRecord:
        """Registration record of the client, for the graph."""
        return SubscriberRecord(self.spec.id, topic_of(self.spec.service), SERVICE_TYPE)

    @property
    def is_connected(self) -> bool:
        """True if a server is ready for calls."""
        with self._participant.changed:
            if self.is_closed:
                return False
            if not self._ready_servers():
                with contextlib.suppress(NepError):  # the server's type is unknown here
                    self._open_channel()
            return bool(self._ready_servers())

    # ---- calling

    def start_call(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> OpenCall:
        """Send a call. See `ClientTransport.start_call`."""
        with self._lock:
            call = self._add_locked(data, timeout_s, callback)
        self._send_waiting_calls()
        self._deadlines.add(min(call.deadline, time.monotonic() + _DISCOVERY_POLL_S))
        return call

    def _send_waiting_calls(self) -> None:
        type_error: NepError | None = None
        with self._participant.changed:
            channel, servers = self._channel, self._ready_servers()
            if not servers:  # only without a ready server: listing all endpoints is slow
                try:
                    channel, servers = self._open_channel(), self._ready_servers()
                except NepError as error:  # the server's type is unknown here
                    type_error = error
            with self._lock:
                waiting_calls = [each for each in self._calls.values() if each.servers is None]
                for call in waiting_calls if servers else ():
                    call.servers, call.is_sent = servers, True
        if type_error is not None:
            for call in waiting_calls:
                self._finish(call, type_error)
        elif servers and channel is not None:
            for call in waiting_calls:
                self._send(channel, call)

    def _ready_servers(self) -> frozenset[bytes]:
        return frozenset() if self._channel is None else self._channel.ready_servers()

    def _send(self, channel: ServiceChannel, call: _Call) -> None:
        try:
            cdr = channel.service_type.encode_call(self.spec.codec, call.data, call.remaining_s)
            channel.send(CallId(self._guid, call.number), cdr)
        except NepError as error:
            self._finish(call, error)
        except self._participant.dds.core.DDSException as error:
            if not self.is_closed:
                reason = _("the call can't be sent: {reason}").format(reason=error)
                self._finish(call, NepError(reason))

    # ---- outcomes

    def _handle_response(self, sample: ReceivedSample) -> None:
        # Runs in the participant's thread.
        channel = self._channel
        if channel is None:
            return
        try:
            outcome: Outcome = channel.service_type.decode_reply(sample.cdr, self.spec.codec)
        except NepError as error:
            outcome = error
        self._finish_by_number(sample.id.number, outcome)

    def _handle_failure(self, call: CallId, reply: Reply) -> None:
        # Runs in the participant's thread: an error from a nep server.
        self._finish_by_number(call.number, reply)

    def _finish_by_number(self, number: int, outcome: Outcome) -> None:
        with self._lock:
            call = self._calls.get(number)
            self.late += call is None
        if call is not None:
            self._finish(call, outcome)

    def expire(self, now: float) -> float:
        """Send waiting calls, fail expired ones, and return the next deadline. See `ExpiringClient.expire`.

        A call also fails if its servers are missing in two consecutive checks.
        """
        with self._lock:
            is_waiting = any(each.servers is None for each in self._calls.values())
        if is_waiting:
            self._send_waiting_calls()
        with self._participant.changed:
            matched_servers = self._channel.matched_servers() if self._channel is not None else frozenset()
        with self._lock:
            calls = tuple(self._calls.values())
        for call in calls:
            is_server_gone = call.servers is not None and not call.servers & matched_servers
            if is_server_gone and call.is_server_missing:
                self._finish(call, ServerGoneError(self.spec.service))
            elif is_server_gone:
                call.is_server_missing = True  # its replies may have arrived, but not been read yet
        return super().expire(now)

    def _next_deadline_locked(self) -> float:
        now = time.monotonic()
        check_times = (
            now + (_SERVER_CHECK_S if each.is_sent else _DISCOVERY_POLL_S) for each in self._calls.values()
        )
        return min(super()._next_deadline_locked(), *check_times, math.inf)

    def service_names(self, timeout_s: float) -> tuple[str, ...]:  # noqa: ARG002 - immediate
        """Return the names of services that have a server."""
        names = (ros_service(each.topic) for each in self._participant.endpoints("reader"))
        return tuple(sorted({each for each in names if each is not None}))

    # ---- closing

    def close(self) -> None:
        """Unregister the client; calls in flight fail with `ClosedError`. Idempotent."""
        in_flight = self._begin_close()
        if in_flight is None:
            return
        self._deadlines.remove_client(self)
        if self._channel is not None:
            self._channel.close()
        self._on_close(self)
        self._fail_closed(in_flight)
