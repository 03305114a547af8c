"""Text and JSON of parts of the graph that several commands show."""

from __future__ import annotations

from collections.abc import Iterable

from msgspec import Struct

from nep.cli.screen import UNKNOWN
from nep.protocol.graph_view import GraphView, to_plain
from nep.text import escaped


def node_name(graph: GraphView, node_id: str) -> str | None:
    """Return the name of a node, or None if the graph doesn't contain the node."""
    node = graph.nodes.get(node_id)
    return None if node is None else node.name


def node_text(graph: GraphView, node_id: str) -> str:
    """Return the name of a node for a table."""
    return escaped(node_name(graph, node_id) or UNKNOWN)


def node_list(graph: GraphView, node_ids: Iterable[str]) -> str:
    """Return the names of nodes for a table, one per line.

    A gateway isn't shown beside the programs of the original NEP for which it publishes.
    """
    nodes = [graph.nodes[each] for each in node_ids if each in graph.nodes]
    has_originals = any(node.generation not in {"native", "gateway"} for node in nodes)
    names = [node.name for node in nodes if not (has_originals and node.generation == "gateway")]
    return "\n".join(dict.fromkeys(map(escaped, names))) or UNKNOWN


def count_text(value: int | None) -> str:
    """Return a count for a table."""
    return UNKNOWN if value is None else str(value)


def plain_with_names(graph: GraphView, info: Struct, *roles: str) -> dict[str, object]:
    """Convert a topic or service to maps and lists, with the name of each member's node.

    Args:
        graph: Graph that contains the topic or service.
        info: The topic or service.
        roles: Names of the fields that contain its members.
    """
    record = to_plain(info)
    for role in roles:
        members: tuple[Struct, ...] = getattr(info, role)
        record[role] = [
            {**to_plain(each), "node": node_name(graph, getattr(each, "node_id"))}  # noqa: B009
            for each in members
        ]
    return record
