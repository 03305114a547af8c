"""Publisher over a DDS writer."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable, Sequence
from typing import Any

from nep.backends.base import HANDSHAKE_TIMEOUT_S, PublisherSpec, SubscriberSpec
from nep.backends.bases.publisher import BasePublisher
from nep.backends.ros2.library import has_forked
from nep.backends.ros2.names import dds_topic, dds_type, encode_user_data
from nep.backends.ros2.participant import DdsEndpoint, Participant
from nep.backends.ros2.quality import qos_policies, queue_depth
from nep.backends.ros2.topics import create_sample
from nep.backends.ros2.type_mapping import mapping_for
from nep.errors import ClosedError, WireError
from nep.i18n import _
from nep.messages.encoded import Encoded
from nep.protocol.requests import PublisherRecord

_logger = logging.getLogger("nep")
_PLAIN_TYPE = re.compile(r"[\w./-]{1,100}", re.ASCII)
_READY_DELAY_S = 0.1
"""Time in seconds after discovery until programs without nep are assumed to be ready to receive."""
_POLL_S = 0.01


def wait_for_matches(
    participant: Participant, endpoints: Sequence[DdsEndpoint], entities: Callable[[], Sequence[Any]]
) -> tuple[str, ...]:
    """Wait up to `HANDSHAKE_TIMEOUT_S` seconds until the known endpoints are matched with ours.

    Programs without nep don't report their matches, so `_READY_DELAY_S` is added for them.

    Args:
        participant: Participant of this process.
        endpoints: Endpoints to wait for.
        entities: Returns our writers or readers.

    Returns:
        Names of the nodes whose endpoints are not matched.
    """
    deadline = time.monotonic() + HANDSHAKE_TIMEOUT_S
    expected = [(each.gid, each.participant, "nepid" in each.user_data) for each in endpoints]
    with participant.changed:
        while (unmatched_gids := participant.matches.unmatched_gids(entities(), expected)) and (
            remaining_s := deadline - time.monotonic()
        ) > 0.0:
            participant.changed.wait(min(remaining_s, _POLL_S))
        if any(each.participant != participant.gid and "nepid" not in each.user_data for each in endpoints):
            ready_at = time.monotonic() + _READY_DELAY_S
            while (remaining_s := ready_at - time.monotonic()) > 0.0:
                participant.changed.wait(remaining_s)
        return participant.remote_node_names(unmatched_gids)


def endpoint_user_data(type_hash: str, node_id: str, spec: PublisherSpec | SubscriberSpec) -> bytes:
    """Return the USER_DATA of a writer or reader, with the entries for ROS 2 and for nep.

    Args:
        type_hash: Type hash of the ROS type.
        node_id: Id of the node.
        spec: Settings of the publisher or subscriber.
    """
    entries = {"typehash": type_hash, "nepnode": node_id, "nepid": f"{spec.id:x}"}
    if _PLAIN_TYPE.fullmatch(spec.msg_type):
        entries["neptype"] = spec.msg_type
    return encode_user_data(entries)


class Ros2Publisher(BasePublisher):
    """Publisher over a DDS writer. The constructor raises `BadTopicError` or `NepError`."""

    def __init__(
        self,
        participant: Participant,
        node_id: str,
        spec: PublisherSpec,
        on_close: Callable[[Ros2Publisher, float], None],
    ) -> None:
        super().__init__(spec, participant.changed)
        self._participant = participant
        self._node_id = node_id
        self._on_close = on_close
        self._mapping = mapping_for(spec.msg_type)
        self._ids_by_handle: dict[int, str] = {}
        self._is_closed = False
        library = participant.dds
        name, ros_type = dds_topic(spec.topic), self._mapping.ros_type
        type_hash = participant.types.type_hash(ros_type)
        user_data = endpoint_user_data(type_hash, node_id, spec)
        depth = queue_depth(spec.qos, spec.codec)
        with participant.changed:
            self._sample_class = participant.topics.sample_class(ros_type)
            self._writer: Any = library.pub.DataWriter(
                participant.entity,
                participant.topics.topic(name, ros_type),
                participant.qos(
                    *qos_policies(
                        library,
                        spec.qos,
                        depth,
                        is_latched=spec.is_latched,
                        user_data=user_data,
                        history=spec.history,
                    )
                ),
            )
            participant.assign(node_id, "writer", self._writer)
        is_reliable = spec.qos in ("", "reliable")
        expected = [
            each
            for each in participant.endpoints("reader", name)
            if each.has_type(dds_type(ros_type), type_hash)
            and (is_reliable or not each.is_reliable)
            and (spec.is_latched or not each.is_latched)
        ]
        try:
            self.missing = wait_for_matches(participant, expected, lambda: [self._writer])
        except BaseException:  # also Ctrl+C: the caller has no object to close yet
            self.finish(0.0)
            raise

    @property
    def record(self) -> PublisherRecord:
        """Registration record of the publisher, for the graph."""
        spec = self.spec
        return PublisherRecord(
            spec.id, spec.topic, spec.msg_type, spec.codec.name, ("ros2",), spec.is_latched
        )

    @property
    def subscribers(self) -> int:
        """Number of matched subscribers; 0 once closed.

        The two readers of a nep subscriber count as one.
        """
        with self._participant.changed:
            if self._is_closed:
                return 0
            handles = self._writer.get_matched_subscriptions()
            self._ids_by_handle = {
                each: self._ids_by_handle.get(each) or self._id_of(each) for each in handles
            }
            return len(set(self._ids_by_handle.values()))

    def _id_of(self, handle: int) -> str:
        data = self._writer.get_matched_subscription_data(handle)
        user_data = {} if data is None else self._participant.to_endpoint(data).user_data
        return user_data.get("nepid") or f"handle {handle}"

    @property
    def has_subscribers(self) -> bool:
        """True if any reader is matched."""
        with self._participant.changed:
            return not self._is_closed and bool(self._writer.get_matched_subscriptions())

    def send(self, encoded: Encoded) -> None:
        """Publish a message. Blocks for up to 0.1 s while the queue of a slow reader is full.

        Raises `ClosedError`, and `WireError` if the data isn't a message of the ROS type.
        """
        cdr = self._mapping.pack(encoded)
        sample = create_sample(self._sample_class, cdr)
        if self._is_closed:
            raise ClosedError(f"publisher '{self.spec.topic}'")
        try:
            self._writer.write(sample, time.time_ns())
        except self._participant.dds.core.DDSException as error:
            if self._is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'") from error
            dds_exception = self._participant.dds.core.DDSException
            if error.code == dds_exception.DDS_RETCODE_BAD_PARAMETER:  # cyclonedds validates every message
                raise WireError(
                    _("the bytes aren't a message of type '{name}'").format(name=self._mapping.ros_type),
                    len(cdr),
                ) from error
            if error.code != dds_exception.DDS_RETCODE_TIMEOUT:
                raise
        with self._participant.changed:
            self._count_locked(len(encoded.data))

    def close(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for acknowledgements and close. Must be called only once."""
        self._on_close(self, timeout_s)

    def finish(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for acknowledgements and delete the writer. Idempotent."""
        if self._is_closed or has_forked():
            return
        if self._participant.has_closed():
            self._is_closed = True
            return
        if self.spec.qos in ("", "reliable") and timeout_s > 0.0:
            # `wait_for_acks` raises on timeout (cyclonedds 11.0.1)
            wait_for_acks = self._writer._wait_for_acks  # noqa: SLF001
            if wait_for_acks(self._writer._ref, int(min(timeout_s, 3600.0) * 1e9)):  # noqa: SLF001
                _logger.warning("'%s' was closed before all subscribers received everything", self.spec.topic)
        with self._participant.changed:
            if not self._is_closed:
                self._is_closed = True
                if self._participant.has_closed():
                    return
                self._participant.remove_endpoint(self._node_id, "writer", self._writer)
