"""Tests of the stop at the end of a program: every program of the robot must confirm it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from hypothesis import given
from hypothesis import strategies as st

import nep
from app.blocks.runtime.network import Network
from app.robots.client import limits
from nep.protocol.graph_view import GraphView
from tests.blocks.samples import robot
from tests.robots.client.views import COMMAND, REPLY, reply, view

Answer = tuple[int, str, str]
PUBLISHERS = {1: "own", 2: "twin", 3: "evil"}


@dataclass
class FakeNode:
    """Node whose robot answers each stop at once with the messages of the test.

    Each answer is the id of a publisher, "this" or another id of a stop, and a state. With
    `has_late_robot`, the graph lists the robot only after the stop was sent.
    """

    answers: Sequence[Answer]
    has_twin: bool
    has_late_robot: bool = False
    is_robot_listed: bool = False
    sinks: dict[str, Callable[[Sequence[nep.Message]], None]] = field(default_factory=dict)

    def new_pub(self, topic: str, msg_type: str = "json", *, batch: bool) -> FakePublisher:
        return FakePublisher(self, topic)

    def new_sub(
        self,
        topic: str,
        msg_type: str = "json",
        *,
        sink: Callable[[Sequence[nep.Message]], None],
    ) -> object:
        self.sinks[topic] = sink
        return sink

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        if self.has_late_robot and not self.is_robot_listed:
            return view({})
        receivers = ["own", "twin"] if self.has_twin else ["own"]
        return view(PUBLISHERS, receivers=receivers, announcers=["own"])


@dataclass(frozen=True)
class FakePublisher:
    node: FakeNode
    topic: str

    def publish(self, payload: object) -> None:
        if self.topic != COMMAND or not isinstance(payload, dict) or payload["op"] != "stop":
            return
        self.node.is_robot_listed = True
        for publisher, id, state in self.node.answers:
            answer = {"id": payload["id"] if id == "this" else id, "op": "stop", "state": state}
            self.node.sinks[REPLY]([reply(publisher, answer)])


answers = st.tuples(
    st.sampled_from([1, 2, 3, 4]),  # the last one is listed by no graph
    st.sampled_from(["this", "this", "stop-other"]),
    st.sampled_from(["succeeded", "succeeded", "failed", "running"]),
)


@given(st.lists(answers, max_size=8), st.booleans())
def test_stop_is_confirmed_only_by_every_program_of_the_robot(answers: list[Answer], has_twin: bool) -> None:
    network = Network(FakeNode(answers, has_twin), "program-1", [robot()])
    try:
        unconfirmed = network.stop_robots(1e-6)
        error = network.stop_error("Pepper")
    finally:
        network.close()
    required = ["own", "twin"] if has_twin else ["own"]
    confirming = {
        PUBLISHERS.get(publisher) for publisher, id, state in answers if (id, state) == ("this", "succeeded")
    }
    assert unconfirmed == (() if confirming >= set(required) else ("Pepper",))
    if unconfirmed:
        assert error.startswith(("Pepper may still move: ", "Pepper didn't reply", "Pepper (“twin program”)"))


def test_stop_of_a_pause_without_reply_does_not_outlive_a_confirmed_stop() -> None:
    node = FakeNode([], has_twin=False)
    network = Network(node, "program-1", [robot()])
    try:
        network._stop_for_pause(robot())
        node.answers = [(1, "this", "succeeded")]
        assert network.stop_robots(1e-6) == ()
    finally:
        network.close()


def test_robot_that_the_graph_lists_after_the_stop_was_sent_confirms_it() -> None:
    node = FakeNode([(1, "this", "succeeded")], has_twin=False, has_late_robot=True)
    network = Network(node, "program-1", [robot()])
    try:
        assert network.stop_robots(30.0) == ()
    finally:
        network.close()


def test_stop_waits_for_robots_as_long_as_their_descriptions_require() -> None:
    slow = replace(robot(), safe_stop=replace(robot().safe_stop, within_s=4.0))
    network = Network(FakeNode([], has_twin=False), "program-1", [slow])
    network._stops_changed = recorded = RecordedWait()
    try:
        assert network.stop_robots() == ("Pepper",)
    finally:
        network.close()
    assert recorded.timeout_s == limits.stop_timeout_s([slow]) == 4.0 + limits.STOP_MARGIN_S


class RecordedWait(threading.Condition):
    """Condition whose waits end at once."""

    timeout_s: float | None = None

    def wait_for(self, predicate: Callable[[], object], timeout: float | None = None) -> bool:  # type: ignore[override]
        self.timeout_s = timeout
        return bool(predicate())
