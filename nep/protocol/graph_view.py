"""What the master knows, as frozen values: nodes, topics, publishers, subscribers, services, alerts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

__all__ = [
    "BRIDGES_TOPIC",
    "Alert",
    "ClientInfo",
    "GraphView",
    "NodeInfo",
    "PatternInfo",
    "PublisherInfo",
    "ServerInfo",
    "ServiceInfo",
    "SubscriberInfo",
    "TopicInfo",
]

BRIDGES_TOPIC = "/nep/bridges"
"""Bridges tell here what they join and how many messages they have carried: who publishes here is one."""


@dataclass(frozen=True)
class Alert:
    """A present problem, for people.

    `id`: what it is about, such as "type:/camera". `sentence`: what is wrong. `hint`: what to do.
    """

    id: str
    sentence: str
    hint: str = ""


@dataclass(frozen=True)
class NodeInfo:
    """A program, or a part of one.

    `id`: 16 hexadecimal digits. `host`: its computer's name. `pid`: its process, None if not known.
    `since_ns`: when it was made, in nanoseconds since 1970 by its own clock. `generation` is "native",
    "gateway", or the original NEP's "A", "B".

    `cpu_ratio` is the share of one core that its process used between its last two renewals (0.5 is half a
    core), None until known; nodes of one process have the same. `clock_offset_ns`: what to add to its
    computer's clock for the master's, known to `clock_uncertainty_ns` to both sides; 0 and 0 on the
    master's own computer, None until known.
    """

    id: str
    name: str
    host: str
    pid: int | None
    language: str
    generation: str
    since_ns: int
    cpu_ratio: float | None = None
    clock_offset_ns: int | None = None
    clock_uncertainty_ns: int | None = None


@dataclass(frozen=True)
class PublisherInfo:
    """A publisher. Its counters are those of its last renewal, one second old at most; in large graphs more.

    `endpoints` is empty for the original NEP's. `latched`: it keeps messages for who comes later. `count`:
    messages so far. `bytes`: of their payloads. `last_seq`: the number of the newest. `last_stamp_ns`: its
    time, in nanoseconds since 1970 by the publisher's clock. `rate_hz`: messages a second, None until known.
    `bandwidth_Bps`: bytes a second, None until known.
    """

    id: int
    node_id: str
    endpoints: tuple[str, ...]
    latched: bool
    count: int
    bytes: int
    last_seq: int
    last_stamp_ns: int | None
    rate_hz: float | None
    bandwidth_Bps: float | None  # noqa: N815 - B/s


@dataclass(frozen=True)
class SubscriberInfo:
    """A subscriber.

    `received`: messages that arrived. `lost`: messages that did not. Both are None where nobody can count
    them (the original NEP).
    """

    id: int
    node_id: str
    received: int | None
    lost: int | None


@dataclass(frozen=True)
class TopicInfo:
    """A topic with everybody on it. Rates are sums over its publishers; loss over its subscribers.

    `codec`: how its publishers encode, empty when there is none. `rate_hz`: messages a second.
    `bandwidth_Bps`: bytes a second. `last_stamp_ns`: of the newest message, in nanoseconds since 1970.
    `loss_ratio`: lost ones of all that should have arrived, 0 to 1. What nobody knows is None.
    """

    name: str
    msg_type: str
    codec: str
    publishers: tuple[PublisherInfo, ...] = ()
    subscribers: tuple[SubscriberInfo, ...] = ()
    rate_hz: float | None = None
    bandwidth_Bps: float | None = None  # noqa: N815 - B/s
    last_stamp_ns: int | None = None
    lost: int | None = None
    loss_ratio: float | None = None


@dataclass(frozen=True)
class PatternInfo:
    """Subscribers whose topic has wildcards, such as "/robot/*/camera": they hear many topics, it is none."""

    name: str
    msg_type: str
    subscribers: tuple[SubscriberInfo, ...] = ()


@dataclass(frozen=True)
class ServerInfo:
    """A server of a service.

    `calls`: those that were answered. `errors`: of these, those answered with an error. `bytes`: the size of
    the answers.
    """

    id: int
    node_id: str
    endpoints: tuple[str, ...]
    calls: int
    errors: int
    bytes: int


@dataclass(frozen=True)
class ClientInfo:
    """A client of a service.

    `answered`: calls that were, also with an error. `failed`: those that ended without an answer. Both are
    None until known.
    """

    id: int
    node_id: str
    answered: int | None
    failed: int | None


@dataclass(frozen=True)
class ServiceInfo:
    """A service with all its servers, the one that is called first, and its clients. Counts are sums."""

    name: str
    msg_type: str
    servers: tuple[ServerInfo, ...] = ()
    clients: tuple[ClientInfo, ...] = ()
    calls: int = 0
    errors: int = 0


@dataclass(frozen=True)
class GraphView:
    """The whole graph at one moment.

    `epoch`: another number after the master was started again. `revision`: grows when somebody comes or goes,
    not with statistics. `nodes`: by id. `topics`: by name. `services`: by name. `alerts`: what is wrong now.
    `listens`: the addresses at which the master serves other computers; none when it serves its own only.
    """

    epoch: int
    revision: int
    nodes: Mapping[str, NodeInfo] = field(default_factory=dict)
    topics: Mapping[str, TopicInfo] = field(default_factory=dict)
    alerts: tuple[Alert, ...] = ()
    listens: tuple[str, ...] = ()
    services: Mapping[str, ServiceInfo] = field(default_factory=dict)
    patterns: Mapping[str, PatternInfo] = field(default_factory=dict)

    def to_plain(self) -> dict[str, object]:
        """The view as maps and lists, for the wire and for `--json`."""
        return {
            "epoch": self.epoch,
            "revision": self.revision,
            "nodes": [asdict(node) for node in self.nodes.values()],
            "topics": [asdict(topic) for topic in self.topics.values()],
            "alerts": [asdict(alert) for alert in self.alerts],
            "listens": list(self.listens),
            "services": [asdict(service) for service in self.services.values()],
            "patterns": [asdict(pattern) for pattern in self.patterns.values()],
        }
