"""Tests of the master's fast paths for many nodes: their results must equal those of the normal paths."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nep.masters.graph import Graph
from nep.masters.leases import encode_renewed, parse_renewal
from nep.masters.master import Master
from nep.masters.snapshot import GraphSnapshotBuilder
from nep.messages.packing import pack
from nep.protocol import encoding
from nep.protocol.encoding import ReplyEncoder, to_plain
from nep.protocol.graph_view import Alert, GraphView
from nep.protocol.requests import (
    GraphReply,
    Join,
    Leave,
    NodeRecord,
    Ping,
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


def renew(graph: Graph, request: Renew, now: float) -> bytes | None:
    """Renew by the master's fast path; return the encoded reply, or None if the path does not apply."""
    said = parse_renewal(encoding.encode_request(request, 7))
    if said is None:
        return None
    last_seqs = graph.renew_fast(said, now, said.node_id)
    return None if last_seqs is None else encode_renewed(said.call, EPOCH, graph.revision, last_seqs, ())


def view(graph: Graph) -> GraphView:
    """Return a complete view, without reuse of an earlier one."""
    return GraphSnapshotBuilder(graph._registry).view(EPOCH)


def test_fast_renewal_matches_the_normal_path() -> None:
    quick, long = graph_of(5), graph_of(5)
    for now in (1.0, 2.0, 3.0):
        for n in range(5):
            request = renewal(n, quick, int(now) * 7 + n, "bad" if n == 2 else "", cpu_ratio=0.25)
            body = renew(quick, request, now)
            assert body is not None
            (answer,) = long.apply(request, 7, now, f"n{n}")
            assert encoding.decode_reply(body) == (7, answer.body)
            assert isinstance(answer.body, RenewedReply)
            assert set(answer.body.last_seqs) == {100 + (n + 1) % 5}
    assert view(quick) == view(long)
    assert view(quick).topics["t0"].rate_hz is not None


def test_renewal_restarts_the_lease() -> None:
    graph = graph_of(2)
    assert renew(graph, renewal(0, graph), 2.9) is not None
    graph.tick(3.0)
    assert list(graph.members) == ["n0"]


@pytest.mark.parametrize(
    "change",
    [
        {"epoch": EPOCH + 1},
        {"revision": 0},
        {"publishers": ()},
        {"publishers": [{"id": 999, "count": 1, "bytes": 1, "last_seq": 1}]},
        {"publishers": [{"id": 100, "count": "1", "bytes": 1, "last_seq": 1}]},
        {"publishers": [{"id": 100, "count": True, "bytes": 1, "last_seq": 1}]},
        {"publishers": [{"id": 100, "count": 1, "bytes": 1, "last_seq": 1, "last_stamp_ns": "x"}]},
        {"publishers": [{"id": 100}]},
        {"publishers": [[100]]},
        {"publishers": ["x"]},
        {"publishers": {"id": 100}},
        {"subscribers": [{"id": 200, "received": 1.5, "lost": 0}]},
        {"subscribers": [{"id": 200, "received": 1, "lost": 0, "problem": 5}]},
        {"subscribers": [{"id": [], "received": 1, "lost": 0}]},
        {"node_id": "n9"},
        {"node_id": 5},
        {"cpu_ratio": "much"},
    ],
)
def test_unusual_renewal_falls_back_to_the_normal_path(change: dict[str, object]) -> None:
    graph = graph_of(2)
    what = to_plain(renewal(0, graph))
    assert isinstance(what, dict)
    said = parse_renewal(pack({"do": "renew", "call": 7, "what": what | change}))
    assert said is None or graph.renew_fast(said, 1.0, said.node_id) is None


@settings(deadline=None, max_examples=60)
@given(st.binary(max_size=60) | st.recursive(st.none() | st.integers() | st.text(), st.lists).map(to_plain))
def test_invalid_renewal_is_not_parsed_by_the_fast_path(junk: object) -> None:
    bodies_of_junk = [junk] if isinstance(junk, bytes) else []
    begins = encoding.encode_request(Renew("n0", 1, 1), 7)
    bodies_of_junk += [begins[:14] + (junk if isinstance(junk, bytes) else b""), begins[:-1], begins + b"x"]
    for body in bodies_of_junk:
        assert parse_renewal(body) is None
    assert parse_renewal(encoding.encode_request(Ping(), 7)) is None
    assert parse_renewal(begins) is not None


KINDS = st.sampled_from(["join", "leave", "renew", "remove", "alert", "retype"])
CHANGES = st.lists(st.tuples(KINDS, st.integers(0, 4)))


@settings(deadline=None, max_examples=60)
@given(CHANGES)
def test_incremental_view_matches_a_full_view(changes: list[tuple[str, int]]) -> None:
    graph, packer = graph_of(3), ReplyEncoder()
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
        assert encoding.decode_reply(packer.encode(answer.body, 3)) == (3, answer.body)


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
