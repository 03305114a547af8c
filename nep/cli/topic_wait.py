"""Waiting for topics that nobody publishes yet: who is missing is said once, and the graph asked again."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from contextlib import suppress

from nep.cli.screen import say
from nep.errors import NepError, nearest
from nep.i18n import _
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from nep.protocol.wire import check_topic

_AGAIN_S = 1.0
_SLICE_S = 0.1
_PATIENCE_S = 0.3
"""A master that is away must not keep messages waiting, which do not need it."""


class TopicWait:
    """Topics that a command waits for: says which of them nobody publishes, when that is so and not again.

    The graph is asked again only while no message comes.
    """

    def __init__(self, node: Node, topics: Sequence[str]) -> None:
        """Raises `BadTopicError` for what is no topic."""
        self._node = node
        self._types = {check_topic(topic): "json" for topic in topics}
        self._silent: set[str] = set()
        self._had: set[str] = set()
        self._look_at = 0.0

    def msg_type(self, topic: str) -> str:
        """The type that it has, "json" while nobody publishes it."""
        return self._types[topic]

    @property
    def silent(self) -> frozenset[str]:
        """Those that nobody publishes."""
        return frozenset(self._silent)

    def look(self, graph: GraphView) -> None:
        """Say which of them nobody publishes, or publishes any more, with the name that may be meant."""
        for topic in self._types:
            known = graph.topics.get(topic)
            if known is not None and known.publishers:
                self._types[topic] = known.msg_type
                self._had.add(topic)
                self._silent.discard(topic)
            elif topic not in self._silent:
                self._silent.add(topic)
                others = [name for name, other in graph.topics.items() if name != topic and other.publishers]
                if topic in self._had:
                    said = _("nobody publishes '{topic}' any more; {meant}waiting, Ctrl+C ends it")
                else:
                    said = _("nobody publishes '{topic}' yet; {meant}waiting, Ctrl+C ends it")
                say(said.format(topic=topic, meant=meant(topic, others)))
        self._look_at = time.monotonic() + _AGAIN_S

    def heard(self, topics: Collection[str]) -> None:
        """Messages came: those are published."""
        self._had.update(topics)
        self._silent.difference_update(topics)
        self._look_at = time.monotonic() + _AGAIN_S

    def slice_s(self, timeout_s: float | None) -> float:
        """How long to wait for a message until it is time to look again, or to give up."""
        return _SLICE_S if timeout_s is None else min(_SLICE_S, max(0.0, timeout_s))

    def look_again(self) -> None:
        """Ask for the graph, if no message came for a while. A master that is away is waited for, too."""
        if time.monotonic() >= self._look_at:
            self._look_at = time.monotonic() + _AGAIN_S
            with suppress(NepError):
                self.look(self._node.graph(_PATIENCE_S))


def meant(topic: str, names: Sequence[str]) -> str:
    """Whether another of these was meant: a sentence with a space behind it, or nothing."""
    near = nearest(topic, names)
    return "" if near is None else _("did you mean '{near}'?").format(near=near) + " "
