from __future__ import annotations

import pytest

from app.core.graph.dot import format_dot, quote
from app.core.graph.node_graph import DrawnNode, GraphGroup, GraphLine, NodeGraph

GRAPH = NodeGraph(
    (
        DrawnNode("k1", 'say "hi"', "host:a", "program"),
        DrawnNode("k2", "gone", "host:a", "program", is_gone=True),
        DrawnNode("host:b", "b", "host:b", "group", member_count=3),
    ),
    (
        GraphLine("topic", ("k1",), ("k2", "host:b"), ("/t",)),
        GraphLine("service", ("k2",), ("k1",), ("ask",)),
    ),
    (
        GraphGroup("host:a", "a", "", "monitor", 2, 0, False),
        GraphGroup("host:b", "b", "", "monitor", 3, 0, True),
    ),
)


def test_dot_export_has_groups_nodes_and_lines() -> None:
    made = format_dot(GRAPH, {"host:a": "This computer", "host:b": "b"}, lambda line: f"{line.topics[0]} 2/s")
    assert made.splitlines() == [
        "digraph nodes {",
        "  rankdir=LR;",
        "  node [shape=box, style=rounded];",
        "  subgraph cluster_0 {",
        '    label="This computer";',
        '    n0 [label="say \\"hi\\""];',
        '    n1 [label="gone", style="rounded,dashed"];',
        "  }",
        '  n2 [label="b"];',
        '  n0 -> n1 [label="/t 2/s"];',
        '  n0 -> n2 [label="/t 2/s"];',
        '  n1 -> n0 [label="ask 2/s", style=dashed];',
        "}",
    ]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("", '""'),
        ("a\\", '"a\\\\"'),
        ('"];x', '"\\"];x"'),
        ("two\r\nlines", '"two\\nlines"'),
        ("n\0ul", '"nul"'),
        ("\N{GRINNING FACE}", '"\N{GRINNING FACE}"'),
    ],
)
def test_names_are_escaped_in_dot(text: str, wanted: str) -> None:
    assert quote(text) == wanted
