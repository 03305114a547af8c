"""Source of a network other than the native one, joined through its back end in a background thread."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from msgspec.structs import replace

import nep
from app.core.faults import error_text
from app.core.network.source import NODE_NAME, LiveSource, NodeSink, Sink
from app.core.network.topics import key_of
from app.core.networks.kinds import NetworkKind
from nep.errors import NepError
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.protocol.graph_view import GraphView

QUERY_INTERVAL_S = 1.0
RESPONSE_TIMEOUT_S = 2.0


class OtherSource(LiveSource):
    """Source of another network. Messages are passed to the sinks by topic key (`key_of`)."""

    poll_interval_s = QUERY_INTERVAL_S

    def __init__(
        self,
        kind: NetworkKind,
        address: str,
        sinks: Sequence[Sink],
        post_event: Callable[[object], None],
    ) -> None:
        super().__init__(
            address,
            [_keyed_sink(kind.name, sink) for sink in sinks],
            post_event,
            thread_name=f"studio-{kind.name}",
        )
        self._kind = kind
        self._members: object = None
        self._revision = 0

    def join(self) -> Node:
        """Join the network and return the node. Raises `NepError` if the network does not respond."""
        with _convert_errors():
            return nep.node(NODE_NAME, self._kind.name, master=self.address, wait_s=RESPONSE_TIMEOUT_S)

    def query_graph(self, node: Node) -> GraphView:
        """Return the graph, with the codec that is used to read each topic.

        The revision of the graph increases with every change of nodes or topics, even if the back end
        does not count revisions.
        """
        with _convert_errors():
            view = node.graph(timeout_s=RESPONSE_TIMEOUT_S)
        topics = {
            name: info if (codec := self._kind.codec_of(info)) == info.codec else replace(info, codec=codec)
            for name, info in view.topics.items()
        }
        members = _graph_members(view)
        if members != self._members:
            self._members = members
            self._revision += 1
        return replace(view, topics=topics, revision=self._revision)

    def subscribe(self, node: Node, topic: str, msg_type: str, sink: NodeSink) -> Subscriber:
        """Subscribe to a topic with the message type given by `NetworkKind.readable_type_of`."""
        info = self._view.topics.get(topic) if self._view is not None else None
        readable_type = self._kind.readable_type_of(info) if info is not None else msg_type
        with _convert_errors():
            return node.new_sub(topic, readable_type, sink=sink, wildcards=False, qos=self._kind.qos)


def _graph_members(view: GraphView) -> object:
    nodes = {(each.id, each.name, each.host, each.pid, each.generation) for each in view.nodes.values()}
    topics = {
        (
            each.name,
            each.msg_type,
            tuple((endpoint.node_id, endpoint.id) for endpoint in each.publishers),
            tuple((endpoint.node_id, endpoint.id) for endpoint in each.subscribers),
        )
        for each in view.topics.values()
    }
    patterns = {
        (each.name, tuple((endpoint.node_id, endpoint.id) for endpoint in each.subscribers))
        for each in view.patterns.values()
    }
    return nodes, topics, patterns, set(view.services)


@contextmanager
def _convert_errors() -> Iterator[None]:
    # Converts exceptions of a back end's library to `NepError`.
    try:
        yield
    except NepError:
        raise
    except Exception as error:
        raise NepError(error_text(error)) from error


def _keyed_sink(network: str, sink: Sink) -> Sink:
    def forward(topic: str, messages: Sequence[Message]) -> None:
        sink(key_of(network, topic), messages)

    return forward
