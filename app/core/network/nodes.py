"""Nodes of the network, with the topics that they publish and subscribe to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from app.core.network.topics import key_of
from nep.patterns.parameters.node_parameters import parameters_topic
from nep.protocol.graph_view import BRIDGES_TOPIC, GraphView, NodeInfo

GONE_DISPLAY_S = 10.0
GATEWAY = "gateway"
NATIVE_GENERATIONS = frozenset({"native", GATEWAY})


@dataclass(slots=True, eq=False)
class NodeEntry:
    """One node of a network. Unknown values are None or empty.

    Attributes:
        published_topics: Names of published topics, sorted and unique.
        subscribed_topics: Names of subscribed topics and patterns, sorted and unique.
        cpu_ratio: CPU time of the process as a share of one core.
        gone_s: Seconds since the node left; None while the node is registered. Its topics are still
            listed.
        network: Kind of network; "" for the native one.
        is_stale: True if the network can't be queried at the moment.
        has_parameters: True if the node declares parameters.
        can_set_parameters: True if other nodes can set the parameters, which requires services.
    """

    id: str
    name: str
    host: str = ""
    pid: int | None = None
    language: str = ""
    generation: str = "native"
    since_ns: int = 0
    cpu_ratio: float | None = None
    published_topics: tuple[str, ...] = ()
    subscribed_topics: tuple[str, ...] = ()
    is_new: bool = False
    gone_s: float | None = None
    gone_since_s: float | None = None
    network: str = ""
    is_stale: bool = False
    has_parameters: bool = False
    can_set_parameters: bool = False

    @property
    def key(self) -> str:
        """Identifier of the node, unique among all networks."""
        return key_of(self.network, self.id)

    @property
    def is_original(self) -> bool:
        """True if the node is a program of the original NEP."""
        return not self.network and self.generation not in NATIVE_GENERATIONS

    @property
    def is_bridge(self) -> bool:
        """True if the node connects this network to another one (see `nep.programs.bridges`)."""
        return BRIDGES_TOPIC in self.published_topics


class Nodes:
    """All nodes, in order of their first appearance. Not thread-safe; use it from the main thread.

    The gateway's node is omitted; programs of the original NEP have separate entries.
    """

    def __init__(self, network: str = "") -> None:
        self._network = network
        self._nodes: dict[str, NodeEntry] = {}
        self._is_first_graph = True
        self._last_version = (0, 0)
        self.revision = 0
        self.values_revision = 0

    def __iter__(self) -> Iterator[NodeEntry]:
        return iter(self._nodes.values())

    def __len__(self) -> int:
        return len(self._nodes)

    def get(self, id: str) -> NodeEntry | None:
        """Return the node with this id, or None."""
        return self._nodes.get(id)

    def set_stale(self, is_stale: bool) -> None:
        """Set `NodeEntry.is_stale` of all nodes. A change discards their CPU load.

        Args:
            is_stale: True while the network can't be queried.
        """
        for node in self._nodes.values():
            if node.is_stale is not is_stale:
                node.is_stale, node.cpu_ratio = is_stale, None
                self.revision += 1

    def mark_seen(self, id: str) -> None:
        """Stop highlighting a node as new."""
        node = self._nodes.get(id)
        if node is not None and node.is_new:
            node.is_new = False
            self.revision += 1

    def update(self, view: GraphView, now: float) -> None:
        """Apply a new graph; ``now`` is monotonic seconds."""
        if (view.epoch, view.revision) != self._last_version:
            self._last_version = (view.epoch, view.revision)
            self._update_all(view, now)
        for id, node in self._nodes.items():
            if id in view.nodes:
                node.cpu_ratio = view.nodes[id].cpu_ratio
        self._is_first_graph = False
        self.values_revision += 1

    def update_ages(self, now: float) -> None:
        """Update `NodeEntry.gone_s` of nodes that have left; ``now`` is monotonic seconds.

        Nodes that left more than `GONE_DISPLAY_S` seconds ago are removed.
        """
        for node in list(self._nodes.values()):
            if node.gone_since_s is None:
                continue
            node.gone_s = now - node.gone_since_s
            if node.gone_s >= GONE_DISPLAY_S:
                del self._nodes[node.id]
                self.revision += 1

    def _update_all(self, view: GraphView, now: float) -> None:
        published_topics, subscribed_topics = _topics_by_node(view)
        for id, info in view.nodes.items():
            if info.generation == GATEWAY:
                continue
            node = self._nodes.get(id)
            if node is None:
                self._replace_gone(info)
                is_new = not self._is_first_graph
                node = self._nodes[id] = NodeEntry(id, info.name, is_new=is_new, network=self._network)
            _update_entry(node, info)
            parameter_topic = parameters_topic(id)
            node.can_set_parameters = parameter_topic in view.services
            topic = view.topics.get(parameter_topic)
            node.has_parameters = node.can_set_parameters or (topic is not None and bool(topic.publishers))
            node.published_topics, node.subscribed_topics = (
                published_topics.get(id, ()),
                subscribed_topics.get(id, ()),
            )
        for id, node in self._nodes.items():
            if id not in view.nodes and node.gone_since_s is None:
                node.gone_since_s, node.gone_s, node.cpu_ratio = now, 0.0, None
        self.revision += 1

    def _replace_gone(self, info: NodeInfo) -> None:
        # A restarted program replaces its entry that left.
        for id, node in list(self._nodes.items()):
            if node.gone_since_s is not None and (node.name, node.host) == (info.name, info.host):
                del self._nodes[id]


def _update_entry(node: NodeEntry, info: NodeInfo) -> None:
    node.name, node.host, node.pid = info.name, info.host, info.pid
    node.language, node.generation, node.since_ns = info.language, info.generation, info.since_ns
    node.gone_since_s = node.gone_s = None
    node.is_stale = False


def _topics_by_node(view: GraphView) -> tuple[Mapping[str, tuple[str, ...]], Mapping[str, tuple[str, ...]]]:
    # (topics that each node publishes, topics that it subscribes to), by node id, sorted and unique.
    published_topics: dict[str, dict[str, None]] = {}
    subscribed_topics: dict[str, dict[str, None]] = {}
    for name in sorted(view.topics):
        info = view.topics[name]
        for publisher in info.publishers:
            published_topics.setdefault(publisher.node_id, {})[name] = None
        for subscriber in info.subscribers:
            subscribed_topics.setdefault(subscriber.node_id, {})[name] = None
    for name, pattern_info in view.patterns.items():
        for subscriber in pattern_info.subscribers:
            subscribed_topics.setdefault(subscriber.node_id, {})[name] = None
    return (
        {id: tuple(names) for id, names in published_topics.items()},
        {id: tuple(sorted(names)) for id, names in subscribed_topics.items()},
    )
