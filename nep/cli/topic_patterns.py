"""Patterns of topics, such as `/*/odom`: the topics that match them and are new."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from contextlib import suppress

from nep.cli.screen import say
from nep.errors import NepError
from nep.i18n import _
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from nep.protocol.topic_glob import glob_matches as matches
from nep.protocol.topic_glob import is_glob
from nep.protocol.wire import check_topic

__all__ = ["TopicPatterns", "is_pattern", "matches"]

_AGAIN_S = 1.0
_PATIENCE_S = 0.3
"""A master that is away must not keep messages waiting, which do not need it."""


def is_pattern(word: str) -> bool:
    """Whether a word of the command line is a pattern; one with brackets or quotes is a field."""
    return is_glob(word) and not any(letter in word for letter in "[\"'")


class TopicPatterns:
    """Topics that match some patterns and are published. Asks for the graph once a second."""

    def __init__(self, node: Node, patterns: Sequence[str], known: Collection[str]) -> None:
        """`known`: topics that are heard anyway. Raises `BadTopicError` for what can be no topic's name."""
        self.patterns = tuple(map(check_topic, patterns))
        self._node = node
        self._known = set(known)
        self._said: set[str] = set()
        self._look_at = 0.0

    def new_in(self, graph: GraphView) -> list[tuple[str, str]]:
        """Topics that match and were not told before, with their types; says which pattern has none."""
        self._look_at = time.monotonic() + _AGAIN_S
        published = {name: each for name, each in graph.topics.items() if each.publishers}
        for pattern in self.patterns:
            if pattern not in self._said:
                self._said.add(pattern)
                if not any(matches(pattern, name) for name in published):
                    said = _("no topic matches '{pattern}' yet; waiting, Ctrl+C ends it")
                    say(said.format(pattern=pattern))
        found = [
            (name, published[name].msg_type)
            for name in sorted(published.keys() - self._known)
            if any(matches(pattern, name) for pattern in self.patterns)
        ]
        self._known.update(name for name, _type in found)
        return found

    def look_again(self) -> list[tuple[str, str]]:
        """`new_in` of the graph now, if it is time. A master that is away is waited for."""
        if self.patterns and time.monotonic() >= self._look_at:
            self._look_at = time.monotonic() + _AGAIN_S
            with suppress(NepError):
                return self.new_in(self._node.graph(_PATIENCE_S))
        return []
