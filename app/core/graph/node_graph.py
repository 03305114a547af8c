"""Node graph as drawn: nodes in groups, and lines that represent one or several topics."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal
from urllib.parse import urlsplit

from app.core.network.graph_changes import UNNAMED_PREFIX
from app.core.network.nodes import NodeEntry
from app.core.network.source import NODE_NAME
from app.core.network.topics import Topic, key_of
from app.core.network.web_texts import PageNode
from app.core.networks.kinds import find_kind
from nep.messages.codecs import content_of
from nep.protocol.graph_view import ServiceInfo
from nep.protocol.topic_pattern import is_pattern, matches

GroupBy = Literal["computer", "robot", "nothing"]
NodeKind = Literal["program", "studio", "behaviour", "robot", "bridge", "original", "page", "group"]
LineKind = Literal["topic", "service"]

INTERNAL_PREFIX = "/nep/"
"""Name prefix of nep's internal topics and services, such as the log, which every node has."""
MAX_EXPANDED_NODES = 200
"""Number of nodes above which all groups are collapsed initially."""
BRIDGE_SEPARATOR = "-to-"
"""Infix of bridge node names: "bridge-NAME-to-BACKEND"."""


WEB_LANGUAGE = "web"
"""Language reported by the nodes of web pages.

A copy, because importing `nep.programs.web.server` is slow.
"""
WEB_GROUP = "web:"


@dataclass(frozen=True, slots=True)
class GraphInput:
    """State of all networks from which the drawing is created.

    Attributes:
        nodes: Nodes of all networks.
        topics: Topics of all networks.
        services: Services of the native network, by name.
        robots: Names of the robots.
        host: Name of this computer.
        pages: Connected web pages, by the name of their node.
    """

    nodes: Sequence[NodeEntry] = ()
    topics: Sequence[Topic] = ()
    services: Mapping[str, ServiceInfo] = field(default_factory=dict)
    robots: Sequence[str] = ()
    host: str = field(default_factory=platform.node)
    pages: Mapping[str, PageNode] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class GraphOptions:
    """Options of the drawing.

    Attributes:
        quiet_nodes: Keys of the nodes without traffic.
        hides_quiet: True if quiet nodes are hidden, except in the groups of
            `groups_with_visible_quiet_nodes`.
        starts_collapsed: True if all groups are collapsed except the groups in `toggled_groups`; False if
            only the groups in `toggled_groups` are collapsed.
    """

    group_by: GroupBy = "computer"
    shows_services: bool = True
    shows_internal: bool = False
    hides_quiet: bool = True
    quiet_nodes: frozenset[str] = frozenset()
    groups_with_visible_quiet_nodes: frozenset[str] = frozenset()
    starts_collapsed: bool = False
    toggled_groups: frozenset[str] = frozenset()

    def is_collapsed(self, group: str) -> bool:
        """Return True if a group is collapsed and drawn as one box."""
        return bool(group) and self.starts_collapsed is not (group in self.toggled_groups)


@dataclass(frozen=True, slots=True)
class DrawnNode:
    """Box of the drawing: a node, a web page or a collapsed group.

    Attributes:
        key: Identifier of the box, which stays the same when a program is restarted.
        entry: Current state of the node; None for a collapsed group.
        member_count: Number of nodes in a collapsed group.
        bridged_network: Name of the network to which a bridge connects, or "".
        has_pictures: True if the node publishes images.
    """

    key: str
    name: str
    group: str
    kind: NodeKind
    entry: NodeEntry | None = field(default=None, compare=False)
    entry_key: str = ""
    bridged_network: str = ""
    has_pictures: bool = False
    is_gone: bool = False
    is_quiet: bool = False
    member_count: int = 1
    quiet_count: int = 0
    page: PageNode | None = None


@dataclass(frozen=True, slots=True)
class GraphLine:
    """Line from each source to each target that share the same topics or the same service.

    Attributes:
        sources: Keys of the publishing nodes; for a service, of the clients.
        targets: Keys of the subscribing nodes; for a service, of the servers.
        topics: Topic keys, unique among all networks (`key_of`).
    """

    kind: LineKind
    sources: tuple[str, ...]
    targets: tuple[str, ...]
    topics: tuple[str, ...]

    @property
    def key(self) -> tuple[LineKind, tuple[str, ...], tuple[str, ...]]:
        """Identifier of the line, which stays the same while the line has the same ends."""
        return self.kind, self.sources, self.targets

    def pairs(self) -> Iterator[tuple[str, str]]:
        """Return an iterator over the (source, target) pairs; a node is not paired with itself."""
        return ((source, target) for source in self.sources for target in self.targets if source != target)


@dataclass(frozen=True, slots=True)
class GraphGroup:
    """Group of nodes on one computer, of one robot, or in one network.

    Attributes:
        member_count: Number of nodes.
        quiet_count: Number of nodes that are hidden because they are quiet.
        is_collapsed: True if the group is collapsed.
    """

    key: str
    name: str
    address: str
    icon: str
    member_count: int
    quiet_count: int
    is_collapsed: bool


@dataclass(frozen=True, slots=True)
class NodeGraph:
    """Drawing of a graph. Boxes, lines and groups are in a stable order.

    Attributes:
        node_count: Number of connected nodes, including hidden ones.
        topic_count: Number of topics that lines represent.
        service_count: Number of services that lines represent.
        hidden_quiet_count: Number of nodes that are hidden because they are quiet.
        page_count: Number of connected web pages.
    """

    nodes: tuple[DrawnNode, ...] = ()
    lines: tuple[GraphLine, ...] = ()
    groups: tuple[GraphGroup, ...] = ()
    node_count: int = 0
    topic_count: int = 0
    service_count: int = 0
    hidden_quiet_count: int = 0
    page_count: int = 0

    def node(self, key: str) -> DrawnNode | None:
        """Return the box with this key, or None."""
        return next((node for node in self.nodes if node.key == key), None)

    def line_of(self, topic: str) -> GraphLine | None:
        """Return the line of a topic or service, or None."""
        return next((line for line in self.lines if topic in line.topics), None)


def node_graph(graph_input: GraphInput, options: GraphOptions) -> NodeGraph:
    """Create the drawing from the state of the networks and the options of the user.

    The run time is proportional to the number of nodes and topics.
    """
    boxes = _boxes(graph_input, options)
    groups = _groups(graph_input, options, boxes)
    collapsed_keys = {group.key for group in groups if group.is_collapsed}
    drawn_nodes = [
        node for node in boxes.values() if node.group not in collapsed_keys and not _is_hidden(node, options)
    ]
    drawn_nodes += [_collapsed_box(group) for group in groups if group.is_collapsed]
    visible_keys = {node.key for node in drawn_nodes}
    box_by_entry = {
        entry: (node.group if node.group in collapsed_keys else node.key)
        for entry, node in boxes.items()
        if node.group in collapsed_keys or node.key in visible_keys
    }
    lines = [*_topic_lines(graph_input, options, box_by_entry)]
    services: list[GraphLine] = []
    if options.shows_services:
        services = [*_service_lines(graph_input, options, box_by_entry)]
    return NodeGraph(
        tuple(drawn_nodes),
        tuple(sorted([*lines, *services], key=lambda line: (line.kind, line.topics))),
        groups,
        sum(entry.gone_s is None for entry in graph_input.nodes),
        sum(len(line.topics) for line in lines),
        sum(len(line.topics) for line in services),
        sum(_is_hidden(node, options) for node in boxes.values()),
        sum(node.kind == "page" and not node.is_gone for node in boxes.values()),
    )


def _is_hidden(node: DrawnNode, options: GraphOptions) -> bool:
    return node.is_quiet and options.hides_quiet and node.group not in options.groups_with_visible_quiet_nodes


# -- nodes and their groups ----------------------------------------------------------------------------------


def _boxes(graph_input: GraphInput, options: GraphOptions) -> dict[str, DrawnNode]:
    # By the entry's key; groups are not collapsed yet.
    image_topics = {topic.key for topic in graph_input.topics if content_of(topic.codec) == "image"}
    drawn_nodes: dict[str, DrawnNode] = {}
    key_counts: Counter[str] = Counter()
    for entry in sorted(graph_input.nodes, key=lambda each: (each.since_ns, each.id)):
        key = f"{entry.network}|{entry.host}|{entry.name}"
        key_counts[key] += 1
        page = graph_input.pages.get(entry.name) if _is_page(entry) else None
        drawn_nodes[entry.key] = DrawnNode(
            key if key_counts[key] == 1 else f"{key}|{key_counts[key]}",
            _name_of(entry) if page is None else page.title,
            _group_of(entry, graph_input, options.group_by),
            _kind_of(entry, graph_input),
            entry,
            entry.key,
            _bridged_network(entry),
            any(key_of(entry.network, topic) in image_topics for topic in entry.published_topics),
            entry.gone_s is not None,
            entry.key in options.quiet_nodes and entry.gone_s is None,
            page=page,
        )
    return dict(sorted(drawn_nodes.items(), key=lambda item: item[1].key))


def _kind_of(entry: NodeEntry, graph_input: GraphInput) -> NodeKind:
    if entry.is_bridge:
        return "bridge"
    if entry.is_original:
        return "original"
    if _is_page(entry):
        return "page"
    if entry.network:
        return "program"
    if entry.name == NODE_NAME:
        return "studio"
    if entry.name.startswith(UNNAMED_PREFIX):
        return "behaviour"
    return "robot" if entry.name in graph_input.robots else "program"


def _is_page(entry: NodeEntry) -> bool:
    return entry.language == WEB_LANGUAGE


def _name_of(entry: NodeEntry) -> str:
    if _is_page(entry):
        return entry.name.removeprefix("web_")
    return entry.name.removeprefix(UNNAMED_PREFIX) or entry.name


def _bridged_network(entry: NodeEntry) -> str:
    # "" when its name does not contain it.
    _before, separator, back_end = entry.name.rpartition(BRIDGE_SEPARATOR)
    if not entry.is_bridge or not separator:
        return ""
    kind = find_kind(back_end)
    return kind.product_name if kind is not None else back_end


def _group_of(entry: NodeEntry, graph_input: GraphInput, group_by: GroupBy) -> str:
    # "host:lab-pc", "network:ros2", "robot:Pepper"; "" for none.
    if group_by == "nothing":
        return ""
    if _is_page(entry):
        return WEB_GROUP
    if group_by == "robot":
        robot_names = [name for name in graph_input.robots if _belongs_to(entry, name)]
        return f"robot:{max(robot_names, key=len)}" if robot_names else "robot:"
    return f"host:{entry.host}" if entry.host or not entry.network else f"network:{entry.network}"


def _belongs_to(entry: NodeEntry, robot: str) -> bool:
    return entry.name == robot or any(topic.startswith(f"/{robot}/") for topic in entry.published_topics)


def _groups(
    graph_input: GraphInput, options: GraphOptions, boxes: Mapping[str, DrawnNode]
) -> tuple[GraphGroup, ...]:
    # Sorted by key. A group whose nodes are all hidden is collapsed, so that it stays visible.
    nodes_by_group: dict[str, list[DrawnNode]] = {}
    for node in boxes.values():
        nodes_by_group.setdefault(node.group, []).append(node)
    addresses = _addresses(graph_input)
    groups = []
    for key in sorted(nodes_by_group):
        if not key:
            continue
        nodes = nodes_by_group[key]
        hidden_count = sum(_is_hidden(node, options) for node in nodes)
        counts = Counter(addresses[node.entry_key] for node in nodes if node.entry_key in addresses)
        address = min(counts, key=lambda each: (-counts[each], each)) if counts and key != WEB_GROUP else ""
        is_collapsed = options.is_collapsed(key) or hidden_count == len(nodes)
        groups.append(
            GraphGroup(
                key,
                _group_name(key),
                address,
                _icon_of(key, nodes, graph_input),
                len(nodes),
                hidden_count,
                is_collapsed,
            )
        )
    return tuple(groups)


def _group_name(group: str) -> str:
    return group.partition(":")[2]


def _icon_of(group: str, nodes: Iterable[DrawnNode], graph_input: GraphInput) -> str:
    kind, _colon, name = group.partition(":")
    if kind == "network":
        return "waypoints"
    if kind == "web":
        return "globe"
    if kind == "robot":
        return "bot" if name else "box"
    return "bot" if name != graph_input.host and any(node.kind == "robot" for node in nodes) else "monitor"


def _addresses(graph_input: GraphInput) -> dict[str, str]:
    # By the key of an entry, where its publishers are reachable from other computers.
    addresses: dict[str, str] = {}
    for topic in graph_input.topics:
        if topic.info is None:
            continue
        for publisher in topic.info.publishers:
            node_key = key_of(topic.network, publisher.node_id)
            if node_key not in addresses:
                address = next(filter(None, map(_address_in, publisher.endpoints)), "")
                if address:
                    addresses[node_key] = address
    return addresses


def _address_in(endpoint: str) -> str:
    # "tcp://192.168.1.20:40001" -> "192.168.1.20"; "" for a local address.
    try:
        host = urlsplit(endpoint).hostname or ""
    except ValueError:
        return ""
    if "://" not in endpoint or endpoint.startswith(("ipc:", "inproc:")):
        return ""
    return "" if host.startswith(("127.", "0.")) or host in {"localhost", "::1", "*", "::"} else host


def _collapsed_box(group: GraphGroup) -> DrawnNode:
    return DrawnNode(
        group.key,
        group.name,
        group.key,
        "group",
        member_count=group.member_count,
        quiet_count=group.quiet_count,
    )


# -- lines ---------------------------------------------------------------------------------------------------

_LineEnds = tuple[tuple[str, ...], tuple[str, ...]]


def is_drawn(topic: str, options: GraphOptions) -> bool:
    """Return True if the topic or service is drawn. Internal ones are drawn only if the options say so."""
    return options.shows_internal or not topic.startswith(INTERNAL_PREFIX)


def _topic_lines(
    graph_input: GraphInput, options: GraphOptions, box_by_entry: Mapping[str, str]
) -> Iterator[GraphLine]:
    patterns = _patterns(graph_input)
    bundles: dict[_LineEnds, list[str]] = {}
    for topic in graph_input.topics:
        info = topic.info
        if info is None or topic.gone_s is not None or not is_drawn(topic.name, options):
            continue
        subscriber_keys = [key_of(topic.network, each.node_id) for each in info.subscribers]
        subscriber_keys += [
            entry
            for network, pattern, entry in patterns
            if network == topic.network and matches(pattern, topic.name)
        ]
        publisher_keys = (key_of(topic.network, each.node_id) for each in info.publishers)
        _add_to_bundle(bundles, _ends(publisher_keys, subscriber_keys, box_by_entry), topic.key)
    yield from _lines_of("topic", bundles)


def _service_lines(
    graph_input: GraphInput, options: GraphOptions, box_by_entry: Mapping[str, str]
) -> Iterator[GraphLine]:
    bundles: dict[_LineEnds, list[str]] = {}
    for name, info in graph_input.services.items():
        if is_drawn(name, options):
            clients = (each.node_id for each in info.clients)
            servers = (each.node_id for each in info.servers)
            _add_to_bundle(bundles, _ends(clients, servers, box_by_entry), name)
    yield from _lines_of("service", bundles)


def _patterns(graph_input: GraphInput) -> list[tuple[str, str, str]]:
    # (network, pattern, entry) of subscribers of patterns.
    return [
        (entry.network, topic, entry.key)
        for entry in graph_input.nodes
        if entry.gone_s is None
        for topic in entry.subscribed_topics
        if is_pattern(topic)
    ]


def _ends(sources: Iterable[str], targets: Iterable[str], box_by_entry: Mapping[str, str]) -> _LineEnds:
    # Boxes that are drawn, each once.
    return _boxes_of(sources, box_by_entry), _boxes_of(targets, box_by_entry)


def _boxes_of(entries: Iterable[str], box_by_entry: Mapping[str, str]) -> tuple[str, ...]:
    boxes = {box_by_entry[each] for each in entries if each in box_by_entry}
    return tuple(boxes) if len(boxes) < 2 else tuple(sorted(boxes))


def _add_to_bundle(bundles: dict[_LineEnds, list[str]], ends: _LineEnds, name: str) -> None:
    sources, targets = ends
    if sources and targets and not (len(sources) == 1 and sources == targets):
        bundles.setdefault(ends, []).append(name)


def _lines_of(kind: LineKind, bundles: Mapping[_LineEnds, Collection[str]]) -> Iterator[GraphLine]:
    for (sources, targets), names in bundles.items():
        yield GraphLine(kind, sources, targets, tuple(sorted(names)))
