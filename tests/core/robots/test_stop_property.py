"""Property tests of Stop: whatever arrives and whenever, it ends in time, and only replies to it prove it.

The stopper runs in the thread of the test: a wait advances a virtual clock and calls what is due.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import nep
from app.core.robots.stop.stopper import RobotStopper
from app.robots.client.limits import GRAPH_TIMEOUT_S
from app.robots.client.stop import StopTarget
from app.robots.client.stop_report import StopReport
from app.robots.identity import Identity
from nep.errors import MasterUnreachable
from nep.protocol.graph_view import GraphView
from tests.blocks.samples import robot
from tests.robots.client.views import COMMAND, REPLY, reply, view

PEPPER = robot()
TIMEOUT_S = 1.0
NODES = ("own", "restarted", "twin", "evil")
PUBLISHERS = {1: "own", 2: "restarted", 3: "twin", 4: "evil", 5: "own"}
"""Node of each publisher of replies; a program may have several, and the graph may list only some."""
MAX_WAITS = 5_000
"""Number of waits of one Stop after which it counts as hung; one poll of 20 ms in 1 s needs 50."""


class VirtualTime:
    """Clock, and a condition whose waits advance it in the thread of the caller."""

    def __init__(self) -> None:
        self.now = 100.0
        self._waits = 0
        self._due: list[tuple[float, int, Callable[[], object]]] = []
        self._numbers = itertools.count()

    def clock(self) -> float:
        return self.now

    def call_at(self, at_s: float, call: Callable[[], object]) -> None:
        heapq.heappush(self._due, (at_s, next(self._numbers), call))

    def advance(self, seconds: float) -> None:
        self.wait_for(lambda: False, seconds)

    def wait_for(self, predicate: Callable[[], object], timeout: float | None = None) -> bool:
        self._waits += 1
        assert self._waits < MAX_WAITS, "the Stop hangs"
        assert timeout is not None or self._due, "nothing can end this wait"
        deadline = self.now + (1e9 if timeout is None else timeout)
        while not predicate():
            if not self._due or self._due[0][0] > deadline:
                self.now = max(self.now, deadline)
                return bool(predicate())
            at_s, _number, call = heapq.heappop(self._due)
            self.now = max(self.now, at_s)
            call()
        return True

    def notify_all(self) -> None:
        """Do nothing: waits check their predicate after each call."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, *_error: object) -> None:
        return None


@dataclass(frozen=True)
class Reply:
    """Message on a reply topic, some time after the Stop was sent."""

    delay_s: float
    publisher: int
    id: str
    op: str
    state: str
    topic: str = REPLY


@dataclass(frozen=True)
class NewGraph:
    """Graph that the master reports from some time on; None while it is unreachable."""

    delay_s: float
    graph: GraphView | None


@dataclass(frozen=True)
class Connection:
    """Number of connected subscribers of the command topic from some time on."""

    delay_s: float
    subscribers: int


@dataclass
class FakeNode:
    """Node of the stopper; replies and changes of the network come at their times."""

    time: VirtualTime
    graph_view: GraphView | None
    subscribers: int = 1
    id: str = "studio"
    sent_ids: list[str] = field(default_factory=list)
    read_graphs: list[GraphView] = field(default_factory=list)
    sinks: dict[str, Callable[[Sequence[nep.Message]], None]] = field(default_factory=dict)

    def new_pub(self, topic: str, msg_type: str = "json", *, batch: bool) -> FakePublisher:
        return FakePublisher(self)

    def new_sub(
        self, topic: str, msg_type: str = "json", *, sink: Callable[[Sequence[nep.Message]], None]
    ) -> FakeSubscriber:
        self.sinks[topic] = sink
        return FakeSubscriber()

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        if self.graph_view is None:
            self.time.advance(timeout_s)
        if self.graph_view is None:
            raise MasterUnreachable("lab:1", timeout_s)
        self.read_graphs.append(self.graph_view)
        return self.graph_view


@dataclass(frozen=True)
class FakePublisher:
    node: FakeNode
    missing: tuple[str, ...] = ()

    @property
    def subscribers(self) -> int:
        return self.node.subscribers

    def publish(self, payload: object) -> None:
        assert isinstance(payload, dict)
        if payload["op"] == "stop" and payload["id"] not in self.node.sent_ids:
            self.node.sent_ids.append(payload["id"])

    def close(self) -> None:
        return


class FakeSubscriber:
    def close(self) -> None:
        return


class Lab:
    """Stopper of one robot, with everything that happens after its Stop."""

    def __init__(
        self,
        target: StopTarget,
        first: GraphView | None,
        events: Sequence[Any],
        newest: GraphView | None = None,
    ) -> None:
        self.time = VirtualTime()
        self.node = FakeNode(self.time, first)
        self.stopper = RobotStopper(self.node, self.time.clock)
        self.stopper._changed = self.time  # type: ignore[assignment]  # virtual time
        self.target, self.confirming = target, set[str]()
        self.stopper.set_robots([target])
        if first is not None:
            self.node.read_graphs.append(first)
            self.stopper.update_graph(first)
        self.node.graph_view = newest or first  # the stopper learns of it only by a query
        self.stopper.send_stop(["Pepper"])  # an earlier one, whose replies must not count
        self.reports: list[StopReport] = []
        for event in events:
            self.time.call_at(self.time.now + event.delay_s, lambda event=event: self._apply(event))

    def _apply(self, event: Reply | NewGraph | Connection) -> None:
        match event:
            case NewGraph():
                self.node.graph_view = event.graph
                if event.graph is not None:
                    self.node.read_graphs.append(event.graph)
                    self.stopper.update_graph(event.graph)
            case Connection():
                self.node.subscribers = event.subscribers
                self.stopper.deliver()
            case Reply():
                sent = self.node.sent_ids
                ids = {"this": sent[1] if len(sent) > 1 else "stop-none", "earlier": sent[0]}
                payload = {"id": ids.get(event.id, event.id), "op": event.op, "state": event.state}
                if (event.id, event.op, event.state, len(sent) > 1) == ("this", "stop", "succeeded", True):
                    self.confirming.add(PUBLISHERS[event.publisher])
                self.node.sinks[REPLY]([reply(event.publisher, payload, event.topic)])

    def required(self, graphs: Sequence[GraphView]) -> set[str]:
        """Return the programs without whose confirmation the robot is not proven to have stopped."""
        identity = self.target.identity
        required = {each.node_id for each in self.target.earlier_programs}
        if identity is not None:
            required.add(identity.node_id)
        for graph in graphs:
            receivers = {each.node_id for each in graph.topics[COMMAND].subscribers}
            required |= receivers & {each.node_id for each in graph.topics[REPLY].publishers}
        return required


graphs = st.builds(
    lambda listed, receivers, announcers: view(
        {id: PUBLISHERS[id] for id in sorted(listed)}, receivers=receivers, announcers=announcers
    ),
    st.sets(st.sampled_from(sorted(PUBLISHERS))),
    st.lists(st.sampled_from(NODES), unique=True),
    st.lists(st.sampled_from(NODES), unique=True),
)
delays = st.sampled_from([0.0, 0.01, 0.05, 0.2, 0.6, 0.9999, 1.0, 1.0001, 1.5, 5.0])
replies = st.builds(
    Reply,
    delays,
    st.sampled_from(sorted(PUBLISHERS)),
    st.sampled_from(["this", "this", "this", "earlier", "stop-other"]),
    st.sampled_from(["stop", "stop", "stop", "invoke", "cancel"]),
    st.sampled_from(["succeeded", "succeeded", "succeeded", "failed", "running"]),
)
new_graphs = st.builds(NewGraph, delays, st.one_of(st.none(), graphs))
connections = st.builds(Connection, delays, st.sampled_from([0, 1]))
events = st.lists(st.one_of(replies, replies, new_graphs, connections), max_size=25)
targets = st.sampled_from(
    [
        StopTarget(PEPPER, Identity("own", "own program")),
        StopTarget(PEPPER),
        StopTarget(PEPPER, Identity("restarted"), earlier_programs=(Identity("own", "own program"),)),
    ]
)
ALONE = view({1: "own"}, receivers=["own"], announcers=["own"])
BOTH = view({1: "own", 3: "twin"}, receivers=["own", "twin"], announcers=["own"])


@settings(deadline=None)
@given(targets, st.one_of(st.none(), graphs), st.one_of(st.none(), graphs), events)
@example(targets.elements[0], ALONE, None, [Reply(0.1, 1, "this", "stop", "succeeded")])
@example(targets.elements[0], BOTH, None, [Reply(0.1, 1, "this", "stop", "succeeded")])
@example(targets.elements[0], BOTH, None, [Reply(5.0, 3, "this", "stop", "succeeded")])
@example(targets.elements[0], ALONE, None, [Reply(0.1, 1, "earlier", "stop", "succeeded")])
@example(targets.elements[0], ALONE, BOTH, [Reply(0.1, 1, "this", "stop", "succeeded")])
@example(targets.elements[0], ALONE, None, [Reply(0.1, 4, "this", "stop", "succeeded")])
@example(targets.elements[1], None, None, [Reply(0.1, 1, "this", "stop", "succeeded"), NewGraph(0.2, ALONE)])
@example(targets.elements[0], None, None, [Reply(1.5, 1, "this", "stop", "succeeded"), NewGraph(5.0, BOTH)])
@example(
    targets.elements[2],
    view({2: "restarted"}, receivers=["own"]),
    None,
    [Reply(0.0, 2, "this", "stop", "succeeded")],
)
def test_stop_ends_in_time_and_only_replies_of_the_robot_prove_it(
    target: StopTarget,
    first: GraphView | None,
    newest: GraphView | None,
    events: list[Reply | NewGraph | Connection],
) -> None:
    lab = Lab(target, first, events, newest)
    start_s, late = lab.time.now, list[StopReport]()
    at_send = [each for each in (*lab.node.read_graphs[-1:], lab.node.graph_view) if each is not None]
    lab.node.read_graphs.clear()
    report = lab.stopper.stop_all(["Pepper"], TIMEOUT_S, on_late=late.append)
    assert lab.time.now - start_s <= TIMEOUT_S + 2 * GRAPH_TIMEOUT_S + 1e-6
    assert report.names == ("Pepper",)
    # The first graph that is read after sending decides which programs received the Stop.
    required = lab.required([*at_send, *lab.node.read_graphs[:1]])
    if report.stopped_names:
        assert required <= lab.confirming
        assert lab.confirming
    lab.time.advance(10.0)
    required = lab.required([*at_send, *lab.node.read_graphs[:1]])
    for each in late:
        assert each.names == ("Pepper",)
        whole = report.with_late_reply(each)
        assert whole.stopped_names == each.stopped_names
        if each.stopped_names:
            assert required <= lab.confirming
    lab.stopper.close()


def test_reply_of_a_publisher_that_only_the_next_graph_lists_is_looked_up() -> None:
    unlisted = view({}, receivers=["own"], announcers=["own"])
    lab = Lab(targets.elements[0], unlisted, [Reply(0.05, 1, "this", "stop", "succeeded")])
    lab.time.call_at(lab.time.now + 0.03, lambda: setattr(lab.node, "graph_view", ALONE))
    report = lab.stopper.stop_all(["Pepper"], 30.0)
    lab.stopper.close()
    assert report.stopped_names == ("Pepper",)
    assert report.elapsed_ms < 1000


@pytest.mark.parametrize("order", list(itertools.permutations([1, 3, 4])))
def test_late_replies_prove_a_stop_only_together(order: tuple[int, ...]) -> None:
    """Both programs of the robot have the same name, so that a name does not identify them."""
    both = view({1: "own", 3: "twin"}, receivers=["own", "twin"], announcers=["own"])
    events = [Reply(2.0 + index, id, "this", "stop", "succeeded") for index, id in enumerate(order)]
    lab = Lab(StopTarget(PEPPER, Identity("own"), earlier_programs=(Identity("twin"),)), both, events)
    late = list[StopReport]()
    report = lab.stopper.stop_all(["Pepper"], TIMEOUT_S, on_late=late.append)
    lab.time.advance(10.0)
    lab.stopper.close()
    assert [each.stopped_names for each in late] == [(), ("Pepper",)]
    assert [report.with_late_reply(each).is_confirmed for each in late] == [False, True]
