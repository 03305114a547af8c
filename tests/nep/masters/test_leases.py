"""Tests of the renewal interval: 1 s in small graphs, longer and spread evenly in large ones."""

from __future__ import annotations

import signal
import sys
from collections import Counter
from itertools import pairwise

import pytest
import zmq

import nep
from nep.backends.zeromq.master_session import RenewalTimer
from nep.masters import leases
from nep.masters.graph import Graph
from nep.masters.leases import LEASE_DURATION_S, Leases
from nep.masters.master import Master
from nep.masters.registry import Registry
from nep.masters.router import MasterRouter
from nep.protocol.requests import Join, NodeRecord, Renew, RenewedReply
from tests.nep.programs import eventually, running


def census_of(nodes: int, managed: int = 0) -> Registry:
    registry = Registry()
    for n in range(nodes + managed):
        registry.add_node(NodeRecord(f"n{n}", f"N{n}", "host", 1), 0.0, is_managed=n >= nodes)
    return registry


def told(nodes: int, managed: int = 0, rounds: int = 4, within_s: float = 1.0) -> list[list[float]]:
    """Return the renewal times of all nodes, round by round, if they start within `within_s` seconds."""
    registry = census_of(nodes, managed)
    found = Leases(registry, LEASE_DURATION_S)
    due = [within_s * n / nodes for n in range(nodes)]
    times = []
    for _ in range(rounds):
        times.append(due)
        found.update_renew_interval(min(due))
        order = sorted(range(nodes), key=lambda n: due[n])
        next_due = list(due)
        for n in order:
            found.update_renew_interval(due[n])
            next_due[n] = due[n] + found.renew(registry.members[f"n{n}"], due[n])
        due = next_due
    return times


@pytest.mark.parametrize(("nodes", "managed"), [(1, 0), (100, 0), (10, 1000)])
def test_up_to_100_nodes_renew_every_second_however_many_are_managed(nodes: int, managed: int) -> None:
    times = told(nodes, managed)
    for before, after in pairwise(times):
        assert [b - a for a, b in zip(before, after, strict=True)] == pytest.approx([1.0] * nodes)


@pytest.mark.parametrize(("nodes", "renew_s"), [(250, 2.0), (500, 4.0), (2000, 5.0)])
@pytest.mark.parametrize("within_s", [0.01, 1.0])
def test_nodes_of_large_graphs_renew_less_often_and_are_spread_evenly(
    nodes: int, renew_s: float, within_s: float
) -> None:
    times = told(nodes, rounds=8, within_s=within_s)
    waits = [b - a for a, b in zip(times[-2], times[-1], strict=True)]
    assert all(1.0 <= wait <= renew_s + 0.1 for wait in waits)
    assert sum(waits) / nodes == pytest.approx(renew_s, rel=0.1)
    together = Counter(round(at, 3) for at in times[-1])
    assert len(together) <= renew_s * 10 + 1
    assert max(together.values()) <= 2 + 1.2 * nodes / (renew_s * 10)


def test_slightly_late_renewal_keeps_its_slot() -> None:
    registry = census_of(500)
    found = Leases(registry, LEASE_DURATION_S)
    found.update_renew_interval(0.0)
    member = registry.members["n0"]
    at = 10.03
    for late_s in (0.04, 0.0, 0.03, 0.01):
        at += found.renew(member, at) + late_s
    assert at == pytest.approx(26.01)


def test_longer_renewal_interval_extends_the_lease() -> None:
    registry = census_of(500)
    found = Leases(registry, LEASE_DURATION_S)
    found.update_renew_interval(0.0)
    assert found.renew(registry.members["n0"], 0.0) == pytest.approx(4.0)
    assert "n0" not in found.overdue_node_ids(4.39)
    assert "n0" in found.overdue_node_ids(4.41)
    assert "n0" not in found.expired_node_ids(5.9)
    assert "n0" in found.expired_node_ids(6.1)
    assert "n1" in found.expired_node_ids(3.0)  # n1 has not received an interval yet


def test_master_sends_the_renewal_interval() -> None:
    graph = Graph(7, 0.0, learn_s=0.0)
    for n in range(500):
        graph.apply(Join(NodeRecord(f"n{n}", f"N{n}", "host", 1)), 1, 0.0, f"n{n}")
    graph.tick(0.0)
    (reply,) = graph.apply(Renew("n0", 7, graph.revision), 1, 1.0, "n0")
    assert isinstance(reply.body, RenewedReply)
    assert reply.body.next_s == pytest.approx(4.0)
    (reply,) = graph.apply(Renew("unknown", 7, graph.revision), 1, 1.0, "unknown")
    assert reply.body == RenewedReply(7, graph.revision, again=True)


def test_node_follows_the_renewal_interval_and_continues_without_replies() -> None:
    pace = RenewalTimer()
    pace.start(10.0)
    assert pace.due_at == 11.0
    pace.set_interval(4.0, 10.1)
    assert pace.due_at == pytest.approx(14.1)
    pace.start(14.1)
    assert pace.due_at == pytest.approx(18.1)
    pace.set_interval(1.0, 14.2)
    assert pace.due_at == pytest.approx(15.2)


@pytest.mark.parametrize(("told_s", "waits_s"), [(0.0, 1.0), (-5.0, 1.0), (1e9, 30.0), (float("nan"), 1.0)])
def test_renewal_interval_of_a_master_is_clamped(told_s: float, waits_s: float) -> None:
    pace = RenewalTimer()
    pace.set_interval(told_s, 10.0)
    assert pace.due_at == 10.0 + waits_s


PUBLISH = """
import nep, sys
node = nep.node("publisher")
pub = node.new_pub("topic")
print("ready")
for line in sys.stdin:
    pub.publish(line.strip())
    print("said")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="uses POSIX signals")
def test_killed_program_is_removed_before_its_long_lease_expires(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(leases, "_MAX_RENEWALS_PER_S", 0.01)
    monkeypatch.setattr(leases, "_MAX_RENEW_INTERVAL_S", 20.0)
    with Master("127.0.0.1:0", learn_s=0.0) as master:
        monkeypatch.setenv("NEP_MASTER", master.address)
        with running(PUBLISH) as program, nep.node("tester") as node:
            program.line()
            program.say("x")
            program.line()
            eventually(lambda: node.graph().topics["topic"].publishers[0].count == 1)
            program.signal(signal.SIGKILL)
            assert eventually(lambda: "topic" not in node.graph(30.0).topics) < 15.0  # its lease: 22 s
            assert node.graph().nodes == {}


def test_node_with_a_long_renewal_interval_registers_at_once_at_a_new_master(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(leases, "_MAX_RENEWALS_PER_S", 0.01)
    monkeypatch.setattr(leases, "_MAX_RENEW_INTERVAL_S", 20.0)
    master = Master("127.0.0.1:0", learn_s=0.0).start()
    with nep.node("n", master=master.address) as node:
        pub = node.new_pub("topic")
        pub.publish(1)
        eventually(lambda: master.view().topics["topic"].publishers[0].count == 1)
        master.close()
        with Master(master.address, learn_s=0.0) as second:
            assert eventually(lambda: "topic" in second.view().topics) < 15.0  # renews every 20 s


def dealer(context: zmq.Context[zmq.Socket[bytes]], address: str, name: bytes) -> zmq.Socket[bytes]:
    socket = context.socket(zmq.DEALER)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.ROUTING_ID, name)
    socket.connect(f"tcp://{address}")
    socket.send(b"hello")
    return socket


def test_router_reports_each_closed_connection_once_after_a_delay() -> None:
    port = MasterRouter("127.0.0.1:0")
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    sockets = {name: dealer(context, port.address, name) for name in (b"a", b"b", b"c")}
    heard: set[bytes] = set()
    while heard != set(sockets):
        assert port.socket.poll(60_000)
        heard.add(port.receive()[0])
        assert port.peer_address() == "127.0.0.1"
    sockets.pop(b"b").close()
    now = 100.0
    eventually(lambda: port.take_ended_senders(now) == [] and b"b" in port._ended_at)
    assert port.take_ended_senders(now + 0.4) == []
    assert port.take_ended_senders(now + 0.6) == [b"b"]
    assert port.take_ended_senders(now + 9.0) == []
    again = dealer(context, port.address, b"d")  # most likely reuses the connection number of b
    assert port.socket.poll(60_000)
    assert port.receive()[0] == b"d"
    for socket in (*sockets.values(), again):
        socket.close()
    eventually(lambda: port.take_ended_senders(now) == [] and set(port._ended_at) == {b"a", b"c", b"d"})
    assert sorted(port.take_ended_senders(now + 1.0)) == [b"a", b"c", b"d"]
    assert port._senders == {}
    context.term()
    port.close()
