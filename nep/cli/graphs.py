"""The graph, as the command line asks for it."""

from __future__ import annotations

import os
from collections.abc import Sequence

from nep.errors import NepError, did_you_mean
from nep.graph import GraphView
from nep.nodes import Node
from nep.wire import check_topic


def node_for(command: str, master: str | None) -> Node:
    """A node for one run of a command. Its name holds the process, because two of them may run."""
    return Node(f"nep-topic-{command}-{os.getpid()}", master=master)


def look(master: str | None, timeout_s: float = 2.0) -> GraphView:
    """The graph of the master now. Raises `MasterUnreachable`."""
    with Node(f"nep-cli-{os.getpid()}", master=master) as node:
        return node.graph(timeout_s)


def known_topics(node: Node, topics: Sequence[str]) -> dict[str, str]:
    """The types of topics that are there. Raises `NepError` for one that is not, with the nearest name."""
    known = node.graph().topics
    for topic in topics:
        if topic not in known:
            check_topic(topic)
            raise NepError(f"no topic '{topic}'; {nearest(topic, list(known))}")
    return {topic: known[topic].msg_type for topic in topics}


def nearest(topic: str, known: Sequence[str]) -> str:
    """What to do about a topic that is not there."""
    if not known:
        return "nobody publishes anything yet, see 'nep topic list'"
    if len(known) > 12:
        near = did_you_mean(topic, known)
        return near if near.startswith("did") else "see 'nep topic list'"
    return did_you_mean(topic, known)
