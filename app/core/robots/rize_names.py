"""Finds robots of RIZE.

They tell nothing about themselves, so who listens to ``robot_action`` is taken for one.
"""

from __future__ import annotations

from collections.abc import Collection

from nep.protocol.graph_view import GraphView

COMMANDS = "robot_action"
NATIVE = frozenset({"native", "gateway"})
SUFFIXES = ("_driver", "_robot", "_node")


class RizeNames:
    """Which robots of RIZE are there, and their names.

    As they said when they were ready, else their node's.
    """

    def __init__(self) -> None:
        """Nobody has said a name."""
        self._told: list[str] = []

    def tell(self, name: str) -> None:
        """A robot said on ``rize_event`` that it is ready under this name."""
        if name not in self._told:
            self._told.append(name)

    def present(self, view: GraphView, native: Collection[str] = ()) -> set[str]:
        """The names of the robots of RIZE in this graph.

        ``native`` are robots with a description: they say on ``rize_event`` that they are ready, too.
        """
        told = [name for name in self._told if name not in native]
        info = view.topics.get(COMMANDS)
        ids = {subscriber.node_id for subscriber in info.subscribers} if info is not None else set()
        nodes = [
            view.nodes[id].name for id in ids if id in view.nodes and view.nodes[id].generation not in NATIVE
        ]
        if len(nodes) == 1 and len(told) == 1:
            return {told[0]}
        return {_name(node, told) for node in nodes}


def _name(node: str, told: Collection[str]) -> str:
    stem = node
    for suffix in SUFFIXES:
        stem = stem.removesuffix(suffix)
    same = {stem.lower(), node.lower()}
    return next((name for name in told if name.lower() in same), stem or node)
