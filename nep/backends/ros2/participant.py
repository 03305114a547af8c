"""DDS participant of this process in one domain, with a thread that reads for all its nodes.

As in ROS 2, `ros_discovery_info` announces the nodes with their writers and readers to other
participants. The USER_DATA of a writer or reader contains the type hash for ROS 2, and for other nep
programs the ids of the node and of the publisher or subscriber.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol, TypeVar

from nep.backends.base import HANDSHAKE_TIMEOUT_S, PublisherSpec, SubscriberSpec
from nep.backends.ros2.environment import MAX_PARTICIPANTS, cyclonedds_config, is_loopback_only
from nep.backends.ros2.library import Dds, load_dds, restrict_to_loopback
from nep.backends.ros2.matches import Matches
from nep.backends.ros2.message_types import MessageTypes, message_types
from nep.backends.ros2.names import decode_user_data, encode_user_data, split_node_name
from nep.backends.ros2.topics import DdsTopics, create_sample
from nep.backends.services import ClientSpec, ServerSpec
from nep.errors import DecodeError, NepError
from nep.i18n import _
from nep.protocol.requests import (
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    SubscriberCount,
    SubscriberRecord,
)
from nep.system import forks
from nep.system.descriptors import check_free_descriptors

_logger = logging.getLogger("nep")
_INFO_TYPE = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_INFO_TOPIC = "ros_discovery_info"
_MAX_PARTICIPANTS = 4096
"""Maximum number of other participants that are tracked."""
_FDS_PER_PARTICIPANT = 16
"""Number of file descriptors that a participant needs."""
_DISCOVERY_TIME_S = 0.3
"""Time in seconds that a new participant waits to discover others, which respond within milliseconds."""
_POLL_S = 0.01
_MAX_SAMPLES_PER_READ = 10_000


@dataclass(frozen=True)
class RosNode:
    """Node as announced in `ros_discovery_info`.

    Attributes:
        name: Full name of the node.
        gids: GUIDs of its writers and readers.
    """

    name: str
    gids: frozenset[bytes]


@dataclass(frozen=True)
class DdsEndpoint:
    """Discovered writer or reader, of this program or another one.

    Attributes:
        gid: GUID of the endpoint.
        participant: GUID of its participant.
        topic: Name of the DDS topic.
        type: Name of the DDS type.
        is_latched: True if its durability is not VOLATILE.
        is_reliable: True if its reliability is RELIABLE.
        user_data: Entries of its USER_DATA.
    """

    gid: bytes
    participant: bytes
    topic: str
    type: str
    is_latched: bool
    is_reliable: bool
    user_data: dict[str, str]

    def has_type(self, kind: str, type_hash: str) -> bool:
        """Return True if the endpoint's type is `kind` and its type hash, if announced, is `type_hash`."""
        return self.type == kind and self.user_data.get("typehash", type_hash) == type_hash


Spec_co = TypeVar("Spec_co", covariant=True)
Record_co = TypeVar("Record_co", covariant=True)
Count_co = TypeVar("Count_co", covariant=True)


class LocalEndpoint(Protocol[Spec_co, Record_co, Count_co]):
    """Interface of a publisher, subscriber, server or client of this process to the graph."""

    @property
    def spec(self) -> Spec_co:
        """Settings."""

    @property
    def record(self) -> Record_co:
        """Registration record."""

    def counts(self) -> Count_co:
        """Return the statistics shown in the graph."""


class LocalNode(Protocol):
    """Interface of a node of this process to its participant."""

    node: NodeRecord

    @property
    def publishers(self) -> Sequence[LocalEndpoint[PublisherSpec, PublisherRecord, PublisherCount]]:
        """Open publishers."""

    @property
    def subscribers(self) -> Sequence[LocalEndpoint[SubscriberSpec, SubscriberRecord, SubscriberCount]]:
        """Open subscribers."""

    @property
    def servers(self) -> Sequence[LocalEndpoint[ServerSpec, PublisherRecord, PublisherCount]]:
        """Open servers."""

    @property
    def clients(self) -> Sequence[LocalEndpoint[ClientSpec, SubscriberRecord, SubscriberCount]]:
        """Open clients."""

    def load(self) -> float | None:
        """Return the CPU load of the process as a share of one core; None if not measured yet."""

    def handle_endpoints_changed(self) -> None:
        """Handle added or removed endpoints. Called in the participant's thread with its lock held."""


@dataclass
class _Member:
    local_node: LocalNode
    gids: dict[str, set[bytes]] = field(default_factory=lambda: {"reader": set(), "writer": set()})


class Participant:
    """Participant of a DDS domain. The constructor raises `NepError` if Cyclone DDS can't start."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.dds: Dds = load_dds()
        self.types: MessageTypes = message_types()
        self.changed = threading.Condition(threading.RLock())
        """Guards all state; notified when endpoints change."""
        self._members: dict[str, _Member] = {}
        self._remote_nodes: dict[bytes, tuple[RosNode, ...]] = {}
        self._read_callbacks: dict[int, tuple[Any, Any, Callable[[], None]]] = {}
        self._is_closing = self._has_changes = self._has_waited_for_discovery = False
        check_free_descriptors(_FDS_PER_PARTICIPANT, "a participant of ROS 2")
        try:
            self._open()
        except self.dds.core.DDSException as error:
            if self._domain is not None:
                _delete(self._domain)
            raise NepError(
                _(
                    "Cyclone DDS can't start: {error}; check CYCLONEDDS_URI, the network, and whether the "
                    "domain already has {most} programs"
                ).format(error=error, most=MAX_PARTICIPANTS)
            ) from error
        self._started_at = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="nep-ros2", daemon=True)
        self._thread.start()

    def _open(self) -> None:
        core, builtin = self.dds.core, self.dds.builtin
        self._domain: Any = None
        settings = cyclonedds_config(os.environ)
        if settings is not None:
            self._domain = self._create_domain(settings)
        self.entity = self.dds.domain.DomainParticipant(
            self.number, self.qos(policy_classes(self.dds).Userdata(encode_user_data({"enclave": "/"})))
        )
        if self._domain is not None and is_loopback_only(os.environ):
            restrict_to_loopback(self.number)
        self.gid = self.entity.guid.bytes
        self.topics = DdsTopics(self.dds, self.types, self.entity)
        """DDS topics; guarded by `changed`."""
        self._waitset = core.WaitSet(self.entity)
        self._guard = core.GuardCondition(self.entity)
        self._waitset.attach(self._guard)
        any_state = core.ViewState.Any | core.SampleState.Any
        self._endpoint_readers = {}
        for kind, topic in (
            ("writer", builtin.BuiltinTopicDcpsPublication),
            ("reader", builtin.BuiltinTopicDcpsSubscription),
        ):
            reader = builtin.BuiltinDataReader(self.entity, topic)
            self._endpoint_readers[kind] = (
                reader,
                core.ReadCondition(reader, any_state | core.InstanceState.Alive),
            )
            condition = core.ReadCondition(
                reader, core.ViewState.Any | core.SampleState.NotRead | core.InstanceState.Any
            )
            self.watch(reader, condition, partial(self._mark_changed, reader, condition))
        self._info_writer = self.topics.create_state_writer(_INFO_TOPIC, _INFO_TYPE)
        self.matches = Matches(self.dds, self.types, self.topics, self.gid)
        for reader, process in (
            (self.topics.create_state_reader(_INFO_TOPIC, _INFO_TYPE), self._process_info),
            (self.matches.reader, self.matches.process),
        ):
            condition = core.ReadCondition(reader, any_state | core.InstanceState.Any)
            self.watch(reader, condition, partial(_read_states, reader, condition, process))

    def _create_domain(self, settings: str) -> Any:  # noqa: ANN401 - cyclonedds is not typed
        try:
            return self.dds.domain.Domain(self.number, settings)
        except self.dds.core.DDSException as error:
            if error.code != self.dds.core.DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
                raise
            return None  # the program has already created the domain, with its own settings

    def qos(self, *policies: Any) -> Any:  # noqa: ANN401 - cyclonedds is not typed
        """Return a Qos object of cyclonedds with these policies."""
        return self.dds.qos.Qos(*policies)

    def wait_for_discovery(self) -> None:
        """Wait until existing participants are discovered. Later calls return immediately."""
        if self._has_waited_for_discovery:
            return
        with self.changed:
            while (
                remaining_s := self._started_at + _DISCOVERY_TIME_S - time.monotonic()
            ) > 0.0 and not self._is_closing:
                self.changed.wait(remaining_s)
            deadline = time.monotonic() + HANDSHAKE_TIMEOUT_S
            while not self._is_discovery_complete() and (remaining_s := deadline - time.monotonic()) > 0.0:
                self.changed.wait(min(remaining_s, _POLL_S))
            self._has_waited_for_discovery = True

    def _is_discovery_complete(self) -> bool:
        # True if all ROS 2 participants have announced their nodes and the endpoints of these are discovered.
        if self._is_closing:
            return True
        discovered = {each.gid for kind in ("writer", "reader") for each in self.endpoints(kind)}
        gids_with_nodes = self.participants(with_nodes=True) - {self.gid}
        return all(
            gid in self._remote_nodes and all(node.gids <= discovered for node in self._remote_nodes[gid])
            for gid in gids_with_nodes
        )

    # ---- nodes

    def add(self, local_node: LocalNode) -> None:
        """Add a node of this process."""
        with self.changed:
            self._members[local_node.node.id] = _Member(local_node)
            self._publish_nodes_locked()

    def remove(self, node_id: str) -> bool:
        """Remove a node of this process; return True if no node is left."""
        with self.changed:
            self._members.pop(node_id, None)
            if self._members:
                self._publish_nodes_locked()
            return not self._members

    def assign(self, node_id: str, kind: str, entity: Any) -> None:  # noqa: ANN401 - cyclonedds is not typed
        """Announce that a writer or reader belongs to a node, and start watching its matches.

        Args:
            node_id: Id of the node.
            kind: "writer" or "reader".
            entity: Writer or reader of cyclonedds.
        """
        with self.changed:
            if node_id in self._members:
                self._members[node_id].gids[kind].add(entity.guid.bytes)
                self._publish_nodes_locked()
            self.matches.add(entity)
            self._waitset.attach(entity)

    def remove_endpoint(self, node_id: str, kind: str, entity: Any) -> None:  # noqa: ANN401 - cyclonedds is not typed
        """Remove a writer or reader from a node and delete it.

        Args:
            node_id: Id of the node.
            kind: "writer" or "reader".
            entity: Writer or reader of cyclonedds.
        """
        with self.changed:
            if node_id in self._members:
                self._members[node_id].gids[kind].discard(entity.guid.bytes)
                self._publish_nodes_locked()
            self.matches.remove(entity.guid.bytes)
            self._waitset.detach(entity)
            _delete(entity)

    def _publish_nodes_locked(self) -> None:
        # Publishes the nodes of this process. Call with the lock held.
        node_entries = []
        for member in self._members.values():
            namespace, name = split_node_name(member.local_node.node.name)
            node_entries.append(
                {
                    "node_namespace": namespace[:255],
                    "node_name": name[:255],
                    "reader_gid_seq": [self._gid_field(each) for each in sorted(member.gids["reader"])],
                    "writer_gid_seq": [self._gid_field(each) for each in sorted(member.gids["writer"])],
                }
            )
        info = {"gid": self._gid_field(self.gid), "node_entities_info_seq": node_entries}
        cdr = self.types.encode(_INFO_TYPE, info)
        self._info_writer.write(create_sample(self.topics.sample_class(_INFO_TYPE), cdr))

    def _gid_field(self, gid: bytes) -> dict[str, bytes]:
        return {"data": gid.ljust(self.types.gid_bytes, b"\0")}

    def _mark_changed(self, reader: Any, condition: Any) -> None:  # noqa: ANN401 - cyclonedds is not typed
        reader.read(_MAX_SAMPLES_PER_READ, condition)
        self._has_changes = True

    def _process_info(self, cdr: bytes) -> None:
        try:
            info: Any = self.types.decode(_INFO_TYPE, cdr)
        except DecodeError as error:
            _logger.debug("malformed message on ros_discovery_info: %s", error)
            return
        gid = info["gid"]["data"][:16]
        if gid == self.gid or (
            gid not in self._remote_nodes and len(self._remote_nodes) >= _MAX_PARTICIPANTS
        ):
            return
        self._remote_nodes[gid] = tuple(
            RosNode(
                f"{each['node_namespace'].rstrip('/')}/{each['node_name']}",
                frozenset(
                    entry["data"][:16] for key in ("reader_gid_seq", "writer_gid_seq") for entry in each[key]
                ),
            )
            for each in info["node_entities_info_seq"]
        )

    def remote_node_names(self, gids: Iterable[bytes]) -> tuple[str, ...]:
        """Return the names of other programs' nodes that own the endpoints with these GUIDs."""
        requested_gids = set(gids)
        with self.changed:
            nodes = [
                node
                for participant_nodes in self._remote_nodes.values()
                for node in participant_nodes
                if node.gids & requested_gids
            ]
        return tuple(sorted({each.name for each in nodes}))

    def local_node_names(self) -> dict[bytes, str]:
        """Return the node names of this process's writers and readers by GUID."""
        with self.changed:
            return {
                gid: member.local_node.node.name
                for member in self._members.values()
                for gids in member.gids.values()
                for gid in gids
            }

    @property
    def local_nodes(self) -> tuple[LocalNode, ...]:
        """Nodes of this process."""
        with self.changed:
            return tuple(each.local_node for each in self._members.values())

    def remote_nodes(self, gids: frozenset[bytes]) -> dict[bytes, tuple[RosNode, ...]]:
        """Return the nodes of other participants by the participant's GUID.

        Args:
            gids: GUIDs of the existing participants; all others are removed.
        """
        with self.changed:
            self._remote_nodes = {gid: nodes for gid, nodes in self._remote_nodes.items() if gid in gids}
            return dict(self._remote_nodes)

    # ---- discovery

    def participants(self, *, with_nodes: bool = False) -> frozenset[bytes]:
        """Return the GUIDs of the domain's participants.

        Args:
            with_nodes: True to return only participants with ROS 2 nodes.
        """
        core, builtin = self.dds.core, self.dds.builtin
        with self.changed:
            reader = builtin.BuiltinDataReader(self.entity, builtin.BuiltinTopicDcpsParticipant)
            condition = core.ReadCondition(
                reader, core.ViewState.Any | core.SampleState.Any | core.InstanceState.Alive
            )
            samples = reader.read(_MAX_SAMPLES_PER_READ, condition)
        userdata = policy_classes(self.dds).Userdata
        return frozenset(
            each.key.bytes
            for each in samples
            if not with_nodes
            or (userdata in each.qos and "enclave" in decode_user_data(each.qos[userdata].data))
        )

    def endpoints(self, kind: str, topic: str | None = None) -> list[DdsEndpoint]:
        """Return all endpoints of a kind, "writer" or "reader".

        Args:
            kind: Kind of the endpoints.
            topic: DDS topic of the endpoints; None for all topics.
        """
        with self.changed:
            if self._is_closing:
                return []
            reader, condition = self._endpoint_readers[kind]
            samples = reader.read(_MAX_SAMPLES_PER_READ, condition)
        return [
            self.to_endpoint(each)
            for each in samples
            if each.topic_name is not None and (topic is None or each.topic_name == topic)
        ]

    def to_endpoint(self, sample: Any) -> DdsEndpoint:  # noqa: ANN401 - cyclonedds is not typed
        """Return the endpoint that a discovery sample of cyclonedds describes."""
        policies = policy_classes(self.dds)
        has_data = policies.Userdata in sample.qos
        return DdsEndpoint(
            sample.key.bytes,
            sample.participant_key.bytes,
            sample.topic_name,
            sample.type_name,
            policies.Durability.Volatile not in sample.qos and policies.Durability in sample.qos,
            policies.Reliability.BestEffort not in sample.qos,
            decode_user_data(sample.qos[policies.Userdata].data) if has_data else {},
        )

    # ---- the thread

    def watch(self, reader: Any, condition: Any, read: Callable[[], None]) -> None:  # noqa: ANN401 - see above
        """Register a function that reads from a reader whenever its condition becomes true.

        Args:
            reader: Reader of cyclonedds.
            condition: Read condition of the reader.
            read: Called in the participant's thread.
        """
        with self.changed:
            self._read_callbacks[id(reader)] = (reader, condition, read)
            self._waitset.attach(condition)

    def unwatch(self, reader: Any) -> None:  # noqa: ANN401 - cyclonedds is not typed
        """Unregister the function that `watch` registered for a reader."""
        with self.changed:
            entry = self._read_callbacks.pop(id(reader), None)
            if entry is not None:
                self._waitset.detach(entry[1])

    def _run(self) -> None:
        while not self._should_stop():
            self._waitset.wait(1_000_000_000)
            with self.changed:
                if self._should_stop():
                    return
                for _reader, condition, read in list(self._read_callbacks.values()):
                    if condition.is_triggered():
                        _run_logged(read)
                _run_logged(self.matches.publish_changes)
                if self._has_changes:
                    self._has_changes = False
                    for member in list(self._members.values()):
                        _run_logged(member.local_node.handle_endpoints_changed)
                self.changed.notify_all()

    def _should_stop(self) -> bool:
        return self._is_closing

    def is_own_thread(self) -> bool:
        """Return True if called in the participant's thread."""
        return threading.current_thread() is self._thread

    def has_closed(self) -> bool:
        """Return True after `close` was called."""
        return self._is_closing

    def close(self) -> None:
        """Stop the thread and leave the domain."""
        with self.changed:
            if self._is_closing:
                return
            self._is_closing = True
            self._guard.set(True)
            self.changed.notify_all()
        self._thread.join()
        with self.changed:
            for _reader, condition, _read in self._read_callbacks.values():
                self._waitset.detach(condition)
            self._waitset.detach(self._guard)
            self._read_callbacks.clear()
            self._endpoint_readers.clear()
            self.topics.clear()
            for entity in (self._waitset, self._guard, self.entity, self._domain):
                if entity is not None:
                    _delete(entity)


def _run_logged(callback: Callable[[], None]) -> None:
    # The thread continues whatever it receives.
    try:
        callback()
    except Exception:
        _logger.exception("error while processing ROS 2 data")


def _read_states(reader: Any, condition: Any, process: Callable[[bytes], None]) -> None:  # noqa: ANN401 - see above
    for sample in reader.take(100, condition):
        cdr = getattr(sample, "cdr", None)
        if cdr is not None:
            process(cdr)


def _delete(entity: Any) -> None:  # noqa: ANN401 - cyclonedds is not typed
    # Deletes the entity and its children now, not in the finalizer.
    entity.__del__()


def policy_classes(library: Dds) -> Any:  # noqa: ANN401 - cyclonedds is not typed
    """Return the QoS policy classes of cyclonedds."""
    return library.qos.Policy


# ---- participants by domain

_participants: dict[int, Participant] = {}
_lock = threading.Lock()


def join_domain(local_node: LocalNode, number: int) -> Participant:
    """Add a node to the process's participant in a domain and return the participant.

    Args:
        local_node: Node to add.
        number: Domain id.

    Raises:
        NepError: Cyclone DDS can't start.
    """
    with _lock:
        if number not in _participants:
            _participants[number] = Participant(number)
        _participants[number].add(local_node)
        return _participants[number]


def leave_domain(participant: Participant, node_id: str) -> None:
    """Remove a closed node from a participant. Removing the last node closes the participant."""
    with _lock:
        if participant.remove(node_id):
            if _participants.get(participant.number) is participant:
                del _participants[participant.number]
            participant.close()


def _forked() -> None:
    # In a forked child the lock may be held by a thread that doesn't exist there.
    global _lock  # noqa: PLW0603 - one per process
    _lock = threading.Lock()
    _participants.clear()


forks.call_in_child(_forked)
