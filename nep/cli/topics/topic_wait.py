"""Waiting for topics that have no publisher yet."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from contextlib import suppress

from nep.cli.screen import print_status
from nep.errors import NepError, nearest
from nep.i18n import _
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from nep.protocol.wire import check_topic

_GRAPH_POLL_INTERVAL_S = 1.0
_WAIT_SLICE_S = 0.1
_GRAPH_TIMEOUT_S = 0.3
"""Time limit of a graph query in seconds; short, because waiting for a missing master delays messages."""


class TopicMonitor:
    """Monitor for topics without publishers, each of which is reported once to the user.

    The graph is queried only while no messages arrive.
    """

    def __init__(self, node: Node, topics: Sequence[str]) -> None:
        # Raises `BadTopicError` for an invalid topic.
        self._node = node
        self._types = {check_topic(topic): "json" for topic in topics}
        self._unpublished: set[str] = set()
        self._published_before: set[str] = set()
        self._poll_at = 0.0

    def msg_type(self, topic: str) -> str:
        """Return the type of a topic; "json" while the topic has no publisher."""
        return self._types[topic]

    @property
    def unpublished_topics(self) -> frozenset[str]:
        """Topics without publishers."""
        return frozenset(self._unpublished)

    def update(self, graph: GraphView) -> None:
        """Report topics that have no publisher, or have lost their last one, and suggest similar names."""
        for topic in self._types:
            topic_info = graph.topics.get(topic)
            if topic_info is not None and topic_info.publishers:
                self._types[topic] = topic_info.msg_type
                self._published_before.add(topic)
                self._unpublished.discard(topic)
            elif topic not in self._unpublished:
                self._unpublished.add(topic)
                other_topics = [
                    name for name, other in graph.topics.items() if name != topic and other.publishers
                ]
                if topic in self._published_before:
                    template = _("'{topic}' no longer has a publisher; {meant}waiting (Ctrl+C to stop)")
                else:
                    template = _("'{topic}' has no publisher yet; {meant}waiting (Ctrl+C to stop)")
                print_status(template.format(topic=topic, meant=suggestion(topic, other_topics)))
        self._poll_at = time.monotonic() + _GRAPH_POLL_INTERVAL_S

    def mark_received(self, topics: Collection[str]) -> None:
        """Record that messages arrived on these topics."""
        self._published_before.update(topics)
        self._unpublished.difference_update(topics)
        self._poll_at = time.monotonic() + _GRAPH_POLL_INTERVAL_S

    def wait_slice_s(self, timeout_s: float | None) -> float:
        """Return the maximum time in seconds to wait for a message before the next poll."""
        return _WAIT_SLICE_S if timeout_s is None else min(_WAIT_SLICE_S, max(0.0, timeout_s))

    def poll(self) -> None:
        """Query the graph if no message arrived for a while. Does nothing while the master is down."""
        if time.monotonic() >= self._poll_at:
            self._poll_at = time.monotonic() + _GRAPH_POLL_INTERVAL_S
            with suppress(NepError):
                self.update(self._node.graph(_GRAPH_TIMEOUT_S))


def suggestion(topic: str, names: Sequence[str]) -> str:
    """Return "did you mean ...?" with a trailing space, or "" if no name is similar to `topic`."""
    nearest_name = nearest(topic, names)
    return "" if nearest_name is None else _("did you mean '{near}'?").format(near=nearest_name) + " "
