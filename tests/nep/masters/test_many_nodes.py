"""Tests of renewals, and of views that reuse unchanged topics."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from nep.errors import WireError
from nep.masters.graph import Graph
from nep.masters.master import Master
from nep.masters.snapshot import GraphSnapshotBuilder
from nep.messages.packing import pack
from nep.protocol import encoding
from nep.protocol.graph_view import Alert, GraphView
from nep.protocol.requests import (
    GraphReply,
    Join,
    Leave,
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    QueryGraph,
    RemovePublisher,
    Renew,
    RenewedReply,
    ReportAlerts,
    SubscriberCount,
    SubscriberRecord,
)
from tests.examples import examples
from tests.nep.programs import eventually

EPOCH = 5


def graph_of(nodes: int) -> Graph:
    """Return a graph in which each node publishes one topic and subscribes to that of the next node."""
    graph = Graph(EPOCH, 0.0, learn_s=0.0)
    for n in range(nodes):
        graph.apply(joining(n, nodes), 1, 0.0, f"n{n}")
    return graph


def joining(n: int, nodes: int, msg_type: str = "json") -> Join:
    other = (n + 1) % nodes
    return Join(
        NodeRecord(f"n{n}", f"Node {n}", "host", 1),
        0,
        (PublisherRecord(100 + n, f"t{n}", msg_type, "json", (f"tcp://x:{n}",)),),
        (SubscriberRecord(200 + n, f"t{other}", "json"),),
    )


def renewal(n: int, graph: Graph, count: int = 10, problem: str = "", **more: Any) -> Renew:
    return Renew(
        f"n{n}",
        EPOCH,
        graph.revision,
        (PublisherCount(100 + n, count, 5 * count, count, 1_700_000_000_000_000_000),),
        (SubscriberCount(200 + n, count, 2, problem),),
        **more,
    )


def renew(graph: Graph, request: Renew, now: float) -> RenewedReply:
    """Send a renewal over the wire; return the reply."""
    received = encoding.decode_request(encoding.encode_request(request, 7))
    assert isinstance(received.request, Renew)
    (answer,) = graph.apply(received.request, 7, now, request.node_id, is_foreign=True)
    call, reply = encoding.decode_reply(encoding.encode_reply(answer.body, 7))
    assert isinstance(reply, RenewedReply)
    assert (call, reply) == (7, answer.body)
    return reply


def view(graph: Graph) -> GraphView:
    """Return a complete view, without reuse of an earlier one."""
    return GraphSnapshotBuilder(graph._registry).view(EPOCH)


def test_renewal_stores_statistics_and_returns_the_sequence_numbers_of_other_publishers() -> None:
    graph = graph_of(5)
    for now in (1.0, 2.0, 3.0):
        for n in range(5):
            counts = int(now) * 7 + n
            reply = renew(graph, renewal(n, graph, counts, "bad" if n == 2 else "", cpu_ratio=0.25), now)
            assert set(reply.last_seqs) == {100 + (n + 1) % 5}
            assert graph.view().nodes[f"n{n}"].cpu_ratio == 0.25
            assert graph.view().topics[f"t{n}"].publishers[0].last_seq == counts
    assert graph.view().topics["t0"].rate_hz is not None
    assert [alert.id for alert in graph.view().alerts] == ["message:t3"]


def test_renewal_restarts_the_lease() -> None:
    graph = graph_of(2)
    renew(graph, renewal(0, graph), 2.9)
    graph.tick(3.0)
    assert list(graph.members) == ["n0"]


@pytest.mark.parametrize(
    "change",
    [
        {"epoch": EPOCH + 1},
        {"publishers": []},
        {"publishers": [{"id": 999, "count": 1, "bytes": 1, "last_seq": 1}]},
        {"subscribers": [{"id": 999, "received": 1, "lost": 1}]},
        {"node_id": "n9"},
    ],
)
def test_node_whose_renewal_does_not_match_its_registration_must_join_again(
    change: dict[str, object],
) -> None:
    graph = graph_of(2)
    fields = msgspec.to_builtins(renewal(0, graph))
    received = encoding.decode_request(pack({"do": "renew", "call": 7, "what": fields | change}))
    assert isinstance(received.request, Renew)
    (answer,) = graph.apply(received.request, 7, 1.0, "n0", is_foreign=True)
    assert isinstance(answer.body, RenewedReply)
    assert answer.body.again


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"publishers": [{"id": 100, "count": "1", "bytes": 1, "last_seq": 1}]}, "publishers[0].count"),
        ({"publishers": [{"id": 100, "count": True, "bytes": 1, "last_seq": 1}]}, "publishers[0].count"),
        (
            {"publishers": [{"id": 100, "count": 1, "bytes": 1, "last_seq": 1, "last_stamp_ns": "x"}]},
            "publishers[0].last_stamp_ns",
        ),
        ({"publishers": [{"id": 100}]}, "publishers[0].count"),
        ({"publishers": [[100]]}, "publishers[0]"),
        ({"publishers": ["x"]}, "publishers[0]"),
        ({"publishers": {"id": 100}}, "publishers"),
        ({"subscribers": [{"id": 200, "received": 1.5, "lost": 0}]}, "subscribers[0].received"),
        ({"subscribers": [{"id": 200, "received": 1, "lost": 0, "problem": 5}]}, "subscribers[0].problem"),
        ({"subscribers": [{"id": [], "received": 1, "lost": 0}]}, "subscribers[0].id"),
        ({"node_id": 5}, "node_id"),
        ({"cpu_ratio": "much"}, "cpu_ratio"),
    ],
)
def test_malformed_renewal_is_rejected_with_the_name_of_the_field(
    change: dict[str, object], field: str
) -> None:
    fields = msgspec.to_builtins(renewal(0, graph_of(2)))
    received = encoding.decode_request(pack({"do": "renew", "call": 7, "what": fields | change}))
    assert received.call == 7
    assert isinstance(received.request, WireError)
    assert f"'Renew.{field}'" in received.request.reason


KINDS = st.sampled_from(["join", "leave", "renew", "remove", "alert", "retype"])
CHANGES = st.lists(st.tuples(KINDS, st.integers(0, 4)))


@settings(deadline=None, max_examples=examples(60))
@given(CHANGES)
def test_incremental_view_matches_a_full_view(changes: list[tuple[str, int]]) -> None:
    graph = graph_of(3)
    for now, (what, n) in enumerate(changes):
        if what == "join":
            graph.apply(joining(n, 5), 1, float(now), f"n{n}")
        elif what == "retype":
            graph.apply(joining(n, 5, "string"), 1, float(now), f"n{n}")
        elif what == "leave":
            graph.apply(Leave(f"n{n}"), 1, float(now), f"n{n}")
        elif what == "renew":
            renew(graph, renewal(n, graph, now, "bad" if n == 1 else ""), float(now))
        elif what == "remove":
            graph.apply(RemovePublisher(f"n{n}", 100 + n, 3), 1, float(now), f"n{n}")
        else:
            graph.apply(ReportAlerts("test", (Alert(f"a{n}", "It hurts"),)), 1, float(now), "")
        (answer,) = graph.apply(QueryGraph(), 3, float(now), "somebody")
        assert isinstance(answer.body, GraphReply)
        assert answer.body.view == view(graph)
        assert encoding.decode_reply(encoding.encode_reply(answer.body, 3)) == (3, answer.body)


def test_unchanged_topics_are_reused_in_the_next_view() -> None:
    graph = graph_of(3)
    before = graph.view()
    renew(graph, renewal(0, graph), 1.0)
    after = graph.view()
    assert after.topics["t2"] is before.topics["t2"]
    assert after.topics["t0"] != before.topics["t0"]


def test_attachment_receives_the_last_of_many_quick_changes() -> None:
    class Slow:
        def __init__(self) -> None:
            self.views: list[GraphView] = []

        def start(self, master: Master) -> None:
            pass

        def changed(self, view: GraphView) -> None:
            self.views.append(view)

        def close(self) -> None:
            pass

    slow = Slow()
    with Master("127.0.0.1:0", attachments=[slow], learn_s=0.0) as master:
        for n in range(50):
            master.submit(replace(joining(n, 50), managed=True))
        eventually(lambda: bool(slow.views) and len(slow.views[-1].nodes) == 50)
