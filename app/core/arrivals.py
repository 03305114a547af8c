"""Who came and who left between two graphs, in one line each for the console."""

from __future__ import annotations

from nep.views import GraphView, NodeInfo

NATIVE = "native"
GATEWAY = "gateway"
MASTER = "master"
PROGRAM = "program "
NEP = "/nep/"
FEW = 2


def arrivals(before: GraphView, after: GraphView) -> list[str]:
    """Sentences: nodes that came with their topics, single new topics, nodes that left."""
    lines = []
    came = [id for id, node in after.nodes.items() if id not in before.nodes and _told(node)]
    told: set[str] = set()
    for node in came:
        topics = [name for name in after.topics if not _ours(name) and _publishes(after, name, node)]
        new = [name for name in topics if not _published(before, name)]
        origin = "" if after.nodes[node].generation == NATIVE else " (original NEP)"
        if len(new) > FEW:
            lines.append(f"{after.nodes[node].name} is here with {len(new)} topics{origin}")
            told.update(new)
        elif not new:
            lines.append(f"{after.nodes[node].name} is here{origin}")
    for name, info in after.topics.items():
        count = len(info.publishers)
        if count and name not in told and not _ours(name) and not _published(before, name):
            lines.append(f"{name} is new, {count} publisher{'' if count == 1 else 's'}")
    left = [node for id, node in before.nodes.items() if id not in after.nodes and _told(node)]
    lines += [f"{node.name} has left" for node in left]
    return lines


def _told(node: NodeInfo) -> bool:
    # a behaviour's program is told by its run; the gateway and who logs for the master are parts of it
    return node.generation != GATEWAY and node.name != MASTER and not node.name.startswith(PROGRAM)


def _ours(topic: str) -> bool:
    """Whether it is one of those that nep itself makes, such as the log records'."""
    return topic.startswith(NEP)


def _published(view: GraphView, topic: str) -> bool:
    return topic in view.topics and bool(view.topics[topic].publishers)


def _publishes(view: GraphView, topic: str, node: str) -> bool:
    return any(publisher.node_id == node for publisher in view.topics[topic].publishers)
