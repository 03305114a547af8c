"""Graph of a ROS network, with the statistics of the nep nodes of this process."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import urlsplit

from msgspec.structs import replace

from nep.backends.ros.master import RosSystemState
from nep.backends.ros_types.carriers import FOREIGN_CODECS
from nep.masters.graph import Graph
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    AddPublisher,
    AddSubscriber,
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    Renew,
    Request,
    SubscriberCount,
    SubscriberRecord,
)
from nep.protocol.service_wire import SERVICE_TYPE, topic_of

_GENERATION = "ros"


@dataclass(frozen=True)
class LocalRosNode:
    """nep node of this process, with its statistics.

    Attributes:
        node: Record of the node.
        ros_name: Name of the process's ROS node.
        publishers: (topic, message type, is_latched, statistics) of each publisher.
        subscribers: (topic, message type, statistics) of each subscriber.
        servers: (service, statistics) of each server.
        clients: (service, statistics) of each client.
    """

    node: NodeRecord
    ros_name: str
    publishers: tuple[tuple[str, str, bool, PublisherCount], ...]
    subscribers: tuple[tuple[str, str, SubscriberCount], ...]
    servers: tuple[tuple[str, PublisherCount], ...] = ()
    clients: tuple[tuple[str, SubscriberCount], ...] = ()


def graph_view(state: RosSystemState, local_nodes: list[LocalRosNode]) -> GraphView:
    """Return the graph of a ROS network.

    The process's own ROS node is listed as its nep nodes. The rates of other nodes are unknown, because ROS
    doesn't report them.

    Args:
        state: Snapshot of the ROS master.
        local_nodes: nep nodes of this process.
    """
    graph = Graph(epoch=1, now=time.monotonic(), learn_s=0.0)
    for topic, name in _remote_entries(state.publishers, local_nodes, lambda each: each.publishers):
        kind = state.types.get(topic, "*")
        uri = state.uris.get(name, "")
        codec = FOREIGN_CODECS.get(kind, "ros")
        record = PublisherRecord(publisher_id(name, topic), topic, kind, codec, (uri,) if uri else ())
        _apply_request(graph, AddPublisher(_node_record(name, uri), record))
    for topic, name in _remote_entries(state.subscribers, local_nodes, lambda each: each.subscribers):
        subscriber_record = SubscriberRecord(_stable_id(name, topic, "i"), topic, state.types.get(topic, "*"))
        _apply_request(graph, AddSubscriber(_node_record(name, state.uris.get(name, "")), subscriber_record))
    for service, name in _remote_entries(state.services, local_nodes, lambda each: each.servers):
        node = _node_record(name, state.uris.get(name, ""))
        _apply_request(graph, _server_request(node, _stable_id(name, service, "s"), service))
    for local_node in local_nodes:
        if local_node.ros_name:
            _add_local_node(graph, local_node, state.uris.get(local_node.ros_name, ""))
    return graph.view()


def _remote_entries(
    nodes_by_name: Mapping[str, Sequence[str]],
    local_nodes: list[LocalRosNode],
    rows_of: Callable[[LocalRosNode], Sequence[tuple[object, ...]]],
) -> Iterator[tuple[str, str]]:
    # Yields (topic or service, node name) of nodes other than this process's nep nodes.
    own_entries = {(row[0], each.ros_name) for each in local_nodes for row in rows_of(each)}
    return (
        (each, node)
        for each, nodes in nodes_by_name.items()
        for node in nodes
        if (each, node) not in own_entries
    )


def _server_request(node: NodeRecord, server_id: int, service: str, uri: str = "") -> AddPublisher:
    endpoints = (uri,) if uri else ()
    return AddPublisher(
        node, PublisherRecord(server_id, topic_of(service), SERVICE_TYPE, SERVICE_TYPE, endpoints)
    )


def _add_local_node(graph: Graph, local_node: LocalRosNode, uri: str) -> None:
    node = replace(local_node.node, generation=_GENERATION)
    for topic, kind, is_latched, count in local_node.publishers:
        codec = FOREIGN_CODECS.get(kind, "ros")
        record = PublisherRecord(count.id, topic, kind, codec, (uri,) if uri else (), is_latched)
        _apply_request(graph, AddPublisher(node, record))
    for topic, kind, subscriber_count in local_node.subscribers:
        _apply_request(graph, AddSubscriber(node, SubscriberRecord(subscriber_count.id, topic, kind)))
    for service, count in local_node.servers:
        _apply_request(graph, _server_request(node, count.id, service, uri))
    for service, subscriber_count in local_node.clients:
        _apply_request(
            graph, AddSubscriber(node, SubscriberRecord(subscriber_count.id, topic_of(service), SERVICE_TYPE))
        )
    counts = (*(each[-1] for each in local_node.publishers), *(count for _, count in local_node.servers))
    subscriber_counts = (
        *(each[-1] for each in local_node.subscribers),
        *(subscriber_count for _, subscriber_count in local_node.clients),
    )
    _apply_request(graph, Renew(node.id, graph.epoch, graph.revision, counts, subscriber_counts))


def _apply_request(graph: Graph, request: Request) -> None:
    graph.apply(request, 0, time.monotonic(), "")


def _node_record(name: str, uri: str) -> NodeRecord:
    # The name is the id: a ROS master has only one node per name.
    host = urlsplit(uri).hostname or "" if uri else ""
    return NodeRecord(name, name.lstrip("/"), host, None, language="", generation=_GENERATION)


def publisher_id(node: str, topic: str) -> int:
    """Return the id of a ROS node's publisher on a topic. `node` and `topic` are full names."""
    return _stable_id(node, topic, "o")


def _stable_id(*parts: str) -> int:
    # The id must be the same in every process.
    digest = hashlib.sha256("\0".join(parts).encode()).digest()
    return int.from_bytes(digest[:8], "little") >> 1 or 1
