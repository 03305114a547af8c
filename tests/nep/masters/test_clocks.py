"""Tests of the clock differences between nodes that the master distributes."""

from __future__ import annotations

import msgspec
import pytest
from msgspec.structs import replace

from nep.errors import WireError
from nep.masters.graph import Graph
from nep.messages.clocks import MAX_OFFSET_NS, MAX_UNCERTAINTY_NS
from nep.messages.packing import pack
from nep.protocol import encoding
from nep.protocol.requests import (
    FoundReply,
    Join,
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    RejectedReply,
    Renew,
    RenewedReply,
    SubscriberCount,
    SubscriberRecord,
)

EPOCH = 5
MASTERS = "c0"
S = 1_000_000_000


def graph_of(*computers: str) -> Graph:
    """Return a graph with one node per computer; the first node subscribes to the topics of all others."""
    graph = Graph(EPOCH, 0.0, 0.0, computer=MASTERS)
    for number, computer in enumerate(computers):
        graph.apply(joining(number, computer, len(computers)), 1, 0.0, f"n{number}")
    return graph


def joining(number: int, computer: str, nodes: int) -> Join:
    record = PublisherRecord(100 + number, f"t{number}", "json", "json", ("tcp://x:1",))
    heard = tuple(SubscriberRecord(200 + each, f"t{each}", "json") for each in range(1, nodes))
    return Join(
        NodeRecord(f"n{number}", f"Node {number}", "host", 1, computer=computer),
        0,
        (record,),
        heard if number == 0 else (),
    )


def renewal(graph: Graph, number: int, clock: tuple[int, ...] | None) -> Renew:
    member = graph.members[f"n{number}"]
    return Renew(
        f"n{number}",
        EPOCH,
        graph.revision,
        tuple(PublisherCount(each, 1, 1, 1) for each in member.publishers),
        tuple(SubscriberCount(each, 1, 0) for each in member.subscribers),
        clock=clock,
    )


def renewed(graph: Graph, number: int, clock: tuple[int, ...] | None, now: float = 1.0) -> RenewedReply:
    (answer,) = graph.apply(renewal(graph, number, clock), 7, now, f"n{number}")
    assert isinstance(answer.body, RenewedReply)
    return answer.body


def test_node_receives_the_summed_clock_offset_of_both_paths() -> None:
    graph = graph_of("c1", "c2")
    assert renewed(graph, 1, (3 * S, 400)).clocks == {}
    assert renewed(graph, 0, (S, 300)).clocks == {"n1": (2 * S, 700)}
    assert graph.view().nodes["n1"].clock_offset_ns == 3 * S
    assert graph.view().nodes["n1"].clock_uncertainty_ns == 400


def test_nodes_on_the_master_computer_need_no_clock_exchange() -> None:
    graph = graph_of(MASTERS, "c2")
    assert not graph.clocks.renewal_timestamps(graph.members["n0"], 5)
    assert graph.clocks.renewal_timestamps(graph.members["n1"], 5, lambda: 6) == (5, 6)
    renewed(graph, 1, (-S, 400))
    assert renewed(graph, 0, ()).clocks == {"n1": (-S, 400)}
    assert graph.view().nodes["n0"].clock_uncertainty_ns == 0


def test_no_clock_difference_is_sent_for_the_same_computer() -> None:
    graph = graph_of("c1", "c1", "")
    renewed(graph, 1, (S, 400))
    renewed(graph, 2, (2 * S, 400))
    assert set(renewed(graph, 0, (S, 400)).clocks) == {"n2"}, "who does not say may be anywhere"


def test_uncertainty_of_a_clock_difference_grows_with_age() -> None:
    graph = graph_of("c1", "c2")
    renewed(graph, 1, (0, 400), now=1.0)
    assert renewed(graph, 0, (0, 300), now=3.0).clocks == {"n1": (0, 700 + 100_000)}


@pytest.mark.parametrize("clock", [None, ()])
def test_node_with_unknown_clock_has_no_clock_difference_to_other_nodes(
    clock: tuple[int, ...] | None,
) -> None:
    graph = graph_of("c1", "c2")
    renewed(graph, 1, (S, 400))
    assert renewed(graph, 0, clock).clocks == {}
    renewed(graph, 0, (S, 300))
    renewed(graph, 1, clock)
    assert renewed(graph, 0, (S, 300)).clocks == {}, "its clock may have been set"
    assert graph.view().nodes["n1"].clock_offset_ns is None


@pytest.mark.parametrize(
    "clock",
    [
        (MAX_OFFSET_NS + 1, 5),
        (-MAX_OFFSET_NS - 1, 5),
        (2**64 - 1, 5),
        (5, -1),
        (5, MAX_UNCERTAINTY_NS + 1),
        (5,),
        (5, 5, 5),
    ],
)
def test_implausible_clock_is_treated_as_unknown(clock: tuple[int, ...]) -> None:
    graph = graph_of("c1", "c2")
    renewed(graph, 0, (0, 0))
    assert not renewed(graph, 1, clock).again
    assert graph.members["n1"].clock is None
    assert renewed(graph, 0, (0, 0)).clocks == {}


@pytest.mark.parametrize(
    "clock", ["x", 5, [1.5, 2], [float("nan"), 1], [True, 1], [None, 1], {"a": 1}, [[1]]]
)
def test_malformed_clock_is_rejected_and_named(clock: object) -> None:
    graph = graph_of("c1", "c2")
    what = msgspec.to_builtins(renewal(graph, 0, None))
    asked = encoding.decode_request(pack({"do": "renew", "call": 7, "what": what | {"clock": clock}}))
    assert isinstance(asked.request, WireError)
    assert "Renew.clock" in asked.request.reason


def test_messages_of_older_nodes_and_masters_contain_no_clock_fields() -> None:
    graph = graph_of("", "")
    body = encoding.encode_reply(renewed(graph, 0, None), 7)
    assert b"clock" not in body
    assert b"times" not in body
    assert b"clock" not in encoding.encode_request(renewal(graph, 0, None), 7)


def test_subscriber_receives_the_computer_id_of_a_publisher() -> None:
    graph = graph_of("c1", "c2")
    (answer,) = graph.apply(replace(joining(0, "c1", 2), epoch=EPOCH), 1, 0.0, "n0")
    assert isinstance(answer.body, FoundReply)
    assert [each.computer for each in answer.body.publishers] == ["c2"]


@pytest.mark.parametrize("computer", ["x" * 65, "a\nb"])
def test_invalid_computer_id_is_rejected(computer: str) -> None:
    graph = Graph(EPOCH, 0.0, 0.0)
    join = Join(NodeRecord("0123456789abcdef", "n", "h", 1, computer=computer))
    (answer,) = graph.apply(join, 1, 0.0, "0123456789abcdef", is_foreign=True)
    assert isinstance(answer.body, RejectedReply)
    assert "computer" in answer.body.reason
