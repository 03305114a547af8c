"""Tests of the master's memory of departed publishers, for subscribers that were disconnected meanwhile."""

from __future__ import annotations

from nep.masters.departed import DepartedPublishers
from nep.masters.graph import Graph
from nep.protocol.requests import (
    AddPublisher,
    AddSubscriber,
    Leave,
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    Renew,
    RenewedReply,
    SubscriberCount,
    SubscriberRecord,
)


def test_newest_departed_publishers_are_kept_for_a_minute_and_bounded() -> None:
    departed: DepartedPublishers[str] = DepartedPublishers()
    for number in range(100):
        departed.add(("t", "**"), number, f"{number}")
    assert list(departed.for_topic("t")) == list(departed.for_topic("**")) == list(range(36, 100))
    departed.tick(10.0)
    departed.add(("t",), 99, "again")  # the publisher returned and ended again
    departed.tick(69.0)
    assert departed.for_topic("t")[99] == "again"
    assert 99 not in departed.for_topic("**")
    before = departed.removal_count
    departed.tick(70.0)
    assert list(departed.for_topic("t")) == [99]
    assert departed.removal_count > before
    departed.tick(129.0)
    assert not departed.for_topic("t")


def test_total_number_of_departed_publishers_is_bounded() -> None:
    departed: DepartedPublishers[int] = DepartedPublishers()
    for number in range(5000):
        departed.add((f"topic {number}",), number, number)
    assert sum(len(departed.for_topic(f"topic {number}")) for number in range(5000)) == 1000
    assert departed.for_topic("topic 4999")


def node(name: str) -> NodeRecord:
    return NodeRecord(name * 16, name, "computer", 1)


def renewed(graph: Graph, who: NodeRecord, now: float, *counts: PublisherCount) -> dict[int, int]:
    """Renew a node; return the last sequence numbers in the reply, by publisher id."""
    heard = () if counts else (SubscriberCount(2, 0, 0), SubscriberCount(3, 0, 0))
    out = graph.apply(Renew(who.id, graph.epoch, 0, counts, heard), 1, now, who.id)
    (answer,) = (each.body for each in out if each.call == 1)
    assert isinstance(answer, RenewedReply)
    assert not answer.again
    return dict(answer.last_seqs)


def test_renewal_reply_has_the_last_sequence_number_of_a_departed_publisher() -> None:
    graph = Graph(1, 0.0, learn_s=0.0)
    sends, hears = node("a"), node("b")
    record = PublisherRecord(1, "/robot/t", "json", "json", ("tcp://10.0.0.1:5000",))
    graph.apply(AddPublisher(sends, record), 1, 0.0, sends.id)
    for subscriber in (
        SubscriberRecord(2, "/robot/*", "json", pattern=True),
        SubscriberRecord(3, "/other", "json"),
    ):
        graph.apply(AddSubscriber(hears, subscriber), 1, 0.0, hears.id)
    renewed(graph, sends, 1.0, PublisherCount(1, 7, 70, 7, 1))
    graph.apply(Leave(sends.id), 1, 1.0, sends.id)
    graph.tick(1.5)
    assert renewed(graph, hears, 2.0) == {1: 7}
    graph.apply(AddPublisher(sends, record), 1, 3.0, sends.id)
    assert renewed(graph, hears, 3.0) == {1: 0}, "it is there again"
    graph.apply(Leave(sends.id), 1, 3.0, sends.id)
    graph.tick(3.5)
    for now in range(4, 70):
        last = renewed(graph, hears, float(now))
        graph.tick(float(now))
    assert last == {}
