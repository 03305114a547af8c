"""A network that a test makes up."""

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
    """A source of messages: a test tells who is there and what they send.

    What robots are told goes over nodes in memory; `listen` hears it.
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
        """Studio's node."""
        if self._node is None:
            self._node = nep.node("studio", "memory", master=self._master)
        return self._node

    def listen(self, topic: str, msg_type: str) -> Subscriber:
        """Hear what is published there."""
        return self.node.new_sub(topic, msg_type)

    def tell(self, view: GraphView) -> None:
        """The master tells who is there."""
        self._post_event(GraphReceived(view, 0.0))

    def find_master(self) -> None:
        """A master answers."""
        self._post_event(MasterFound(self.address))

    def send(self, message: Message) -> None:
        """A program sends a message: it comes to who watches its topic."""
        if message.topic in self.wanted:
            for sink in self._sinks:
                sink(message.topic, [message])

    def start(self) -> None:
        """A test tells everything."""

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
