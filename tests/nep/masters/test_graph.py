"""Tests of the graph: requests in, pushes and replies out, without sockets or a clock."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nep.errors import WireError
from nep.masters.graph import Graph, OutgoingMessage, without_nodes
from nep.masters.rates import TrafficMeter
from nep.messages.packing import pack
from nep.protocol import encoding
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    AddedReply,
    AddPublisher,
    AddSubscriber,
    DoneReply,
    ExpectedSubscriber,
    FoundReply,
    GraphReply,
    Join,
    Leave,
    NodeRecord,
    Ping,
    Probe,
    PublisherAdded,
    PublisherCount,
    PublisherRecord,
    PublisherRemoved,
    QueryGraph,
    RejectedReply,
    RemovePublisher,
    RemoveSubscriber,
    Renew,
    RenewedReply,
    ReportMissing,
    Request,
    SubscriberCount,
    SubscriberRecord,
)


def node(id: str, generation: str = "native", name: str = "") -> NodeRecord:
    return NodeRecord(id, name or id.upper(), "host", 1, generation=generation)


def publisher(
    id: int, topic: str = "t", msg_type: str = "json", at: str = "tcp://127.0.0.1:5"
) -> PublisherRecord:
    return PublisherRecord(id, topic, msg_type, "json", (at,) if at else ())


def subscriber(id: int, topic: str = "t") -> SubscriberRecord:
    return SubscriberRecord(id, topic, "json")


@pytest.fixture
def graph() -> Graph:
    return Graph(epoch=7, now=0.0, learn_s=0.0)


def ask(graph: Graph, request: Request, now: float = 0.0) -> tuple[OutgoingMessage, ...]:
    return graph.apply(request, 1, now, "asker")


def test_publisher_receives_its_subscribers_after_the_subscribers_are_notified(graph: Graph) -> None:
    ask(graph, AddSubscriber(node("s"), subscriber(1)))
    push, reply = ask(graph, AddPublisher(node("p"), publisher(2)))
    assert (push.to, push.call) == ("s", None)
    assert isinstance(push.body, PublisherAdded)
    assert (push.body.publisher.publisher, push.body.publisher.node_name) == (publisher(2), "P")
    assert (reply.to, reply.call) == ("asker", 1)
    assert isinstance(reply.body, AddedReply)
    assert (reply.body.epoch, reply.body.expected) == (7, (ExpectedSubscriber(1, "s", "S"),))


def test_only_the_first_notice_of_a_publisher_marks_it_as_new(graph: Graph) -> None:
    ask(graph, AddSubscriber(node("s"), subscriber(1)))
    moved = publisher(2, at="tcp://127.0.0.1:6")
    rejoined = Join(node("p"), 3, (moved, publisher(3)), ())
    requests = [AddPublisher(node("p"), publisher(2)), AddPublisher(node("p"), moved), rejoined]
    notices = [each.body for request in requests for each in ask(graph, request)]
    assert [each.is_new for each in notices if isinstance(each, PublisherAdded)] == [True, False, False]


def test_unlisted_publisher_that_returns_with_another_endpoint_is_not_new(graph: Graph) -> None:
    ask(graph, AddSubscriber(node("s"), subscriber(1)))
    ask(graph, AddPublisher(node("p"), publisher(2)))
    graph.unregister_nodes(["p"])
    push, _reply = ask(graph, AddPublisher(node("p"), publisher(2, at="tcp://127.0.0.1:6")))
    assert isinstance(push.body, PublisherAdded)
    assert not push.body.is_new


def test_node_with_two_subscribers_is_notified_once(graph: Graph) -> None:
    for id in (1, 2):
        ask(graph, AddSubscriber(node("s"), subscriber(id)))
    outgoing = ask(graph, AddPublisher(node("p"), publisher(3)))
    assert [each.to for each in outgoing] == ["s", "asker"]


def test_new_subscriber_receives_native_publishers_whose_nodes_are_probed(graph: Graph) -> None:
    ask(graph, AddPublisher(node("p"), publisher(1)))
    ask(graph, AddPublisher(node("original", "A"), publisher(2, at="")))
    probe, reply = ask(graph, AddSubscriber(node("s"), subscriber(3)))
    assert (probe.to, type(probe.body)) == ("p", Probe)
    assert isinstance(reply.body, FoundReply)
    assert [each.publisher.id for each in reply.body.publishers] == [1]
    assert without_nodes(reply.body, frozenset({"p"})) == FoundReply(7, graph.revision)


def test_subscribers_of_removed_nodes_are_not_expected() -> None:
    answer = AddedReply(
        1,
        1,
        (ExpectedSubscriber(1, "a", "A"), ExpectedSubscriber(2, "b", "B")),
        (ExpectedSubscriber(3, "a", "A"),),
    )
    assert without_nodes(answer, frozenset({"a"})) == AddedReply(1, 1, (ExpectedSubscriber(2, "b", "B"),), ())
    assert without_nodes(answer, frozenset()) is answer


def test_invalid_topic_is_rejected(graph: Graph) -> None:
    (reply,) = ask(graph, AddPublisher(node("p"), publisher(1, "two words")))
    assert isinstance(reply.body, RejectedReply)
    assert reply.body.code == "topic"
    assert "'two words'" in reply.body.reason
    assert graph.nodes == ()


def test_removed_publisher_is_announced_with_its_last_sequence_number(graph: Graph) -> None:
    ask(graph, AddSubscriber(node("s"), subscriber(1)))
    ask(graph, AddPublisher(node("p"), publisher(2)))
    push, reply = ask(graph, RemovePublisher("p", 2, last_seq=5))
    assert push.body == PublisherRemoved(7, graph.revision, 2, "t", is_closed=True, last_seq=5)
    assert isinstance(reply.body, DoneReply)
    ask(graph, AddPublisher(node("p"), publisher(3)))
    push, _reply = ask(graph, Leave("p"))
    assert isinstance(push.body, PublisherRemoved)
    assert push.body.is_closed
    ask(graph, RemoveSubscriber("s", 1))
    assert graph.view().topics == {}
    assert [each.id for each in graph.nodes] == ["s"]


def test_expired_lease_unlists_a_publisher_without_closing_it(graph: Graph) -> None:
    ask(graph, AddSubscriber(node("s"), subscriber(1)), 0.0)
    ask(graph, AddPublisher(node("p"), publisher(2)), 0.0)
    ask(graph, Renew("s", 7, 0, (), (SubscriberCount(1, 0, 0),)), 2.0)
    assert [each.to for each in graph.probes_for_overdue(2.0)] == ["p"]
    assert graph.tick(2.9) == ()
    (push,) = graph.tick(3.0)
    assert isinstance(push.body, PublisherRemoved)
    assert (push.to, push.body.is_closed) == ("s", False)
    (reply,) = ask(graph, Renew("p", 7, 0, (PublisherCount(2, 1, 1, 1),)), 4.0)
    assert isinstance(reply.body, RenewedReply)
    assert reply.body.again


def test_managed_nodes_have_no_lease_and_receive_no_pushes(graph: Graph) -> None:
    ask(graph, Join(node("o", "A"), 0, (publisher(1, at=""),), (subscriber(2),), managed=True))
    assert graph.probes_for_overdue(100.0) == ()
    assert graph.tick(100.0) == ()
    outgoing = ask(graph, AddPublisher(node("p"), publisher(3)))
    assert [each.to for each in outgoing] == ["asker"]
    assert isinstance(outgoing[0].body, AddedReply)
    assert outgoing[0].body.expected == ()
    assert graph.view().nodes["o"].generation == "A"


def test_renewals_update_statistics_and_return_changes(graph: Graph) -> None:
    ask(graph, AddSubscriber(node("s"), subscriber(1)))
    before = graph.revision
    ask(graph, AddPublisher(node("p"), publisher(2)))
    for second in range(3):
        count = PublisherCount(2, 20 * second, 2000 * second, 20 * second, second)
        ask(graph, Renew("p", 7, 0, (count,)), float(second))
    (reply,) = ask(graph, Renew("s", 7, before, (), (SubscriberCount(1, 30, 10),)), 2.0)
    assert isinstance(reply.body, RenewedReply)
    assert [each.topic for each in reply.body.topics] == ["t"]
    assert reply.body.last_seqs == {2: 40}
    (reply,) = ask(graph, Renew("s", 7, graph.revision, (), (SubscriberCount(1, 30, 10),)), 2.0)
    assert isinstance(reply.body, RenewedReply)
    assert reply.body.topics == ()
    topic = graph.view().topics["t"]
    assert (topic.rate_hz, topic.bandwidth_Bps, topic.last_stamp_ns) == (20.0, 2000.0, 2)
    assert (topic.lost, topic.loss_ratio) == (10, 0.25)


def test_node_shows_the_cpu_load_of_its_last_renewal(graph: Graph) -> None:
    ask(graph, Join(node("p")))
    assert graph.view().nodes["p"].cpu_ratio is None
    ask(graph, Renew("p", 7, 0, cpu_ratio=0.25))
    assert graph.view().nodes["p"].cpu_ratio == 0.25
    ask(graph, Renew("p", 7, 0))
    assert graph.view().nodes["p"].cpu_ratio is None


@pytest.mark.parametrize("epoch", [6, 7])
def test_mismatching_renewal_requests_a_full_join(graph: Graph, epoch: int) -> None:
    ask(graph, AddPublisher(node("p"), publisher(2)))
    counts = () if epoch == 7 else (PublisherCount(2, 0, 0, 0),)
    (reply,) = ask(graph, Renew("p", epoch, 0, counts))
    assert isinstance(reply.body, RenewedReply)
    assert reply.body.again


def test_join_replaces_the_previous_registration(graph: Graph) -> None:
    ask(graph, AddSubscriber(node("s"), subscriber(1)))
    ask(graph, AddPublisher(node("p"), publisher(2)))
    outgoing = ask(graph, Join(node("p"), 3, (publisher(4),), (subscriber(5),)))
    assert [type(each.body) for each in outgoing] == [PublisherAdded, PublisherAdded, FoundReply]
    topic = graph.view().topics["t"]
    assert [each.id for each in topic.publishers] == [4]
    assert sorted(each.id for each in topic.subscribers) == [1, 5]


def test_restarted_master_accepts_known_nodes_before_new_nodes() -> None:
    graph = Graph(epoch=7, now=0.0, learn_s=1.0)
    assert ask(graph, AddPublisher(node("new"), publisher(1)), 0.2) == ()
    assert graph.learning_end == 1.0
    assert ask(graph, Join(node("old"), 3, (), (subscriber(2),)), 0.4) != ()
    assert graph.tick(0.9) == ()
    push, reply = graph.tick(1.0)
    assert (push.to, reply.to, reply.call) == ("old", "asker", 1)
    assert isinstance(reply.body, AddedReply)
    assert [each.id for each in reply.body.expected] == [2]
    assert graph.learning_end is None


def test_unresponsive_node_raises_an_alert_until_it_renews(graph: Graph) -> None:
    ask(graph, AddSubscriber(node("s"), subscriber(1)))
    ask(graph, AddPublisher(node("p"), publisher(2)))
    ask(graph, ReportMissing("p", 2, (1, 99)))
    (alert,) = graph.view().alerts
    assert (alert.id, alert.sentence) == ("missing:s", "“S” doesn't respond to “P”")
    _push, reply = ask(graph, AddPublisher(node("p"), publisher(3)))
    assert isinstance(reply.body, AddedReply)
    assert (reply.body.expected, reply.body.hung) == ((), (ExpectedSubscriber(1, "s", "S"),))
    ask(graph, Renew("s", 7, 0, (), (SubscriberCount(1, 0, 0),)))
    assert graph.view().alerts == ()


def test_duplicate_names_conflicting_types_and_unreadable_messages_raise_alerts(graph: Graph) -> None:
    ask(graph, AddPublisher(node("a", name="N"), publisher(1, msg_type="json")))
    ask(graph, AddPublisher(node("b", name="N"), publisher(2, msg_type="string")))
    ask(graph, AddSubscriber(node("c"), subscriber(3)))
    ask(graph, Renew("c", 7, 0, (), (SubscriberCount(3, 1, 0, "its version is 2"),)))
    alerts = {each.id: each.sentence for each in graph.view().alerts}
    assert set(alerts) == {"name:N", "type:t", "message:t"}
    assert alerts["message:t"] == "“C” can't read “t”: its version is 2"
    ask(graph, Leave("b"))
    assert {each.id for each in graph.view().alerts} == {"message:t"}


def test_messages_relayed_by_the_gateway_are_not_counted_twice(graph: Graph) -> None:
    ask(graph, Join(node("o", "A"), 0, (publisher(1, at=""),), managed=True))
    ask(graph, AddPublisher(node("g", "gateway"), publisher(2)))
    for second in range(2):
        ask(graph, Renew("o", 7, 0, (PublisherCount(1, 10 * second, 0, 0),)), float(second))
        ask(graph, Renew("g", 7, 0, (PublisherCount(2, 10 * second, 0, 0),)), float(second))
    assert graph.view().topics["t"].rate_hz == 10.0


REQUESTS: list[Request] = [
    Join(node("a"), 3, (publisher(1),), (subscriber(2),), True),
    AddPublisher(node("a"), publisher(2**63)),
    AddSubscriber(node("a"), subscriber(2**64 - 1)),
    RemovePublisher("a", 1, 5),
    RemoveSubscriber("a", 1),
    Leave("a"),
    Renew("a", 1, 2, (PublisherCount(1, 2, 3, 4, 5),), (SubscriberCount(1, None, None, "p"),)),
    Renew("a", 1, 2, cpu_ratio=0.25),
    ReportMissing("a", 1, (2, 3)),
    QueryGraph(),
    Ping(),
]


@pytest.mark.parametrize("request_", REQUESTS, ids=lambda each: type(each).__name__)
def test_requests_round_trip(request_: Request) -> None:
    assert encoding.decode_request(encoding.encode_request(request_, 42)) == (42, request_)


def test_replies_round_trip(graph: Graph) -> None:
    ask(graph, AddSubscriber(node("s"), subscriber(1)))
    ask(graph, AddPublisher(node("a", name="S"), publisher(2)))
    ask(graph, Renew("s", 7, 0, (), (SubscriberCount(1, 5, 5),)))
    for request in REQUESTS:
        for each in ask(graph, request):
            assert encoding.decode_reply(encoding.encode_reply(each.body, 3)) == (3, each.body)
    (seen,) = ask(graph, QueryGraph())
    assert isinstance(seen.body, GraphReply)
    assert isinstance(seen.body.view, GraphView)


@given(st.binary(max_size=50))
def test_any_bytes_decode_to_a_request_or_a_wire_error(body: bytes) -> None:
    assert isinstance(encoding.decode_request(body).request, WireError | Ping | QueryGraph)
    with pytest.raises(WireError):
        encoding.decode_reply(body)


@given(
    st.sampled_from(["join", "publisher+", "renew", "missing", "look", "nonsense", 7, None]),
    st.recursive(
        st.none() | st.integers(0, 9) | st.text(max_size=4),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["node", "id", "publisher", "topic", "node_id"]), inner, max_size=5
            )
        ),
    ),
)
def test_any_map_decodes_to_a_request_or_a_wire_error(do: object, what: object) -> None:
    asked = encoding.decode_request(pack({"do": do, "call": 5, "what": what}))
    assert asked.call == 5
    if isinstance(asked.request, WireError):
        assert asked.request.reason


def test_invalid_or_missing_request_field_is_named() -> None:
    body = pack({"do": "renew", "call": 1, "what": {"node_id": "a", "epoch": "x", "revision": 1}})
    refused = encoding.decode_request(body).request
    assert isinstance(refused, WireError)
    assert (refused.code, refused.reason) == ("field-type", "'Renew.epoch' must be 'int', not 'str'")
    body = pack({"do": "leave", "call": 1, "what": {}})
    missing = encoding.decode_request(body).request
    assert isinstance(missing, WireError)
    assert (missing.code, missing.reason) == ("field-missing", "'Leave.node_id' is missing")


def test_wildcard_subscribers_are_listed_as_patterns_and_round_trip(graph: Graph) -> None:
    wide = SubscriberRecord(1, "/robot/*/camera", "image", pattern=True)
    ask(graph, AddSubscriber(node("s"), wide))
    ask(graph, AddPublisher(node("p"), publisher(2, "/robot/a/camera")))
    seen = graph.view()
    assert list(seen.topics) == ["/robot/a/camera"]
    pattern = seen.patterns["/robot/*/camera"]
    assert (pattern.msg_type, [each.node_id for each in pattern.subscribers]) == ("image", ["s"])
    body = encoding.encode_reply(GraphReply(7, graph.revision, seen), 3)
    assert encoding.decode_reply(body) == (3, GraphReply(7, graph.revision, seen))
    assert seen.to_plain()["patterns"][0]["name"] == "/robot/*/camera"  # type: ignore[index]
    ask(graph, AddPublisher(node("p"), publisher(3, "/robot/*/camera")))  # valid as an ordinary topic name
    assert set(graph.view().topics) == {"/robot/a/camera", "/robot/*/camera"}
    assert graph.view().topics["/robot/*/camera"].subscribers == ()
    ask(graph, RemovePublisher("p", 3))
    ask(graph, RemoveSubscriber("s", 1))
    assert (list(graph.view().topics), graph.view().patterns) == (["/robot/a/camera"], {})


def test_unknown_fields_of_newer_peers_are_ignored() -> None:
    body = pack({"do": "leave", "call": 1, "what": {"node_id": "a", "mood": "fine"}})
    assert encoding.decode_request(body).request == Leave("a")


def test_rate_meter_needs_two_readings_and_resets_on_restart() -> None:
    meter = TrafficMeter()
    assert meter.rates() is None
    meter.add(0.0, 0, 0)
    assert meter.rates() is None
    meter.add(1.0, 100, 1000)
    assert meter.rates() == (100.0, 1000.0)
    meter.add(2.0, 100, 1000)  # stopped: the mean is shown until ten messages have left the window
    for second in range(3, 20):
        meter.add(float(second), 100, 1000)
    assert meter.rates() == (0.0, 0.0)
    meter.add(21.0, 3, 3)  # the program was restarted
    assert meter.rates() is None
