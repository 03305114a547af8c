"""Export of the graph to DOT, the language of Graphviz."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from app.core.graph.node_graph import GraphLine, NodeGraph


def format_dot(graph: NodeGraph, group_names: Mapping[str, str], label: Callable[[GraphLine], str]) -> str:
    """Return the graph in the DOT language.

    Args:
        graph: Drawing to export.
        group_names: Display name of each group, by key.
        label: Returns the label of a line.
    """
    names = {node.key: f"n{number}" for number, node in enumerate(graph.nodes)}
    lines = ["digraph nodes {", "  rankdir=LR;", "  node [shape=box, style=rounded];"]
    lines_by_group: dict[str, list[str]] = {}
    for node in graph.nodes:
        style = ', style="rounded,dashed"' if node.is_gone or node.is_quiet else ""
        name = group_names.get(node.key, node.name) if node.kind == "group" else node.name
        lines_by_group.setdefault(node.group, []).append(f"{names[node.key]} [label={quote(name)}{style}];")
    clusters = [group for group in graph.groups if not group.is_collapsed and group.key in lines_by_group]
    for number, group in enumerate(clusters):
        lines += [
            f"  subgraph cluster_{number} {{",
            f"    label={quote(group_names.get(group.key, group.name))};",
            *(f"    {each}" for each in lines_by_group.pop(group.key)),
            "  }",
        ]
    lines += [f"  {each}" for group_lines in lines_by_group.values() for each in group_lines]
    for line in graph.lines:
        style = ", style=dashed" if line.kind == "service" else ""
        text = quote(label(line))
        lines += [
            f"  {names[source]} -> {names[target]} [label={text}{style}];" for source, target in line.pairs()
        ]
    return "\n".join([*lines, "}", ""])


def quote(text: str) -> str:
    r"""Quote a string for DOT: escape quotes and backslashes, and replace line breaks by ``\n``."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\0", "")
    return '"' + "\\n".join(escaped.splitlines() or [""]) + '"'
