"""State of the networks that are shown in addition to the native one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Literal, Protocol

from app.core.alerts.alerts import Alerts
from app.core.network.mailbox import Batch
from app.core.network.nodes import NodeEntry, Nodes
from app.core.network.source import GraphReceived, MasterFound, MasterLost, Sink, WatchFailed
from app.core.network.topics import Topic, Topics, split_key
from app.core.networks.kinds import KINDS, NetworkKind, find_kind
from app.core.networks.source import OtherSource
from app.core.storage.settings import Settings
from app.intents import BrowseNetworks
from nep.errors import NepError
from nep.i18n import _

COUNT_INTERVAL_S = 1.0

NetworkState = Literal["off", "looking", "there", "lost"]


class NetworkSource(Protocol):
    """Source of a network's graph and messages (see `app.core.network.source.Source`)."""

    def start(self) -> None:
        """Start the source."""

    def watch(self, topic: str) -> None:
        """Subscribe to a topic."""

    def unwatch(self, topic: str) -> None:
        """Unsubscribe from a topic."""

    def request_stop(self) -> None:
        """Signal the thread to stop, without waiting for it."""

    @property
    def has_ended(self) -> bool:
        """True if the thread has ended."""

    def close(self) -> None:
        """Stop the thread and wait for it."""


NetworkSourceFactory = Callable[[NetworkKind, str, Sequence[Sink], Callable[[object], None]], NetworkSource]
"""Factory of a network's source, given the kind, the address, the message sinks, and the event callback."""


@dataclass(frozen=True, slots=True)
class NetworkEvent:
    """Event of the source of a network.

    Attributes:
        kind: Name of the kind of network.
        number: Number of the source; events of a source that was replaced are ignored.
        event: Event of the source.
    """

    kind: str
    number: int
    event: object


class OtherNetwork:
    """State of one network that is not the native one.

    Attributes:
        state: State of the connection; "off" while the network isn't shown.
        sentence: Reason for the state "lost", or "".
        read_problems: Reason why a watched topic can't be read, by topic.
    """

    def __init__(self, kind: NetworkKind) -> None:
        self.kind = kind
        self.address = ""
        self.number = 0
        self.source: NetworkSource | None = None
        self.reset()

    def reset(self) -> None:
        """Reset the state to "off", without topics and nodes."""
        self.state: NetworkState = "off"
        self.sentence = ""
        self.topics, self.nodes = Topics(network=self.kind.name), Nodes(self.kind.name)
        self.read_problems: dict[str, str] = {}
        self._received_totals: dict[str, tuple[int, int]] = {}
        self._counted_s: float | None = None

    @property
    def is_selected(self) -> bool:
        """True if the network is shown."""
        return self.source is not None

    def on_event(self, event: object, now: float) -> None:
        """Apply an event of the network's source."""
        match event:
            case GraphReceived():
                self.state, self.sentence = "there", ""
                self.topics.set_stale(False)
                self.nodes.set_stale(False)
                self.topics.update(event.view, now)
                self.nodes.update(event.view, now)
            case MasterLost():
                self.state, self.sentence = "lost", event.message
                self.topics.set_stale(True)
                self.nodes.set_stale(True)
            case MasterFound():
                pass  # the graph follows
            case WatchFailed():
                self.read_problems[event.topic] = event.message
            case _:
                pass

    def update_ages(self, now: float, now_ns: int) -> None:
        """Update the ages. Once a second, also measure rates that publishers don't report.

        Args:
            now: Monotonic seconds.
            now_ns: Current time in ns since 1970.
        """
        self.topics.update_ages(now, now_ns)
        self.nodes.update_ages(now)
        if self._counted_s is None or now - self._counted_s >= COUNT_INTERVAL_S:
            passed_s = 0.0 if self._counted_s is None else now - self._counted_s
            self._received_totals, self._counted_s = (
                self.topics.measure_rates(passed_s, self._received_totals),
                now,
            )


class NetworkList:
    """Networks that are shown in addition to the native one; none by default. Not thread-safe."""

    def __init__(self) -> None:
        self._networks = {kind.name: OtherNetwork(kind) for kind in KINDS}
        self._change_count = 0

    def __iter__(self) -> Iterator[OtherNetwork]:
        return iter(self._networks.values())

    def get(self, name: str) -> OtherNetwork | None:
        """Return the network of this kind; None for "" (the native network) and unknown kinds."""
        return self._networks.get(name)

    @property
    def selected_networks(self) -> list[OtherNetwork]:
        """Networks that are shown."""
        return [network for network in self if network.is_selected]

    @property
    def revision(self) -> int:
        """Counter that increases with every change, except changes of statistics."""
        return self._change_count + sum(each.topics.revision + each.nodes.revision for each in self)

    @property
    def values_revision(self) -> int:
        """Counter that increases when statistics may have changed."""
        return sum(each.topics.values_revision + each.nodes.values_revision for each in self)

    @property
    def topics(self) -> list[Topic]:
        """Topics of all shown networks."""
        return [topic for network in self.selected_networks for topic in network.topics]

    @property
    def nodes(self) -> list[NodeEntry]:
        """Nodes of all shown networks."""
        return [node for network in self.selected_networks for node in network.nodes]

    def topic(self, key: str) -> Topic | None:
        """Return the topic with this key; None if it is native or unknown."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        return network.topics.get(topic) if network is not None else None

    def read_problem(self, key: str) -> str:
        """Return the reason why a watched topic can't be read, or ""."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        return network.read_problems.get(topic, "") if network is not None else ""


class Networks(NetworkList):
    """Networks that the user can join. Not thread-safe; use it from the main thread.

    Each shown network has its own background thread.
    """

    def __init__(
        self,
        settings: Settings,
        sinks: Sequence[Sink],
        post_event: Callable[[object], None],
        alerts: Alerts,
        create_source: NetworkSourceFactory = OtherSource,
    ) -> None:
        # `sinks` get messages by topic key (`key_of`); `post_event` gets the sources' events.
        super().__init__()
        self._alerts = alerts
        self._settings, self._sinks, self._post_event, self._create_source = (
            settings,
            tuple(sinks),
            post_event,
            create_source,
        )
        self._watched_topics: dict[str, set[str]] = {kind.name: set() for kind in KINDS}
        self._numbers = count(1)
        self._ending_sources: list[NetworkSource] = []

    # -- choosing --------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Join the saved networks; invalid saved addresses are skipped."""
        for name, address in self._settings.networks.items():
            network = self._networks.get(name)
            if network is not None and isinstance(address, str):
                try:
                    self._start(network, network.kind.validate_address(address))
                except NepError:
                    continue

    def select(self, name: str, address: str) -> None:
        """Connect to a network, show it, and save the choice for the next start.

        Raises:
            NepError: The address is invalid.
            SettingsError: The choice can't be saved.
        """
        network = self._networks[name]
        valid_address = network.kind.validate_address(address)
        if not network.is_selected or valid_address != network.address:
            self._stop(network)
            self._start(network, valid_address)
        self._settings.networks = {**self._settings.networks, name: valid_address}

    def deselect(self, name: str) -> None:
        """Stop showing a network. Raises `SettingsError` if the choice can't be saved."""
        self._stop(self._networks[name])
        addresses = self._settings.networks
        self._settings.networks = {kind: address for kind, address in addresses.items() if kind != name}

    def _start(self, network: OtherNetwork, address: str) -> None:
        number, kind = next(self._numbers), network.kind
        network.reset()
        network.address, network.number, network.state = address, number, "looking"

        def post(event: object) -> None:
            self._post_event(NetworkEvent(kind.name, number, event))

        network.source = self._create_source(kind, address, self._sinks, post)
        for topic in self._watched_topics[kind.name]:
            network.source.watch(topic)
        network.source.start()
        self._change_count += 1

    def _stop(self, network: OtherNetwork) -> None:
        if network.source is not None:
            network.source.request_stop()
            self._ending_sources = [
                *(each for each in self._ending_sources if not each.has_ended),
                network.source,
            ]
            network.source = None
            self._alerts.resolve(f"network:{network.kind.name}")
            self._change_count += network.topics.revision + network.nodes.revision + 1
            network.reset()

    # -- interface of the session ----------------------------------------------------------------------------

    def on_event(self, network_event: NetworkEvent, now: float) -> None:
        """Apply an event of a network's source."""
        network = self._networks[network_event.kind]
        if network.is_selected and network_event.number == network.number:
            previous_state = network.state
            network.on_event(network_event.event, now)
            if network.state != previous_state:
                self._change_count += 1
                self._update_alert(network)

    def _update_alert(self, network: OtherNetwork) -> None:
        id = f"network:{network.kind.name}"
        if network.state != "lost":
            self._alerts.resolve(id)
            return
        self._alerts.raise_alert(
            id,
            "warn",
            _("{network} can't be shown now.").format(network=network.kind.product_name),
            f"{network.sentence[:1].upper()}{network.sentence[1:]}.",
            button=_("Other networks"),
            intent=BrowseNetworks(),
            count=0,
        )

    def add(self, key: str, batch: Batch, now: float) -> None:
        """Add messages received on a watched topic. Messages of other topics are discarded."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        if network is None or not network.is_selected or topic not in self._watched_topics[name]:
            return
        network.topics.add(topic, batch, now)
        network.topics[topic].is_watched = True
        network.read_problems.pop(topic, None)

    def watch(self, key: str) -> None:
        """Watch the topic with this key (see `key_of`). Keys of native topics are ignored."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        if network is None:
            return
        self._watched_topics[name].add(topic)
        known_topic = network.topics.get(topic)
        if known_topic is not None:
            known_topic.is_watched = True
        if network.source is not None:
            network.source.watch(topic)

    def unwatch(self, key: str) -> None:
        """Stop watching the topic with this key. Keys of native topics are ignored."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        if network is None:
            return
        self._watched_topics[name].discard(topic)
        network.topics.unwatch(topic)
        network.read_problems.pop(topic, None)
        if network.source is not None:
            network.source.unwatch(topic)

    def update_ages(self, now: float, now_ns: int) -> None:
        """Update the ages of nodes and topics.

        Args:
            now: Monotonic seconds.
            now_ns: Current time in ns since 1970.
        """
        for network in self.selected_networks:
            network.update_ages(now, now_ns)

    def close(self) -> None:
        """Stop all sources and wait for their threads."""
        for network in self:
            if network.source is not None:
                network.source.request_stop()
                self._ending_sources.append(network.source)
                network.source = None
        for source in self._ending_sources:
            source.close()
        self._ending_sources.clear()


def lost_message(network: OtherNetwork) -> str:
    """Return the reason why the connection to a network was lost, or "".

    Example: "ROS 1: no ROS master replied at ...".
    """
    if network.state != "lost":
        return ""
    return _("{network}: {reason}.").format(network=network.kind.product_name, reason=network.sentence)


def network_label(name: str) -> str:
    """Return the product name of the network of this kind; "NEP" for the native one."""
    kind = find_kind(name)
    return kind.product_name if kind is not None else "NEP"


def topic_label(key: str) -> str:
    """Return the display name of a topic: "/camera", or "/camera on ROS 2"."""
    name, topic = split_key(key)
    return _("{topic} on {network}").format(topic=topic, network=network_label(name)) if name else topic
