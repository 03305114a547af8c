"""The graph, as the command line asks for it."""

from __future__ import annotations

import os

from nep.graph import GraphView
from nep.nodes import Node


def node_for(command: str, master: str | None) -> Node:
    """A node for one run of a command. Its name holds the process, because two of them may run."""
    return Node(f"nep-topic-{command}-{os.getpid()}", master=master)


def look(master: str | None) -> GraphView:
    """The graph of the master now. Raises `MasterUnreachable`."""
    with Node(f"nep-cli-{os.getpid()}", master=master) as node:
        return node.graph()
