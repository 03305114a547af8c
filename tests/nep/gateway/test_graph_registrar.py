from __future__ import annotations

import itertools
import os

import pytest

from nep.masters.graph import Graph
from nep.programs.gateway.graph_registrar import GraphRegistrar
from nep.programs.gateway.processes import cpu_load_of
from nep.programs.gateway.programs import OriginalProgram, TopicLink
from nep.protocol.requests import QueryGraph
from nep.system.cpu import CpuLoad

EPOCH = 77


class RequestServer:
    """Graph that applies requests without a master."""

    def __init__(self):
        self.now = 100.0
        self.graph = Graph(EPOCH, self.now, learn_s=0.0)
        self._calls = itertools.count(-1, -1)
        self.replies = []

    def submit(self, request):
        out = self.graph.apply(request, next(self._calls), self.now, "")
        self.replies.append(out[-1].body)
        return self.replies[-1]

    def view(self):
        return self.submit(QueryGraph()).view


@pytest.fixture
def desk():
    return RequestServer()


@pytest.fixture
def listing(desk):
    return GraphRegistrar(desk.submit, EPOCH)


def program(name, *links, pid=1, language="python"):
    return OriginalProgram(f"original:A:{name}:{pid}", name, pid, "A", language, links)


def publishes(topic, codec="json", msg_type="json"):
    return TopicLink(topic, msg_type, codec, "publisher")


def test_originals_are_listed_as_nodes_with_language_and_wire(desk, listing):
    listing.set_programs(
        (
            program("a", publishes("t")),
            program("b", TopicLink("t", "json", "json", "subscriber"), language="javascript"),
        )
    )
    view = desk.view()
    assert {(node.name, node.language, node.generation) for node in view.nodes.values()} == {
        ("a", "Python", "A"),
        ("b", "JavaScript", "A"),
    }
    topic = view.topics["t"]
    assert (topic.msg_type, len(topic.publishers), len(topic.subscribers)) == ("json", 1, 1)
    assert topic.publishers[0].endpoints == ()


def test_departed_programs_are_removed(desk, listing):
    listing.set_programs((program("a", publishes("t")),))
    listing.set_programs((program("a"),))
    assert not desk.view().topics
    listing.set_programs(())
    assert not desk.view().nodes


def test_unchanged_program_is_not_registered_again(desk, listing):
    listing.set_programs((program("a", publishes("t")),))
    told = len(desk.replies)
    listing.set_programs((program("a", publishes("t")),))
    assert len(desk.replies) == told


def test_rate_is_counted_once_per_topic(desk, listing):
    listing.set_programs((program("a", publishes("t")), program("b", publishes("t"), pid=2)))
    for _ in range(5):
        listing.renew()
        desk.now += 1.0
        for _ in range(30):
            listing.count(("t", "json"), 100)
    listing.renew()
    topic = desk.view().topics["t"]
    assert topic.rate_hz == pytest.approx(30, rel=0.2)
    assert topic.bandwidth_Bps == pytest.approx(3000, rel=0.2)
    assert not any(getattr(reply, "again", False) for reply in desk.replies)


def test_cpu_load_of_an_original_is_read_from_the_system(desk):
    used = {1: 0.0}
    now = iter([0.0, 1.0])
    loads = {1: CpuLoad(lambda: used[1], lambda: next(now))}
    listing = GraphRegistrar(desk.submit, EPOCH, loads.__getitem__)
    listing.set_programs((program("a", publishes("t")), program("b", pid=None)))
    listing.renew()
    assert {node.cpu_ratio for node in desk.view().nodes.values()} == {None}
    used[1] = 0.5
    listing.renew()
    assert {node.name: node.cpu_ratio for node in desk.view().nodes.values()} == {"a": 0.5, "b": None}


def test_missing_process_and_first_reading_have_no_cpu_load():
    assert cpu_load_of(2**22 + 1).ratio() is None
    assert cpu_load_of(os.getpid()).ratio() is None  # a load needs two readings


def test_equivalent_type_names_are_not_a_conflict(desk, listing):
    listing.set_programs(
        (program("a", publishes("t")), program("b", publishes("t", msg_type="dictionary"), pid=2))
    )
    assert not desk.view().alerts


def test_invalid_native_topic_name_is_left_out_of_the_graph(desk, listing):
    listing.set_programs((program("a", publishes("not a topic"), publishes("t")),))
    assert set(desk.view().topics) == {"t"}


def test_services_of_originals_are_listed_with_the_server_port(desk, listing):
    listing.set_programs(
        (
            program("a", TopicLink("weather", "json", "service", "server", 9000)),
            program("b", TopicLink("weather", "json", "service", "client", 9000), pid=2),
        )
    )
    view = desk.view()
    service = view.services["weather"]
    assert view.topics == {}
    assert [view.nodes[each.node_id].name for each in service.servers] == ["a"]
    assert [each.endpoints for each in service.servers] == [("tcp://127.0.0.1:9000",)]
    assert [view.nodes[each.node_id].name for each in service.clients] == ["b"]
    listing.set_programs(())
    assert desk.view().services == {}
