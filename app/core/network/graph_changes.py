"""Comparison of two graphs: one console line for each node or topic that appeared or disappeared."""

from __future__ import annotations

from collections.abc import Sequence

from nep.i18n import _, ngettext
from nep.protocol.graph_view import GraphView, NodeInfo

NATIVE_GENERATION = "native"
GATEWAY_GENERATION = "gateway"
MASTER = "master"
UNNAMED_PREFIX = "program "
INTERNAL_PREFIX = "/nep/"
MAX_LISTED_TOPICS = 2
MAX_LINES = 8
"""Maximum number of lines for one comparison.

If there are more changes, one line with their number is written; a bridge can add a thousand topics.
"""
MAX_NAMED = 3


def change_messages(before: GraphView, after: GraphView) -> list[str]:
    """Return sentences about the differences between two graphs.

    There is one sentence for each new node without topics or with more than `MAX_LISTED_TOPICS` new
    ones, each other new topic, and each node that left. More than `MAX_LINES` sentences of one kind are
    summarized in one.
    """
    join_messages: list[tuple[str, str]] = []
    topic_messages: list[tuple[str, str]] = []
    new_nodes = [id for id, node in after.nodes.items() if id not in before.nodes and _is_reported(node)]
    reported: set[str] = set()
    topics_by_node = _topics_by_node(after)
    for node in new_nodes:
        new_topics = [name for name in topics_by_node.get(node, ()) if not _is_published(before, name)]
        name, is_original = after.nodes[node].name, after.nodes[node].generation != NATIVE_GENERATION
        if len(new_topics) > MAX_LISTED_TOPICS:
            join_messages.append((name, _joined_message(name, len(new_topics), is_original=is_original)))
            reported.update(new_topics)
        elif not new_topics:
            template = _("{node} joined (original NEP)") if is_original else _("{node} joined")
            join_messages.append((name, template.format(node=name)))
    for name, info in after.topics.items():
        count = len(info.publishers)
        if count and name not in reported and not _is_internal(name) and not _is_published(before, name):
            template = ngettext(
                "new topic {topic} ({count} publisher)", "new topic {topic} ({count} publishers)", count
            )
            topic_messages.append((name, template.format(topic=name, count=count)))
    left_names = [
        node.name for id, node in before.nodes.items() if id not in after.nodes and _is_reported(node)
    ]
    return [
        *_summarize(join_messages, _("{count} nodes joined: {names} and {more} more")),
        *_summarize(topic_messages, _("{count} new topics: {names} and {more} more")),
        *_summarize(
            [(name, _("{node} left").format(node=name)) for name in left_names],
            _("{count} nodes left: {names} and {more} more"),
        ),
    ]


def _summarize(lines: Sequence[tuple[str, str]], summary_template: str) -> list[str]:
    if len(lines) <= MAX_LINES:
        return [line for _name, line in lines]
    listed_names = ", ".join(name for name, _line in lines[:MAX_NAMED])
    return [summary_template.format(count=len(lines), names=listed_names, more=len(lines) - MAX_NAMED)]


def _joined_message(node: str, count: int, *, is_original: bool) -> str:
    template = (
        ngettext(
            "{node} joined with {count} topic (original NEP)",
            "{node} joined with {count} topics (original NEP)",
            count,
        )
        if is_original
        else ngettext("{node} joined with {count} topic", "{node} joined with {count} topics", count)
    )
    return template.format(node=node, count=count)


def _is_reported(node: NodeInfo) -> bool:
    # a behaviour's program is reported by its run; the gateway and the master's log node belong to the master
    return (
        node.generation != GATEWAY_GENERATION
        and node.name != MASTER
        and not node.name.startswith(UNNAMED_PREFIX)
    )


def _is_internal(topic: str) -> bool:
    return topic.startswith(INTERNAL_PREFIX)


def _is_published(view: GraphView, topic: str) -> bool:
    return topic in view.topics and bool(view.topics[topic].publishers)


def _topics_by_node(view: GraphView) -> dict[str, dict[str, None]]:
    topics_by_node: dict[str, dict[str, None]] = {}
    for name, info in view.topics.items():
        if not _is_internal(name):
            for publisher in info.publishers:
                topics_by_node.setdefault(publisher.node_id, {})[name] = None
    return topics_by_node
