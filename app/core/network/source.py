"""Sources of messages and graphs: the live network, or a recording with the same interface."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import Protocol

import nep
from app.core.faults import error_text, log_errors
from nep.errors import NepError
from nep.i18n import _
from nep.masters.process import view_or_none
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.protocol.graph_view import GraphView

POLL_INTERVAL_S = 0.4
POLL_PAUSE_FACTOR = 5.0
"""Minimum pause between two queries of the graph, as a multiple of the duration of the last query.

A query takes 0.4 s for 10 000 topics.
"""
MAX_POLL_INTERVAL_S = 3.0
NODE_NAME = "studio"

_log = logging.getLogger("studio")

Sink = Callable[[str, Sequence[Message]], None]
"""Callback for a batch of messages of one topic, oldest first. Called in a thread of nep."""
NodeSink = Callable[[Sequence[Message]], None]
"""Callback for a batch of messages of one subscriber."""
Job = Callable[[Node], None]


@dataclass(frozen=True, slots=True)
class GraphReceived:
    """Event: a new graph was received.

    Attributes:
        view: New graph.
        query_duration_s: Duration of the query in seconds.
    """

    view: GraphView
    query_duration_s: float


@dataclass(frozen=True, slots=True)
class MasterFound:
    """Event: a master replies at ``address``."""

    address: str


@dataclass(frozen=True, slots=True)
class MasterLost:
    """Event: the master at ``address`` does not reply.

    Attributes:
        address: Address of the master.
        message: Explanation for the user.
    """

    address: str
    message: str


@dataclass(frozen=True, slots=True)
class WatchFailed:
    """Event: subscribing to a topic failed. `message` contains the reason."""

    topic: str
    message: str


@dataclass(frozen=True, slots=True)
class JobFailed:
    """Event: a job on the network failed.

    Attributes:
        message_template: Sentence for the report, see `Source.submit`.
        message: Reason for the failure.
    """

    message_template: str
    message: str


class Source(Protocol):
    """Source of messages, live or recorded. Only messages of watched topics are received."""

    address: str

    def start(self) -> None:
        """Start delivering messages to the sinks and events to the callback."""

    def watch(self, topic: str) -> None:
        """Subscribe to ``topic`` as soon as it exists."""

    def unwatch(self, topic: str) -> None:
        """Unsubscribe from ``topic``."""

    def submit(self, error_template: str, job: Job) -> None:
        """Run a job with Studio's node in the source's thread. A failure is reported as `JobFailed`.

        Args:
            error_template: Sentence for the report (a `lazy` text) with the placeholder ``error``; "" to
                report nothing.
            job: Function that receives the node.
        """

    def lost_counts(self) -> Mapping[str, int]:
        """Return the number of messages lost on each topic since its watch began."""

    def close(self) -> None:
        """Stop the source and wait for its thread."""


SourceFactory = Callable[[str, Sequence[Sink], Callable[[object], None]], Source]
"""Factory of a source, given the address of a master, the message sinks, and the event callback."""


class LiveSource:
    """Source of the live network of one master.

    One thread queries the master, subscribes and runs jobs, so that the window never blocks.
    """

    def __init__(
        self,
        address: str,
        sinks: Sequence[Sink],
        post_event: Callable[[object], None],
        *,
        permanent_topics: Mapping[str, str] | None = None,
        thread_name: str = "studio-source",
    ) -> None:
        # `permanent_topics`: topics with their types that are subscribed to from the start, before they have
        # publishers.
        self._permanent_topics = permanent_topics or {}
        self.address = address
        self._sinks = tuple(sinks)
        self._post_event = post_event
        self._jobs: queue.SimpleQueue[tuple[str, Job] | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._watched_topics: set[str] = set()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=thread_name, daemon=True)
        self._node: Node | None = None
        self._subscribers: dict[str, tuple[str, Subscriber]] = {}
        self._lost_offsets: Counter[str] = Counter()
        self._is_connected: bool | None = None
        self._view: GraphView | None = None

    def start(self) -> None:
        """Start connecting to the master."""
        self._thread.start()

    def watch(self, topic: str) -> None:
        """Subscribe to ``topic`` as soon as it exists."""
        with self._lock:
            self._watched_topics.add(topic)
            existing = self._subscribers.get(topic)
            self._lost_offsets[topic] = -(existing[1].lost or 0) if existing is not None else 0
        self.submit("", _no_op_job)

    def unwatch(self, topic: str) -> None:
        """Unsubscribe from ``topic``."""
        with self._lock:
            self._watched_topics.discard(topic)
        self.submit("", _no_op_job)

    def submit(self, error_template: str, job: Job) -> None:
        """Queue a job. Jobs run in order and wait until a master replies.

        Args:
            error_template: Sentence for the report, see `Source.submit`.
            job: Function that receives the node.
        """
        self._jobs.put((error_template, job))

    def lost_counts(self) -> Mapping[str, int]:
        """Return the number of messages lost on each topic since its watch began."""
        with self._lock:
            subscribers = {topic: subscriber for topic, (_, subscriber) in self._subscribers.items()}
            offsets = dict(self._lost_offsets)
        return {topic: offsets.get(topic, 0) + (each.lost or 0) for topic, each in subscribers.items()}

    def request_stop(self) -> None:
        """Signal the thread to stop, without waiting for it; `close` waits."""
        self._closing.set()
        self._jobs.put(None)

    @property
    def has_ended(self) -> bool:
        """True if the thread has ended."""
        return not self._thread.is_alive()

    def close(self) -> None:
        """Stop the thread and wait for it (at most 5 s)."""
        self.request_stop()
        if self._thread.is_alive():
            self._thread.join(timeout=5)

    # -- overridden for other networks (see `app.core.networks`); called in its thread -------------

    poll_interval_s = POLL_INTERVAL_S
    """Interval between queries of the graph in seconds."""

    def join(self) -> Node:
        """Create Studio's node. Raises `NepError` if no master replies."""
        view = view_or_none(self.address, timeout_s=0.5)
        if view is None:
            raise NepError(_("no master responds at {address}").format(address=self.address))
        return nep.node(_free_name(view), master=self.address)

    def query_graph(self, node: Node) -> GraphView:
        """Return the current graph. Raises `NepError` if the master doesn't reply within 1 s."""
        return node.graph(timeout_s=1.0)

    def subscribe(self, node: Node, topic: str, msg_type: str, sink: NodeSink) -> Subscriber:
        """Subscribe to a topic.

        Args:
            node: Studio's node.
            topic: Name of the topic.
            msg_type: Message type of the subscription.
            sink: Callback for received messages.

        Raises:
            NepError: The subscription failed.
        """
        return node.new_sub(topic, msg_type, sink=sink, wildcards=False)

    # -- its thread ------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                has_succeeded = False
                with log_errors("poll the network"):
                    has_succeeded = self._run_cycle()
                if not has_succeeded:
                    self._closing.wait(self.poll_interval_s)
        finally:
            for _, subscriber in self._subscribers.values():
                with log_errors("end a subscription"):
                    subscriber.close()
            if self._node is not None:
                self._node.close()

    def _run_cycle(self) -> bool:
        # One cycle: join, query, run jobs until the next query. False while no master answers.
        if self._node is None and not self._join():
            return False
        query_duration_s = self._query_graph()
        pause_s = max(self.poll_interval_s, min(MAX_POLL_INTERVAL_S, POLL_PAUSE_FACTOR * query_duration_s))
        self._run_jobs(time.monotonic() + pause_s)
        return True

    def _join(self) -> bool:
        try:
            self._node = self.join()
        except NepError as error:
            self._report_lost(str(error))
            return False
        return True

    def _report_lost(self, message: str) -> None:
        if self._is_connected is not False:
            self._is_connected = False
            self._post_event(MasterLost(self.address, message))

    def _query_graph(self) -> float:
        # Returns the duration of the query in seconds, 0.0 when it failed.
        if self._node is None:
            return 0.0
        started_s = time.monotonic()
        try:
            view = self.query_graph(self._node)
        except NepError as error:
            self._report_lost(str(error))
            return 0.0
        query_duration_s = time.monotonic() - started_s
        if self._is_connected is not True:
            self._is_connected = True
            self._post_event(MasterFound(self.address))
        self._post_event(GraphReceived(view, query_duration_s))
        self._view = view
        self._reconcile()
        return query_duration_s

    def _run_jobs(self, deadline_s: float) -> None:
        while not self._closing.is_set() and self._node is not None:
            try:
                item = self._jobs.get(timeout=max(0.0, deadline_s - time.monotonic()))
            except queue.Empty:
                return
            if item is None:
                return
            error_template, job = item
            try:
                job(self._node)
            except NepError as error:
                self._post_event(JobFailed(error_template, str(error)))
            except Exception as error:  # noqa: BLE001  a failing job must not end the thread
                _log.exception("a network job failed")
                self._post_event(JobFailed(error_template, error_text(error)))
            self._reconcile()

    def _reconcile(self) -> None:
        view = self._view
        if view is None:
            return
        with self._lock:
            required_topics = {*self._watched_topics, *self._permanent_topics}
        for topic in [topic for topic in self._subscribers if topic not in required_topics]:
            self._unsubscribe(topic)
            self._lost_offsets.pop(topic, None)
        for topic in required_topics:
            info = view.topics.get(topic)
            msg_type = self._permanent_topics.get(topic) if info is None else info.msg_type
            if msg_type is None:
                continue
            existing = self._subscribers.get(topic)
            if existing is not None and existing[0] != msg_type:
                self._lost_offsets[topic] += self._unsubscribe(topic)
                existing = None
            if existing is None:
                self._subscribe(topic, msg_type)

    def _subscribe(self, topic: str, msg_type: str) -> None:
        if self._node is None:
            return
        try:
            subscriber = self.subscribe(self._node, topic, msg_type, partial(self._deliver, topic))
        except NepError as error:
            self._post_event(WatchFailed(topic, str(error)))
            return
        with self._lock:
            self._subscribers[topic] = (msg_type, subscriber)

    def _unsubscribe(self, topic: str) -> int:
        # Returns the number of lost messages of the subscription.
        with self._lock:
            _, subscriber = self._subscribers.pop(topic)
        subscriber.close()
        return subscriber.lost or 0

    def _deliver(self, topic: str, messages: Sequence[Message]) -> None:
        for sink in self._sinks:
            with log_errors(f"process messages of {topic}"):
                sink(topic, messages)


def _free_name(view: GraphView) -> str:
    used_names = {node.name for node in view.nodes.values()}
    numbered_names = (f"{NODE_NAME} {number}" for number in count(2))
    return (
        NODE_NAME
        if NODE_NAME not in used_names
        else next(name for name in numbered_names if name not in used_names)
    )


def _no_op_job(_node: Node) -> None: ...
