"""DDS writers and readers of a server or client, and their matches.

As in rmw_cyclonedds, requests are sent on `rq/NAMERequest` and responses on `rr/NAMEReply`; the
client's id (u64) and the number of the call (i64) precede the fields. ROS 2 can't transfer a server's
errors. nep programs therefore exchange errors on a topic hidden from ROS 2: the same 16 bytes, the kind
(u8), and the reason.
"""

from __future__ import annotations

import secrets
import struct
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from nep.backends.ros2.library import has_forked
from nep.backends.ros2.matches import PREFIX_BYTES
from nep.backends.ros2.names import dds_service, dds_type, encode_user_data
from nep.backends.ros2.participant import DdsEndpoint, Participant, policy_classes
from nep.backends.ros2.services.definitions import request_type_of, response_type_of
from nep.backends.ros2.topics import create_sample
from nep.backends.ros_types.typed_services import TypedService
from nep.backends.services import MAX_CALLS
from nep.errors import DecodeError, WireError
from nep.i18n import _
from nep.protocol.service_wire import CallKind, Reply

_CDR_AND_CALL_ID_BYTES, _CDR_HEADER_BYTES = 20, 4
_FAILURE_TYPE = "std_msgs/msg/UInt8MultiArray"
_FAILURE_HEADER = struct.Struct("<QqB")
_BATCH_SIZE = 256
_MAX_WRITERS = 1024
"""Maximum number of clients' request writers that are tracked."""
_MAX_BLOCKING_NS = 100_000_000
_READY_DELAY_S = 0.1
"""Time in seconds after discovery until programs without nep are assumed to be ready to receive."""
_FAILURE_KINDS = (CallKind.ERROR, CallKind.REJECTED)


class CallId(NamedTuple):
    """Id of a call in DDS.

    Attributes:
        guid: Id of the client.
        number: Number of the call in the client.
    """

    guid: int
    number: int


class ReceivedSample(NamedTuple):
    """Received request or response.

    Attributes:
        id: Id of the call.
        cdr: CDR without the call id.
        writer: Writer of the sample; None if unknown.
    """

    id: CallId
    cdr: bytes
    writer: DdsEndpoint | None


class ServiceChannel:
    """DDS endpoints of a server or client.

    Args:
        participant: Participant of this process.
        node_id: Id of the node.
        service: Name of the service.
        kind: Service type.
        entry_id: Id of the server or client.
        guid: Client id in the calls of a client; None for a server.
        on_sample: Called with each received request or response, in the participant's thread.
        on_failure: Called with each received error, in the participant's thread.
    """

    def __init__(
        self,
        participant: Participant,
        node_id: str,
        service: str,
        service_type: TypedService,
        entry_id: int,
        *,
        guid: int | None = None,
        on_sample: Callable[[ReceivedSample], None],
        on_failure: Callable[[CallId, Reply], None] | None = None,
    ) -> None:
        self.service_type = service_type
        self.participant = participant
        self.is_closed = False
        self.node_id = node_id
        self._on_sample = on_sample
        self._on_failure = on_failure
        self._is_server = is_server = guid is None
        self._guid = guid
        self._ready_servers: frozenset[bytes] = frozenset()
        self._ready_handles: tuple[int, ...] = ()
        self._has_only_ready_servers = False
        self._known_writers: dict[int, DdsEndpoint] = {}
        self._first_seen_times: dict[bytes, float] = {}
        request_topic, response_topic = dds_service(service)
        types = participant.types
        pair_id = ".".join(f"{each:x}" for each in secrets.token_bytes(16))
        self._user_data = {
            "serviceid" if is_server else "clientid": pair_id,
            "nepnode": node_id,
            "nepid": f"{entry_id:x}",
        }
        request_type, response_type = request_type_of(service_type.name), response_type_of(service_type.name)
        self._topics = (
            ((response_topic, response_type), (request_topic, request_type))
            if is_server
            else ((request_topic, request_type), (response_topic, response_type))
        )
        self._hashes = {name: types.type_hash(name) for name in (request_type, response_type)}
        self._readers: list[Any] = []
        self._writers: list[Any] = []
        with participant.changed:
            (out_topic, out_type), (in_topic, in_type) = self._topics
            self._sample_class = participant.topics.service_class(out_type)
            self._add_writer(participant.topics.service_topic(out_topic, out_type), out_type)
            self._add_reader(participant.topics.service_topic(in_topic, in_type), in_type, self._read)
            if not service_type.is_nep:
                self._add_failure_topic(request_topic)

    # ---- owned objects; call with the participant's lock held

    def _add_failure_topic(self, request_topic: str) -> None:
        name = f"nep_failures/{request_topic.removeprefix('rq/')}"
        topic = self.participant.topics.topic(name, _FAILURE_TYPE)
        self._failure_class = self.participant.topics.sample_class(_FAILURE_TYPE)
        if self._is_server:
            self._add_writer(topic, _FAILURE_TYPE)
        else:
            self._add_reader(topic, _FAILURE_TYPE, self._read_failures)

    def _qos(self, ros_type: str) -> Any:  # noqa: ANN401 - cyclonedds is not typed
        policies = policy_classes(self.participant.dds)
        type_hash = self._hashes.get(ros_type) or self.participant.types.type_hash(ros_type)
        return self.participant.qos(
            policies.Reliability.Reliable(_MAX_BLOCKING_NS),
            policies.Durability.Volatile,
            policies.History.KeepLast(MAX_CALLS),
            policies.DataRepresentation(use_cdrv0_representation=True),
            policies.Userdata(encode_user_data({"typehash": type_hash} | self._user_data)),
        )

    def _add_writer(self, topic: Any, ros_type: str) -> None:  # noqa: ANN401 - cyclonedds is not typed
        participant = self.participant
        writer = participant.dds.pub.DataWriter(participant.entity, topic, self._qos(ros_type))
        self._writers.append(writer)
        participant.assign(self.node_id, "writer", writer)

    def _add_reader(
        self,
        topic: Any,  # noqa: ANN401 - cyclonedds is not typed
        ros_type: str,
        read: Callable[[Any, Any], None],
    ) -> None:
        participant, core = self.participant, self.participant.dds.core
        reader = participant.dds.sub.DataReader(participant.entity, topic, self._qos(ros_type))
        self._readers.append(reader)
        participant.assign(self.node_id, "reader", reader)
        condition = core.ReadCondition(
            reader, core.ViewState.Any | core.SampleState.Any | core.InstanceState.Any
        )
        participant.watch(reader, condition, lambda: read(reader, condition))

    # ---- receiving, in the participant's thread, with its lock held

    def _read(self, reader: Any, condition: Any) -> None:  # noqa: ANN401 - cyclonedds is not typed
        while samples := reader.take(_BATCH_SIZE, condition):
            for sample in samples:
                cdr = getattr(sample, "cdr", None)
                if cdr is None or len(cdr) < _CDR_HEADER_BYTES + 16 or cdr[0] != 0 or cdr[1] > 1:
                    continue  # a disposed writer, or not CDR
                guid, number = struct.unpack_from(f"{'<' if cdr[1] else '>'}Qq", cdr, _CDR_HEADER_BYTES)
                call = CallId(guid, number)
                if self._is_own_call(call):
                    writer = self._writer_of(reader, sample.sample_info.publication_handle)
                    fields = bytes(cdr[:_CDR_HEADER_BYTES] + cdr[_CDR_AND_CALL_ID_BYTES:])
                    self._on_sample(ReceivedSample(call, fields, writer))
            if len(samples) < _BATCH_SIZE:
                return

    def _is_own_call(self, call: CallId) -> bool:
        # All clients receive all responses.
        return self._guid is None or call.guid == self._guid

    def _writer_of(self, reader: Any, handle: int) -> DdsEndpoint | None:  # noqa: ANN401 - cyclonedds is not typed
        writer = self._known_writers.get(handle)
        if writer is None:
            sample = reader.get_matched_publication_data(handle)
            if sample is None:
                return None
            if len(self._known_writers) >= _MAX_WRITERS:
                self._known_writers.pop(next(iter(self._known_writers)))
            writer = self._known_writers[handle] = self.participant.to_endpoint(sample)
        return writer

    def _read_failures(self, reader: Any, condition: Any) -> None:  # noqa: ANN401 - cyclonedds is not typed
        for sample in reader.take(_BATCH_SIZE, condition):
            cdr = getattr(sample, "cdr", None)
            if cdr is None or self._on_failure is None:
                continue  # a disposed writer
            try:
                decoded: Any = self.participant.types.decode(_FAILURE_TYPE, cdr)
            except DecodeError:
                continue
            data: bytes = decoded["data"]
            if len(data) >= _FAILURE_HEADER.size:
                guid, number, kind = _FAILURE_HEADER.unpack_from(data)
                failure_kind = next((each for each in _FAILURE_KINDS if each == kind), None)
                if failure_kind is not None and self._is_own_call(CallId(guid, number)):
                    self._on_failure(CallId(guid, number), Reply(failure_kind, data[_FAILURE_HEADER.size :]))

    # ---- sending, without the participant's lock

    def send(self, call: CallId, cdr: bytes) -> None:
        """Write a request or response. Raises `WireError`, or `DDSException` if the channel is closed."""
        order = "<" if cdr[1] else ">"
        framed_cdr = cdr[:_CDR_HEADER_BYTES] + struct.pack(f"{order}Qq", *call) + cdr[_CDR_HEADER_BYTES:]
        codes = self.participant.dds.core.DDSException
        try:
            self._writers[0].write(create_sample(self._sample_class, framed_cdr))
        except codes as error:
            if error.code == codes.DDS_RETCODE_TIMEOUT:
                raise WireError(_("the other side is too slow"), len(cdr)) from error
            raise

    def send_failure(self, call: CallId, reply: Reply) -> None:
        """Send an error to nep programs.

        Raises `DDSException` if a reader is too slow or the channel is closed.
        """
        data = _FAILURE_HEADER.pack(*call, reply.kind) + bytes(reply.data)
        cdr = self.participant.types.encode(_FAILURE_TYPE, {"data": data})
        self._writers[1].write(create_sample(self._failure_class, cdr))

    # ---- matched endpoints; call with the participant's lock held

    @property
    def discovered_peers(self) -> list[DdsEndpoint]:
        """Discovered endpoints of the peers: clients for a server, servers for a client."""
        (out_topic, out_type), (in_topic, in_type) = self._topics
        candidates = [(each, out_type) for each in self.participant.endpoints("reader", out_topic)] + [
            (each, in_type) for each in self.participant.endpoints("writer", in_topic)
        ]
        return [
            each for each, ros_type in candidates if each.has_type(dds_type(ros_type), self._hashes[ros_type])
        ]

    @property
    def entities(self) -> Sequence[Any]:
        """This channel's writer and reader of requests and responses."""
        return (self._writers[0], self._readers[0])

    def _matched_endpoints(self, entity: Any) -> list[DdsEndpoint]:  # noqa: ANN401 - cyclonedds is not typed
        if hasattr(entity, "get_matched_subscriptions"):
            handles, get_data = entity.get_matched_subscriptions(), entity.get_matched_subscription_data
        else:
            handles, get_data = entity.get_matched_publications(), entity.get_matched_publication_data
        return [self.participant.to_endpoint(data) for data in map(get_data, handles) if data is not None]

    def ready_servers(self) -> frozenset[bytes]:
        """Return the GUIDs of the response writers of all servers that are ready for calls.

        Used by clients.
        """
        if self.is_closed:
            return frozenset()
        handles = self._match_handles()
        if handles != self._ready_handles:
            self._ready_servers = self._find_ready_servers()
            self._ready_handles = handles if self._has_only_ready_servers else ()
        return self._ready_servers

    def _match_handles(self) -> tuple[int, ...]:
        # Returns a value that changes whenever the set of matches changes.
        readers = (each.get_matched_publications() for each in self._readers)
        return (
            *self._writers[0].get_matched_subscriptions(),
            -1,
            *(handle for each in readers for handle in each),
        )

    def _find_ready_servers(self) -> frozenset[bytes]:
        self._has_only_ready_servers = True
        now = time.monotonic()
        readers, writers = (
            self._matched_endpoints(self._writers[0]),
            self._matched_endpoints(self._readers[0]),
        )
        failure_writers = [self._matched_endpoints(each) for each in self._readers[1:]]
        ready: set[bytes] = set()
        for reader in readers:
            matching_writers = [each for each in writers if each.participant == reader.participant]
            first_seen = self._first_seen_times.setdefault(reader.gid, now) if matching_writers else now
            if "nepid" not in reader.user_data:
                is_ready = bool(matching_writers) and (
                    now - first_seen >= _READY_DELAY_S or self._is_local(reader)
                )
            else:
                is_ready = bool(matching_writers) and self._is_confirmed(reader, writers, failure_writers)
            self._has_only_ready_servers = self._has_only_ready_servers and is_ready
            if is_ready:
                ready.update(each.gid for each in matching_writers)
        self._first_seen_times = {each.gid: self._first_seen_times.get(each.gid, now) for each in readers}
        return frozenset(ready)

    def _is_local(self, endpoint: DdsEndpoint) -> bool:
        return bool(endpoint.gid[:PREFIX_BYTES] == self.participant.gid[:PREFIX_BYTES])

    def _is_confirmed(
        self, reader: DdsEndpoint, writers: list[DdsEndpoint], failure_writers: list[list[DdsEndpoint]]
    ) -> bool:
        # True if a nep server has reported matches with all endpoints of this client.
        pairs = [(self._writers[0], [reader]), (self._readers[0], writers)]
        pairs += zip(self._readers[1:], failure_writers, strict=True)
        return all(
            any(
                self.participant.matches.is_confirmed(entity.guid.bytes, endpoint.gid, endpoint.participant)
                for endpoint in endpoints
                if endpoint.participant == reader.participant
            )
            for entity, endpoints in pairs
        )

    def matched_servers(self) -> frozenset[bytes]:
        """Return the GUIDs of the response writers of all matched servers. Used by clients."""
        return (
            frozenset()
            if self.is_closed
            else frozenset(each.gid for each in self._matched_endpoints(self._readers[0]))
        )

    def can_reply_to(self, client: DdsEndpoint) -> bool:
        """Return True if a response reaches a client. Used by servers.

        Args:
            client: Request writer of the client.
        """
        endpoints = [
            each
            for each in self._matched_endpoints(self._writers[0])
            if each.participant == client.participant
        ]
        pair_id = client.user_data.get("clientid")
        return any(pair_id is None or each.user_data.get("clientid") in {None, pair_id} for each in endpoints)

    # ---- closing

    def finish(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for acknowledgements. Call without the participant's lock."""
        if not self.is_closed and not has_forked() and timeout_s > 0.0 and not self.participant.has_closed():
            for writer in self._writers:  # `wait_for_acks` raises on timeout
                writer._wait_for_acks(writer._ref, int(min(timeout_s, 3600.0) * 1e9))  # noqa: SLF001

    def close(self) -> None:
        """Close all endpoints. Idempotent; has no effect in a forked child process."""
        if has_forked():
            return
        with self.participant.changed:
            if self.is_closed:
                return
            self.is_closed = True
            if self.participant.has_closed():
                return
            for reader in self._readers:
                self.participant.unwatch(reader)
                self.participant.remove_endpoint(self.node_id, "reader", reader)
            for writer in self._writers:
                self.participant.remove_endpoint(self.node_id, "writer", writer)
