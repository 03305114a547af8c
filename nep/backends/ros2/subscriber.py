"""Subscriber over a DDS reader, and a second reader for latching publishers.

A TRANSIENT_LOCAL reader isn't matched with volatile writers, and a VOLATILE reader doesn't receive
older messages. The first reader is therefore volatile; a second reader is added when a latching
publisher is discovered. A message received by both readers is counted once.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from nep.backends.base import SubscriberSpec
from nep.backends.bases.inbox import Inboxes, InboxSubscriber
from nep.backends.ros2.library import has_forked
from nep.backends.ros2.names import dds_topic, dds_type
from nep.backends.ros2.participant import Participant
from nep.backends.ros2.publisher import endpoint_user_data, wait_for_matches
from nep.backends.ros2.quality import qos_policies, queue_depth
from nep.backends.ros2.type_mapping import mapping_for
from nep.errors import WireError
from nep.messages.history import MAX_HISTORY
from nep.messages.message import Message, MessageKind, received_message
from nep.protocol.requests import SubscriberCount, SubscriberRecord
from nep.system.log_rarely import is_logged

_logger = logging.getLogger("nep")
_BATCH_SIZE = 256
_MAX_SOURCES = 4096
"""Maximum number of publishers that are tracked."""


def endpoint_id(gid: bytes, announced_id: str | None) -> int:
    """Return the id of a publisher or subscriber.

    Args:
        gid: GUID of the writer or reader.
        announced_id: Id in its USER_DATA, in hexadecimal; without a valid one, the id is derived from `gid`.
    """
    try:
        number = int(announced_id or "", 16)
    except ValueError:
        number = 0
    if 0 < number < 2**63:
        return number
    return int.from_bytes(hashlib.sha256(gid).digest()[:8], "little") >> 1 or 1


@dataclass
class _Source:
    # Publisher whose messages were received.
    id: int
    kind: MessageKind
    newest_stamp_ns: int = -1
    is_caught_up: bool = False
    held_messages: list[tuple[int, Message]] = field(default_factory=list)
    """Messages with their time stamps that arrived before the publisher's history and wait for it."""


class Ros2Subscriber(InboxSubscriber):
    """Subscriber over DDS readers. The constructor raises `BadTopicError` or `NepError`.

    Args:
        participant: Participant of the domain. Its lock is acquired before that of the inboxes.
        node_id: Id of the node.
        spec: Settings of the subscriber.
        inboxes: Shared state of the node's inboxes.
        on_close: Removes the closed subscriber from its transport.
    """

    def __init__(
        self,
        participant: Participant,
        node_id: str,
        spec: SubscriberSpec,
        inboxes: Inboxes,
        on_close: Callable[[Ros2Subscriber], None],
    ) -> None:
        super().__init__(spec, inboxes)
        self.received = self.refused = 0
        self._dropped_count = 0
        self._node_id = node_id
        self._on_close = on_close
        self._participant = participant
        self._mapping = mapping_for(spec.msg_type)
        self._type_hash = participant.types.type_hash(self._mapping.ros_type)
        self._dds_name = dds_topic(spec.topic)
        self._sources: dict[int, _Source] = {}
        self._readers: list[Any] = []
        self._lost_before_close = 0
        self._has_latched_reader = False
        writers = [
            each
            for each in participant.endpoints("writer", self._dds_name)
            if each.has_type(dds_type(self._mapping.ros_type), self._type_hash)
            and (each.is_reliable or spec.qos in ("best_effort", "sensor"))
        ]
        with participant.changed:
            self._add_reader_locked(is_latched=False)
            if any(each.is_latched for each in writers):
                self._add_reader_locked(is_latched=True)
        try:
            wait_for_matches(participant, writers, lambda: self._readers)
        except BaseException:  # also Ctrl+C: the caller has no object to close yet
            self.close()
            raise

    def _add_reader_locked(self, *, is_latched: bool) -> None:
        # Call with the participant's lock held.
        participant, spec = self._participant, self.spec
        self._has_latched_reader = self._has_latched_reader or is_latched
        library, core = participant.dds, participant.dds.core
        user_data = endpoint_user_data(self._type_hash, self._node_id, spec)
        depth = max(queue_depth(spec.qos, self._mapping.codec), MAX_HISTORY if is_latched else 0)
        reader = library.sub.DataReader(
            participant.entity,
            participant.topics.topic(self._dds_name, self._mapping.ros_type),
            participant.qos(
                *qos_policies(library, spec.qos, depth, is_latched=is_latched, user_data=user_data)
            ),
        )
        self._readers.append(reader)
        participant.assign(self._node_id, "reader", reader)
        condition = core.ReadCondition(
            reader, core.ViewState.Any | core.SampleState.Any | core.InstanceState.Any
        )
        participant.watch(reader, condition, lambda: self._read(reader, condition))

    def update_latched_reader(self) -> None:
        """Add the second reader if a latching publisher has appeared. Called in the participant's thread."""
        if not self._has_latched_reader and not self.is_closed:
            for handle in self._readers[0].get_matched_publications():
                if self._source(self._readers[0], handle).kind.is_latched:
                    self._add_reader_locked(is_latched=True)
                    return

    # ---- receiving

    def _read(self, reader: Any, condition: Any) -> None:  # noqa: ANN401 - cyclonedds is not typed
        # Runs in the participant's thread, with its lock held.
        while samples := reader.take(_BATCH_SIZE, condition):
            messages = [each for sample in samples for each in self._convert_sample(reader, sample)]
            if messages:
                self._enqueue(messages)
            if len(samples) < _BATCH_SIZE:
                return

    def _convert_sample(self, reader: Any, sample: Any) -> list[Message]:  # noqa: ANN401 - see above
        cdr = getattr(sample, "cdr", None)
        if cdr is None:
            return self._release_held(sample.sample_info.publication_handle)
        info = sample.sample_info
        source = self._source(reader, info.publication_handle)
        try:
            data = self._mapping.unpack(cdr)
        except WireError as error:
            self.refused += 1
            self.report(error.reason)
            if is_logged(self.refused):
                _logger.warning(
                    "malformed message on '%s' (%d so far): %s", self.spec.topic, self.refused, error
                )
            return []
        message = received_message(source.kind, data, info.source_timestamp, 0, source.id)
        message.seq = None  # DDS doesn't expose its sequence numbers
        if source.kind.is_latched:
            return self._merge_history(reader, source, message, info.source_timestamp)
        return [message]

    def _merge_history(self, reader: Any, source: _Source, message: Message, stamp_ns: int) -> list[Message]:  # noqa: ANN401 - see above
        # Merges the messages of a latching publisher: the history first, then the others, without duplicates.
        # Messages of the first reader are held until the second one has received the history.
        if reader is not self._readers[0] or not self._has_latched_reader:
            messages: list[tuple[int, Message]] = []
            if self._has_latched_reader:
                source.is_caught_up = True
                if source.held_messages and stamp_ns >= source.held_messages[0][0]:
                    messages, source.held_messages = source.held_messages, []
            messages.append((stamp_ns, message))
        elif source.is_caught_up:
            return []
        else:
            source.held_messages.append((stamp_ns, message))
            if len(source.held_messages) <= MAX_HISTORY:
                return []
            messages, source.held_messages = source.held_messages, []
        return self._without_duplicates(source, messages)

    def _without_duplicates(self, source: _Source, messages: list[tuple[int, Message]]) -> list[Message]:
        new_messages = []
        for stamp_ns, message in messages:
            if stamp_ns > source.newest_stamp_ns:
                source.newest_stamp_ns = stamp_ns
                new_messages.append(message)
        return new_messages

    def _release_held(self, handle: int) -> list[Message]:
        # A publisher has disappeared: deliver its held messages.
        source = self._sources.get(handle)
        if source is None or not source.held_messages:
            return []
        messages, source.held_messages = source.held_messages, []
        return self._without_duplicates(source, messages)

    def _source(self, reader: Any, handle: int) -> _Source:  # noqa: ANN401 - see above
        existing = self._sources.get(handle)
        if existing is not None:
            return existing
        sample = reader.get_matched_publication_data(handle)
        endpoint = None if sample is None else self._participant.to_endpoint(sample)
        is_latched = endpoint is not None and endpoint.is_latched
        source = _Source(
            endpoint_id(handle.to_bytes(8, "little", signed=handle < 0), None)
            if endpoint is None
            else endpoint_id(endpoint.gid, endpoint.user_data.get("nepid")),
            self._mapping.kind(self.spec.topic, self.spec.msg_type, is_latched=is_latched),
        )
        if endpoint is not None:
            if len(self._sources) >= _MAX_SOURCES:
                self._sources.pop(next(iter(self._sources)))
            self._sources[handle] = source
        return source

    def _enqueue(self, messages: list[Message]) -> None:
        with self._changed:
            if self.is_closed:
                return
            dropped = self._put_locked(*messages)
            self.received += len(messages) - dropped
            self._dropped_count += dropped

    # ---- statistics

    @property
    def lost(self) -> int | None:
        """Number of messages that DDS reports as lost or that were dropped from the full queue."""
        with self._participant.changed:
            return self._lost_before_close + self._lost_in_transit_count() + self._dropped_count

    def _lost_in_transit_count(self) -> int:
        if self.is_closed or has_forked() or self._participant.has_closed():
            return 0
        return sum(int(each.get_sample_lost_status().total_count) for each in self._readers)

    @property
    def record(self) -> SubscriberRecord:
        """Registration record of the subscriber, for the graph."""
        return SubscriberRecord(self.spec.id, self.spec.topic, self.spec.msg_type)

    def counts(self) -> SubscriberCount:
        """Return the statistics shown in the graph."""
        return SubscriberCount(self.spec.id, self.received, self.lost, self.problem)

    @property
    def gids(self) -> frozenset[bytes]:
        """GUIDs of the subscriber's readers."""
        with self._participant.changed:
            return frozenset() if self.is_closed else frozenset(each.guid.bytes for each in self._readers)

    def close(self) -> None:
        """Close the readers and discard unread messages."""
        if has_forked():
            return
        with self._participant.changed:
            self._lost_before_close += self._lost_in_transit_count()
            if not self._close_inbox():
                return
            if self._participant.has_closed():
                self._readers.clear()
            for reader in self._readers:
                self._participant.unwatch(reader)
                self._participant.remove_endpoint(self._node_id, "reader", reader)
            self._readers.clear()
        self._on_close(self)
