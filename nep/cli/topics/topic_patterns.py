"""Topic patterns on the command line, such as `/*/odom`."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from contextlib import suppress

from nep.cli.screen import print_status
from nep.errors import NepError
from nep.i18n import _
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from nep.protocol.topic_glob import glob_matches as matches
from nep.protocol.topic_glob import is_glob
from nep.protocol.wire import check_topic

__all__ = ["TopicPatterns", "is_pattern", "matches"]

_GRAPH_POLL_INTERVAL_S = 1.0
_GRAPH_TIMEOUT_S = 0.3
"""Time limit of a graph query in seconds; short, because waiting for a missing master delays messages."""


def is_pattern(argument: str) -> bool:
    """Return True if a word is a topic pattern; words with brackets or quotes are field paths."""
    return is_glob(argument) and not any(letter in argument for letter in "[\"'")


class TopicPatterns:
    """Tracker of published topics that match patterns. Queries the graph once a second."""

    def __init__(self, node: Node, patterns: Sequence[str], subscribed: Collection[str]) -> None:
        # `subscribed`: topics that are already subscribed. Raises `BadTopicError` for an invalid pattern.
        self.patterns = tuple(map(check_topic, patterns))
        self._node = node
        self._known_topics = set(subscribed)
        self._reported: set[str] = set()
        self._poll_at = 0.0

    def new_topics(self, graph: GraphView) -> list[tuple[str, str]]:
        """Return (name, type) of matching topics that are new in `graph`.

        A pattern without a match is reported once to the user.
        """
        self._poll_at = time.monotonic() + _GRAPH_POLL_INTERVAL_S
        published = {name: each for name, each in graph.topics.items() if each.publishers}
        for pattern in self.patterns:
            if pattern not in self._reported:
                self._reported.add(pattern)
                if not any(matches(pattern, name) for name in published):
                    template = _("no topic matches '{pattern}' yet; waiting (Ctrl+C to stop)")
                    print_status(template.format(pattern=pattern))
        matching = [
            (name, published[name].msg_type)
            for name in sorted(published.keys() - self._known_topics)
            if any(matches(pattern, name) for pattern in self.patterns)
        ]
        self._known_topics.update(name for name, _type in matching)
        return matching

    def poll(self) -> list[tuple[str, str]]:
        """Return (name, type) of new matching topics; query the graph at most once a second.

        Returns an empty list while the master is down.
        """
        if self.patterns and time.monotonic() >= self._poll_at:
            self._poll_at = time.monotonic() + _GRAPH_POLL_INTERVAL_S
            with suppress(NepError):
                return self.new_topics(self._node.graph(_GRAPH_TIMEOUT_S))
        return []
