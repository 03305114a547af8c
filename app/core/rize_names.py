"""Finds robots of RIZE.

They tell nothing about themselves, so who listens to ``robot_action`` is taken for one.
"""

from __future__ import annotations

from nep.views import GraphView

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

    def present(self, view: GraphView) -> set[str]:
        """The names of the robots of RIZE in this graph."""
        info = view.topics.get(COMMANDS)
        ids = {subscriber.node_id for subscriber in info.subscribers} if info is not None else set()
        nodes = [
            view.nodes[id].name for id in ids if id in view.nodes and view.nodes[id].generation not in NATIVE
        ]
        if len(nodes) == 1 and len(self._told) == 1:
            return {self._told[0]}
        return {self._name(node) for node in nodes}

    def _name(self, node: str) -> str:
        stem = node
        for suffix in SUFFIXES:
            stem = stem.removesuffix(suffix)
        return next(
            (told for told in self._told if told.lower() in {stem.lower(), node.lower()}), stem or node
        )
