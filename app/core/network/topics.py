"""Topics of the network with their statistics and newest messages."""

from __future__ import annotations

import os
import platform
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice

from app.core.network.mailbox import Batch
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView, TopicInfo

GONE_DISPLAY_S = 10.0
MAX_RATES = 60
MAX_TOPICS_PER_UPDATE = 1500
START_GRACE_S = 5.0
"""Time in seconds that a publisher may need for its first message after a subscription.

Some cameras start only when the topic is subscribed to.
"""
MIN_REPORTED_SILENCE_S = 6.0
"""Minimum silence in seconds of topics whose message counts are known only from reports of nodes.

In large graphs, nodes report every 5 s.
"""


_SEPARATOR = " "


def key_of(network: str, topic: str) -> str:
    """Return the key of a topic, unique among all networks, such as "ros2 /camera".

    For the native network (""), the key is the name of the topic. Names of native topics contain no
    space, so keys are unambiguous.
    """
    return f"{network}{_SEPARATOR}{topic}" if network else topic


def split_key(key: str) -> tuple[str, str]:
    """Split a topic key (see `key_of`) into the network and the name of the topic."""
    network, separator, topic = key.partition(_SEPARATOR)
    return (network, topic) if separator else ("", key)


@dataclass(slots=True, eq=False)
class Topic:
    """One topic. Unknown statistics are None; panels leave them blank.

    Attributes:
        rate_hz: Messages per second, as reported by the publishers.
        bandwidth_Bps: Bytes per second, as reported by the publishers.
        age_s: Seconds since the time stamp of the newest message.
        silent_s: Seconds without a message although the topic has subscribers; None without
            subscribers, because some publishers send only to subscribers.
        lost: Number of lost messages.
        loss_ratio: Lost messages as a share of all messages that the subscribers should have received.
        gone_s: Seconds since the topic vanished; None while it exists.
        newest: Newest message; like `previous`, only while the topic is watched.
        received: Number of messages received since the watch began.
        dropped: Number of messages discarded before a panel read them, since the watch began.
        missed: Number of messages sent but not received here, since the watch began.
        network: Kind of network; "" for the native one.
        is_stale: True if the network can't be queried at the moment.
        measured_rates: Measured rate (messages and bytes per second) of a watched topic whose publishers
            report no rate.
    """

    name: str
    msg_type: str = ""
    codec: str = "bytes"
    publishers: int = 0
    publisher_nodes: tuple[str, ...] = ()
    subscribers: int = 0
    rate_hz: float | None = None
    bandwidth_Bps: float | None = None  # noqa: N815  unit: bytes per second
    age_s: float | None = None
    silent_s: float | None = None
    lost: int | None = None
    loss_ratio: float | None = None
    is_new: bool = False
    gone_s: float | None = None
    rates: deque[float] = field(default_factory=lambda: deque(maxlen=MAX_RATES))
    newest: Message | None = None
    previous: Message | None = None
    received: int = 0
    dropped: int = 0
    missed: int = 0
    is_watched: bool = False
    gone_since_s: float | None = None
    last_stamp_ns: int | None = None
    last_received_s: float | None = None
    subscribed_since_s: float | None = None
    last_activity_s: float | None = None
    info: TopicInfo | None = None
    network: str = ""
    is_stale: bool = False
    measured_rates: tuple[float, float] | None = None
    received_bytes: int = 0

    @property
    def key(self) -> str:
        """Key of the topic, unique among all networks."""
        return key_of(self.network, self.name)

    @property
    def displayed_and_sent_counts(self) -> tuple[int, int]:
        """Number of messages passed to panels, and number of messages sent, since the watch began."""
        return self.received - self.dropped, self.received + self.missed

    def static_values(self) -> tuple[object, ...]:
        """Return the values that change rarely. Panels rebuild their rows if one of these values changes."""
        is_gone = self.gone_since_s is not None
        return (self.msg_type, self.codec, self.publisher_nodes, self.is_new, is_gone, self.is_stale)


class Topics:
    """All topics, in order of their first appearance. Not thread-safe; use it from the main thread."""

    def __init__(self, own_process: tuple[str, int] | None = None, network: str = "") -> None:
        # `own_process` is (host, process id) of the watching process: a topic with no other subscriber
        # counts as vanished.
        self._network = network
        self._own_process = own_process if own_process is not None else (platform.node(), os.getpid())
        self._topics: dict[str, Topic] = {}
        self._is_first_graph = True
        self._view_version = (-1, -1)
        self._view: GraphView | None = None
        self._clock_offsets_ns: Mapping[str, int] = {}
        """Clock offset (ns) of each node on another computer, to be added to times of that node."""
        self._next_index = 0
        self._reported_s = 0.0
        self._hidden_names: set[str] = set()  # vanished, but still watched
        self.revision = 0
        self.values_revision = 0

    def __iter__(self) -> Iterator[Topic]:
        return (topic for topic in self._topics.values() if topic.name not in self._hidden_names)

    def __len__(self) -> int:
        return len(self._topics) - len(self._hidden_names)

    def __getitem__(self, name: str) -> Topic:
        return self._topics[name]

    def __contains__(self, name: object) -> bool:
        return name in self._topics

    def get(self, name: str) -> Topic | None:
        """Return the topic with this name, or None."""
        return self._topics.get(name)

    def existing_topics(self) -> list[Topic]:
        """Return the topics that have not vanished."""
        return [topic for topic in self._topics.values() if topic.gone_since_s is None]

    def topics_of_type(self, *msg_types: str) -> list[Topic]:
        """Return the existing topics that have one of these message types."""
        return [topic for topic in self.existing_topics() if topic.msg_type in msg_types]

    def mark_seen(self, name: str) -> None:
        """Stop highlighting a topic as new."""
        topic = self._topics.get(name)
        if topic is not None and topic.is_new:
            topic.is_new = False
            self.revision += 1

    def update(self, view: GraphView, now: float) -> None:
        """Apply a new graph at ``now`` (monotonic seconds).

        If no node or topic has changed, only the statistics are updated. The statistics of more than
        `MAX_TOPICS_PER_UPDATE` topics are updated in parts, by `update_ages`.
        """
        version = (view.epoch, view.revision)
        self._clock_offsets_ns = self._clock_offsets(view)
        if version != self._view_version:
            self._apply_graph(view, now)
        elif len(self._topics) <= MAX_TOPICS_PER_UPDATE:
            _update_statistics(self._topics.values(), view, now, self._clock_offsets_ns)
        self._view_version, self._view, self._reported_s = version, view, now
        self.values_revision += 1

    def _own_node_ids(self, view: GraphView) -> set[str]:
        return {id for id, node in view.nodes.items() if (node.host, node.pid) == self._own_process}

    def _clock_offsets(self, view: GraphView) -> Mapping[str, int]:
        offsets_ns = {
            id: node.clock_offset_ns for id, node in view.nodes.items() if node.clock_offset_ns is not None
        }
        if not any(offsets_ns.values()):
            return {}  # all nodes are on the master's computer
        own_offset_ns = next((offsets_ns[id] for id in self._own_node_ids(view) if id in offsets_ns), None)
        return (
            {}
            if own_offset_ns is None
            else {id: offset - own_offset_ns for id, offset in offsets_ns.items() if offset != own_offset_ns}
        )

    def _apply_graph(self, view: GraphView, now: float) -> None:
        own_node_ids = self._own_node_ids(view)
        listed_topics = {
            name: info
            for name, info in view.topics.items()
            if info.publishers or any(each.node_id not in own_node_ids for each in info.subscribers)
        }
        for name, info in listed_topics.items():
            topic = self._topics.get(name)
            if topic is None:
                topic = self._topics[name] = Topic(
                    name, is_new=not self._is_first_graph, network=self._network
                )
                self.revision += 1
            self._apply_info(topic, info, view, now)
        for name, topic in self._topics.items():
            if name not in listed_topics and topic.gone_since_s is None:
                self._mark_vanished(topic, now)
        self._is_first_graph = False

    def mark_all_vanished(self, now: float) -> None:
        """Set all topics to vanished, because the connection to the master was lost."""
        for topic in self._topics.values():
            if topic.gone_since_s is None:
                self._mark_vanished(topic, now)

    def set_stale(self, is_stale: bool) -> None:
        """Set `Topic.is_stale` of all topics. Topics that become stale lose their rates.

        Args:
            is_stale: True while the network can't be queried.
        """
        for topic in self._topics.values():
            if topic.is_stale is not is_stale:
                topic.is_stale = is_stale
                if is_stale:
                    topic.rate_hz = topic.bandwidth_Bps = None
                self.revision += 1

    def measure_rates(
        self, elapsed_s: float, previous_totals: Mapping[str, tuple[int, int]]
    ) -> dict[str, tuple[int, int]]:
        """Measure the rates of watched topics whose publishers report no rate.

        Args:
            elapsed_s: Seconds since the previous call.
            previous_totals: Return value of the previous call.

        Returns:
            Total number of received messages and bytes, by topic.
        """
        totals = {
            topic.name: (topic.received, topic.received_bytes)
            for topic in self._topics.values()
            if topic.is_watched and topic.gone_since_s is None
        }
        for name, (received, size_bytes) in totals.items():
            previous = previous_totals.get(name)
            if previous is not None and previous[0] <= received and elapsed_s > 0:
                topic = self._topics[name]
                topic.measured_rates = (
                    (received - previous[0]) / elapsed_s,
                    (size_bytes - previous[1]) / elapsed_s,
                )
                if topic.info is None or topic.info.rate_hz is None:
                    topic.rate_hz, topic.bandwidth_Bps = topic.measured_rates
                    topic.rates.append(topic.measured_rates[0])
                    self.values_revision += 1
        return totals

    def update_ages(self, now: float, now_ns: int) -> None:
        """Update the ages of topics, and remove topics that vanished more than `GONE_DISPLAY_S` seconds ago.

        Each call processes at most `MAX_TOPICS_PER_UPDATE` topics and updates their statistics.

        Args:
            now: Monotonic seconds.
            now_ns: Current time in ns since 1970.
        """
        if self._next_index >= len(self._topics):
            self._next_index = 0
        start, self._next_index = self._next_index, self._next_index + MAX_TOPICS_PER_UPDATE
        batch = list(islice(self._topics.values(), start, self._next_index))
        if self._view is not None and len(self._topics) > MAX_TOPICS_PER_UPDATE:
            _update_statistics(batch, self._view, self._reported_s, self._clock_offsets_ns)
        for topic in batch:
            if topic.gone_since_s is not None:
                topic.gone_s = now - topic.gone_since_s
                if topic.gone_s >= GONE_DISPLAY_S:
                    self._remove_or_hide(topic)
            else:
                topic.age_s = _age_s(topic, now, now_ns)
                topic.silent_s = _silence_s(topic, now, self._reported_s)

    def _remove_or_hide(self, topic: Topic) -> None:
        # A vanished topic that is still watched only leaves the lists.
        was_listed = topic.name not in self._hidden_names
        if topic.is_watched:
            self._hidden_names.add(topic.name)
        else:
            self._hidden_names.discard(topic.name)
            del self._topics[topic.name]
        self.revision += was_listed

    def add(self, name: str, batch: Batch, now: float) -> None:
        """Add messages received on a watched topic, and the topic if it is unknown.

        An empty batch is ignored.
        """
        if not batch.messages:  # a watched topic without messages; it may never have existed
            return
        topic = self._topics.get(name)
        if topic is None:
            topic = self._topics[name] = Topic(name, is_new=True, network=self._network)
            self.revision += 1
        topic.previous = batch.messages[-2] if len(batch.messages) > 1 else topic.newest
        topic.newest = batch.messages[-1]
        topic.received += batch.arrived_count
        received_bytes = sum(message.size_bytes for message in batch.messages)
        # dropped messages are assumed to be as large as the others
        topic.received_bytes += received_bytes * batch.arrived_count // len(batch.messages)
        topic.dropped += batch.dropped
        topic.last_received_s = topic.last_activity_s = now
        self.values_revision += 1

    def unwatch(self, name: str) -> None:
        """Discard the messages and counts of a topic that is no longer watched."""
        topic = self._topics.get(name)
        if topic is not None:
            topic.newest = topic.previous = None
            topic.received = topic.dropped = topic.missed = topic.received_bytes = 0
            topic.measured_rates = None
            topic.last_received_s = None
            topic.is_watched = False

    def set_stats(self, stats: Mapping[str, tuple[float | None, int | None]]) -> None:
        """Set the statistics reported for each topic. Unknown topics are ignored.

        Args:
            stats: Messages per second and time of the newest message (ns since 1970), by topic; None
                for an unknown value.
        """
        for name, (rate_hz, newest_ns) in stats.items():
            topic = self._topics.get(name)
            if topic is not None:
                topic.rate_hz, topic.last_stamp_ns = rate_hz, newest_ns
                if rate_hz is not None:
                    topic.rates.append(rate_hz)
        self.values_revision += 1

    def reset(self) -> None:
        """Discard the newest messages, their times and the history of rates. Called when a replay seeks."""
        for topic in self._topics.values():
            topic.newest = topic.previous = None
            topic.last_stamp_ns = topic.last_received_s = topic.age_s = None
            topic.rates.clear()
        self.values_revision += 1

    def _mark_vanished(self, topic: Topic, now: float) -> None:
        topic.gone_since_s, topic.gone_s = now, 0.0
        topic.publishers, topic.publisher_nodes = 0, ()
        topic.rate_hz = topic.bandwidth_Bps = topic.age_s = None
        topic.silent_s = topic.subscribed_since_s = topic.last_activity_s = None
        self.revision += 1

    def _apply_info(self, topic: Topic, info: TopicInfo, view: GraphView, now: float) -> None:
        previous_values = topic.static_values()
        topic.subscribed_since_s = _subscribed_since_s(topic, info, now)
        topic.msg_type, topic.codec = info.msg_type, info.codec
        topic.publishers, topic.subscribers = len(info.publishers), len(info.subscribers)
        topic.publisher_nodes = _publisher_names(info, view)
        topic.gone_since_s = topic.gone_s = None
        topic.is_stale = False
        self._hidden_names.discard(topic.name)
        _apply_statistics(topic, info, now, self._clock_offsets_ns)
        if topic.static_values() != previous_values:
            self.revision += 1


def _update_statistics(
    topics: Iterable[Topic], view: GraphView, now: float, clock_offsets_ns: Mapping[str, int]
) -> None:
    find_info = view.topics.get
    for topic in topics:
        info = find_info(topic.name)
        if info is not None and info is not topic.info and topic.gone_since_s is None:
            _apply_statistics(topic, info, now, clock_offsets_ns)


def _apply_statistics(topic: Topic, info: TopicInfo, now: float, clock_offsets_ns: Mapping[str, int]) -> None:
    if info.last_stamp_ns is not None and (
        topic.info is None or info.last_stamp_ns != topic.info.last_stamp_ns
    ):
        topic.last_activity_s = now
    topic.info = info
    topic.rate_hz = rate_hz = info.rate_hz
    topic.bandwidth_Bps = info.bandwidth_Bps
    if rate_hz is None and topic.measured_rates is not None:
        topic.rate_hz, topic.bandwidth_Bps = topic.measured_rates
    topic.lost, topic.loss_ratio = info.lost, info.loss_ratio
    stamp_ns, previous_ns = info.last_stamp_ns, topic.last_stamp_ns
    if clock_offsets_ns and any(each.node_id in clock_offsets_ns for each in info.publishers):
        topic.last_stamp_ns = _newest_stamp_ns(info, clock_offsets_ns)
    elif stamp_ns is not None and (previous_ns is None or stamp_ns > previous_ns):
        topic.last_stamp_ns = stamp_ns
    if rate_hz is not None:
        topic.rates.append(rate_hz)


def _newest_stamp_ns(info: TopicInfo, clock_offsets_ns: Mapping[str, int]) -> int | None:
    # In this computer's clock.
    stamps = (
        each.last_stamp_ns + clock_offsets_ns.get(each.node_id, 0)
        for each in info.publishers
        if each.last_stamp_ns is not None
    )
    return max(stamps, default=None)


def _publisher_names(info: TopicInfo, view: GraphView) -> tuple[str, ...]:
    names = {view.nodes[p.node_id].name for p in info.publishers if p.node_id in view.nodes}
    return tuple(sorted(names))


def _age_s(topic: Topic, now: float, now_ns: int) -> float | None:
    stamp_ns, newest = topic.last_stamp_ns, topic.newest
    if newest is not None and newest.stamp_ns is not None:
        difference = newest.kind.clock.difference
        stamp_ns = max(stamp_ns or 0, newest.stamp_ns + (0 if difference is None else difference.offset_ns))
    if stamp_ns is not None:
        return (now_ns - stamp_ns) / 1e9 if now_ns > stamp_ns else 0.0
    return now - topic.last_received_s if topic.last_received_s is not None else None


def _subscribed_since_s(topic: Topic, info: TopicInfo, now: float) -> float | None:
    # Start of the time in which the present publishers have had a subscriber.
    if not info.publishers or not info.subscribers:
        return None
    previous_ids = {each.id for each in topic.info.publishers} if topic.info is not None else set()
    is_new = topic.subscribed_since_s is None or not previous_ids & {each.id for each in info.publishers}
    return now if is_new else topic.subscribed_since_s


def _silence_s(topic: Topic, now: float, reported_s: float) -> float | None:
    # By this computer's clock, because the publisher's may be wrong. For topics that are not watched, the
    # last report of the master (`reported_s`) counts.
    if topic.subscribed_since_s is None or topic.last_activity_s is None:
        return None
    end_s = now if topic.is_watched else reported_s
    start_s = (
        topic.last_activity_s
        if topic.last_activity_s >= topic.subscribed_since_s
        else topic.subscribed_since_s + START_GRACE_S
    )
    silent_s = max(0.0, end_s - start_s)
    return silent_s if topic.is_watched or silent_s >= MIN_REPORTED_SILENCE_S else 0.0


def total_rate_hz(topics: Iterable[TopicInfo]) -> float | None:
    """Return the total message rate of the topics; None if no publisher reports one."""
    rates_hz = [info.rate_hz for info in topics if info.rate_hz is not None]
    return sum(rates_hz) if rates_hz else None
