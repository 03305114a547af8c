"""Server for a ROS 2 service. Requests are read in the participant's thread."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from nep.backends.bases.server import BaseServer
from nep.backends.ros2.participant import Participant
from nep.backends.ros2.publisher import wait_for_matches
from nep.backends.ros2.services.channel import CallId, ReceivedSample, ServiceChannel
from nep.backends.ros2.services.definitions import service_type_for
from nep.backends.services import (
    ServerSpec,
    limit_reply_size,
)
from nep.errors import NepError
from nep.protocol.requests import PublisherRecord
from nep.protocol.service_wire import SERVICE_TYPE, CallKind, Reply, error_reply, topic_of

_logger = logging.getLogger("nep")
_MATCH_TIMEOUT_S = 1.0
"""Maximum time in seconds that a response waits for a match with the client's reader."""
_POLL_S = 0.01


class Ros2Server(BaseServer):
    """Server with a call queue. The constructor raises `BadTopicError` or `NepError`."""

    def __init__(
        self,
        participant: Participant,
        node_id: str,
        spec: ServerSpec,
        on_close: Callable[[Ros2Server], object],
    ) -> None:
        super().__init__(spec)
        self.endpoints = ("ros2",)
        self._on_close = on_close
        self._participant = participant
        self._type = service_type_for(participant.types, spec.msg_type)
        self._channel = ServiceChannel(
            participant, node_id, spec.service, self._type, spec.id, on_sample=self._handle_request
        )
        try:
            wait_for_matches(participant, self._channel.discovered_peers, lambda: self._channel.entities)
        except BaseException:  # also Ctrl+C: the caller has no object to close yet
            self._channel.close()
            raise

    @property
    def record(self) -> PublisherRecord:
        """Registration record of the server, for the graph."""
        return PublisherRecord(
            self.spec.id, topic_of(self.spec.service), self._type.name, SERVICE_TYPE, self.endpoints
        )

    def _handle_request(self, sample: ReceivedSample) -> None:
        # Runs in the participant's thread, with its lock held.
        try:
            request = self._type.decode_call(sample.cdr)
        except NepError as error:
            self._count_malformed(error)
            self._reply(sample, error_reply(CallKind.REJECTED, "", str(error)))
            return
        self._enqueue(self._new_call(*request, lambda reply: self._reply(sample, limit_reply_size(reply))))

    def _reply(self, sample: ReceivedSample, reply: Reply) -> bool:
        cdr: bytes | None = None
        if self._type.is_nep or reply.kind == CallKind.REPLY:
            try:
                cdr = self._type.encode_reply(reply)
            except NepError as error:  # the callback's result doesn't fit the type
                reply = error_reply(CallKind.ERROR, type(error).__name__, str(error))
        self.stats.add(reply)
        if self._channel.is_closed:
            return False
        self._wait_for_match(sample)
        try:
            self._write(sample.id, cdr, reply)
        except (NepError, self._participant.dds.core.DDSException) as error:
            _logger.warning("can't send a reply of '%s': %s", self.spec.service, error)
            return False
        return True

    def _write(self, call: CallId, cdr: bytes | None, reply: Reply) -> None:
        if cdr is not None:
            self._channel.send(call, cdr)
        else:  # ROS has no form for errors: its clients wait until their timeout
            self._channel.send_failure(call, reply)

    def _wait_for_match(self, sample: ReceivedSample) -> None:
        # The client's reader may be discovered later than its writer.
        if sample.writer is None or "nepid" in sample.writer.user_data:
            return  # disconnected, or a nep client, which waits for the match itself
        deadline = time.monotonic() + _MATCH_TIMEOUT_S
        with self._participant.changed:
            while not self._channel.is_closed and not self._channel.can_reply_to(sample.writer):
                remaining_s = deadline - time.monotonic()
                if remaining_s <= 0.0 or self._participant.is_own_thread():
                    return
                self._participant.changed.wait(min(remaining_s, _POLL_S))

    # ---- closing

    def close(self, timeout_s: float) -> None:
        """Close the server; wait up to `timeout_s` seconds for acknowledgements of responses. Idempotent."""
        self.begin_close()
        if self.is_closed:
            return
        self._channel.finish(timeout_s)
        self.is_closed = True
        self._channel.close()
        self._on_close(self)
