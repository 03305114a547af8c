from __future__ import annotations

from types import SimpleNamespace

import pytest

from nep.programs.gateway.portmap import PortMap, Registration, TopicLine
from nep.programs.gateway.programs import ProgramTable, TopicLink
from nep.programs.gateway.proxy_pair import endpoints_of

LINE = TopicLine("t", "prefixed", "json", "many2many")


class FakeProcesses:
    def __init__(self):
        self.running = {}
        self.joined = set()
        self.is_secret = False

    def start_time_s(self, pid):
        return self.running.get(pid)

    def language(self, pid):
        return "python"

    def is_connected(self, pid, port, *, is_bound_by_process):
        return None if self.is_secret else (pid, port) in self.joined


@pytest.fixture
def scene():
    known, processes = PortMap(None), FakeProcesses()
    known.assign(LINE, 9000)
    pair = SimpleNamespace(
        ends=endpoints_of(LINE, 9000),
        connections={"publisher": 0, "subscriber": 0},
        connect_count=0,
        unsupported_versions={},
    )
    now = [0.0]
    programs = ProgramTable(known, processes, lambda line: pair if line == LINE else None, lambda: now[0])
    return SimpleNamespace(known=known, processes=processes, pair=pair, programs=programs, now=now)


def register(scene, pid=7, socket="publisher", node="n", started=100.0):
    if pid is not None:
        scene.processes.running[pid] = 100.0
    registration = Registration(LINE, node, socket, "json", "A", "python", pid, started)
    scene.known.add(registration)
    return registration


def roles(scene):
    scene.programs.update()
    return [link.role for program in scene.programs.programs() for link in program.links]


def test_program_has_no_role_before_it_connects(scene):
    register(scene)
    assert roles(scene) == []
    assert [program.name for program in scene.programs.programs()] == ["n"]


def test_role_follows_the_connection_and_not_the_request(scene):
    register(scene, socket="publisher")
    scene.pair.connections["subscriber"] = 1
    scene.processes.joined = {(7, 9001)}
    assert roles(scene) == ["subscriber"]
    assert scene.programs.programs()[0].links == (TopicLink("t", "json", "json", "subscriber"),)


def test_role_follows_the_request_if_the_system_hides_connections(scene):
    register(scene, socket="publisher")
    scene.processes.is_secret = True
    scene.pair.connections.update(publisher=1, subscriber=1)
    assert roles(scene) == ["publisher"]


def test_program_is_removed_when_its_process_ends(scene):
    register(scene)
    assert not scene.programs.remove_ended()
    del scene.processes.running[7]
    assert scene.programs.remove_ended()
    assert not scene.programs.programs()


def test_reused_process_id_is_not_mistaken_for_the_program(scene):
    register(scene)
    scene.processes.running[7] = 5000.0
    assert scene.programs.remove_ended()


def test_program_is_removed_when_its_connections_close(scene):
    register(scene)
    scene.pair.connections["publisher"] = 1
    scene.processes.joined = {(7, 9000)}
    assert roles(scene) == ["publisher"]
    assert not scene.programs.remove_ended()
    scene.processes.joined = set()
    scene.programs.update()
    assert scene.programs.remove_ended()


def test_program_without_process_id_lives_as_long_as_its_connection(scene):
    register(scene, pid=None, started=None, socket="subscriber")
    assert not scene.programs.remove_ended()
    scene.pair.connections["subscriber"] = 1
    assert roles(scene) == ["subscriber"]
    scene.pair.connections["subscriber"] = 0
    scene.programs.update()
    assert scene.programs.remove_ended()


def test_program_that_left_between_polls_is_removed(scene):
    register(scene)
    scene.programs.update()
    scene.pair.connect_count = 1
    scene.now[0] = 11.0
    scene.programs.update()
    assert scene.programs.remove_ended()


def test_short_foreign_connection_does_not_remove_a_connecting_program(scene):
    register(scene)
    scene.programs.update()
    scene.pair.connect_count = 1
    scene.now[0] = 3.0
    scene.programs.update()
    assert not scene.programs.remove_ended()
    scene.pair.connections["subscriber"] = 1
    scene.processes.joined = {(7, 9001)}
    scene.now[0] = 11.0
    assert roles(scene) == ["subscriber"]
    assert not scene.programs.remove_ended()


def test_program_that_publishes_and_subscribes_is_one_node_with_two_links(scene):
    register(scene, socket="publisher")
    register(scene, socket="subscriber")
    scene.pair.connections.update(publisher=1, subscriber=1)
    scene.processes.joined = {(7, 9000), (7, 9001)}
    assert sorted(roles(scene)) == ["publisher", "subscriber"]
    assert len(scene.programs.programs()) == 1


def test_topic_line_is_in_use_while_requested_or_connected(scene):
    assert not scene.programs.is_used(LINE)
    scene.pair.connections["publisher"] = 1
    assert scene.programs.is_used(LINE)
    scene.pair.connections["publisher"] = 0
    register(scene)
    assert scene.programs.is_used(LINE)


def test_broadcast_lists_the_requested_topic_role_and_port_of_each_program(scene):
    register(scene)
    (member,) = scene.programs.members()
    assert (member.topic, member.node, member.port, member.socket, member.pid) == (
        "t",
        "n",
        9000,
        "publisher",
        7,
    )
    assert scene.programs.languages() == {LINE: frozenset({"python"})}


def test_unsupported_version_is_shown_only_if_the_program_is_unambiguous(scene):
    register(scene)
    scene.pair.connections["subscriber"] = 1
    scene.processes.joined = {(7, 9001)}
    scene.pair.unsupported_versions["subscriber"] = "0.5.4.6"
    scene.programs.update()
    (program,) = scene.programs.programs()
    assert program.generation == "0.5.4.6"
    assert scene.programs.names(LINE, "subscriber") == (program.name,)
    register(scene, pid=8, node="m")
    scene.processes.joined.add((8, 9001))
    scene.programs.update()
    assert {program.generation for program in scene.programs.programs()} == {"A"}
