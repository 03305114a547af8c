"""Collection of facts about one topic by subscribing to it and connecting to its publishers."""

from __future__ import annotations

import os
import platform
import socket
import time
from collections.abc import Mapping

import zmq

import nep.errors
from nep.i18n import _
from nep.nodes.node import Node
from nep.programs.doctor.facts import PublisherFact, ReachFailure, TopicFacts
from nep.protocol.graph_view import GraphView, PublisherInfo, TopicInfo
from nep.protocol.wire import check_topic
from nep.system.addresses import master_address, reachable_endpoint

_GRAPH_TIMEOUT_S = 1.0
_LISTEN_DURATION_S = 1.5
_CONNECT_TIMEOUT_S = 0.7
_MAX_ENDPOINTS_TRIED = 4
"""Maximum number of publisher addresses tried, each of which may take `_CONNECT_TIMEOUT_S`."""
_REMEDIES = ("restart", "reset", "start")
"""Name prefixes of services that may restart a program."""


def collect_topic(topic: str, address: str | None = None) -> TopicFacts | None:
    """Subscribe to a topic for up to 1.5 s and return the facts about it.

    Returns None if no master replies or the subscription fails. If the name is invalid, the facts contain
    only the reason (`name_problem`).
    """
    master = master_address(address)
    try:
        check_topic(topic)
    except nep.errors.NepError as error:
        return TopicFacts(topic, time.time(), master, name_problem=str(error))
    try:
        with Node(f"nep-doctor-topic-{os.getpid()}", master=master) as node:
            return _collect(node, topic, master)
    except (nep.errors.NepError, zmq.ZMQError, OSError):
        return None


def probe_endpoint(endpoint: str) -> ReachFailure:
    """Try to connect to an endpoint; return the reason why it can't be reached, or "" if it can.

    Returns "" without connecting if the endpoint isn't a TCP address.
    """
    host, colon, port = endpoint.removeprefix("tcp://").rpartition(":")
    if not endpoint.startswith("tcp://") or not colon:
        return ""
    try:
        with socket.create_connection((host, int(port)), timeout=_CONNECT_TIMEOUT_S):
            return ""
    except TimeoutError:
        return "timeout"
    except ConnectionRefusedError:
        return "refused"
    except (OSError, ValueError, OverflowError):
        return "unknown"


def _collect(node: Node, topic: str, address: str) -> TopicFacts:
    view = node.graph(_GRAPH_TIMEOUT_S)
    info = view.topics.get(topic)
    rate_by_topic = {name: each.rate_hz for name, each in view.topics.items() if each.publishers}
    if info is None or not info.publishers:
        return TopicFacts(
            topic,
            time.time(),
            address,
            bool(view.listens),
            other_topics=rate_by_topic,
            services=tuple(view.services),
        )
    received, rejected, decode_problem, listen_duration_s = _listen(node, info)
    view = node.graph(_GRAPH_TIMEOUT_S)  # includes alerts raised while subscribed
    info = view.topics.get(topic, info)
    return TopicFacts(
        topic,
        time.time(),
        address,
        bool(view.listens),
        _publishers(view, info, address),
        rate_by_topic,
        tuple(view.services),
        tuple(each for each in view.alerts if each.id in {f"type:{topic}", f"encode:{topic}"}),
        listen_duration_s,
        received,
        rejected,
        decode_problem,
    )


def _listen(node: Node, info: TopicInfo) -> tuple[int, int, str, float]:
    start_s = time.monotonic()
    with node.new_sub(info.name, info.msg_type, wildcards=False) as subscriber:
        message, decode_problem = subscriber.receive(_LISTEN_DURATION_S), ""
        if message is not None:
            try:
                message.kind.decode(message.raw, message.extension)
            except nep.errors.NepError as error:
                decode_problem = str(error)
        return subscriber.received, subscriber.refused, decode_problem, time.monotonic() - start_s


def _publishers(view: GraphView, info: TopicInfo, address: str) -> tuple[PublisherFact, ...]:
    failure_by_endpoint: dict[str, ReachFailure] = {}
    return tuple(_publisher(view, each, address, failure_by_endpoint) for each in info.publishers)


def _publisher(
    view: GraphView, publisher: PublisherInfo, address: str, failure_by_endpoint: dict[str, ReachFailure]
) -> PublisherFact:
    node = view.nodes.get(publisher.node_id)
    is_native = node is None or node.generation == "native"
    endpoint, reach_failure = (
        _endpoint_and_reach(publisher, address, failure_by_endpoint) if is_native else ("", "")
    )
    services = [
        name
        for name, service in view.services.items()
        if any(server.node_id == publisher.node_id for server in service.servers)
    ]
    return PublisherFact(
        node.name if node is not None else _("a program that has disconnected"),
        node.host if node is not None else "",
        node.generation if node is not None else "native",
        publisher.count if is_native else None,
        _last_message_s(view, publisher),
        endpoint,
        reach_failure,
        tuple(name for name in services if name.rpartition("/")[2].lower().startswith(_REMEDIES)),
    )


def _endpoint_and_reach(
    publisher: PublisherInfo, address: str, failure_by_endpoint: dict[str, ReachFailure]
) -> tuple[str, ReachFailure]:
    # Each endpoint is tried once.
    if not publisher.endpoints:
        return "", ""
    endpoint = reachable_endpoint(publisher.endpoints, address)
    if not endpoint:
        return publisher.endpoints[0], "elsewhere"
    if endpoint not in failure_by_endpoint and len(failure_by_endpoint) < _MAX_ENDPOINTS_TRIED:
        failure_by_endpoint[endpoint] = probe_endpoint(endpoint)
    return endpoint, failure_by_endpoint.get(endpoint, "")


def _last_message_s(view: GraphView, publisher: PublisherInfo) -> float | None:
    if publisher.last_stamp_ns is None:
        return None
    offsets = _clock_offsets(view)
    offset_ns = offsets.get(publisher.node_id, 0)
    local_offset_ns = next(
        (offsets[id] for id, node in view.nodes.items() if id in offsets and _is_local_host(node.host)), 0
    )
    return (publisher.last_stamp_ns + offset_ns - local_offset_ns) / 1e9


def _clock_offsets(view: GraphView) -> Mapping[str, int]:
    return {id: node.clock_offset_ns for id, node in view.nodes.items() if node.clock_offset_ns is not None}


def _is_local_host(host: str) -> bool:
    return host == platform.node()
