"""Networks with fake sources, whose events a test posts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from app.core.alerts.alerts import Alerts
from app.core.network.source import Sink
from app.core.networks.kinds import NetworkKind
from app.core.networks.networks import NetworkEvent, Networks
from app.core.storage.settings import Settings
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo


class Fake:
    """Fake source that posts the events of a test."""

    def __init__(
        self,
        kind: NetworkKind,
        address: str,
        sinks: Sequence[Sink],
        post_event: Callable[[object], None],
    ) -> None:
        self.kind, self.address, self.sinks, self.tell = kind, address, sinks, post_event
        self.wanted: set[str] = set()
        self.said: list[str] = []

    def start(self) -> None:
        self.said.append("start")

    def watch(self, topic: str) -> None:
        self.wanted.add(topic)

    def unwatch(self, topic: str) -> None:
        self.wanted.discard(topic)

    def request_stop(self) -> None:
        self.said.append("end")

    @property
    def has_ended(self) -> bool:
        return "close" in self.said

    def close(self) -> None:
        self.said.append("close")


class World:
    """Networks with fake sources, and the events that these have posted."""

    def __init__(self, settings: Settings) -> None:
        self.made: list[Fake] = []
        self.posted: list[NetworkEvent] = []
        self.settings = settings
        self.alerts = Alerts()
        self.networks = Networks(settings, [], self.post, self.alerts, self.make)

    def post(self, event: object) -> None:
        assert isinstance(event, NetworkEvent)
        self.posted.append(event)

    def make(
        self, kind: NetworkKind, address: str, sinks: Sequence[Sink], post: Callable[[object], None]
    ) -> Fake:
        self.made.append(Fake(kind, address, sinks, post))
        return self.made[-1]

    def tell(self, event: object, now: float = 0.0, source: int = -1) -> None:
        """Post an event from a source, by default the newest, and process it."""
        self.made[source].tell(event)
        self.networks.on_event(self.posted.pop(), now)


def graph(*topics: str, rate_hz: float | None = None, revision: int = 1) -> GraphView:
    publisher = PublisherInfo(1, "/arm", (), False, 0, 0, 0, None, rate_hz, None)
    infos = {name: TopicInfo(name, "std_msgs/String", "ros", (publisher,), (), rate_hz) for name in topics}
    return GraphView(1, revision, {"/arm": NodeInfo("/arm", "arm", "", None, "", "ros", 0)}, infos)
