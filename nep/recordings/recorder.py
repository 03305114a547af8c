"""`Recorder`: subscribes to selected topics, including new ones, and passes their messages to a writer."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Protocol

from nep.errors import BadTopicError, NepError
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.programs.robots.moving import DESCRIPTION_TYPE
from nep.protocol.graph_view import GraphView, to_plain
from nep.protocol.topic_glob import glob_matches, is_glob, widened_pattern
from nep.protocol.wire import check_topic
from nep.recordings.formats.channels import Role

if TYPE_CHECKING:
    from typing_extensions import Self


_GRAPH_POLL_INTERVAL_S = 1.0
_MASTER_TIMEOUT_S = 0.5
"""Time limit in seconds of requests to the master, so that a missing master doesn't delay the recorder."""
_MAX_CACHED_TOPICS = 20_000
_ALL_TOPICS = "**"


class _Writer(Protocol):
    """Interface to a `RecordingWriter` or `FlightRecorder`."""

    def post(self, messages: Sequence[Message]) -> None:
        """Record messages that were just received."""

    def write_entry(self, role: Role, value: object) -> None:
        """Record an entry of the recorder itself, such as an alert."""


@dataclass(frozen=True)
class TopicSelection:
    """Selection of topics by names and patterns (`*`, `?`, `**`).

    The constructor raises `BadTopicError` for invalid names.

    Attributes:
        topics: Included topics and patterns; empty for all topics.
        excluded: Excluded topics and patterns, which take precedence.
    """

    topics: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for topic in (*self.topics, *self.excluded):
            check_topic(topic)

    @property
    def subscriptions(self) -> tuple[str, ...]:
        """Minimal set of topics and patterns that covers the selection."""
        selected: list[str] = []
        for pattern in map(widened_pattern, self.topics or (_ALL_TOPICS,)):
            if not any(glob_matches(other, pattern) for other in selected):
                selected = [*(other for other in selected if not glob_matches(pattern, other)), pattern]
        return tuple(selected)

    def has(self, topic: str) -> bool:
        """Return True if a topic is selected."""
        if any(glob_matches(each, topic) for each in self.excluded):
            return False
        return not self.topics or any(glob_matches(each, topic) for each in self.topics)

    def is_excluded(self, topic: str) -> bool:
        """Return True if a topic is explicitly excluded."""
        return any(glob_matches(each, topic) for each in self.excluded)


class Recorder:
    """Recorder of selected topics. Usable as a context manager.

    All messages published after its creation are recorded. This includes the first message of a new topic
    if the back end supports patterns; otherwise a new topic is recorded within a second. Once a second, the
    recorder also records changed alerts and subscribes to the descriptions of new robots.
    """

    def __init__(
        self,
        node: Node,
        writer: _Writer,
        selection: TopicSelection = TopicSelection(),
        *,
        poll_interval_s: float = _GRAPH_POLL_INTERVAL_S,
    ) -> None:
        """Subscribe to the topics. Raises the exceptions of `Node.new_sub`.

        Args:
            node: Node that subscribes; stays open after `close`.
            writer: Receiver of the messages.
            selection: Topics to record; all by default.
            poll_interval_s: Interval in seconds at which the graph is polled.
        """
        self._node, self._writer, self._selection = node, writer, selection
        self._subscriptions = selection.subscriptions
        self._owning_subscriptions: dict[str, int] = {}
        self._subscribers: list[Subscriber] = []
        self._exact_topics: set[str] = set()
        self._last_alerts: object = None
        self._stop_event = threading.Event()
        self._has_patterns = True
        try:
            for number, topic in enumerate(self._subscriptions):
                self._subscribe(number, topic)
        except BaseException:
            self._unsubscribe()
            raise
        self._thread = threading.Thread(
            target=self._poll_graph, args=(poll_interval_s,), name="recorder-graph", daemon=True
        )
        self._thread.start()

    def _subscribe(self, number: int, topic: str) -> None:
        if is_glob(topic):
            try:
                self._subscribers.append(self._node.new_sub(topic, sink=partial(self._record, number)))
            except BadTopicError:  # a back end without patterns: use the names in the graph
                self._has_patterns = False
        else:
            self._subscribers.append(
                self._node.new_sub(
                    topic, self._type_of(topic), sink=partial(self._record, number), wildcards=False
                )
            )

    def _type_of(self, topic: str) -> str:
        # Subscribing with another type would cause an alert.
        with suppress(NepError):
            info = self._node.graph(_MASTER_TIMEOUT_S).topics.get(topic)
            if info is not None and info.msg_type:
                return info.msg_type
        return "json"

    def _record(self, number: int, messages: Sequence[Message]) -> None:
        # With overlapping subscriptions the first one counts.
        own_messages = [each for each in messages if self._owning_subscription(each.topic) == number]
        if own_messages:
            self._writer.post(own_messages)

    def _owning_subscription(self, topic: str) -> int:
        # -1 if the topic is not selected.
        owner = self._owning_subscriptions.get(topic)
        if owner is None:
            if len(self._owning_subscriptions) >= _MAX_CACHED_TOPICS:
                self._owning_subscriptions.clear()
            owner = -1
            if self._selection.has(topic):
                subscriptions = enumerate(self._subscriptions)
                owner = next((index for index, each in subscriptions if glob_matches(each, topic)), -1)
            self._owning_subscriptions[topic] = owner
        return owner

    # ---- once a second

    def _poll_graph(self, poll_interval_s: float) -> None:
        while not self._stop_event.is_set():
            with suppress(NepError):
                self._handle_graph(self._node.graph(_MASTER_TIMEOUT_S))
            self._stop_event.wait(poll_interval_s)

    def _handle_graph(self, graph: GraphView) -> None:
        alerts = [to_plain(each) for each in graph.alerts]
        if alerts != self._last_alerts and (alerts or self._last_alerts is not None):
            self._writer.write_entry("alerts", {"alerts": alerts})
        self._last_alerts = alerts
        for name, topic in graph.topics.items():
            # descriptions are recorded in any case, unless excluded explicitly
            is_description = topic.msg_type == DESCRIPTION_TYPE and not self._selection.is_excluded(name)
            is_chosen = self._selection.has(name)
            is_covered = is_chosen and (self._has_patterns or name in self._subscriptions)
            if (
                is_covered
                or not (is_chosen or is_description)
                or name in self._exact_topics
                or not topic.publishers
            ):
                continue
            self._exact_topics.add(name)
            self._subscribers.append(
                self._node.new_sub(name, topic.msg_type, sink=self._writer.post, wildcards=False)
            )

    def close(self) -> None:
        """Stop recording. The writer and the node stay open. Idempotent."""
        self._stop_event.set()
        self._thread.join(10.0)
        self._unsubscribe()

    def _unsubscribe(self) -> None:
        for subscriber in self._subscribers:
            subscriber.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()
