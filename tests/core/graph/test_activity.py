from __future__ import annotations

from app.core.graph.activity import QUIET_TIMEOUT_S, CallRates, QuietNodes
from app.core.graph.node_graph import GraphInput
from app.core.network.nodes import NodeEntry
from app.core.network.topics import Topic
from nep.protocol.graph_view import (
    ClientInfo,
    PublisherInfo,
    ServerInfo,
    ServiceInfo,
    SubscriberInfo,
    TopicInfo,
)


def heard(count: int, received: int | None, name: str = "/a") -> Topic:
    info = TopicInfo(
        name,
        "json",
        "json",
        (PublisherInfo(1, "1", (), False, count, 0, 0, None, None, None),),
        (SubscriberInfo(2, "2", received, 0),),
    )
    return Topic(name, info=info)


def facts(*topics: Topic, calls: int = 0, generation: str = "native", network: str = "") -> GraphInput:
    service = ServiceInfo(
        "s", "", (ServerInfo(1, "3", (), calls, 0, 0),), (ClientInfo(1, "4", None, None),), calls
    )
    entries = [NodeEntry(id, f"node {id}", generation=generation, network=network) for id in "1234"]
    return GraphInput(entries, topics, {"s": service}, (), "here")


def test_node_without_traffic_for_a_minute_is_quiet() -> None:
    quiet = QuietNodes()
    quiet.update(facts(heard(1, 1)), 0.0)
    assert quiet.quiet_keys(QUIET_TIMEOUT_S - 1) == frozenset()
    assert quiet.quiet_keys(QUIET_TIMEOUT_S) == {"1", "2", "3", "4"}
    quiet.update(facts(heard(2, 1), calls=1), 30.0)
    assert quiet.quiet_keys(QUIET_TIMEOUT_S) == {"2", "4"}
    assert quiet.quiet_keys(30.0 + QUIET_TIMEOUT_S) == {"1", "2", "3", "4"}


def test_counter_reset_counts_as_traffic() -> None:
    quiet = QuietNodes()
    quiet.update(facts(heard(2**64 - 1, 5)), 0.0)
    quiet.update(facts(heard(0, 5)), 50.0)
    assert quiet.quiet_keys(70.0) == {"2", "3", "4"}


def test_node_without_counters_is_not_quiet() -> None:
    quiet = QuietNodes()
    quiet.update(facts(heard(1, None), generation="B"), 0.0)
    assert quiet.quiet_keys(QUIET_TIMEOUT_S) == {"1", "3"}
    other = QuietNodes()
    other.update(facts(generation="native", network="ros2"), 0.0)
    assert other.quiet_keys(QUIET_TIMEOUT_S) == frozenset()


def test_internal_nep_messages_do_not_count_as_traffic() -> None:
    quiet = QuietNodes()
    quiet.update(facts(heard(1, 1, "/nep/log")), 0.0)
    quiet.update(facts(heard(9, 9, "/nep/log")), 50.0)
    assert "1" in quiet.quiet_keys(QUIET_TIMEOUT_S)


def test_departed_node_is_removed_from_quiet_nodes() -> None:
    quiet = QuietNodes()
    quiet.update(facts(), 0.0)
    quiet.update(GraphInput(), 1.0)
    assert quiet.quiet_keys(1000.0) == frozenset()


def test_call_rate_is_averaged_over_a_minute() -> None:
    rates = CallRates()
    assert rates.rates_hz() == {}
    rates.update(facts(calls=0), 0.0)
    assert rates.rates_hz() == {}
    rates.update(facts(calls=5), 0.5)  # interval too short: ignored
    for second in range(1, 121):
        rates.update(facts(calls=2 * second), float(second))
    assert rates.rates_hz() == {"s": 2.0}
    rates.update(facts(calls=0), 121.0)  # a restarted server, whose count starts at 0
    assert rates.rates_hz() == {}
