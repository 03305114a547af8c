"""The networks that a person chose to look at beside the native one, and what is known of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Literal, Protocol

from app.core.alerts import Alerts
from app.core.network.mailbox import Batch
from app.core.network.nodes import NodeEntry, Nodes
from app.core.network.source import GraphSeen, MasterFound, MasterLost, Sink, WatchFailed
from app.core.network.topics import Topic, Topics, split_key
from app.core.networks.kinds import KINDS, NetworkKind, kind_named
from app.core.networks.source import OtherSource
from app.core.storage.settings import Settings
from nep.errors import NepError
from nep.i18n import _

KEPT = "networks"
"""Which are looked at, by kind: their addresses."""
LOOK_COMMAND = "network.look"
"""The window's command that lets a person choose."""
COUNT_S = 1.0

NetworkState = Literal["off", "looking", "there", "lost"]


class NetworkSource(Protocol):
    """What brings a network's graph and messages; see `app.core.network.source.Source`."""

    def start(self) -> None:
        """Begin."""

    def watch(self, topic: str) -> None:
        """Messages of it are wanted."""

    def unwatch(self, topic: str) -> None:
        """Messages of it are not wanted any more."""

    def end(self) -> None:
        """End soon; waits for nothing."""

    @property
    def has_ended(self) -> bool:
        """Whether its thread runs no more."""

    def close(self) -> None:
        """End; returns when its thread has."""


MakeNetwork = Callable[[NetworkKind, str, Sequence[Sink], Callable[[object], None]], NetworkSource]
"""Makes the source of a network of this kind and address."""


@dataclass(frozen=True, slots=True)
class NetworkEvent:
    """What a network's source told; ``number`` is the source's: one that was ended may still tell things."""

    kind: str
    number: int
    event: object


class OtherNetwork:
    """One of them. ``state`` is "off" until it is chosen; ``sentence`` says why it is "lost".

    ``unread`` has, by topic, why a topic that somebody looks at can't be read.
    """

    def __init__(self, kind: NetworkKind) -> None:
        """Not chosen yet."""
        self.kind = kind
        self.address = ""
        self.number = 0
        self.source: NetworkSource | None = None
        self.forget()

    def forget(self) -> None:
        """Nothing is known of it."""
        self.state: NetworkState = "off"
        self.sentence = ""
        self.topics, self.nodes = Topics(network=self.kind.name), Nodes(self.kind.name)
        self.unread: dict[str, str] = {}
        self._arrived: dict[str, tuple[int, int]] = {}
        self._counted_at: float | None = None

    @property
    def is_chosen(self) -> bool:
        """Whether it is looked at."""
        return self.source is not None

    def take(self, event: object, now: float) -> None:
        """What its source told."""
        match event:
            case GraphSeen():
                self.state, self.sentence = "there", ""
                self.topics.set_stale(False)
                self.nodes.set_stale(False)
                self.topics.update(event.view, now)
                self.nodes.update(event.view, now)
            case MasterLost():
                self.state, self.sentence = "lost", event.sentence
                self.topics.set_stale(True)
                self.nodes.set_stale(True)
            case MasterFound():
                pass  # the graph follows
            case WatchFailed():
                self.unread[event.topic] = event.sentence
            case _:
                pass

    def age(self, now: float, now_ns: int) -> None:
        """Let time pass; once a second what arrives is counted, where publishers don't tell it."""
        self.topics.age(now, now_ns)
        self.nodes.age(now)
        if self._counted_at is None or now - self._counted_at >= COUNT_S:
            passed_s = 0.0 if self._counted_at is None else now - self._counted_at
            self._arrived, self._counted_at = self.topics.count(passed_s, self._arrived), now


class Networks:
    """All kinds, chosen or not. One thread uses it (the window's); each network has a thread of its own."""

    def __init__(
        self,
        settings: Settings,
        sinks: Sequence[Sink],
        post_event: Callable[[object], None],
        alerts: Alerts,
        make: MakeNetwork = OtherSource,
    ) -> None:
        """``sinks`` take messages by their topics' names among all networks, ``post_event`` what is told.

        ``alerts`` say which network does not answer.
        """
        self._alerts = alerts
        self._settings, self._sinks, self._post_event, self._make = settings, tuple(sinks), post_event, make
        self._networks = {kind.name: OtherNetwork(kind) for kind in KINDS}
        self._watched: dict[str, set[str]] = {kind.name: set() for kind in KINDS}
        self._numbers = count(1)
        self._ending: list[NetworkSource] = []
        self._changes = 0

    def __iter__(self) -> Iterator[OtherNetwork]:
        """All of them, also those that are not chosen."""
        return iter(self._networks.values())

    def get(self, name: str) -> OtherNetwork | None:
        """The network of this kind; None for the native one."""
        return self._networks.get(name)

    @property
    def chosen(self) -> list[OtherNetwork]:
        """Those that are looked at."""
        return [network for network in self if network.is_chosen]

    @property
    def revision(self) -> int:
        """Grows with every change but that of figures."""
        return self._changes + sum(each.topics.revision + each.nodes.revision for each in self)

    @property
    def values_revision(self) -> int:
        """Grows when figures may have changed."""
        return sum(each.topics.values_revision + each.nodes.values_revision for each in self)

    @property
    def topics(self) -> list[Topic]:
        """The topics of all that are looked at."""
        return [topic for network in self.chosen for topic in network.topics]

    @property
    def nodes(self) -> list[NodeEntry]:
        """The nodes of all that are looked at."""
        return [node for network in self.chosen for node in network.nodes]

    def topic(self, key: str) -> Topic | None:
        """The topic of this name among all networks; None when it is native or not known."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        return network.topics.get(topic) if network is not None else None

    def unread(self, key: str) -> str:
        """Why this topic can't be read; empty when it can, or nobody looks at it."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        return network.unread.get(topic, "") if network is not None else ""

    # -- choosing --------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Look at those that were chosen before; whatever is kept and is no address is left out."""
        for name, address in self._kept().items():
            network = self._networks.get(name)
            if network is not None and isinstance(address, str):
                try:
                    self._begin(network, network.kind.checked(address))
                except NepError:
                    continue

    def choose(self, name: str, address: str) -> None:
        """Look at the network of this kind, at this address; kept for the next start.

        Raises `NepError` for what is no address there, `SettingsError` when it can't be kept.
        """
        network = self._networks[name]
        checked = network.kind.checked(address)
        if not network.is_chosen or checked != network.address:
            self._end(network)
            self._begin(network, checked)
        self._keep({**self._kept(), name: checked})

    def leave(self, name: str) -> None:
        """Look at it no more. Raises `SettingsError` when that can't be kept."""
        self._end(self._networks[name])
        self._keep({kind: address for kind, address in self._kept().items() if kind != name})

    def _kept(self) -> dict[str, object]:
        return self._settings.get(KEPT, {})

    def _keep(self, chosen: dict[str, object]) -> None:
        self._settings.set(KEPT, chosen)

    def _begin(self, network: OtherNetwork, address: str) -> None:
        number, kind = next(self._numbers), network.kind
        network.forget()
        network.address, network.number, network.state = address, number, "looking"

        def post(event: object) -> None:
            self._post_event(NetworkEvent(kind.name, number, event))

        network.source = self._make(kind, address, self._sinks, post)
        for topic in self._watched[kind.name]:
            network.source.watch(topic)
        network.source.start()
        self._changes += 1

    def _end(self, network: OtherNetwork) -> None:
        if network.source is not None:
            network.source.end()
            self._ending = [*(each for each in self._ending if not each.has_ended), network.source]
            network.source = None
            self._alerts.resolve(f"network:{network.kind.name}")
            self._changes += network.topics.revision + network.nodes.revision + 1
            network.forget()

    # -- what the session does -------------------------------------------------------------------------------

    def on_event(self, told: NetworkEvent, now: float) -> None:
        """Take over what a network's source told."""
        network = self._networks[told.kind]
        if network.is_chosen and told.number == network.number:
            before = network.state
            network.take(told.event, now)
            if network.state != before:
                self._changes += 1
                self._tell(network)

    def _tell(self, network: OtherNetwork) -> None:
        """An alert says what is wrong with it, as long as that is so."""
        id = f"network:{network.kind.name}"
        if network.state != "lost":
            self._alerts.resolve(id)
            return
        self._alerts.put(
            id,
            "warn",
            _("{network} can't be shown now.").format(network=network.kind.words),
            f"{network.sentence[:1].upper()}{network.sentence[1:]}.",
            button=_("Other networks"),
            action=LOOK_COMMAND,
            count=0,
        )

    def add(self, key: str, batch: Batch, now: float) -> None:
        """Take over what arrived on a topic that is looked at."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        if network is None or not network.is_chosen or topic not in self._watched[name]:
            return
        network.topics.add(topic, batch, now)
        network.topics[topic].watched = True
        network.unread.pop(topic, None)

    def watch(self, key: str) -> None:
        """Somebody looks at a topic."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        if network is None:
            return
        self._watched[name].add(topic)
        known = network.topics.get(topic)
        if known is not None:
            known.watched = True
        if network.source is not None:
            network.source.watch(topic)

    def unwatch(self, key: str) -> None:
        """Nobody looks at a topic any more."""
        name, topic = split_key(key)
        network = self._networks.get(name)
        if network is None:
            return
        self._watched[name].discard(topic)
        network.topics.unwatch(topic)
        network.unread.pop(topic, None)
        if network.source is not None:
            network.source.unwatch(topic)

    def age(self, now: float, now_ns: int) -> None:
        """Let time pass."""
        for network in self.chosen:
            network.age(now, now_ns)

    def close(self) -> None:
        """End all; returns when their threads have ended."""
        for network in self:
            if network.source is not None:
                network.source.end()
                self._ending.append(network.source)
                network.source = None
        for source in self._ending:
            source.close()
        self._ending.clear()


def lost_words(network: OtherNetwork) -> str:
    """Why nothing new is known of it: "ROS 1: no ROS master answers at ..."; empty while it is well."""
    if network.state != "lost":
        return ""
    return _("{network}: {reason}.").format(network=network.kind.words, reason=network.sentence)


def network_words(name: str) -> str:
    """What people call the network of this kind; "NEP" for the native one."""
    kind = kind_named(name)
    return kind.words if kind is not None else "NEP"


def topic_words(key: str) -> str:
    """What a topic is called: "/camera", or "/camera on ROS 2"."""
    name, topic = split_key(key)
    return _("{topic} on {network}").format(topic=topic, network=network_words(name)) if name else topic


def by_network(batches: Mapping[str, Batch]) -> tuple[dict[str, Batch], dict[str, Batch]]:
    """Batches by topic: those of the native network, and those of others."""
    native: dict[str, Batch] = {}
    others: dict[str, Batch] = {}
    for key, batch in batches.items():
        (others if split_key(key)[0] else native)[key] = batch
    return native, others
