"""Tests of what proves a Stop: only the replies of the robot's own programs, whatever else is sent."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

import nep
from app.robots.client import rize
from app.robots.client.inbox import ReplyInbox, Senders
from app.robots.client.limits import LATE_REPLY_TIMEOUT_S, MAX_LATE_STOPS, MAX_STOP_REPLY_BYTES
from app.robots.client.stop import PendingStops, StopRequest, StopTarget, unproven_robots
from app.robots.description.description import RobotTopics
from app.robots.identity import Identity
from nep.protocol.graph_view import GraphView
from tests.blocks.samples import robot
from tests.robots.client.views import COMMAND, DESCRIPTION, REPLY, reply, stop_reply, view

PEPPER = robot()
OWN = Identity("own", "pepper driver")
ALONE = view({1: "own"}, receivers=["own"], announcers=["own"])


@dataclass
class StopClient:
    """Client that receives messages and graphs as `RobotStopper` does."""

    target: StopTarget = field(default_factory=lambda: StopTarget(PEPPER, OWN))
    now: float = 100.0

    def __post_init__(self) -> None:
        self.senders = Senders()
        self.inbox = ReplyInbox(self.senders)
        self.stops = PendingStops("studio")
        self.view: GraphView | None = None

    def start(self, graph: GraphView | None = None) -> StopRequest:
        if graph is not None:
            self.see(graph)
        return self.stops.start(self.target, self.view, self.now)

    def see(self, graph: GraphView) -> None:
        self.view = graph
        self.senders.update(graph, self.target.reply_topics)
        self.stops.update(graph, self.now)
        for node, message in self.inbox.pop_listed():
            self.stops.receive(node, message, self.now)

    def receive(self, message: nep.Message) -> None:
        self.now += 0.001
        if self.stops.is_awaited(message):
            node = self.inbox.sender_of(message)
            if node is not None:
                self.stops.receive(node, message, self.now)


def test_reply_of_the_own_program_proves_a_stop() -> None:
    client = StopClient()
    request = client.start(ALONE)
    assert not request.is_proven
    client.receive(stop_reply(1, request.id))
    assert request.is_proven
    (result,) = request.results()
    assert (result.is_confirmed, result.node) == (True, "own")
    assert result.elapsed_ms == pytest.approx(1.0)


@pytest.mark.parametrize(
    "message",
    [
        stop_reply(2, "ID"),
        stop_reply(3, "ID"),
        stop_reply(1, "stop-other"),
        stop_reply(1, ["ID"]),
        stop_reply(1, "ID", "running"),
        stop_reply(1, "ID", "canceled"),
        stop_reply(1, "ID", ["succeeded"]),
        stop_reply(1, "ID", topic="/Other/answer"),
        reply(1, {"id": "ID", "op": "invoke", "state": "succeeded"}),
        reply(1, {"id": "ID", "state": "succeeded"}),
        reply(1, {"id": "ID", "op": "stop", "state": "succeeded", "output": "x" * MAX_STOP_REPLY_BYTES}),
        reply(1, ["stop", "succeeded"]),
        nep.Message(REPLY, b"{", "json", "robot/answer", publisher=1),
    ],
    ids=["foreign", "unlisted", "other id", "list as id", "running", "canceled", "list as state",
         "other topic", "invoke", "no op", "huge", "no object", "broken"],
)  # fmt: skip
def test_other_messages_do_not_prove_a_stop(message: nep.Message) -> None:
    client = StopClient()
    request = client.start(view({1: "own", 2: "evil"}, receivers=["own"], announcers=["own"]))
    data = message.raw.replace(b"ID", request.id.encode())
    client.receive(nep.Message(message.topic, data, "json", "robot/answer", publisher=message.publisher))
    client.see(view({1: "own", 2: "evil", 3: "evil"}, receivers=["own"], announcers=["own"]))
    assert (request.is_proven, request.is_refused, request.has_all_replies) == (False, False, False)
    assert unproven_robots([request]) == {"Pepper": request}


def test_program_that_announces_the_robot_later_does_not_prove_a_stop_of_the_first_one() -> None:
    client = StopClient()
    request = client.start(view({2: "restarted"}, receivers=["restarted"], announcers=["restarted"]))
    client.receive(stop_reply(2, request.id))
    assert not request.is_proven
    client.see(
        view({1: "own", 2: "restarted"}, receivers=["own", "restarted"], announcers=["restarted", "own"])
    )
    client.receive(stop_reply(1, request.id))
    assert request.is_proven


def test_reply_that_arrives_before_its_publisher_is_listed_proves_a_stop() -> None:
    client = StopClient()
    request = client.start(view({}, receivers=["own"], announcers=["own"]))
    client.receive(stop_reply(1, request.id))
    assert not request.is_proven
    client.see(ALONE)
    assert request.is_proven


def test_reply_of_a_robot_whose_program_is_unknown_counts_once_it_is_known() -> None:
    client = StopClient(StopTarget(PEPPER))
    request = client.start(view({1: "own"}))  # nobody announces it or receives its commands yet
    client.receive(stop_reply(1, request.id))
    assert not request.is_proven
    client.see(ALONE)
    assert request.is_proven


def test_program_that_replies_for_the_first_time_must_confirm_too() -> None:
    """A program that only received commands is awaited as soon as it publishes replies."""
    client = StopClient()
    request = client.start(view({1: "own"}, receivers=["own", "twin"], announcers=["own"]))
    client.receive(stop_reply(1, request.id))
    assert request.is_proven
    both = view({1: "own", 2: "twin"}, receivers=["own", "twin"], announcers=["own"])
    client.see(both)
    client.stops.update(both, client.now, [request])
    assert not request.is_proven
    client.receive(stop_reply(2, request.id))
    assert request.is_proven


def test_refusal_of_a_program_that_only_listened_is_reported() -> None:
    client = StopClient()
    request = client.start(view({1: "own"}, receivers=["own", "twin"], announcers=["own"]))
    client.receive(stop_reply(1, request.id))
    client.receive(stop_reply(2, request.id, "failed"))
    client.see(view({1: "own", 2: "twin"}, receivers=["own", "twin"], announcers=["own"]))
    assert (request.is_proven, request.is_refused) == (False, True)


def test_refusal_can_be_followed_by_a_confirmation_but_not_the_other_way_round() -> None:
    client = StopClient()
    request = client.start(ALONE)
    client.receive(stop_reply(1, request.id, "failed"))
    assert (request.is_proven, request.has_all_replies, request.is_refused) == (False, True, True)
    client.receive(stop_reply(1, request.id))
    client.receive(stop_reply(1, request.id, "failed"))
    assert request.is_proven


def test_earlier_program_of_the_robot_must_confirm_too() -> None:
    client = StopClient(StopTarget(PEPPER, OWN, earlier_programs=(Identity("before", "old driver"),)))
    request = client.start(ALONE)
    client.receive(stop_reply(1, request.id))
    assert not request.is_proven
    assert [result.program for result in request.results()] == ["", "old driver"]


def test_earlier_program_that_only_receives_commands_must_confirm_too() -> None:
    """A program publishes its replies from the first one on; until then, the graph lists no publisher."""
    client = StopClient(StopTarget(PEPPER, OWN, earlier_programs=(Identity("before", "old driver"),)))
    request = client.start(view({1: "own"}, receivers=["own", "before"], announcers=["own"]))
    client.receive(stop_reply(1, request.id))
    assert not request.is_proven
    client.see(view({1: "own", 2: "before"}, receivers=["own", "before"], announcers=["own"]))
    client.receive(stop_reply(2, request.id))
    assert request.is_proven


def test_replies_on_earlier_topics_count() -> None:
    moved = RobotTopics(DESCRIPTION, "/Pepper/other_command", "/Pepper/other_answer")
    client = StopClient(StopTarget(robot(**{"rb:topics": {}}), OWN, earlier_topics=(moved,)))
    request = client.start(ALONE)
    client.receive(stop_reply(1, request.id, topic="/Pepper/other_answer"))
    assert request.is_proven


def test_robot_of_rize_is_never_proven_to_have_stopped() -> None:
    client = StopClient(StopTarget(rize.robot("Rosie")))
    request = client.start(ALONE)
    client.stops.update(ALONE, client.now, [request])
    client.receive(stop_reply(1, request.id, topic=rize.ANSWERS))
    assert [result.can_confirm for result in request.results()] == [False]
    assert not request.is_proven


def test_impostors_are_the_nodes_that_replied_to_this_stop() -> None:
    client = StopClient()
    request = client.start(view({1: "own", 2: "evil", 3: "chatty"}, receivers=["own"], announcers=["own"]))
    client.receive(stop_reply(2, request.id))
    client.receive(stop_reply(3, "stop-other"))
    assert request.impostors() == ["evil"]


def test_old_stops_are_evicted_but_stay_own() -> None:
    client = StopClient()
    requests = [client.start(ALONE) for _ in range(MAX_LATE_STOPS + 10)]
    for request in requests:
        request.is_over = True
    client.start(ALONE)
    assert len(client.stops.requests) == MAX_LATE_STOPS + 1
    client.now += LATE_REPLY_TIMEOUT_S + 1
    client.start(ALONE)
    assert len(client.stops.requests) == 2
    assert client.stops.is_own(requests[0].id)
    assert not client.stops.is_own("stop-other")


# ---- any order of replies, foreign programs and restarts

NODES = ("own", "restarted", "twin", "evil")
PUBLISHERS = {1: "own", 2: "restarted", 3: "twin", 4: "evil", 5: "own"}
"""Node of each publisher of replies; a program may have several."""

graphs = st.builds(
    lambda listed, receivers, announcers: view(
        {id: PUBLISHERS[id] for id in sorted(listed)}, receivers=receivers, announcers=announcers
    ),
    st.sets(st.sampled_from(sorted(PUBLISHERS))),
    st.lists(st.sampled_from(NODES), unique=True),
    st.lists(st.sampled_from(NODES), unique=True),
)
messages = st.tuples(
    st.sampled_from(sorted(PUBLISHERS)),
    st.sampled_from(["this", "this", "previous", "other"]),
    st.sampled_from(["stop", "stop", "stop", "invoke", "cancel"]),
    st.sampled_from(["succeeded", "succeeded", "failed", "running", "canceled"]),
    st.sampled_from([REPLY, REPLY, REPLY, "/Other/answer"]),
)
targets = st.sampled_from(
    [
        StopTarget(PEPPER, OWN),
        StopTarget(PEPPER),
        StopTarget(PEPPER, Identity("restarted"), earlier_programs=(OWN,)),
    ]
)


def serving(graph: GraphView) -> set[str]:
    """Return the nodes that receive Pepper's commands and publish its replies."""
    receivers = {each.node_id for each in graph.topics[COMMAND].subscribers}
    return receivers & {each.node_id for each in graph.topics[REPLY].publishers}


@given(targets, graphs, st.lists(st.one_of(graphs, messages), max_size=30))
def test_stop_is_proven_only_by_replies_of_every_program_that_serves_the_robot(
    target: StopTarget, first: GraphView, events: list[object]
) -> None:
    client = StopClient(target)
    previous = client.start(first)
    request = client.start()
    confirming: set[str] = set()
    required = serving(first) | {each.node_id for each in target.earlier_programs}
    for event in events:
        if isinstance(event, GraphView):
            client.see(event)
            client.stops.update(event, client.now, [request])  # as after sending the Stop
            required |= serving(event)
        else:
            assert isinstance(event, tuple)
            publisher, id, op, state, topic = event
            ids = {"this": request.id, "previous": previous.id, "other": "stop-other"}
            client.receive(reply(publisher, {"id": ids[id], "op": op, "state": state}, topic))
            if (id, op, state, topic) == ("this", "stop", "succeeded", REPLY):
                confirming.add(PUBLISHERS[publisher])
        if request.is_proven:
            own = {target.identity.node_id} if target.identity is not None else set()
            assert required | own <= confirming
            assert confirming, "a stop is never proven without a reply"


@given(st.permutations(["own", "twin", "graph", "evil", "evil fails", "other id"]))
def test_stop_is_proven_in_every_order_of_the_required_replies(order: list[str]) -> None:
    graph = view({1: "own", 3: "twin", 4: "evil"}, receivers=["own", "twin"], announcers=["own"])
    client = StopClient()
    request = client.start(view({}, receivers=["own", "twin"], announcers=["own"]))
    for step in order:
        match step:
            case "graph":
                client.see(graph)
                client.stops.update(graph, client.now, [request])
            case "own" | "twin":
                client.receive(stop_reply(1 if step == "own" else 3, request.id))
            case "other id":
                client.receive(stop_reply(1, "stop-other", "failed"))
            case _:
                client.receive(stop_reply(4, request.id, "failed" if "fails" in step else "succeeded"))
    assert request.is_proven
