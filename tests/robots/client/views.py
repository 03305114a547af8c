"""Graphs and messages of robots, built without a network."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

import nep
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo

COMMAND, REPLY, DESCRIPTION = "/Pepper/command", "/Pepper/answer", "/Pepper/description"


def view(
    replies: Mapping[int, str],
    *,
    receivers: Iterable[str] = (),
    announcers: Iterable[str] = (),
    generations: Mapping[str, str] | None = None,
) -> GraphView:
    """Return a graph of Pepper's programs.

    Args:
        replies: Node by id of its publisher of replies.
        receivers: Nodes that subscribe to the commands.
        announcers: Nodes that publish the description, in order of registration.
        generations: Generations of nodes other than "native".
    """
    receivers, announcers = tuple(receivers), tuple(announcers)
    nodes = dict.fromkeys([*replies.values(), *receivers, *announcers])
    topics = {
        REPLY: TopicInfo(REPLY, "robot/answer", "json", tuple(map(_publisher, replies, replies.values()))),
        COMMAND: TopicInfo(
            COMMAND,
            "robot/command",
            "json",
            (),
            tuple(SubscriberInfo(index, node, None, None) for index, node in enumerate(receivers, 900)),
        ),
        DESCRIPTION: TopicInfo(
            DESCRIPTION,
            "robot/description",
            "json",
            tuple(_publisher(id, node) for id, node in enumerate(announcers, 800)),
        ),
    }
    infos = {
        node: NodeInfo(
            node, f"{node} program", "lab", 1, "python", (generations or {}).get(node, "native"), 0
        )
        for node in nodes
    }
    return GraphView(1, 1, infos, topics)


def _publisher(id: int, node: str) -> PublisherInfo:
    return PublisherInfo(id, node, (), False, 0, 0, 0, None, None, None)


def reply(publisher: int, payload: object, topic: str = REPLY) -> nep.Message:
    """Return a message on a reply topic."""
    data = json.dumps(payload).encode()
    return nep.Message(topic, data, "json", "robot/answer", publisher=publisher)


def stop_reply(publisher: int, id: object, state: object = "succeeded", topic: str = REPLY) -> nep.Message:
    """Return a reply to a Stop."""
    return reply(publisher, {"id": id, "op": "stop", "action": "stop", "state": state}, topic)
