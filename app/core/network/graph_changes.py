"""Who came and who left between two graphs, in one line each for the console."""

from __future__ import annotations

from collections.abc import Sequence

from nep.protocol.graph_view import GraphView, NodeInfo

NATIVE = "native"
GATEWAY = "gateway"
MASTER = "master"
PROGRAM = "program "
NEP = "/nep/"
FEW = 2
MOST_LINES = 8
"""More that come or leave at once are one line with their number: a bridge brings a thousand topics."""
NAMED = 3


def arrivals(before: GraphView, after: GraphView) -> list[str]:
    """Sentences: nodes that came with their topics, single new topics, nodes that left."""
    here: list[tuple[str, str]] = []
    more: list[tuple[str, str]] = []
    came = [id for id, node in after.nodes.items() if id not in before.nodes and _told(node)]
    told: set[str] = set()
    topics_of = _topics_by_node(after)
    for node in came:
        new = [name for name in topics_of.get(node, ()) if not _published(before, name)]
        origin = "" if after.nodes[node].generation == NATIVE else " (original NEP)"
        if len(new) > FEW:
            name = after.nodes[node].name
            here.append((name, f"{name} is here with {len(new)} topics{origin}"))
            told.update(new)
        elif not new:
            here.append((after.nodes[node].name, f"{after.nodes[node].name} is here{origin}"))
    for name, info in after.topics.items():
        count = len(info.publishers)
        if count and name not in told and not _ours(name) and not _published(before, name):
            more.append((name, f"{name} is new, {count} publisher{'' if count == 1 else 's'}"))
    left = [node.name for id, node in before.nodes.items() if id not in after.nodes and _told(node)]
    return [
        *_gathered(here, "nodes are here"),
        *_gathered(more, "new topics"),
        *_gathered([(name, f"{name} has left") for name in left], "nodes have left"),
    ]


def _gathered(lines: Sequence[tuple[str, str]], what: str) -> list[str]:
    """The lines, each with the name that it is about; one line for all when they are many."""
    if len(lines) <= MOST_LINES:
        return [line for _, line in lines]
    named = ", ".join(name for name, _ in lines[:NAMED])
    return [f"{len(lines)} {what}: {named} and {len(lines) - NAMED} more"]


def _told(node: NodeInfo) -> bool:
    # a behaviour's program is told by its run; the gateway and who logs for the master are parts of it
    return node.generation != GATEWAY and node.name != MASTER and not node.name.startswith(PROGRAM)


def _ours(topic: str) -> bool:
    """Whether it is one of those that nep itself makes, such as the log records'."""
    return topic.startswith(NEP)


def _published(view: GraphView, topic: str) -> bool:
    return topic in view.topics and bool(view.topics[topic].publishers)


def _topics_by_node(view: GraphView) -> dict[str, dict[str, None]]:
    """What each node publishes, but for nep's own."""
    found: dict[str, dict[str, None]] = {}
    for name, info in view.topics.items():
        if not _ours(name):
            for publisher in info.publishers:
                found.setdefault(publisher.node_id, {})[name] = None
    return found
