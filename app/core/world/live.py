"""Live network as a world: what its sources deliver, also while another world is shown."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from app.core.alerts.alerts import Alerts
from app.core.faults import FaultAlerts, log_errors
from app.core.network.decode_checks import CheckResult, DecodeChecker
from app.core.network.graph_changes import change_messages
from app.core.network.mailbox import Batch, Mailbox
from app.core.network.master import MasterChangeDetector, MasterState
from app.core.network.source import (
    GraphReceived,
    JobFailed,
    MasterFound,
    MasterLost,
    Sink,
    Source,
    WatchFailed,
)
from app.core.network.topics import split_key
from app.core.networks.networks import NetworkEvent, Networks
from app.core.storage.settings import Settings
from app.core.world.world import World
from app.intents import OPEN_DOCTOR_LABEL, OpenDoctor
from nep.i18n import _, lazy, ngettext
from nep.messages.message import Message
from nep.nodes.log_handler import LAST_ERRORS_TOPIC, LAST_ERRORS_TYPE, LOG_TOPIC, LOG_TYPE
from nep.protocol.graph_view import GraphView

LOG_TOPICS = {LOG_TOPIC: LOG_TYPE, LAST_ERRORS_TOPIC: LAST_ERRORS_TYPE}
"""Message types of the topics that are shown in the Console, by topic."""

LiveEvent = GraphReceived | MasterFound | MasterLost | WatchFailed | JobFailed | NetworkEvent
"""Event of a source of the live network."""


class LiveWorld(World):
    """Live network and the other networks that are shown.

    Parts of the session read what has arrived since the last tick from ``batches`` and ``new_graph``.

    Attributes:
        master: State of the connection to the master.
        networks: Networks in addition to the native one, which the user can join.
        source: Source of the native network.
        batches: Messages of the native network since the last tick, by topic; also of topics that have just
            lost their last watch.
        new_graph: Graph that was received since the last tick, or None.
        on_unsubscribed: Called with a topic when its last watch is suspended or closed.
        on_forgotten: Called with a topic when its last watch is closed.
    """

    is_live = True
    task = lazy("update the topics and nodes")
    networks: Networks

    def __init__(
        self,
        create_source: Callable[[Sequence[Sink], Callable[[object], None]], Source],
        settings: Settings,
        alerts: Alerts,
        mailbox: Mailbox,
        faults: FaultAlerts,
        *,
        sink: Sink,
        clock: Callable[[], float] = time.monotonic,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        # `sink` gets the messages of all networks in the receiving thread, like `mailbox`.
        self._alerts, self._mailbox, self._faults = alerts, mailbox, faults
        self._decode_checker = DecodeChecker()
        self.on_unsubscribed: Callable[[str], object] = _ignore_topic
        self.on_forgotten: Callable[[str], object] = _ignore_topic
        sinks: tuple[Sink, ...] = (mailbox.post, self._offer_images, sink)
        self.source: Source = create_source((self._decode_checker.check, *sinks), mailbox.post_event)
        networks = Networks(settings, sinks, mailbox.post_event, alerts)
        super().__init__(networks=networks, clock=clock, now_ns=now_ns)
        self.master = MasterState("searching", self.source.address)
        self._master_change_detector = MasterChangeDetector()
        self.batches: Mapping[str, Batch] = {}
        self.new_graph: GraphView | None = None

    def start(self) -> None:
        """Join the network and the other networks that were shown before."""
        self.source.start()
        self.networks.start()

    def take_events(self) -> list[object]:
        """Begin a tick, and return the events since the last one, oldest first. Call `tick` after them."""
        self.batches, self.new_graph = {}, None
        events, lost_count = self._mailbox.drain_events()
        if lost_count:
            self._alerts.raise_alert(
                "mailbox",
                "warn",
                ngettext(
                    "{count} event was lost because the window was busy.",
                    "{count} events were lost because the window was busy.",
                    lost_count,
                ).format(count=lost_count),
                _("Panels may be up to a second out of date."),
                count=lost_count,
            )
        return events

    def on_event(self, event: LiveEvent) -> None:
        """Apply an event of a source."""
        match event:
            case GraphReceived():
                self._on_graph(event.view)
            case MasterFound():
                self.master = MasterState("connected", event.address)
                self._alerts.resolve("master")
                self._alerts.resolve("companion:master")
                self.console.add("info", "master", _("connected to {address}").format(address=event.address))
            case MasterLost():
                self._on_master_lost(event)
            case WatchFailed():
                self._alerts.raise_alert(
                    f"watch:{event.topic}",
                    "warn",
                    _("Can't subscribe to {topic}.").format(topic=event.topic),
                    event.message,
                )
            case JobFailed():
                if event.message_template:
                    text = _(event.message_template).format(error=event.message)
                    self.console.add("error", "studio", text)
            case NetworkEvent():
                self.networks.on_event(event, self._clock())

    def tick(self) -> None:
        """Apply the messages since the last tick, and update the ages of topics and nodes."""
        batches, now = self._mailbox.drain(), self._clock()
        self.batches = {key: batch for key, batch in batches.items() if not split_key(key)[0]}
        for key, batch in batches.items():
            with self._faults.guarded(lazy("receive messages of {topic}"), topic=key):
                if key in LOG_TOPICS:
                    self.console.add_messages(batch.messages, batch.dropped)
                if key in self.batches:
                    self.add(key, batch)
                else:
                    self.networks.add(key, batch, now)
        with self._faults.guarded(lazy("update the plots")):
            self.series.dispatch(batches)
        now_ns = self.now_ns()
        self.topics.update_ages(now, now_ns)
        self.nodes.update_ages(now)
        self.networks.update_ages(now, now_ns)

    def close(self) -> None:
        """Leave all networks, and release the messages of the last tick, which may be in shared memory."""
        self.batches = {}
        for close in (self.images.close, self.source.close, self.networks.close):
            with log_errors("leave the network"):
                close()

    def pop_check_results(self) -> dict[str, CheckResult]:
        """Return and clear the results of decoding the messages of watched topics."""
        results = self._decode_checker.pop_results()
        return {topic: result for topic, result in results.items() if self.is_watched(topic)}

    def lost_counts(self) -> dict[str, int]:
        """Return the number of messages lost on each watched topic since its watch began."""
        counts = self.source.lost_counts()
        return {topic: count for topic, count in counts.items() if self.is_watched(topic)}

    # -- overridden --------------------------------------------------------------------------------

    def subscribe(self, topic: str) -> None:
        """Subscribe to a topic as soon as it exists."""
        if split_key(topic)[0]:
            self.networks.watch(topic)
        else:
            self.source.watch(topic)

    def unsubscribe(self, topic: str) -> None:
        """Unsubscribe from a topic."""
        if split_key(topic)[0]:
            self.networks.unwatch(topic)
        else:
            self.source.unwatch(topic)
            self.on_unsubscribed(topic)

    def on_released(self, topic: str) -> None:
        """Call `on_forgotten`."""
        self.on_forgotten(topic)

    def set_capacity(self, topic: str, count: int | None) -> None:
        """Set how many messages of a topic the mailbox keeps."""
        self._mailbox.set_capacity(topic, count)

    # -- private -----------------------------------------------------------------------------------

    def _offer_images(self, topic: str, messages: Sequence[Message]) -> None:
        self.images.offer(messages, topic)

    def _on_graph(self, view: GraphView) -> None:
        previous, now = self.graph, self._clock()
        if self._master_change_detector.is_incomplete(previous, view, now):
            return
        if previous is not None and (previous.epoch, previous.revision) != (view.epoch, view.revision):
            for line in change_messages(previous, view):
                self.console.add("info", "master", line)
        self.graph = self.new_graph = view
        self.topics.update(view, now)
        self.nodes.update(view, now)

    def _on_master_lost(self, event: MasterLost) -> None:
        was_connected = self.master.kind == "connected"
        self.master = MasterState("none", event.address, event.message)
        if was_connected:
            self.console.add("error", "master", event.message)
            self._alerts.raise_alert(
                "master",
                "warn",
                _("Lost the connection to the master."),
                _("Connected programs keep running. New programs can't join until a master responds."),
                button=_(OPEN_DOCTOR_LABEL),
                intent=OpenDoctor(),
            )
            self.topics.values_revision += 1


def _ignore_topic(_topic: str) -> None: ...
