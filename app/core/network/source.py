"""Where messages come from. The live network today; a recording gives the same calls."""

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
from app.core.faults import error_words, log_errors
from nep.errors import NepError
from nep.i18n import _
from nep.masters.process import look
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.protocol.graph_view import GraphView

POLL_S = 0.4
POLL_PAUSE = 5.0
"""Where telling the graph takes long (10 000 topics: 0.4 s) the pause is so many times as long, at most:"""
POLL_SLOWEST_S = 3.0
NODE_NAME = "studio"

_log = logging.getLogger("studio")

Sink = Callable[[str, Sequence[Message]], None]
"""Takes a batch of one topic, oldest first, in nep's thread."""
NodeSink = Callable[[Sequence[Message]], None]
"""The same of one topic's subscriber."""
Job = Callable[[Node], None]


@dataclass(frozen=True, slots=True)
class GraphSeen:
    """The master told what is there; ``asked_s`` is how long it took."""

    view: GraphView
    asked_s: float


@dataclass(frozen=True, slots=True)
class MasterFound:
    """A master answers at ``address``."""

    address: str


@dataclass(frozen=True, slots=True)
class MasterLost:
    """No master answers at ``address``; ``sentence`` says so to a person."""

    address: str
    sentence: str


@dataclass(frozen=True, slots=True)
class WatchFailed:
    """A topic could not be subscribed."""

    topic: str
    sentence: str


@dataclass(frozen=True, slots=True)
class JobFailed:
    """Something that was to be done on the network failed: ``what`` (see `Source.submit`), and why."""

    what: str
    sentence: str


class Source(Protocol):
    """Messages by topic, live or recorded. Nothing arrives for a topic that is not watched."""

    address: str

    def start(self) -> None:
        """Begin; events and messages reach the sinks from now on."""

    def watch(self, topic: str) -> None:
        """Messages of ``topic`` are wanted, as soon as it is there."""

    def unwatch(self, topic: str) -> None:
        """Messages of ``topic`` are not wanted any more."""

    def submit(self, what: str, job: Job) -> None:
        """Do something with the node, in the source's thread; a failure is told as `JobFailed`.

        ``what`` is the `lazy` sentence for that, with the hole ``error``; "" when nobody is to be told.
        """

    def missed(self) -> Mapping[str, int]:
        """By watched topic, the messages that were sent since it is watched and did not arrive here."""

    def close(self) -> None:
        """End; returns when its thread has ended."""


MakeSource = Callable[[str, Sequence[Sink], Callable[[object], None]], Source]
"""Makes a source of a master's address, the sinks of its messages, and what takes its events."""


class LiveSource:
    """The network of one master.

    One thread asks the master, subscribes and does jobs; none of it in the window.
    """

    def __init__(
        self,
        address: str,
        sinks: Sequence[Sink],
        post_event: Callable[[object], None],
        *,
        always: Mapping[str, str] | None = None,
        thread: str = "studio-source",
    ) -> None:
        """Give batches of messages to every sink (in nep's thread) and events to ``post_event``.

        ``always``: topics, with their types, that are subscribed from the start, before anybody publishes.
        ``thread`` is the name of its thread.
        """
        self._always = always or {}
        self.address = address
        self._sinks = tuple(sinks)
        self._post_event = post_event
        self._jobs: queue.SimpleQueue[tuple[str, Job] | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._wanted: set[str] = set()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=thread, daemon=True)
        self._node: Node | None = None
        self._subscribers: dict[str, tuple[str, Subscriber]] = {}
        self._missed_before: Counter[str] = Counter()
        self._found: bool | None = None
        self._view: GraphView | None = None

    def start(self) -> None:
        """Look for the master from now on."""
        self._thread.start()

    def watch(self, topic: str) -> None:
        """See `Source.watch`."""
        with self._lock:
            self._wanted.add(topic)
            held = self._subscribers.get(topic)
            self._missed_before[topic] = -(held[1].lost or 0) if held is not None else 0
        self.submit("", _nothing)

    def unwatch(self, topic: str) -> None:
        """See `Source.unwatch`."""
        with self._lock:
            self._wanted.discard(topic)
        self.submit("", _nothing)

    def submit(self, what: str, job: Job) -> None:
        """See `Source.submit`; jobs keep their order and wait until a master is there."""
        self._jobs.put((what, job))

    def missed(self) -> Mapping[str, int]:
        """See `Source.missed`."""
        with self._lock:
            held = {topic: subscriber for topic, (_, subscriber) in self._subscribers.items()}
            before = dict(self._missed_before)
        return {topic: before.get(topic, 0) + (each.lost or 0) for topic, each in held.items()}

    def end(self) -> None:
        """Let its thread end, and wait for nothing; `close` waits."""
        self._closing.set()
        self._jobs.put(None)

    @property
    def has_ended(self) -> bool:
        """Whether its thread runs no more."""
        return not self._thread.is_alive()

    def close(self) -> None:
        """See `Source.close`."""
        self.end()
        if self._thread.is_alive():
            self._thread.join(timeout=5)

    # -- what is otherwise on other networks (see `app.core.networks`); in its thread ------------------------

    poll_s = POLL_S
    """How often the graph is asked for."""

    def join(self) -> Node:
        """Studio's node there. Raises `NepError` while nobody answers."""
        view = look(self.address, timeout_s=0.5)
        if view is None:
            raise NepError(_("no master responds at {address}").format(address=self.address))
        return nep.node(_free_name(view), master=self.address)

    def look(self, node: Node) -> GraphView:
        """Who is there. Raises `NepError`."""
        return node.graph(timeout_s=1.0)

    def subscribe(self, node: Node, topic: str, msg_type: str, sink: NodeSink) -> Subscriber:
        """Hear a topic of this type. Raises `NepError`."""
        return node.new_sub(topic, msg_type, sink=sink, wildcards=False)

    # -- its thread ------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                went_well = False
                with log_errors("follow the network"):
                    went_well = self._turn()
                if not went_well:
                    self._closing.wait(self.poll_s)
        finally:
            for _, subscriber in self._subscribers.values():
                with log_errors("end a subscription"):
                    subscriber.close()
            if self._node is not None:
                self._node.close()

    def _turn(self) -> bool:
        """Join, ask once, do what is wished until it is time to ask again; False while no master answers."""
        if self._node is None and not self._join():
            return False
        asked_s = self._ask()
        pause_s = max(self.poll_s, min(POLL_SLOWEST_S, POLL_PAUSE * asked_s))
        self._do_jobs(time.monotonic() + pause_s)
        return True

    def _join(self) -> bool:
        try:
            self._node = self.join()
        except NepError as error:
            self._lost(str(error))
            return False
        return True

    def _lost(self, sentence: str) -> None:
        if self._found is not False:
            self._found = False
            self._post_event(MasterLost(self.address, sentence))

    def _ask(self) -> float:
        """Ask for the graph; how long the answer took, 0.0 when there was none."""
        if self._node is None:
            return 0.0
        asked = time.monotonic()
        try:
            view = self.look(self._node)
        except NepError as error:
            self._lost(str(error))
            return 0.0
        asked_s = time.monotonic() - asked
        if self._found is not True:
            self._found = True
            self._post_event(MasterFound(self.address))
        self._post_event(GraphSeen(view, asked_s))
        self._view = view
        self._reconcile()
        return asked_s

    def _do_jobs(self, until: float) -> None:
        while not self._closing.is_set() and self._node is not None:
            try:
                item = self._jobs.get(timeout=max(0.0, until - time.monotonic()))
            except queue.Empty:
                return
            if item is None:
                return
            what, job = item
            try:
                job(self._node)
            except NepError as error:
                self._post_event(JobFailed(what, str(error)))
            except Exception as error:  # noqa: BLE001  one job that fails must not end all others
                _log.exception("a job on the network failed")
                self._post_event(JobFailed(what, error_words(error)))
            self._reconcile()

    def _reconcile(self) -> None:
        """Subscribe what is wanted and there, unsubscribe what is not wanted any more."""
        view = self._view
        if view is None:
            return
        with self._lock:
            wanted = {*self._wanted, *self._always}
        for topic in [topic for topic in self._subscribers if topic not in wanted]:
            self._leave(topic)
            self._missed_before.pop(topic, None)
        for topic in wanted:
            info = view.topics.get(topic)
            msg_type = self._always.get(topic) if info is None else info.msg_type
            if msg_type is None:
                continue
            held = self._subscribers.get(topic)
            if held is not None and held[0] != msg_type:
                self._missed_before[topic] += self._leave(topic)
                held = None
            if held is None:
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

    def _leave(self, topic: str) -> int:
        """Unsubscribe; how many messages had not arrived."""
        with self._lock:
            _, subscriber = self._subscribers.pop(topic)
        subscriber.close()
        return subscriber.lost or 0

    def _deliver(self, topic: str, messages: Sequence[Message]) -> None:
        for sink in self._sinks:
            with log_errors(f"take messages of {topic}"):
                sink(topic, messages)


def _free_name(view: GraphView) -> str:
    """The node's name; a second Studio on this network has its number behind it."""
    taken = {node.name for node in view.nodes.values()}
    others = (f"{NODE_NAME} {number}" for number in count(2))
    return NODE_NAME if NODE_NAME not in taken else next(name for name in others if name not in taken)


def _nothing(_node: Node) -> None:
    """Only wakes the thread, so that a new wish is met at once."""
