"""Graph of a domain, built from DDS discovery.

Nodes of this program are listed with statistics and problems. For other nodes, DDS discovery provides
names, topics, types and owners, but no rates. Writers and readers outside a ROS 2 node, such as those
of plain DDS programs, are listed under a node named after their participant.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

from nep.backends.base import PublisherSpec, SubscriberSpec
from nep.backends.ros2.mismatches import NodeEndpoint, mismatches
from nep.backends.ros2.names import (
    dds_service,
    dds_topic,
    dds_type,
    ros_service,
    ros_topic,
    ros_type,
    service_type_of,
)
from nep.backends.ros2.participant import DdsEndpoint, LocalNode, Participant
from nep.backends.ros2.subscriber import endpoint_id
from nep.backends.ros2.type_mapping import CDR, mapping_for
from nep.backends.services import ClientSpec, ServerSpec
from nep.errors import NepError
from nep.masters.graph import Graph
from nep.messages.codecs import codec_for
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    AddPublisher,
    AddSubscriber,
    Join,
    NodeRecord,
    PublisherRecord,
    Renew,
    ReportAlerts,
    SubscriberRecord,
)
from nep.protocol.service_wire import SERVICE_TYPE, topic_of

_MAX_REMOTE_ENDPOINTS = 10_000
"""Maximum number of other programs' writers and readers in the graph."""


@dataclass
class _NameCache:
    # Names in nep of DDS topics and types, as used by this program or another nep program.
    topics: dict[str, str] = field(default_factory=dict)
    types: dict[tuple[str, str], str] = field(default_factory=dict)
    ids: set[int] = field(default_factory=set)

    def topic(self, endpoint: DdsEndpoint) -> str:
        service = ros_service(endpoint.topic)
        topic_name = self.topics.get(endpoint.topic) or ros_topic(endpoint.topic)
        return topic_name or (endpoint.topic if service is None else topic_of(service))

    def msg_type(self, endpoint: DdsEndpoint) -> str:
        type_name = self.types.get((endpoint.topic, endpoint.type))
        return type_name or endpoint.user_data.get("neptype") or ros_type(endpoint.type)

    def id(self, endpoint: DdsEndpoint) -> int:
        # Returns the announced id, unless another endpoint announces the same one.
        announced_id = endpoint_id(endpoint.gid, endpoint.user_data.get("nepid"))
        unique_id = endpoint_id(endpoint.gid, None) if announced_id in self.ids else announced_id
        self.ids.add(unique_id)
        return unique_id


def current_graph(participant: Participant) -> GraphView:
    """Return the current graph of the participant's domain."""
    graph, names = Graph(epoch=1, now=0.0, learn_s=0.0), _NameCache()
    for local_node in participant.local_nodes:
        _add_local(graph, local_node, names)
    endpoints = [
        (kind, each)
        for kind in ("writer", "reader")
        for each in participant.endpoints(kind)
        if ros_topic(each.topic) is not None or ros_service(each.topic) is not None
    ]
    endpoints_by_topic: dict[str, dict[str, list[NodeEndpoint]]] = {}
    local_names = participant.local_node_names()
    for kind, each in endpoints:
        if each.gid in local_names and ros_service(each.topic) is None:
            _add_endpoint(endpoints_by_topic, names, NodeEndpoint(local_names[each.gid], each), kind)
    for node, kind, endpoint in islice(
        _remote_endpoints(participant, endpoints, names), _MAX_REMOTE_ENDPOINTS
    ):
        _add_remote(graph, node, kind, endpoint, names)
        if endpoint is not None and ros_service(endpoint.topic) is None:
            _add_endpoint(endpoints_by_topic, names, NodeEndpoint(node.name, endpoint), kind)
    alerts = (
        alert
        for topic, each in sorted(endpoints_by_topic.items())
        for alert in mismatches(topic, each["writer"], each["reader"])
    )
    graph.apply(ReportAlerts("ros2", tuple(alerts)), 0, 0.0, "")
    return graph.view()


def _add_endpoint(
    endpoints_by_topic: dict[str, dict[str, list[NodeEndpoint]]],
    names: _NameCache,
    node_endpoint: NodeEndpoint,
    kind: str,
) -> None:
    topic = names.topic(node_endpoint.endpoint)
    endpoints_by_topic.setdefault(topic, {"writer": [], "reader": []})[kind].append(node_endpoint)


def _add_local(graph: Graph, local_node: LocalNode, names: _NameCache) -> None:
    publishers, subscribers = local_node.publishers, local_node.subscribers
    servers, clients = local_node.servers, local_node.clients
    specs: list[PublisherSpec | SubscriberSpec] = [each.spec for each in publishers]
    specs += [each.spec for each in subscribers]
    for spec in specs:
        name, mapping = dds_topic(spec.topic), mapping_for(spec.msg_type)
        names.topics.setdefault(name, spec.topic)
        names.types.setdefault((name, dds_type(mapping.ros_type)), spec.msg_type)
        names.ids.add(spec.id)
    service_specs: list[ServerSpec | ClientSpec] = [each.spec for each in servers]
    service_specs += [each.spec for each in clients]
    for service_spec in service_specs:
        names.topics.setdefault(dds_service(service_spec.service)[0], topic_of(service_spec.service))
        names.ids.add(service_spec.id)
    node = local_node.node
    graph.apply(Join(node), 0, 0.0, node.id)
    for record in (*(each.record for each in publishers), *(each.record for each in servers)):
        graph.apply(AddPublisher(node, record), 0, 0.0, node.id)
    for subscriber_record in (*(each.record for each in subscribers), *(each.record for each in clients)):
        graph.apply(AddSubscriber(node, subscriber_record), 0, 0.0, node.id)
    counts = (
        (*(each.counts() for each in publishers), *(each.counts() for each in servers)),
        (*(each.counts() for each in subscribers), *(each.counts() for each in clients)),
    )
    graph.apply(Renew(node.id, graph.epoch, graph.revision, *counts, local_node.load()), 0, 0.0, node.id)


def _remote_endpoints(
    participant: Participant, discovered: Sequence[tuple[str, DdsEndpoint]], names: _NameCache
) -> Iterator[tuple[NodeRecord, str, DdsEndpoint | None]]:
    # Yields (node, kind, endpoint): the nodes of other programs with kind "" and endpoint None, then the
    # writers and readers of other programs with their nodes.
    own_gid = participant.gid
    gids = participant.participants() - {own_gid}
    endpoints = [(kind, endpoint) for kind, endpoint in discovered if endpoint.participant != own_gid]
    for _kind, endpoint in endpoints:
        if endpoint.user_data.get("neptype"):
            names.types.setdefault((endpoint.topic, endpoint.type), endpoint.user_data["neptype"])
    announced_ids = {
        endpoint.gid: endpoint.user_data["nepnode"]
        for _kind, endpoint in endpoints
        if endpoint.user_data.get("nepnode")
    }
    owners: dict[bytes, NodeRecord] = {}
    for gid, nodes in sorted(participant.remote_nodes(gids).items()):
        for number, node in enumerate(nodes):
            node_id = next(
                (announced_ids[node_gid] for node_gid in sorted(node.gids) if node_gid in announced_ids), ""
            )
            record = _node_record(node_id or _hashed_id(gid + number.to_bytes(4, "little")), node.name)
            owners.update(dict.fromkeys(node.gids, record))
            yield record, "", None
    unknown_nodes = {
        endpoint.participant: _unknown_node(endpoint.participant) for _kind, endpoint in endpoints
    }
    for kind, endpoint in endpoints:
        yield owners.get(endpoint.gid) or unknown_nodes[endpoint.participant], kind, endpoint


def _hashed_id(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def _node_record(node_id: str, name: str) -> NodeRecord:
    return NodeRecord(node_id, name, "", None, language="", generation="ros2")


def _unknown_node(gid: bytes) -> NodeRecord:
    return _node_record(_hashed_id(gid), f"dds/{gid.hex()[:24]}")


def _add_remote(
    graph: Graph, node: NodeRecord, kind: str, endpoint: DdsEndpoint | None, names: _NameCache
) -> None:
    # Records that the graph rejects are skipped.
    if node.id not in graph.members:
        graph.apply(Join(node), 0, 0.0, node.id)
    if endpoint is None:
        return
    topic, msg_type, number = names.topic(endpoint), names.msg_type(endpoint), names.id(endpoint)
    if ros_service(endpoint.topic) is not None:
        _add_remote_service(graph, node, kind, endpoint, topic, number)
        return
    if kind == "writer":
        publisher = PublisherRecord(
            number, topic, msg_type, _codec_of(msg_type), ("ros2",), endpoint.is_latched
        )
        graph.apply(AddPublisher(node, publisher), 0, 0.0, node.id)
    else:
        graph.apply(AddSubscriber(node, SubscriberRecord(number, topic, msg_type)), 0, 0.0, node.id)


def _add_remote_service(
    graph: Graph, node: NodeRecord, kind: str, endpoint: DdsEndpoint, topic: str, number: int
) -> None:
    # A reader of requests is a server, a writer of requests is a client.
    msg_type = service_type_of(endpoint.type) or SERVICE_TYPE
    if kind == "reader":
        server = PublisherRecord(number, topic, msg_type, SERVICE_TYPE, ("ros2",))
        graph.apply(AddPublisher(node, server), 0, 0.0, node.id)
    else:
        graph.apply(AddSubscriber(node, SubscriberRecord(number, topic, msg_type)), 0, 0.0, node.id)


def _codec_of(msg_type: str) -> str:
    try:
        return mapping_for(msg_type).codec.name
    except NepError:  # unknown type
        return CDR if "/" in msg_type else codec_for(msg_type).name
