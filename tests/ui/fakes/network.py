"""Fake network whose nodes and messages are defined by a test."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence

import nep
from app.core.faults import error_text
from app.core.network.source import GraphReceived, Job, JobFailed, MasterFound, Sink
from nep.errors import NepError
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.protocol.graph_view import GraphView


class Network:
    """Message source whose graph and messages are defined by a test.

    Commands to robots are published by a node in memory; subscribe to them with `listen`.
    """

    _names = itertools.count()

    def __init__(self, address: str, sinks: Sequence[Sink], post_event: Callable[[object], None]) -> None:
        self.address = address
        self._sinks, self._post_event = sinks, post_event
        self._master = f"memory of a test {next(self._names)}"
        self._node: Node | None = None
        self.wanted: set[str] = set()
        """The topics that are watched now."""
        self.asked: list[str] = []
        """The topics that were to be watched, each time."""

    @property
    def node(self) -> Node:
        """Studio's node, created on first use."""
        if self._node is None:
            self._node = nep.node("studio", "memory", master=self._master)
        return self._node

    def listen(self, topic: str, msg_type: str) -> Subscriber:
        """Return a subscriber to a topic in memory."""
        return self.node.new_sub(topic, msg_type)

    def tell(self, view: GraphView) -> None:
        """Deliver a graph as if the master had sent it."""
        self._post_event(GraphReceived(view, 0.0))

    def find_master(self) -> None:
        """Report that a master was found."""
        self._post_event(MasterFound(self.address))

    def send(self, message: Message) -> None:
        """Deliver a message to all sinks if its topic is watched."""
        if message.topic in self.wanted:
            for sink in self._sinks:
                sink(message.topic, [message])

    def start(self) -> None:
        """Do nothing; the test delivers all events."""

    def watch(self, topic: str) -> None:
        self.wanted.add(topic)
        self.asked.append(topic)

    def unwatch(self, topic: str) -> None:
        self.wanted.discard(topic)

    def submit(self, what: str, job: Job) -> None:
        try:
            job(self.node)
        except NepError as error:
            self._post_event(JobFailed(what, str(error)))
        except Exception as error:  # noqa: BLE001  as the network does: one job that fails must not end all others
            self._post_event(JobFailed(what, error_text(error)))

    def lost_counts(self) -> Mapping[str, int]:
        return dict.fromkeys(self.wanted, 0)

    def close(self) -> None:
        if self._node is not None:
            self._node.close()
